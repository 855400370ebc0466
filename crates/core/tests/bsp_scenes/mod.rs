//! Scenes for tests and benches of rays: corners go in, a [`Scene`] with the fields that rays look at comes out.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "each test binary uses a part of it")]

use isolux_core::kernels::Patch;
use isolux_core::scene::{Corners, Object, Plane, Polygon, Scene, Side};
use isolux_core::units::{Rgb, Unit};
use isolux_core::{DVec2, DVec3};

pub fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A polygon of opacity 1 without mask, or `None` where the corners span no area.
pub fn polygon(points: &[DVec3]) -> Option<Polygon> {
    let corners = Corners::from_slice(points).unwrap();
    let normal = corners.area_vector().try_normalize()?;
    Some(Polygon {
        corners,
        plane: Plane { normal, offset: normal.dot(corners.mean()) },
        area: corners.area(),
        reflectance: Rgb::splat(0.5),
        emission: Rgb::ZERO,
        opacity: 1.0,
        mask: None,
        object: 0,
        material: 0,
        side: Side::Front,
        twin: None,
        faces: [0, Scene::NO_POLYGON],
        uv: None,
    })
}

/// A scene of fronts only.
pub fn scene(polygons: Vec<Polygon>) -> Scene {
    let points = || polygons.iter().flat_map(|polygon| polygon.corners.iter().copied());
    let lower = points().fold(DVec3::INFINITY, DVec3::min);
    let upper = points().fold(DVec3::NEG_INFINITY, DVec3::max);
    Scene {
        fronts: polygons.len(),
        front_area: Scene::area_of(&polygons),
        joined: 0,
        polygons,
        objects: vec![Object { name: "all".into() }],
        materials: vec![],
        images: vec![],
        masks: vec![],
        cameras: vec![],
        lamps: vec![],
        sky: None,
        triangles: vec![],
        face_polygon: vec![],
        issues: vec![],
        diameter: (upper - lower).length(),
        unit: Unit::default(),
        hash: [0; 32],
        name: "test".into(),
    }
}

pub fn scene_of(faces: &[Vec<DVec3>]) -> Scene {
    scene(faces.iter().filter_map(|face| polygon(face)).collect())
}

/// The kernel's view of a polygon.
pub fn patch(polygon: &Polygon) -> Patch<'_> {
    Patch { corners: &polygon.corners, plane: &polygon.plane, area: polygon.area }
}

/// The six faces of a box, normals outwards (or inwards: a room).
pub fn cuboid(low: DVec3, high: DVec3, inwards: bool) -> Vec<Vec<DVec3>> {
    let corner = |k: usize| {
        v(
            if k & 1 == 0 { low.x } else { high.x },
            if k & 2 == 0 { low.y } else { high.y },
            if k & 4 == 0 { low.z } else { high.z },
        )
    };
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        .map(|face| {
            let mut face: Vec<DVec3> = face.map(corner).to_vec();
            if inwards {
                face.reverse();
            }
            face
        })
        .to_vec()
}

/// Turns faces about the vertical axis through `centre`.
pub fn turned(mut faces: Vec<Vec<DVec3>>, centre: DVec3, angle: f64) -> Vec<Vec<DVec3>> {
    let (sine, cosine) = angle.sin_cos();
    for point in faces.iter_mut().flatten() {
        let d = *point - centre;
        *point = centre + v(cosine * d.x - sine * d.y, sine * d.x + cosine * d.y, d.z);
    }
    faces
}

/// A top on four legs.
pub fn table(centre: DVec3, size: DVec3, angle: f64) -> Vec<Vec<DVec3>> {
    let half = v(size.x / 2.0, size.y / 2.0, 0.0);
    let top = v(0.0, 0.0, size.z);
    let mut faces = cuboid(centre - half + top - v(0.0, 0.0, 0.04), centre + half + top, false);
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let foot = centre + v(x * (half.x - 0.05), y * (half.y - 0.05), 0.0);
        faces.extend(cuboid(foot - v(0.03, 0.03, 0.0), foot + v(0.03, 0.03, size.z - 0.04), false));
    }
    turned(faces, centre, angle)
}

/// A room of 8 m x 6 m x 3 m with tables, chairs, a shelf, lamps: 348 quadrilaterals, a third of them askew.
pub fn furnished_room() -> Scene {
    let mut faces = cuboid(v(0.0, 0.0, 0.0), v(8.0, 6.0, 3.0), true);
    for (k, (x, y)) in [(1.6, 1.5), (4.1, 1.4), (6.4, 1.7), (2.0, 4.3)].into_iter().enumerate() {
        let askew = if k % 2 == 0 { 0.0 } else { 0.3 };
        faces.extend(table(v(x, y, 0.0), v(1.4, 0.8, 0.74), askew));
    }
    for (k, (x, y)) in [(1.6, 2.3), (4.1, 2.2), (6.4, 2.5), (2.0, 5.1)].into_iter().enumerate() {
        faces.extend(table(v(x, y, 0.0), v(0.45, 0.45, 0.45), 0.5 * k as f64));
        let back = cuboid(v(x - 0.2, y + 0.19, 0.45), v(x + 0.2, y + 0.22, 0.95), false);
        faces.extend(turned(back, v(x, y, 0.0), 0.5 * k as f64));
    }
    for board in 0..6 {
        let z = 0.1 + 0.4 * f64::from(board);
        faces.extend(cuboid(v(5.0, 5.6, z), v(7.5, 6.0, z + 0.03), false));
    }
    for lamp in 0..3 {
        let x = 2.0 + 2.0 * f64::from(lamp);
        faces.extend(cuboid(v(x - 0.3, 2.9, 2.6), v(x + 0.3, 3.1, 2.7), false));
    }
    let mut k = 0;
    while faces.len() + 6 <= 350 {
        // Books and boxes on shelf and tables.
        let (x, y, z) = if k % 2 == 0 {
            (5.1 + 0.3 * f64::from(k / 2 % 8), 5.8, 0.13 + 0.4 * f64::from(k % 3))
        } else {
            (1.3 + 2.5 * f64::from(k / 2 % 3), 1.4 + 0.05 * f64::from(k % 5), 0.74)
        };
        let low = v(x - 0.08, y - 0.1, z);
        faces.extend(turned(cuboid(low, low + v(0.16, 0.2, 0.2), false), v(x, y, z), 0.2 * f64::from(k % 4)));
        k += 1;
    }
    scene_of(&faces)
}

/// All quads of a polygon cut `level` times in four, as polygons of their own with the plane of the whole.
pub fn quartered(whole: &Polygon, level: u32) -> Vec<Polygon> {
    let count = 1 << level;
    let side = 1.0 / f64::from(count);
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| whole.corners[k]);
    let at = |i: i32, j: i32| {
        let (s, t) = (f64::from(i) * side, f64::from(j) * side);
        a * ((1.0 - s) * (1.0 - t)) + b * (s * (1.0 - t)) + c * (s * t) + d * ((1.0 - s) * t)
    };
    let mut parts = Vec::new();
    for i in 0..count {
        for j in 0..count {
            let corners = Corners::quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            parts.push(Polygon { corners, area: corners.area(), ..whole.clone() });
        }
    }
    parts
}

/// Random numbers for tests (xorshift64*, Vigna 2016): not the kernel's own, so that they share no pattern.
pub struct Random(pub u64);

impl Random {
    pub fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64
    }
    pub fn point(&mut self, low: DVec3, high: DVec3) -> DVec3 {
        low + (high - low) * v(self.unit(), self.unit(), self.unit())
    }
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let p = self.point(DVec3::NEG_ONE, DVec3::ONE);
            if p.length_squared() > 1e-4 && p.length_squared() <= 1.0 {
                return p.normalize();
            }
        }
    }
    pub fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count - 1)
    }
}

/// Texture coordinates of a unit square for a quad.
pub const UNIT_UV: [DVec2; 4] = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
