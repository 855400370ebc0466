//! The figures that simulated machines charge: they are those of the classes that programs name.

use isolux_machine::{Machine, Processor, Work, WorkClass};
use isolux_schedules::{CLASSES, COST_MODEL};
use isolux_simulator::{MachineSpec, Simulator};

/// The names and figures of the table, in its order.
fn figures() -> Vec<(&'static str, f64)> {
    let lines = COST_MODEL.lines().map(|line| line.split('#').next().unwrap_or_default());
    let entries = lines.filter_map(|line| line.split_once('='));
    entries.map(|(name, figure)| (name.trim(), figure.trim().parse().expect("a number"))).collect()
}

/// Catches a class without a figure, and a figure that nothing is charged by.
#[test]
fn classes_and_figures_are_the_same() {
    let mut named: Vec<&str> = figures().into_iter().map(|(name, _)| name).collect();
    let mut classes = CLASSES.to_vec();
    named.sort_unstable();
    classes.sort_unstable();
    assert_eq!(named, classes);
}

/// Catches a table that machines refuse, a figure of 0, and a class that is charged by another one's figure.
#[test]
fn machines_charge_by_the_figures() {
    for machine in MachineSpec::NAMES {
        let mut spec = MachineSpec::named(machine).expect("comes along");
        spec.add_work(COST_MODEL, "cost_model.toml").unwrap_or_else(|e| panic!("{machine}: {e}"));
    }
    let mut spec = MachineSpec::named("sb-pram").expect("comes along");
    spec.add_work(COST_MODEL, "cost_model.toml").expect("sound figures");
    let mut machine = Simulator::new(&spec, 1, &CLASSES).expect("a machine");
    for (name, figure) in figures() {
        let class = WorkClass(CLASSES.iter().position(|&class| class == name).expect("a class"));
        let run = machine.run(|p| async move { p.charge(&Work::of(class, 10)).await }).expect("runs");
        assert!(figure > 0.0, "{name}");
        assert_eq!(run.clock, (10.0 * figure).round() as u64, "{name}");
    }
}
