//! The contract, on the simulated machines.

#![allow(clippy::unwrap_used)]

use isolux_machine::contract_suite;
use isolux_simulator::{Polling, Simulator, Spec};

fn machine(mut spec: Spec, processors: usize) -> Simulator {
    spec.add_work("[work]\nstep = 1", "test").unwrap();
    Simulator::new(&spec, processors, &["step"]).unwrap()
}

contract_suite!(ideal, |p| machine(Spec::ideal(), p), [1, 2, 5, 64]);
contract_suite!(sb_pram, |p| machine(Spec::sb_pram(), p), [1, 2, 5, 64, 1000]);
contract_suite!(sb_pram_every_poll, |p| machine(Spec::sb_pram(), p).polling(Polling::EveryPoll), [1, 2, 7, 16]);
