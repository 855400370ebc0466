//! Rays through the BSP tree and the visibility of patches, against exact cases and against rays over all polygons.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod bsp_scenes;

use bsp_scenes::*;
use isolux_core::DVec3;
use isolux_core::kernels::NoProbe;
use isolux_core::kernels::visibility::{Rays, visibility};
use isolux_core::scene::Scene;
use isolux_core::tree::{Bsp, InsertionOrder};

const ORDERS: [InsertionOrder; 4] =
    [InsertionOrder::AsGiven, InsertionOrder::LargestFirst, InsertionOrder::Random(1), InsertionOrder::Random(2)];

/// The tree of a scene, checked.
fn tree(scene: &Scene, order: InsertionOrder) -> Bsp {
    let bsp = Bsp::build(scene, order);
    bsp.check(scene).unwrap();
    bsp
}

/// Catches a broken split: a tree of the furnished room whose fragments leave their planes, sides or areas.
#[test]
fn trees_of_a_room_keep_their_invariants() {
    let scene = furnished_room();
    for order in ORDERS {
        let bsp = tree(&scene, order);
        println!(
            "{order:?}: {} polygons, {} fragments, {} nodes",
            scene.fronts,
            bsp.fragments().len(),
            bsp.nodes().len()
        );
    }
}

/// Catches a wall that leaks or an empty room that blocks.
#[test]
fn a_wall_blocks_all_and_nothing_blocks_nothing() {
    let floor = vec![v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0)];
    let ceiling = vec![v(0.0, 0.0, 1.0), v(0.0, 1.0, 1.0), v(1.0, 1.0, 1.0), v(1.0, 0.0, 1.0)];
    let between: Vec<DVec3> = floor.iter().map(|&p| p + v(0.0, 0.0, 0.5)).collect();
    for (faces, expected) in [(vec![floor.clone(), ceiling.clone()], 1.0), (vec![floor, ceiling, between], 0.0)] {
        let scene = scene_of(&faces);
        for order in ORDERS {
            let bsp = tree(&scene, order);
            let (a, b) = (patch(&scene.polygons[0]), patch(&scene.polygons[1]));
            for rays in [Rays::Sixteen, Rays::TwoHundredFiftySix] {
                for seed in 0..20 {
                    assert_eq!(visibility(&bsp, &scene, &a, &b, rays, seed, &mut NoProbe), expected);
                }
            }
        }
    }
}
