//! Scene inputs for tests: faces, materials and objects are added one by one, a [`SceneInput`] or a checked [`Scene`]
//! comes out.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "each test binary uses a part of it")]

pub mod rooms;

use isolux_core::scene::{Alpha, BuildOptions, Face, Material, Object, Scene, SceneInput, Surface};
use isolux_core::units::Rgb;
use isolux_core::{DVec2, DVec3};

pub fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// An opaque surface, the same in every band.
pub fn grey(reflectance: f64, emission: f64) -> Surface {
    Surface { reflectance: Rgb::splat(reflectance), emission: Rgb::splat(emission), opacity: 1.0 }
}

/// An empty input in metres.
pub fn empty() -> SceneInput {
    SceneInput { name: "test".into(), metres_per_unit: 1.0, ..SceneInput::default() }
}

/// Adding to an input; every method returns the index of what it added.
pub trait Make {
    fn object(&mut self, name: &str) -> u32;
    fn material(&mut self, name: &str, surface: Surface) -> u32;
    fn face(&mut self, object: u32, material: u32, corners: &[DVec3]) -> u32;
    /// Six quads around the box from `low` to `high`, fronts inside: x-, x+, y-, y+, z-, z+.
    fn inside_of_box(&mut self, object: u32, material: u32, low: DVec3, high: DVec3);
    /// The same with fronts outside.
    fn outside_of_box(&mut self, object: u32, material: u32, low: DVec3, high: DVec3);
}

impl Make for SceneInput {
    fn object(&mut self, name: &str) -> u32 {
        self.objects.push(Object { name: name.into() });
        self.objects.len() as u32 - 1
    }

    fn material(&mut self, name: &str, surface: Surface) -> u32 {
        let material = Material { name: name.into(), surface, two_sided: false, alpha: Alpha::Opaque, texture: None };
        self.materials.push(material);
        self.materials.len() as u32 - 1
    }

    fn face(&mut self, object: u32, material: u32, corners: &[DVec3]) -> u32 {
        self.faces.push(Face { object, material, corners: corners.to_vec(), uv: None, surface: None });
        self.faces.len() as u32 - 1
    }

    fn inside_of_box(&mut self, object: u32, material: u32, low: DVec3, high: DVec3) {
        for corners in box_faces(low, high) {
            self.face(object, material, &corners);
        }
    }

    fn outside_of_box(&mut self, object: u32, material: u32, low: DVec3, high: DVec3) {
        for [a, b, c, d] in box_faces(low, high) {
            self.face(object, material, &[a, d, c, b]);
        }
    }
}

/// Faces of a box, counter-clockwise seen from inside: x-, x+, y-, y+, z-, z+.
pub fn box_faces(l: DVec3, h: DVec3) -> [[DVec3; 4]; 6] {
    let p = |x: u8, y: u8, z: u8| {
        let pick = |bit: u8, low: f64, high: f64| if bit == 0 { low } else { high };
        v(pick(x, l.x, h.x), pick(y, l.y, h.y), pick(z, l.z, h.z))
    };
    [
        [p(0, 0, 0), p(0, 1, 0), p(0, 1, 1), p(0, 0, 1)],
        [p(1, 0, 0), p(1, 0, 1), p(1, 1, 1), p(1, 1, 0)],
        [p(0, 0, 0), p(0, 0, 1), p(1, 0, 1), p(1, 0, 0)],
        [p(0, 1, 0), p(1, 1, 0), p(1, 1, 1), p(0, 1, 1)],
        [p(0, 0, 0), p(1, 0, 0), p(1, 1, 0), p(0, 1, 0)],
        [p(0, 0, 1), p(0, 1, 1), p(1, 1, 1), p(1, 0, 1)],
    ]
}

/// Texture coordinates for every corner of a face.
pub fn with_uv(input: &mut SceneInput, face: u32, uv: &[[f64; 2]]) {
    input.faces[face as usize].uv = Some(uv.iter().map(|&[u, v]| DVec2::new(u, v)).collect());
}

/// A scene that passes its check.
pub fn built(input: SceneInput) -> Scene {
    let scene = Scene::build(input, &BuildOptions::default()).unwrap();
    scene.check().unwrap();
    scene
}

/// One object and one material that reflects half and emits 1, to add faces to.
pub fn plain() -> SceneInput {
    let mut input = empty();
    input.object("thing");
    input.material("paint", grey(0.5, 1.0));
    input
}
