//! Polls that are computed against polls that are simulated one by one: the same run, to the byte.

#![allow(clippy::unwrap_used)]

use isolux_machine::protocols::{DistributedQueues, ParallelQueue, StealCounts, Termination};
use isolux_machine::{
    BarrierId, Condition, Home, LockId, Machine, Mark, Prefix, Processor, Region, Run, RunError, Sequence, Work,
    WorkClass,
};
use isolux_simulator::{
    Caches, MachineSpec, Memory, Polling, ProcessorOf, SimulatedProcessor, Simulator, SimulatorOf, Uniform,
};
use proptest::prelude::*;

const CELLS: u64 = 6;

/// One step of a random program.
#[derive(Clone, Copy, Debug)]
enum Step {
    Load(u64),
    Store(u64, u64),
    LoadBlock(u64),
    StoreBlock(u64, u64),
    Touch(u32),
    Prefix(u8, u64, u64),
    Charge(u64),
    Locked(u32, u64),
    Wait(u64, Condition),
    Scan(usize, bool, Condition),
    Barrier,
}

fn conditions() -> impl Strategy<Value = Condition> {
    prop_oneof![
        (0..4u64).prop_map(Condition::Equal),
        (0..4u64).prop_map(Condition::Differs),
        (1..4u64).prop_map(Condition::AtLeast),
        (1..4u64).prop_map(Condition::Below),
        Just(Condition::Positive),
    ]
}

fn a_step() -> impl Strategy<Value = Step> {
    prop_oneof![
        (0..CELLS).prop_map(Step::Load),
        (0..CELLS, 0..4u64).prop_map(|(c, v)| Step::Store(c, v)),
        (0..CELLS, 0..4u64).prop_map(|(c, v)| Step::Store(c, v)),
        (0..4u8, 0..CELLS, prop_oneof![0..4u64, Just(u64::MAX)]).prop_map(|(o, c, v)| Step::Prefix(o, c, v)),
        (0..CELLS - 2).prop_map(Step::LoadBlock),
        (0..CELLS - 2, 0..3u64).prop_map(|(c, v)| Step::StoreBlock(c, v)),
        (0..3u32).prop_map(Step::Touch),
        (0..40u64).prop_map(Step::Charge),
        (0..2u32, 0..10u64).prop_map(|(l, w)| Step::Locked(l, w)),
        (0..CELLS, conditions()).prop_map(|(c, n)| Step::Wait(c, n)),
        (0..5usize, any::<bool>(), conditions()).prop_map(|(o, a, n)| Step::Scan(o, a, n)),
        Just(Step::Barrier),
    ]
}

async fn act<P: Processor>(p: &P, cells: Region, step: Step) -> u64 {
    match step {
        Step::Load(c) => p.load(cells.at(c)).await,
        Step::Store(c, v) => {
            p.store(cells.at(c), v).await;
            0
        }
        Step::LoadBlock(c) => {
            let words = p.load_block::<3>(cells.at(c)).await;
            words.into_iter().fold(0, |sum: u64, word| sum.wrapping_mul(5).wrapping_add(word))
        }
        Step::StoreBlock(c, v) => {
            p.store_block(cells.at(c), [v, v + 1, v]).await;
            0
        }
        Step::Touch(record) => {
            p.touch(cells, 2, &[record, 0]).await;
            0
        }
        Step::Prefix(op, c, v) => {
            let op = [Prefix::Add, Prefix::Max, Prefix::And, Prefix::Or][usize::from(op)];
            p.prefix(op, cells.at(c), v).await
        }
        Step::Charge(n) => {
            p.charge(&Work::of(WorkClass(0), n)).await;
            0
        }
        Step::Locked(lock, n) => {
            p.lock(LockId(lock)).await;
            p.charge(&Work::of(WorkClass(0), n)).await;
            p.unlock(LockId(lock)).await;
            0
        }
        Step::Wait(c, condition) => p.wait_while(cells.at(c), condition).await,
        Step::Scan(own, apart, condition) => {
            let ring = Sequence::around(cells.at(0), 1, 5, own);
            let sequence = if apart { ring.and(cells.at(5)) } else { ring };
            p.scan(sequence, condition).await as u64
        }
        Step::Barrier => {
            p.barrier(BarrierId(0)).await;
            0
        }
    }
}

struct Outcome {
    run: Result<Run<Vec<u64>>, RunError>,
    trace: String,
    words: Vec<u64>,
    events: u64,
}

/// The same programs with each way of polling, on the machine of these figures.
fn both(programs: &[Vec<Step>], spec: &MachineSpec) -> [Outcome; 2] {
    [Polling::ClosedForm, Polling::EveryPoll].map(|polling| match spec.caches() {
        None => simulate::<Uniform>(programs, spec, polling),
        Some(_) => simulate::<Caches>(programs, spec, polling),
    })
}

fn simulate<M: Memory>(programs: &[Vec<Step>], spec: &MachineSpec, polling: Polling) -> Outcome {
    let mut machine = SimulatorOf::<M>::new(spec, programs.len(), &["step"]).unwrap().traced(true).polling(polling);
    let cells = machine.allocate("cells", CELLS, Home::RoundRobin).unwrap();
    machine.allocate_locks(2);
    machine.allocate_barriers(1);
    let run = machine.run(async |p: ProcessorOf<M>| {
        let mut seen = vec![];
        for &step in &programs[p.id()] {
            let before = p.enter(Mark::new(isolux_machine::Cause::Work, "step"));
            seen.push(act(&p, cells, step).await);
            p.enter(before);
        }
        seen
    });
    let trace = machine.take_trace().unwrap().to_text();
    let words = (0..CELLS).map(|c| machine.peek(cells.at(c))).collect();
    Outcome { run, trace, words, events: machine.events() }
}

fn specs() -> Vec<MachineSpec> {
    let mut specs: Vec<_> = ["ideal", "sb-pram", "dash"].map(|name| MachineSpec::named(name).unwrap()).into();
    specs.iter_mut().for_each(|s| s.add_work("[work]\nstep = 1", "test").unwrap());
    specs
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    /// Catches a poll too early, too late or uncounted, a wake-up lost or invented, a deadlock seen by one alone.
    #[test]
    fn computed_polls_are_the_simulated_ones(
        programs in prop::collection::vec(prop::collection::vec(a_step(), 0..14), 1..=16)
    ) {
        for spec in specs() {
            let [computed, simulated] = both(&programs, &spec);
            prop_assert_eq!(&computed.trace, &simulated.trace);
            prop_assert_eq!(&computed.words, &simulated.words);
            prop_assert_eq!(&computed.run, &simulated.run);
            prop_assert!(computed.events <= simulated.events);
        }
    }

    /// The same where all waits end: one processor sets every cell to every value, again and again, until the others
    /// are through.
    #[test]
    fn computed_polls_are_the_simulated_ones_to_the_end(
        programs in prop::collection::vec(prop::collection::vec(a_step(), 1..14), 1..=15),
        pace in 1..30u64,
    ) {
        let mut programs: Vec<Vec<Step>> = programs;
        for program in &mut programs {
            program.retain(|s| !matches!(s, Step::Barrier));
        }
        // A wait for a condition that 0, 1, 2 and 3 in turn make true and false; each value stays for a whole turn of a
        // scan.
        let turn = 6 * 5;
        let feed = |v: u64| (0..CELLS).map(move |c| Step::Store(c, v)).chain([Step::Charge(turn + pace)]);
        programs.push((0..4 * 15 * 14u64).flat_map(|i| feed(i % 4)).collect());
        for spec in specs() {
            let [computed, simulated] = both(&programs, &spec);
            prop_assert_eq!(&computed.trace, &simulated.trace);
            prop_assert_eq!(&computed.run, &simulated.run);
        }
    }
}

/// A tree of tasks of different lengths through a queue, and its trace.
macro_rules! queue_trace {
    ($polling:expr, $processors:expr, $queue:expr, $put:expr, $next:expr, $finish:expr) => {{
        let mut machine = Simulator::new(&specs()[1], $processors, &["step"]).unwrap().traced(true).polling($polling);
        let queue = $queue(&mut machine);
        let open = Termination::new(&mut machine, "open", 1).unwrap();
        let run = machine
            .run(async |p: SimulatedProcessor| {
                if p.id() == 0 {
                    assert!($put(&queue, &p, 0).await);
                }
                while let Some([task]) = $next(&queue, &p, &open).await {
                    let mut mine = vec![task];
                    while let Some(task) = mine.pop() {
                        p.charge(&Work::of(WorkClass(0), 20 + task * 7919 % 100)).await;
                        for child in 2 * task + 1..(2 * task + 3).min(400) {
                            open.add(&p, 1).await;
                            if !$put(&queue, &p, child).await {
                                mine.push(child);
                            }
                        }
                        $finish(&queue, &p, &open).await;
                    }
                }
            })
            .unwrap();
        (run, machine.take_trace().unwrap().to_text())
    }};
}

/// Catches thieves and dequeuers that find work at another time than those whose every poll is simulated.
#[test]
fn queues_run_the_same_with_computed_polls() {
    for processors in [1, 2, 7, 16, 100] {
        let [computed, simulated] = [Polling::ClosedForm, Polling::EveryPoll].map(|polling| {
            let distributed = queue_trace!(
                polling,
                processors,
                |m: &mut Simulator| DistributedQueues::<1>::new(m, "queues", 4).unwrap(),
                async |q: &DistributedQueues<1>, p: &SimulatedProcessor, t| q.push(p, p.id(), [t]).await.is_ok(),
                async |q: &DistributedQueues<1>, p: &SimulatedProcessor, open: &Termination| {
                    q.next(p, open, &mut StealCounts::default()).await
                },
                async |_: &DistributedQueues<1>, p: &SimulatedProcessor, open: &Termination| open.finish(p).await
            );
            let parallel = queue_trace!(
                polling,
                processors,
                |m: &mut Simulator| ParallelQueue::<1>::new(m, "queue", 16).unwrap(),
                async |q: &ParallelQueue<1>, p: &SimulatedProcessor, t| q.enqueue(p, [t]).await.is_ok(),
                async |q: &ParallelQueue<1>, p: &SimulatedProcessor, open: &Termination| q.next(p, open).await,
                async |q: &ParallelQueue<1>, p: &SimulatedProcessor, open: &Termination| q.finish(p, open).await
            );
            (distributed, parallel)
        });
        assert!(computed == simulated, "{processors} processors");
        let (distributed, parallel) = computed;
        for (run, trace) in [distributed, parallel] {
            assert_eq!(run.total_counts().work.counts()[0], (0..400).map(|t: u64| 20 + t * 7919 % 100).sum::<u64>());
            assert!(processors == 1 || trace.contains("idle"), "nobody waited, so nothing was compared");
        }
    }
}
