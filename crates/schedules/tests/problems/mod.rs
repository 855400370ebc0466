//! Scenes as problems: what tests of schedules begin with.

use isolux_core::kernels::form_factor::FormFactor;
use isolux_core::kernels::oracle::Thresholds;
use isolux_core::kernels::visibility::{Covered, Rays, Sampling};
use isolux_core::scene::Scene;
use isolux_core::solution::{Parameters, Roots, Stop, Update};

/// A scene of the project.
pub(crate) fn scene(name: &str) -> Scene {
    let path = format!("{}/../../scenes/{name}.glb", env!("CARGO_MANIFEST_DIR"));
    let input = isolux_formats::read::read(path.as_ref(), &Default::default()).expect("a scene of the project");
    Scene::build(input, &Default::default()).expect("a sound scene")
}

/// The paper's way, with `bf` in units of the mean emission and areas relative to the scene's.
pub(crate) fn parameters(scene: &Scene, bf: f64, area: f64, update: Update) -> Parameters {
    let scale = scene.emitted_power().mean() / scene.area();
    Parameters {
        thresholds: Thresholds {
            bf: bf * scale,
            partial: 0.0,
            partial_form_factor: 1.0,
            emission: 1.0,
            area: area * scene.area(),
        },
        stop: Stop::Change(0.01),
        update,
        roots: Roots::Fragments,
        form_factor: FormFactor::Disks,
        sampling: Sampling::from(Rays::Sixteen),
        covered: Covered::Counted,
        seed: 0,
    }
}
