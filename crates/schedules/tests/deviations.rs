//! Where the schedules depart from SPLASH-2's program and the paper's: the size of each departure, as DEVIATIONS.md states it.

mod problems;

use isolux_core::solution::Update;
use isolux_core::tree::{Bsp, InsertionOrder};
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

/// D30. Catches a tree of the tasks that is not the one that rays walk: the same planes, and as many pieces in each.
#[test]
fn d30_the_tasks_build_the_tree_that_rays_walk() {
    for schedule in [Schedule::SPLASH, Schedule::SB_PRAM, Schedule::Wavefront] {
        let (setting, outcome) = solve(5, schedule, BF, |_, _| ());
        let nodes = setting.bsp.nodes();
        let mut pairs = vec![(0_u32, 0_u32)];
        let mut met = 0;
        while let Some((built, node)) = pairs.pop() {
            let [polygon, front, back, in_plane] = outcome.nodes[built as usize];
            met += 1;
            assert_eq!(setting.scene.polygons[polygon as usize].plane, nodes[node as usize].plane, "{schedule:?}");
            assert_eq!(in_plane, setting.bsp.fragments_of(node).count() as u64, "{schedule:?}");
            for (built, node) in [(front, nodes[node as usize].front), (back, nodes[node as usize].back)] {
                assert_eq!(built == 0, node == Bsp::NONE, "{schedule:?}");
                if built > 0 {
                    pairs.push((built as u32 - 1, node));
                }
            }
        }
        assert_eq!(met, nodes.len());
    }
}

/// D31. Catches lists that are sorted at no cost, or at one that counts: what keeps sums in one order is charged, and below 1 %
/// of the work.
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
    assert!(sorted > 0 && share < 0.01, "{share}");
}
