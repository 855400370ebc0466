//! Identity of a scene: a hash over everything that its links and radiosities depend on.

use super::{Scene, Wrap};
use sha2::{Digest, Sha256};

/// SHA-256 over polygons (corners, surface values, sides) and masks; names, images and cameras do not count.
pub(super) fn hash(scene: &Scene) -> [u8; 32] {
    let mut digest = Sha256::new();
    let mut number = |value: f64| digest.update(value.to_le_bytes());
    for polygon in &scene.polygons {
        number(polygon.corners.len() as f64);
        for corner in polygon.corners.iter() {
            corner.to_array().into_iter().for_each(&mut number);
        }
        polygon.reflectance.0.into_iter().chain(polygon.emission.0).for_each(&mut number);
        number(polygon.opacity);
        number(polygon.twin.map_or(-1.0, f64::from));
        number(polygon.mask.map_or(-1.0, f64::from));
        if let (Some(_), Some(uv)) = (polygon.mask, polygon.uv) {
            uv.iter().flat_map(|uv| uv.to_array()).for_each(&mut number);
        }
    }
    for mask in &scene.masks {
        digest.update(mask.width.to_le_bytes());
        digest.update(mask.height.to_le_bytes());
        for wrap in mask.wrap {
            digest.update([match wrap {
                Wrap::Repeat => 0u8,
                Wrap::Clamp => 1,
                Wrap::Mirror => 2,
            }]);
        }
        for &solid in &mask.solid {
            digest.update([u8::from(solid)]);
        }
    }
    digest.finalize().into()
}
