//! What simulated runs of the schedules promise: the same bytes every time, waiting that is computed as if each poll were made,
//! small idle processors, and times that no machine could beat.

mod problems;

use isolux_core::solution::Update;
use isolux_core::tree::InsertionOrder;
use isolux_machine::Cause;
use isolux_schedules::{CLASSES, Grain, Schedule, Switches};
use isolux_simulator::{CacheSimulator, Memory, Polling, SimulatorOf};
use problems::{Setting, parameters, simulator, spec};
use std::fmt::Write;

const FINEST: Schedule = Schedule::Tasks { switches: Switches::SPLASH, grain: Grain::FINEST };

fn coarse(update: Update) -> (Setting, isolux_core::solution::Parameters) {
    let setting = Setting::new(problems::crooked_box(), InsertionOrder::AsGiven);
    let parameters = parameters(&setting.scene, 0.2, 5e-3, update);
    (setting, parameters)
}

/// Everything that a run leaves: traces of all phases, accounts, counts, light.
fn everything<M: Memory>(setting: &Setting, machine: SimulatorOf<M>, schedule: Schedule, update: Update) -> String {
    let parameters = parameters(&setting.scene, 0.2, 5e-3, update);
    let problem = setting.problem(parameters);
    let mut text = String::new();
    let outcome = setting.solve(machine.traced(true), &problem, schedule, |machine, name, run| {
        let trace = machine.take_trace().expect("is traced");
        let _ =
            write!(text, "{name:?} {} {} {:?} {:?}\n{}", run.clock, run.span, run.time, run.counts, trace.to_text());
    });
    let _ = write!(text, "{:?} {:?} {:?}", outcome.radiosity, outcome.vertices, outcome.tally);
    text
}

/// Catches anything of the host that reaches a run: addresses, hashes, the order of its threads.
#[test]
fn the_same_inputs_give_the_same_bytes() {
    let (setting, _) = coarse(Update::InPlace);
    for schedule in [Schedule::SPLASH, Schedule::SB_PRAM, Schedule::Wavefront] {
        let on_sb_pram = || everything(&setting, simulator("sb-pram", 13), schedule, Update::InPlace);
        let on_dash = || {
            let dash = CacheSimulator::new(&spec("dash"), 13, &CLASSES).expect("a machine");
            everything(&setting, dash, schedule, Update::InPlace)
        };
        let (first, second) = std::thread::scope(|scope| {
            let other = scope.spawn(|| (on_sb_pram(), on_dash()));
            ((on_sb_pram(), on_dash()), other.join().expect("does not panic"))
        });
        assert!(first == second, "{schedule:?}");
    }
}

/// Catches waiting that is computed otherwise than it would be polled: every poll an event, for up to 16 processors.
#[test]
fn each_poll_gives_the_same_trace() {
    let (setting, _) = coarse(Update::InPlace);
    for schedule in [Schedule::SPLASH, FINEST, Schedule::SB_PRAM, Schedule::Wavefront] {
        for p in [2, 16] {
            let with =
                |polling| everything(&setting, simulator("sb-pram", p).polling(polling), schedule, Update::InPlace);
            assert!(with(Polling::ClosedForm) == with(Polling::EveryPoll), "{schedule:?}, {p}");
        }
    }
}

/// Catches time that is lost or made up: causes add up to processors times clock, and no phase is shorter than its work shared
/// out, or than its longest chain. Work grows with processors only by what is counted.
#[test]
fn no_phase_is_shorter_than_it_can_be() {
    let (setting, parameters) = coarse(Update::Jacobi);
    let problem = setting.problem(parameters);
    for schedule in [Schedule::SPLASH, Schedule::SB_PRAM, Schedule::Wavefront] {
        for p in [1, 8, 200] {
            setting.solve(simulator("sb-pram", p), &problem, schedule, |_, name, run| {
                let total = run.total_time();
                assert_eq!(total.total(), run.clock * p as u64, "{name:?}");
                let bound = (total.get(Cause::Work).div_ceil(p as u64)).max(run.span);
                assert!(run.span > 0 && run.clock >= bound, "{schedule:?}, {p}, {name:?}: {} of {bound}", run.clock);
            });
        }
    }
}

/// Catches a program whose waiting processors take more than 4 KB each, 64 MB at 16,384.
#[test]
fn waiting_processors_are_small() {
    let (setting, parameters) = coarse(Update::Jacobi);
    let problem = setting.problem(parameters);
    for schedule in [Schedule::SPLASH, Schedule::SB_PRAM, Schedule::Wavefront] {
        let outcome = setting.solve(simulator("sb-pram", 2), &problem, schedule, |_, _, _| ());
        let bytes = outcome.program_bytes + isolux_simulator::Simulator::PARKED_BYTES;
        assert!(bytes <= 4096, "{schedule:?}: {bytes} bytes");
    }
}

/// Catches tasks that are lost, or run twice, where they are many and processors are more: the largest machine.
#[test]
fn the_largest_machine_runs_each_schedule() {
    let (setting, parameters) = coarse(Update::Jacobi);
    let problem = setting.problem(parameters);
    let expected = setting.solve(simulator("sb-pram", 1), &problem, Schedule::SB_PRAM, |_, _, _| ());
    for schedule in [Schedule::SPLASH, Schedule::SB_PRAM, Schedule::Wavefront] {
        let outcome = setting.solve(simulator("sb-pram", 16_384), &problem, schedule, |_, _, _| ());
        assert!(outcome.radiosity == expected.radiosity, "{schedule:?}");
    }
}
