//! Programs whose schedules are known beforehand: to the unit, they must take what the figures say.

#![allow(clippy::unwrap_used)]

use isolux_machine::protocols::{DistributedQueues, ParallelLoop, StealCounts, Termination, parallel_for};
use isolux_machine::{
    Address, Cause, Condition, Home, Machine, Mark, Prefix, Processor, Run, RunError, Sequence, Wait, Work, WorkClass,
};
use isolux_simulator::{MachineSpec, SimulatedProcessor, Simulator, SpecError};

const STEP: WorkClass = WorkClass(0);

fn machine(mut spec: MachineSpec, processors: usize) -> Simulator {
    spec.add_work("[work]\nstep = 1", "test").unwrap();
    Simulator::new(&spec, processors, &["step"]).unwrap().traced(true)
}

fn word(machine: &mut Simulator, name: &str) -> Address {
    machine.allocate(name, 1, Home::RoundRobin).unwrap().at(0)
}

async fn steps(p: &SimulatedProcessor, count: u64) {
    p.charge(&Work::of(STEP, count)).await;
}

fn lines(machine: &mut Simulator) -> Vec<String> {
    machine.take_trace().unwrap().to_text().lines().map(|l| l.replace('\t', " ")).collect()
}

/// What a parallel loop of unit steps takes: all claim in lockstep, chunk after chunk, and once more in vain.
fn loop_time(claim: u64, steps: u64, chunk: u64, processors: u64) -> u64 {
    let chunks = steps.div_ceil(chunk);
    let last = steps - (chunks.saturating_sub(1)) * chunk;
    let (rounds, rest) = (chunks / processors, chunks % processors);
    // Who has the most claims; where that is the one with the last chunk alone, that chunk may be short.
    let alone = rest == 1 || (processors == 1 && chunks > 0);
    let claims = rounds + u64::from(rest > 0);
    let full = claims * (claim + chunk) + claim;
    if alone { (full - (chunk - last)).max(rounds * (claim + chunk) * u64::from(rest > 0) + claim) } else { full }
}

/// Catches a unit too many or too few in multiprefix, charge or resumption, for any number of processors.
#[test]
fn a_parallel_loop_takes_its_closed_form() {
    for (spec, claim) in [(MachineSpec::named("ideal").unwrap(), 1), (MachineSpec::named("sb-pram").unwrap(), 2)] {
        for processors in [1, 2, 3, 16, 100] {
            for (n, chunk) in [(0, 1), (1, 1), (99, 1), (100, 1), (101, 1), (1000, 7), (1000, 10), (5, 8)] {
                let mut machine = machine(spec.clone(), processors);
                let indices = ParallelLoop::new(&mut machine, "indices").unwrap();
                let run = machine
                    .run(async |p: SimulatedProcessor| {
                        parallel_for(&p, &indices, n, chunk, async |_| steps(&p, 1).await).await;
                    })
                    .unwrap();
                let expected = loop_time(claim, n, chunk, processors as u64);
                assert_eq!(run.clock, expected, "{}: {n} steps, chunk {chunk}, {processors} processors", spec.name());
                assert_eq!(run.total_counts().work, Work::of(STEP, n));
            }
        }
    }
    // By hand: 10 steps, 4 processors, claim 2: three rounds of 3 for two of them, then 2 in vain.
    assert_eq!(loop_time(2, 10, 1, 4), 11);
}

/// Catches loads that see stores of their own time, and multiprefixes or stores in another order than the contract's.
#[test]
fn effects_of_one_time_are_in_order() {
    let mut machine = machine(MachineSpec::named("ideal").unwrap(), 6);
    let (a, b) = (word(&mut machine, "a"), word(&mut machine, "b"));
    machine.poke(a, 100);
    let run = machine
        .run(async |p: SimulatedProcessor| match p.id() {
            0 => {
                p.store(a, 7).await;
                p.load(a).await
            }
            1 => p.prefix(Prefix::Max, a, 500).await,
            2 => p.prefix(Prefix::Add, a, 10).await,
            3 => p.prefix(Prefix::Add, a, 1).await,
            4 => p.load(a).await,
            _ => {
                p.store(a, 8).await;
                p.load(b).await
            }
        })
        .unwrap();
    // Time 0: the load, then both additions, then the maximum, then both stores, the last one's stays. Time 1: loads.
    assert_eq!(run.values, [8, 111, 100, 110, 100, 0]);
    assert_eq!(run.clock, 2);
}

/// Catches locks that are not first come, first served, ties by number, and waits charged to the wrong cause.
#[test]
fn a_lock_serves_in_the_order_of_coming() {
    let mut machine = machine(MachineSpec::named("ideal").unwrap(), 4);
    let lock = machine.allocate_locks(1);
    let order = word(&mut machine, "order");
    let run = machine
        .run(async |p: SimulatedProcessor| {
            // Processor 2 comes at 0, 1 and 3 at 1, 0 at 2.
            steps(&p, [2, 1, 0, 1][p.id()]).await;
            p.lock(lock).await;
            let place = p.prefix(Prefix::Add, order, 1).await;
            steps(&p, 10).await;
            p.unlock(lock).await;
            place
        })
        .unwrap();
    assert_eq!(run.values, [3, 1, 0, 2]);
    // A turn: 1 to take, 1 for the place, 10 steps; the next one's begins as the unlock takes effect.
    assert_eq!(run.clock, 4 * 12 + 1);
    let waits: Vec<_> = run.time.iter().map(|t| t.get(Cause::LockWait)).collect();
    assert_eq!(waits, [36 - 2, 12 - 1, 0, 24 - 1]);
    assert_eq!(
        lines(&mut machine)[..5],
        [
            "0 0 2 work start",
            "0 2 36 lock wait start",
            "0 36 49 work start",
            "1 0 1 work start",
            "1 1 12 lock wait start"
        ]
    );
}

/// Catches a barrier that costs other than its formula after the last arrival.
#[test]
fn a_barrier_ends_for_all_at_once() {
    let figures = "name='b'\nprocessors_max=9\n[operation]\nload=1\nstore=1\nprefix=1\n[wait]\nspin=1\nscan=1\n\
        [lock]\ntake=1\ngive=1\n[barrier]\nbase=5\nper_processor=2\nper_level=100\n[work]\nstep=0.5";
    let spec = MachineSpec::from_toml(figures, "b.toml").unwrap();
    let mut machine = Simulator::new(&spec, 3, &["step"]).unwrap();
    let barrier = machine.allocate_barriers(1);
    let run = machine
        .run(async |p: SimulatedProcessor| {
            steps(&p, 10 * p.id() as u64 + 1).await;
            p.barrier(barrier).await;
        })
        .unwrap();
    // Half units are rounded up: the last comes at 11. Then 5 + 3 x 2 + 2 x 100.
    assert_eq!(run.clock, 11 + 211);
    assert_eq!(run.time.iter().map(|t| t.get(Cause::BarrierWait)).collect::<Vec<_>>(), [221, 216, 211]);
}

/// Catches a spin that ends at another poll than the first that can see the store.
#[test]
fn a_spin_ends_at_the_first_poll_that_sees() {
    for at in 1..20 {
        let mut machine = machine(MachineSpec::named("sb-pram").unwrap(), 2);
        let flag = word(&mut machine, "flag");
        let run = machine
            .run(async |p: SimulatedProcessor| {
                if p.id() == 0 {
                    steps(&p, at).await;
                    p.store(flag, 1).await;
                } else {
                    p.wait_while(flag, Condition::Equal(0)).await;
                }
            })
            .unwrap();
        // Polls at 0, 3, 6, ...; one at the time of the store comes before it.
        let polls = at / 3 + 2;
        assert_eq!(run.counts[1].polls, polls, "a store at {at}");
        assert_eq!(run.time[1].get(Cause::Idle), 3 * polls);
        assert_eq!(run.clock, 3 * polls);
    }
}

/// Catches a scan that polls in another order, or skips a poll.
#[test]
fn a_scan_ends_at_the_first_poll_that_sees() {
    // Four cells around cell 1: 1, 2, 0, 3; then the one apart: five polls of 5 units to a turn.
    for (cell, position) in [(0, 2), (1, 0), (2, 1), (3, 3), (4, 4)] {
        let mut machine = machine(MachineSpec::named("sb-pram").unwrap(), 2);
        let ring = machine.allocate("ring", 8, Home::RoundRobin).unwrap();
        let apart = word(&mut machine, "apart");
        let run = machine
            .run(async |p: SimulatedProcessor| {
                if p.id() == 0 {
                    steps(&p, 26).await;
                    p.store(if cell < 4 { ring.at(2 * cell) } else { apart }, 1).await;
                    0
                } else {
                    p.scan(Sequence::around(ring.at(0), 2, 4, 1).and(apart), Condition::Positive).await
                }
            })
            .unwrap();
        // The store takes effect at 26: after the poll at 25, which is the first of the second turn.
        let polls = if position == 0 { 10 } else { 5 + position as u64 } + 1;
        assert_eq!((run.values[1], run.counts[1].polls, run.clock), (position, polls, 5 * polls), "cell {cell}");
    }
}

/// A fork and a join on the ideal machine: a chain of 3 steps, 2 branches of 5 and 7, and 2 steps behind both.
#[test]
fn a_small_graph_of_tasks_meets_its_schedule() {
    let mut machine = machine(MachineSpec::named("ideal").unwrap(), 2);
    let (forked, joined) = (word(&mut machine, "forked"), word(&mut machine, "joined"));
    let run = machine
        .run(async |p: SimulatedProcessor| {
            if p.id() == 0 {
                p.enter(Mark::new(Cause::Work, "head"));
                steps(&p, 3).await;
                p.store(forked, 1).await;
                p.enter(Mark::new(Cause::Work, "left"));
                steps(&p, 5).await;
                p.wait_while(joined, Condition::Equal(0)).await;
                p.enter(Mark::new(Cause::Work, "tail"));
                steps(&p, 2).await;
            } else {
                p.wait_while(forked, Condition::Equal(0)).await;
                p.enter(Mark::new(Cause::Work, "right"));
                steps(&p, 7).await;
                p.store(joined, 1).await;
            }
        })
        .unwrap();
    // The store at 3 is seen by the poll at 4, which ends at 5; the one at 12 by that at 13, which ends at 14.
    assert_eq!(run.clock, 16);
    assert_eq!(
        lines(&mut machine),
        [
            "0 0 4 work head",
            "0 4 9 work left",
            "0 9 14 idle left",
            "0 14 16 work tail",
            "1 0 5 idle start",
            "1 5 13 work right",
            "1 13 16 idle ended",
        ]
    );
}

/// Catches thieves that take the wrong end, and a walk that does not cost a load per entry.
#[test]
fn a_thief_takes_the_oldest_and_pays_for_the_walk() {
    for length in 1..=6 {
        let mut machine = machine(MachineSpec::named("ideal").unwrap(), 2);
        let queues = DistributedQueues::<1>::new(&mut machine, "queues", 6).unwrap();
        let barrier = machine.allocate_barriers(1);
        let run = machine
            .run(async |p: SimulatedProcessor| {
                if p.id() == 0 {
                    for task in 0..length {
                        queues.push(&p, 0, [10 + task]).await.unwrap();
                    }
                    assert!(length < 6 || queues.push(&p, 0, [1]).await.is_err());
                }
                p.barrier(barrier).await;
                if p.id() == 1 { queues.steal(&p, 0, &mut StealCounts::default()).await } else { None }
            })
            .unwrap();
        assert_eq!(run.values[1], Some([10]));
        // Length, top, one load per entry, the task's word, free, length; the last, too, has an entry below to be
        // looked for.
        assert_eq!(run.counts[1].loads, 2 + length + 3);
        // And to take and give the lock, and stores: above, the tail if one is left, free, its chain, length.
        assert_eq!(run.time[1].get(Cause::Steal), 2 + length + 3 + 2 + 4 + u64::from(length > 1));
    }
}

/// Catches waits that never end being simulated for ever.
#[test]
fn deadlocks_are_told() {
    let mut machine = machine(MachineSpec::named("sb-pram").unwrap(), 3);
    let locks = machine.allocate_locks(2);
    let other = isolux_machine::LockId(locks.0 + 1);
    let flag = word(&mut machine, "flag");
    let crossed = machine.run(async |p: SimulatedProcessor| match p.id() {
        0 => {}
        id => {
            let (first, second) = if id == 1 { (locks, other) } else { (other, locks) };
            p.lock(first).await;
            p.lock(second).await;
        }
    });
    assert_eq!(crossed.err(), Some(RunError::Deadlock { processor: 1, wait: Wait::Lock(other) }));
    let unset = machine.run(async |p: SimulatedProcessor| {
        if p.id() == 2 {
            p.wait_while(flag, Condition::Equal(0)).await;
        }
    });
    assert_eq!(unset.err(), Some(RunError::Deadlock { processor: 2, wait: Wait::Word(flag) }));
}

/// Catches a machine larger than its file allows, and a class of work without a figure.
#[test]
fn impossible_machines_are_refused_by_file_and_key() {
    let told = |e: Result<Simulator, SpecError>| e.err().unwrap().to_string();
    let spec = MachineSpec::named("sb-pram").unwrap();
    assert_eq!(told(Simulator::new(&spec, 1, &["ray"])), "sb_pram/spec.toml: work.ray is missing");
    assert_eq!(
        told(Simulator::new(&spec, 16_385, &[])),
        "sb_pram/spec.toml: 16385 processors; the machine has 1 to 16384"
    );
}

fn tasks(processors: usize) -> (Run<u64>, Simulator, usize) {
    fn size<F: Fn(SimulatedProcessor) -> R, R>(_: &F) -> usize {
        size_of::<R>()
    }
    let mut machine = machine(MachineSpec::named("sb-pram").unwrap(), processors);
    let queues = DistributedQueues::<2>::new(&mut machine, "queues", 8).unwrap();
    let tasks = 20_000;
    let open = Termination::new(&mut machine, "open", 1).unwrap();
    let program = async |p: SimulatedProcessor| {
        if p.id() == 0 {
            queues.push(&p, 0, [0, 0]).await.unwrap();
        }
        let mut ran = 0;
        let mut counts = StealCounts::default();
        while let Some([task, _]) = queues.next(&p, &open, &mut counts).await {
            let mut mine = vec![task];
            while let Some(task) = mine.pop() {
                ran += 1;
                steps(&p, 500 + task * 7919 % 1000).await;
                for child in 2 * task + 1..(2 * task + 3).min(tasks) {
                    open.add(&p, 1).await;
                    if queues.push(&p, p.id(), [child, 0]).await.is_err() {
                        mine.push(child);
                    }
                }
                open.finish(&p).await;
            }
        }
        ran
    };
    let bytes = size(&program) + Simulator::PARKED_BYTES;
    let run = machine.run(program).unwrap();
    assert_eq!(run.values.iter().sum::<u64>(), tasks);
    (run, machine, bytes)
}

/// Catches state of a waiting processor that grows with their number, and a machine of 16,384 that takes minutes.
#[test]
fn the_largest_machine_runs_and_its_waiting_processors_are_small() {
    let (run, machine, bytes) = tasks(16_384);
    assert!(bytes <= 4096, "{bytes} bytes");
    assert!(run.clock > 0 && machine.events() > 20_000);
    assert_eq!(run.total_time().total(), 16_384 * run.clock);
}

/// Catches anything that varies from run to run.
#[test]
fn the_same_inputs_give_the_same_trace() {
    let traces: Vec<_> = (0..2).map(|_| tasks(100).1.take_trace().unwrap().to_text()).collect();
    assert!(traces[0].lines().count() > 1000);
    assert!(traces[0] == traces[1], "two runs of one program differ");
}

/// Catches a run that cannot be stopped: one processor that never waits, and many that do.
#[test]
fn a_run_can_be_stopped() {
    for p in [1, 20] {
        let stop = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
        let spec = MachineSpec::named("sb-pram").expect("comes along");
        let mut machine = self::machine(spec, p).stopped_by(stop);
        let word = machine.allocate("word", 1, Home::RoundRobin).expect("fits").at(0);
        let program = async |p: SimulatedProcessor| {
            loop {
                p.prefix(Prefix::Add, word, 1).await;
            }
        };
        let error: Result<Run<()>, RunError> = machine.run(program);
        assert_eq!(error.expect_err("never ends"), RunError::Stopped);
    }
}
