//! Where the schedules depart from SPLASH-2's program and the paper's: the size of each departure, as DEVIATIONS.md states it.

mod problems;

use isolux_core::solution::{Stop, Unobserved, Update};
use isolux_core::tree::InsertionOrder;
use isolux_machine::{Cause, Run};
use isolux_schedules::{Outcome, Schedule, Tally};
use problems::{Setting, parameters, simulator};

fn solve(p: usize, schedule: Schedule, bf: f64, mut look: impl FnMut(&str, &Run<Tally>)) -> (Setting, Outcome) {
    let setting = Setting::new(problems::crooked_box(), InsertionOrder::AsGiven);
    let outcome = {
        let problem = setting.problem(parameters(&setting.scene, bf, 2e-3, Update::Jacobi));
        setting.solve(simulator("sb-pram", p), &problem, schedule, |_, name, run| look(name.number, run))
    };
    (setting, outcome)
}

/// What refines the box to some thousand links.
const BF: f64 = 0.1;

/// D29. Catches a lock around the reservation of records: the loop over initial pairs takes one for each link that it puts into
/// a list, and none besides.
#[test]
fn d29_records_are_reserved_without_locks() {
    let mut locks = 0;
    // Nothing is ever refined: all links are those of the initial pairs.
    let (_, outcome) = solve(8, Schedule::SB_PRAM, 1e6, |phase, run| {
        if phase == "1''" {
            locks = run.total_counts().locks;
        }
    });
    assert!(locks > 0);
    assert_eq!(locks, outcome.links);
}

/// D30. Catches a tree of the tasks that is not the one that rays walk, and a comparison that sees no difference: in a plane, in
/// the number of pieces, in a child.
#[test]
fn d30_the_tasks_build_the_tree_that_rays_walk() {
    for schedule in [Schedule::SPLASH, Schedule::SB_PRAM, Schedule::Wavefront] {
        let (setting, outcome) = solve(5, schedule, BF, |_, _| ());
        let problem = setting.problem(parameters(&setting.scene, BF, 2e-3, Update::Jacobi));
        assert_eq!(outcome.check_tree(&problem), Ok(()), "{schedule:?}");
        for word in 0..4 {
            let mut altered = outcome.clone();
            // Another plane, a child where there is none or none where there is one, a piece more.
            let there = altered.nodes[0][word];
            altered.nodes[0][word] = match word {
                0 => setting.scene.polygons.len() as u64 - 1,
                3 => there + 1,
                _ => u64::from(there == 0),
            };
            assert_ne!(altered.check_tree(&problem), Ok(()), "{schedule:?}, word {word}");
        }
    }
}

/// D31. Catches lists that are sorted at no cost, or at one that counts: what keeps sums in one order is charged, and is little.
#[test]
fn d31_sorting_lists_costs_little() {
    let order = isolux_schedules::CLASSES.iter().position(|&class| class == "order").expect("a class");
    let (mut sorted, mut work) = (0, 0);
    solve(1, Schedule::SPLASH, BF, |_, run| {
        sorted += run.total_counts().work.counts()[order];
        work += run.total_time().get(Cause::Work);
    });
    // 27.7 instructions each, as the cost model has it.
    let share = sorted as f64 * 27.7 / work as f64;
    // 0.037 %.
    assert!((0.0003..0.0005).contains(&share), "{share}");
}

/// Time and longest chain of each of splash's phases, on one processor and on 1,024: the room at a quarter of the study's work.
fn room() -> [Vec<(&'static str, u64, u64)>; 2] {
    let setting = Setting::new(problems::scene("room"), InsertionOrder::FewestCuts);
    let pilot = isolux_core::solution::pilot_irradiance(&setting.scene, &setting.bsp, 0, &mut Unobserved);
    let mut parameters = parameters(&setting.scene, 1.0, 1e-4, Update::InPlace);
    parameters.thresholds.bf = 0.055 * pilot.expect("nobody stops it");
    parameters.stop = Stop::Change(0.005);
    let problem = setting.problem(parameters);
    [1, 1024].map(|p| {
        let mut phases: Vec<(&str, u64, u64)> = Vec::new();
        setting.solve(simulator("sb-pram", p), &problem, Schedule::SPLASH, |_, name, run| {
            match phases.iter_mut().find(|(number, _, _)| *number == name.number) {
                Some((_, time, span)) => (*time, *span) = (*time + run.clock, *span + run.span),
                None => phases.push((name.number, run.clock, run.span)),
            }
        });
        phases
    })
}

/// D32, D33, D34. Catches another size of what departs from the paper's Figure 7: shares, speedups, and what bounds them.
#[test]
fn splash_departs_from_figure_7_as_stated() {
    let [one, many] = room();
    let total = |phases: &[(&str, u64, u64)]| phases.iter().map(|&(_, time, _)| time as f64).sum::<f64>();
    let share = |k: usize| one[k].1 as f64 / total(&one);
    let speedup = |k: usize| one[k].1 as f64 / many[k].1 as f64;
    // 0.93 %, 24.2, and 98.5 % of the time is the chain of B-tasks.
    assert!((0.0084..0.0103).contains(&share(0)), "{}", share(0));
    assert!((22.0..26.5).contains(&speedup(0)), "{}", speedup(0));
    assert!(many[0].2 as f64 > 0.95 * many[0].1 as f64, "{:?}", many[0]);
    // 200.5 and 188.4; the longest chain is 99 % of the iterations' time.
    assert!((180.0..220.0).contains(&speedup(1)), "{}", speedup(1));
    let all = total(&one) / total(&many);
    assert!((170.0..207.0).contains(&all), "{all}");
    assert!(many[1].2 as f64 > 0.9 * many[1].1 as f64, "{:?}", many[1]);
    // 0.55 % and 695.
    assert!((0.0049..0.006).contains(&share(2)), "{}", share(2));
    assert!((625.0..765.0).contains(&speedup(2)), "{}", speedup(2));
}
