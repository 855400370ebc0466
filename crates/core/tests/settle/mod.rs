//! Solves for tests: a scene, its tree and parameters go in, a checked solver at its end comes out.

#![allow(unreachable_pub, clippy::unwrap_used, reason = "tests")]

use isolux_core::kernels::Counts;
use isolux_core::kernels::form_factor::FormFactor;
use isolux_core::kernels::oracle::Thresholds;
use isolux_core::kernels::visibility::{Covered, Sampling};
use isolux_core::links::Hierarchy;
use isolux_core::scene::Scene;
use isolux_core::solution::{Flow, Parameters, Roots, Solver, Stop, Unobserved, Update};
use isolux_core::tree::Bsp;

/// The paper's rule of refinement, with these thresholds.
pub fn parameters(bf: f64, area: f64) -> Parameters {
    Parameters {
        thresholds: Thresholds { bf, partial: 0.0, partial_form_factor: 1.0, emission: 1.0, area },
        stop: Stop::Change(1e-12),
        update: Update::InPlace,
        roots: Roots::Polygons,
        form_factor: FormFactor::Lambert,
        sampling: Sampling::default(),
        covered: Covered::default(),
        seed: 0,
    }
}

/// Links the roots and iterates to the end, in fewer than `most` iterations; checks what came out.
pub fn settled<'a>(scene: &'a Scene, bsp: &'a Bsp, parameters: Parameters, most: usize) -> Solver<'a, Counts> {
    let mut solver: Solver<'_, Counts> = Solver::new(scene, bsp, parameters);
    assert_eq!(solver.link_roots(&mut Unobserved), Flow::Continue);
    solver.hierarchy().links.check(&solver.hierarchy().elements, scene).unwrap();
    while !solver.iterate(&mut Unobserved).unwrap().converged {
        assert!(solver.iterations().len() < most);
    }
    let Hierarchy { elements, links, light } = solver.hierarchy();
    elements.check().unwrap();
    links.check(elements, scene).unwrap();
    light.check(scene, elements).unwrap();
    solver
}
