//! The contract, on the machines of this crate.

#![allow(clippy::unwrap_used)]

use isolux_machine::{ClassError, Condition, Machine, Processor, RunError, Sequential, Threads, Wait, contract_suite};

contract_suite!(sequential, |_| Sequential::new(&["step"]).unwrap(), [1]);
contract_suite!(threads, |processors| Threads::new(processors, &["step"]).unwrap(), [1, 2, 4, 9]);

/// Catches a sequential machine that spins for ever where nobody is left to end the wait.
#[test]
fn one_processor_alone_waits_for_nothing() {
    let mut machine = Sequential::new(&[]).unwrap();
    let cell = machine.allocate("cell", 1, isolux_machine::Home::RoundRobin).unwrap().at(0);
    let run = machine.run(async |p: isolux_machine::SequentialProcessor| p.wait_while(cell, Condition::Equal(0)).await);
    assert_eq!(run.err(), Some(RunError::Deadlock { processor: 0, wait: Wait::Word(cell) }));
}

/// Catches machines of impossible sizes, and work classes that cannot be told apart.
#[test]
fn impossible_machines_are_refused() {
    let processors = |asked| ClassError::Processors { asked, max: 1024 };
    assert_eq!(Threads::new(0, &[]).err(), Some(processors(0)));
    assert_eq!(Threads::new(1025, &[]).err(), Some(processors(1025)));
    assert_eq!(Sequential::new(&["x"; 17]).err(), Some(ClassError::TooMany { asked: 17 }));
    assert_eq!(Sequential::new(&["x", "y", "x"]).err(), Some(ClassError::Duplicate { name: "x".to_owned() }));
}
