//! Scenes that tests of this crate look at: corners go in, a scene comes out.

#![allow(clippy::unwrap_used, reason = "tests")]

use glam::DVec3;
use isolux_core::scene::{Alpha, BuildOptions, Face, Material, Object, Scene, SceneInput, Surface};
use isolux_core::units::Rgb;
use std::sync::Arc;

/// One object of single-sided faces, all of one paint.
pub(crate) fn painted(faces: &[&[[f64; 3]]], reflectance: f64, emission: f64) -> Arc<Scene> {
    let surface = Surface { reflectance: Rgb::splat(reflectance), emission: Rgb::splat(emission), opacity: 1.0 };
    let material = Material { name: "paint".into(), surface, two_sided: false, alpha: Alpha::Opaque, texture: None };
    let faces = faces.iter().map(|corners| {
        let corners = corners.iter().copied().map(DVec3::from_array).collect();
        Face { object: 0, material: 0, corners, uv: None, surface: None }
    });
    let input = SceneInput {
        name: "sample".into(),
        metres_per_unit: 1.0,
        objects: vec![Object { name: "thing".into() }],
        materials: vec![material],
        faces: faces.collect(),
        ..SceneInput::default()
    };
    Arc::new(Scene::build(input, &BuildOptions::default()).unwrap())
}
