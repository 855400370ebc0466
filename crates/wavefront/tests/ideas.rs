//! What each switch of [`Ideas`] says it leaves out is left out, and the light is still that of the scene.

#![allow(clippy::unwrap_used, reason = "a test")]

use isolux_core::scene::{BuildOptions, Scene};
use isolux_formats::read::read;
use isolux_wavefront::{Control, Ideas, Outcome, Prepared, Request};
use std::sync::Arc;

/// A shipped scene.
fn shipped(name: &str) -> Arc<Scene> {
    let path = format!("{}/../../scenes/{name}.glb", env!("CARGO_MANIFEST_DIR"));
    Arc::new(Scene::build(read(path.as_ref(), &Default::default()).unwrap(), &BuildOptions::default()).unwrap())
}

/// Solves for an error of 20 %.
fn solved(scene: &Arc<Scene>, ideas: Ideas) -> Outcome {
    let request = Request {
        error: 0.2,
        dark: None,
        least_area: 1e-7,
        seed: 0,
        max_elements: None,
        memory: None,
        time: None,
        ideas,
    };
    Prepared::new(scene.clone()).solve(&request, &Control::default()).outcome(scene)
}

/// Mean irradiance over the fronts, and bands.
fn mean(scene: &Scene, outcome: &Outcome) -> f64 {
    let irradiance = |front: usize| outcome.light.irradiance(isolux_core::tree::ElementId(front as u32)).mean();
    let sum: f64 = (0..scene.fronts).map(|front| scene.polygons[front].area * irradiance(front)).sum();
    sum / scene.area()
}

/// Links with a cluster at one end at least.
fn of_clusters(outcome: &Outcome) -> usize {
    let elements = outcome.elements.as_slice().len() as u32;
    let links = &outcome.links;
    links.receiver.iter().zip(&links.source).filter(|&(&a, &b)| a.max(b) >= elements).count()
}

/// Catches pairs that clusters still stand for though they are off, and light that is lost where they do not.
#[test]
fn without_clusters_only_elements_are_linked() {
    let scene = shipped("room");
    let (with, without) =
        (solved(&scene, Ideas::default()), solved(&scene, Ideas { clusters: false, ..Ideas::default() }));
    assert!(of_clusters(&with) > 0);
    assert_eq!(of_clusters(&without), 0);
    let (with, without) = (mean(&scene, &with), mean(&scene, &without));
    assert!((with / without - 1.0).abs() < 0.05, "{with} {without}");
}
