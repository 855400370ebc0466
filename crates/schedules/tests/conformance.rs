//! Every schedule on every machine: with Jacobi's update, the light of the sequential solver, bit for bit.

mod problems;

use isolux_core::kernels::Counts;
use isolux_core::solution::{Solver, Unobserved, Update};
use isolux_core::tree::{Bsp, ElementId, InsertionOrder, Path};
use isolux_core::units::Rgb;
use isolux_machine::{Machine, Sequential, Threads};
use isolux_schedules::{
    CLASSES, COST_MODEL, Grain, Memory, Outcome, Problem, Remembered, Schedule, Sizes, Switches, run,
};
use isolux_simulator::{CacheSimulator, MachineSpec, Simulator};

const SIZES: Sizes =
    Sizes { elements: 1 << 16, links: 1 << 20, pieces: 1 << 14, nodes: 1 << 12, fragments: 1 << 12, tasks: 1 << 18 };

fn spec(name: &str) -> MachineSpec {
    let mut spec = MachineSpec::named(name).expect("a machine that comes along");
    spec.add_work(COST_MODEL, "cost_model.toml").expect("sound figures");
    spec
}

fn simulator(name: &str, processors: usize) -> Simulator {
    Simulator::new(&spec(name), processors, &CLASSES).expect("a machine")
}

fn solve<M: Machine>(mut machine: M, problem: &Problem<'_>, memory: &Memory, schedule: Schedule) -> Outcome {
    let pairs = Remembered::new(problem, memory);
    run(&mut machine, problem, pairs, schedule, SIZES, 50, &mut |_, _, _| true).expect("runs")
}

/// What the sequential solver computes: radiosities by name.
fn reference(problem: &Problem<'_>) -> (Vec<(Path, Rgb)>, usize) {
    let active = vec![true; problem.scene.polygons.len()];
    let mut solver: Solver<'_, Counts> = Solver::with_active(problem.scene, problem.bsp, problem.parameters, active);
    solver.link_roots(&mut Unobserved);
    let mut iterations = 0;
    loop {
        iterations += 1;
        if solver.iterate(&mut Unobserved).expect("nobody stops it").converged {
            break;
        }
    }
    let hierarchy = solver.hierarchy();
    let elements = (0..hierarchy.elements.len() as u32).map(ElementId);
    let mut light: Vec<_> =
        elements.map(|id| (hierarchy.elements.get(id).path, hierarchy.light.radiosity(id))).collect();
    light.sort_unstable_by_key(|&(path, _)| path);
    (light, iterations)
}

fn assert_same(outcome: &Outcome, reference: &(Vec<(Path, Rgb)>, usize), what: &str) {
    assert_eq!(outcome.iterations.len(), reference.1, "{what}: iterations");
    assert_eq!(outcome.radiosity.len(), reference.0.len(), "{what}: elements");
    let differs = outcome.radiosity.iter().zip(&reference.0).find(|(a, b)| a != b);
    assert_eq!(differs, None, "{what}");
}

/// Catches any order of work that reaches a result.
#[test]
fn jacobi_is_the_same_everywhere() {
    let scene = problems::scene("cornell");
    let bsp = Bsp::build(&scene, InsertionOrder::LargestFirst);
    let parameters = problems::parameters(&scene, 0.1, 1e-3, Update::Jacobi);
    let problem =
        Problem::new(&scene, &bsp, InsertionOrder::LargestFirst, parameters, &vec![true; scene.polygons.len()]);
    let memory = Memory::default();
    let expected = reference(&problem);
    let finest = Schedule::Tasks { switches: Switches::SPLASH, grain: Grain::FINEST };
    for schedule in [Schedule::SPLASH, Schedule::SB_PRAM, finest, Schedule::Wavefront] {
        let on = |machine: &str| format!("{schedule:?} on {machine}");
        assert_same(
            &solve(Sequential::new(&CLASSES).expect("a machine"), &problem, &memory, schedule),
            &expected,
            &on("sequential"),
        );
        assert_same(
            &solve(Threads::new(3, &CLASSES).expect("a machine"), &problem, &memory, schedule),
            &expected,
            &on("threads"),
        );
        for p in [1, 3, 16, 500] {
            let machine = simulator("sb-pram", p);
            assert_same(&solve(machine, &problem, &memory, schedule), &expected, &on(&format!("SB-PRAM, {p}")));
        }
        for p in [1, 6] {
            let machine = CacheSimulator::new(&spec("dash"), p, &CLASSES).expect("a machine");
            assert_same(&solve(machine, &problem, &memory, schedule), &expected, &on(&format!("DASH, {p}")));
        }
    }
}
