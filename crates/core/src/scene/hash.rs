//! Identity of a scene: a hash over everything that its results depend on or are read by; [`Scene::compute_hash`] lists
//! what that is.

use super::{
    Alpha, AlphaMask, Corners, Lamp, LampShape, Material, Plane, Pole, Polygon, Scene, Side, Sky, SkyPattern, Texture,
    Wrap,
};
use crate::units::Rgb;
use glam::{DVec2, DVec3};
use sha2::{Digest, Sha256};

/// What is hashed, and how: changes when either does.
const LAYOUT: &str = "isolux scene 2";

/// SHA-256 of a scene. Every list and name is preceded by its length, every choice by its number, so that no two scenes
/// give the same bytes.
pub(super) fn hash(scene: &Scene) -> [u8; 32] {
    // All fields are named, so that a new one cannot be forgotten here.
    let Scene {
        polygons,
        fronts,
        joined,
        objects,
        materials,
        images: _,
        masks,
        cameras: _,
        lamps,
        sky,
        triangles,
        face_polygon,
        issues: _,
        diameter,
        front_area: _,
        unit,
        hash: _,
        name: _,
    } = scene;
    let mut bytes = Bytes(Sha256::new());
    bytes.text(LAYOUT);
    bytes.text(unit.power());
    bytes.number(*diameter);
    bytes.count(*fronts);
    bytes.count(*joined);
    bytes.list(polygons, Bytes::polygon);
    bytes.list(triangles, |bytes, triangle| triangle.iter().for_each(|&corner| bytes.point(corner)));
    bytes.list(face_polygon, |bytes, &polygon| bytes.index(polygon));
    bytes.list(objects, |bytes, object| bytes.text(&object.name));
    bytes.list(materials, Bytes::material);
    bytes.list(masks, Bytes::mask);
    // Scenes without lamps keep the hash that they had before there were any.
    if !lamps.is_empty() {
        bytes.list(lamps, Bytes::lamp);
    }
    // As those without a sky.
    if let Some(sky) = sky {
        bytes.sky(sky);
    }
    bytes.0.finalize().into()
}

/// A hash that is being fed.
struct Bytes(Sha256);

impl Bytes {
    fn number(&mut self, value: f64) {
        self.0.update(value.to_le_bytes());
    }

    fn index(&mut self, value: u32) {
        self.0.update(value.to_le_bytes());
    }

    fn count(&mut self, value: usize) {
        self.0.update((value as u64).to_le_bytes());
    }

    fn choice(&mut self, value: u8) {
        self.0.update([value]);
    }

    fn text(&mut self, text: &str) {
        self.count(text.len());
        self.0.update(text.as_bytes());
    }

    fn list<T>(&mut self, entries: &[T], mut each: impl FnMut(&mut Bytes, &T)) {
        self.count(entries.len());
        entries.iter().for_each(|entry| each(self, entry));
    }

    fn option<T>(&mut self, value: Option<T>, each: impl FnOnce(&mut Bytes, T)) {
        self.choice(u8::from(value.is_some()));
        if let Some(value) = value {
            each(self, value);
        }
    }

    fn point(&mut self, point: DVec3) {
        point.to_array().into_iter().for_each(|value| self.number(value));
    }

    fn uv(&mut self, uv: DVec2) {
        uv.to_array().into_iter().for_each(|value| self.number(value));
    }

    fn rgb(&mut self, value: Rgb) {
        value.0.into_iter().for_each(|value| self.number(value));
    }

    fn wrap(&mut self, wrap: [Wrap; 2]) {
        for wrap in wrap {
            self.choice(match wrap {
                Wrap::Repeat => 0,
                Wrap::Clamp => 1,
                Wrap::Mirror => 2,
            });
        }
    }

    fn corners(&mut self, corners: &Corners) {
        self.list(corners, |bytes, &corner| bytes.point(corner));
    }

    fn polygon(&mut self, polygon: &Polygon) {
        let Polygon {
            corners,
            plane: Plane { normal, offset },
            area,
            reflectance,
            emission,
            opacity,
            mask,
            object,
            material,
            side,
            twin,
            faces,
            uv,
        } = polygon;
        self.corners(corners);
        self.point(*normal);
        self.number(*offset);
        self.number(*area);
        self.rgb(*reflectance);
        self.rgb(*emission);
        self.number(*opacity);
        self.option(*mask, Bytes::index);
        self.index(*object);
        self.index(*material);
        self.choice(match side {
            Side::Front => 0,
            Side::Back => 1,
        });
        self.option(*twin, Bytes::index);
        faces.iter().for_each(|&face| self.index(face));
        self.option(*uv, |bytes, uv| uv.into_iter().for_each(|uv| bytes.uv(uv)));
    }

    fn material(&mut self, material: &Material) {
        let Material { name, surface, two_sided, alpha, texture } = material;
        self.text(name);
        self.rgb(surface.reflectance);
        self.rgb(surface.emission);
        self.number(surface.opacity);
        self.choice(u8::from(*two_sided));
        match alpha {
            Alpha::Opaque => self.choice(0),
            Alpha::Mask(mask) => {
                self.choice(1);
                self.index(*mask);
            }
            Alpha::Attenuate => self.choice(2),
        }
        self.option(texture.as_ref(), |bytes, Texture { image, factor, wrap }| {
            bytes.index(*image);
            bytes.rgb(*factor);
            bytes.wrap(*wrap);
        });
    }

    fn lamp(&mut self, lamp: &Lamp) {
        let Lamp { name, position, forward, side, intensity, shape } = lamp;
        self.text(name);
        [position, forward, side].into_iter().for_each(|&vector| self.point(vector));
        self.rgb(*intensity);
        match shape {
            LampShape::Point => self.choice(0),
            LampShape::Spot { inner, outer } => {
                self.choice(1);
                self.number(*inner);
                self.number(*outer);
            }
            LampShape::Parallel => self.choice(2),
            LampShape::Web(web) => {
                self.choice(match web.pole {
                    Pole::Forward => 3,
                    Pole::Across => 4,
                    Pole::Aside => 5,
                });
                for list in [&web.polar, &web.around, &web.intensity] {
                    self.list(list, |bytes, &value| bytes.number(value));
                }
            }
        }
    }

    fn sky(&mut self, sky: &Sky) {
        let Sky { name, up, sun, pattern: SkyPattern { gradation, indicatrix }, radiance, ground } = sky;
        self.text("sky");
        self.text(name);
        [up, sun].into_iter().for_each(|&vector| self.point(vector));
        gradation.iter().chain(indicatrix).for_each(|&value| self.number(value));
        self.rgb(*radiance);
        self.rgb(*ground);
    }

    fn mask(&mut self, mask: &AlphaMask) {
        let AlphaMask { width, height, solid, cutoff, wrap } = mask;
        self.index(*width);
        self.index(*height);
        self.number(*cutoff);
        self.wrap(*wrap);
        self.list(solid, |bytes, &solid| bytes.choice(u8::from(solid)));
    }
}
