//! Scenes as problems: what tests of schedules begin with.

#![allow(dead_code, reason = "each test binary uses a part of it")]

use glam::DVec3;
use isolux_core::kernels::form_factor::FormFactor;
use isolux_core::kernels::oracle::Thresholds;
use isolux_core::kernels::visibility::{Covered, Rays, Sampling};
use isolux_core::scene::{Alpha, BuildOptions, Face, Material, Object, Scene, SceneInput, Surface};
use isolux_core::solution::{Parameters, Roots, Stop, Update};
use isolux_core::tree::{Bsp, InsertionOrder};
use isolux_core::units::Rgb;
use isolux_machine::{Machine, Run};
use isolux_schedules::{
    CLASSES, COST_MODEL, Memory, Outcome, PhaseName, Problem, Remembered, Schedule, Sizes, Tally, run,
};
use isolux_simulator::{MachineSpec, Simulator};

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

/// Room for records, ample for what tests solve.
pub(crate) const SIZES: Sizes =
    Sizes { elements: 1 << 18, links: 1 << 22, pieces: 1 << 14, nodes: 1 << 12, fragments: 1 << 12, tasks: 1 << 18 };

/// Figures of a machine that comes along, with what kernels cost.
pub(crate) fn spec(name: &str) -> MachineSpec {
    let mut spec = MachineSpec::named(name).expect("a machine that comes along");
    spec.add_work(COST_MODEL, "cost_model.toml").expect("sound figures");
    spec
}

/// A simulated machine with uniform access.
pub(crate) fn simulator(name: &str, processors: usize) -> Simulator {
    Simulator::new(&spec(name), processors, &CLASSES).expect("a machine")
}

/// A scene, its tree, and what has been found out about its pairs.
pub(crate) struct Setting {
    pub(crate) scene: Scene,
    pub(crate) bsp: Bsp,
    pub(crate) order: InsertionOrder,
    pub(crate) memory: Memory,
}

impl Setting {
    pub(crate) fn new(scene: Scene, order: InsertionOrder) -> Setting {
        let bsp = Bsp::build(&scene, order);
        Setting { scene, bsp, order, memory: Memory::default() }
    }

    pub(crate) fn problem(&self, parameters: Parameters) -> Problem<'_> {
        Problem::new(&self.scene, &self.bsp, self.order, parameters, &vec![true; self.scene.polygons.len()])
    }

    /// Solves on a machine; each phase's run is looked at by `look`.
    pub(crate) fn solve<M: Machine>(
        &self,
        mut machine: M,
        problem: &Problem<'_>,
        schedule: Schedule,
        mut look: impl FnMut(&mut M, PhaseName, &Run<Tally>),
    ) -> Outcome {
        let pairs = Remembered::new(problem, &self.memory);
        run(&mut machine, problem, pairs, schedule, SIZES, 100, &mut |machine, name, run| {
            look(machine, name, run);
            true
        })
        .expect("runs")
    }
}

/// A box with a lamp in it, its walls trapezoids and triangles: quadrilaterals that are no parallelograms, and a two-sided
/// lamp that cuts through the plane of nothing.
pub(crate) fn crooked_box() -> Scene {
    let [a, b, c, d] = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
    let [e, f, g, h] = [[0.5, 0.5], [3.5, 0.5], [3.5, 2.5], [0.5, 2.5]].map(|[x, y]| DVec3::new(x, y, 2.0));
    let [i, j, k, l] = [[1.0, 1.0], [2.2, 1.1], [1.9, 1.8], [1.2, 1.7]].map(|[x, y]| DVec3::new(x, y, 1.2));
    // Stands on the floor and cuts the planes of others.
    let [m, n, o] = [[2.5, 0.6, 0.0], [3.2, 2.0, 0.0], [2.8, 1.2, 1.1]].map(DVec3::from_array);
    let (wall, lamp) = (0, 1);
    let faces: Vec<(u32, Vec<DVec3>)> = vec![
        (wall, vec![a, b, c]),
        (wall, vec![a, c, d]),
        (wall, vec![e, h, g, f]),
        (wall, vec![a, e, f, b]),
        (wall, vec![b, f, g, c]),
        (wall, vec![c, g, h, d]),
        (wall, vec![d, h, e, a]),
        (lamp, vec![i, l, k, j]),
        (wall, vec![m, n, o]),
    ];
    let material = |name: &str, reflectance: [f64; 3], emission: f64, two_sided: bool| Material {
        name: name.into(),
        surface: Surface { reflectance: Rgb(reflectance), emission: Rgb::splat(emission), opacity: 1.0 },
        two_sided,
        alpha: Alpha::Opaque,
        texture: None,
    };
    let face = |(material, corners)| Face { object: 0, material, corners, uv: None, surface: None };
    let input = SceneInput {
        name: "crooked box".into(),
        metres_per_unit: 1.0,
        objects: vec![Object { name: "box".into() }],
        faces: faces.into_iter().map(face).collect(),
        materials: vec![material("wall", [0.7, 0.5, 0.3], 0.0, false), material("lamp", [0.2, 0.3, 0.4], 10.0, true)],
        ..SceneInput::default()
    };
    Scene::build(input, &BuildOptions::default()).expect("a sound scene")
}
