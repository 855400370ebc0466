//! The contract, on the simulated machines.

#![allow(clippy::unwrap_used)]

use isolux_machine::contract_suite;
use isolux_simulator::{Caches, MachineSpec, Memory, Polling, SimulatorOf, Uniform};

fn machine<M: Memory>(name: &str, processors: usize) -> SimulatorOf<M> {
    let mut spec = MachineSpec::named(name).unwrap();
    spec.add_work("[work]\nstep = 1", "test").unwrap();
    SimulatorOf::new(&spec, processors, &["step"]).unwrap()
}

contract_suite!(ideal, |p| machine::<Uniform>("ideal", p), [1, 2, 5, 64]);
contract_suite!(sb_pram, |p| machine::<Uniform>("sb-pram", p), [1, 2, 5, 64, 1000]);
contract_suite!(sb_pram_every_poll, |p| machine::<Uniform>("sb-pram", p).polling(Polling::EveryPoll), [1, 2, 7, 16]);
contract_suite!(dash, |p| machine::<Caches>("dash", p), [1, 4, 5, 64]);
contract_suite!(dash_every_poll, |p| machine::<Caches>("dash", p).polling(Polling::EveryPoll), [1, 2, 9]);
contract_suite!(two_socket, |p| machine::<Caches>("two-socket", p), [1, 2, 56]);
