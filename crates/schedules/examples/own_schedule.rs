//! A schedule of one's own: unequal tasks go in, dealt out beforehand or drawn from a shared counter; speedups
//! on several machines come out, as a table. `docs/how-to/own-schedule.md` explains it.
//!
//! `cargo run --release -p isolux-schedules --example own_schedule`

use isolux_machine::protocols::{ParallelLoop, parallel_for};
use isolux_machine::{Home, Machine, Note, Processor, Region, Run, Sequential, Threads, Work, WorkClass};
use isolux_simulator::{CacheSimulator, MachineSpec, Simulator};
use std::error::Error;
use std::fmt::Write;
use std::path::Path;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Task `i` finds the smallest factor of this number + i.
const FIRST: u64 = 1_000_000;
const TASKS: u64 = 4096;

/// What the tasks' work is counted in, and what one of it costs on simulated machines: a round figure, for the example.
const CLASSES: [&str; 1] = ["division"];
const DIVISION: WorkClass = WorkClass(0);
const COSTS: &str = "[work]\ndivision = 12";

/// The smallest factor of a number, and how many divisions it took to find: one for even numbers, 500 for primes.
fn smallest_factor(number: u64) -> (u64, u64) {
    let candidates = std::iter::once(2).chain((3..).step_by(2)).take_while(|d| d * d <= number);
    let mut divisions = 0;
    for candidate in candidates {
        divisions += 1;
        if number.is_multiple_of(candidate) {
            return (candidate, divisions);
        }
    }
    (number, divisions)
}

/// Who gets which task.
#[derive(Clone, Copy)]
enum Sharing {
    /// Processor k of p: tasks k, k + p, k + 2p, ...
    Cyclic,
    /// So many at a time, first come, first served.
    Counter { chunk: u64 },
}

/// What all processors know: where the factors go, and the counter.
#[derive(Clone, Copy)]
struct Shared {
    factors: Region,
    indices: ParallelLoop,
}

/// The schedule: what each processor does. The same code on every machine.
async fn schedule<P: Processor>(p: P, shared: Shared, sharing: Sharing) {
    match sharing {
        Sharing::Cyclic => {
            p.note(Note::LoopBegin);
            for index in (p.id() as u64..TASKS).step_by(p.count()) {
                p.note(Note::LoopIndex);
                task(&p, shared.factors, index).await;
            }
            p.note(Note::LoopEnd);
        }
        Sharing::Counter { chunk } => {
            parallel_for(&p, &shared.indices, TASKS, chunk, async |index| {
                task(&p, shared.factors, index).await;
            })
            .await;
        }
    }
}

/// One task. Its work is done by the host, and charged; its result goes to a shared word.
async fn task<P: Processor>(p: &P, factors: Region, index: u64) {
    let (factor, divisions) = smallest_factor(FIRST + index);
    p.charge(&Work::of(DIVISION, divisions)).await;
    p.store(factors.at(index), factor).await;
}

/// Runs the schedule on a machine of any kind; gives the factors, and what the machine says of the run.
fn on<M: Machine>(mut machine: M, sharing: Sharing) -> Outcome<(Vec<u64>, Run<()>)> {
    let factors = machine.allocate("factors", TASKS, Home::RoundRobin)?;
    let indices = ParallelLoop::new(&mut machine, "counter")?;
    let shared = Shared { factors, indices };
    let run = machine.run(|p| schedule(p, shared, sharing))?;
    Ok(((0..TASKS).map(|index| machine.peek(factors.at(index))).collect(), run))
}

/// The same on a simulated machine, whose figures say of which kind it is.
fn on_simulated(spec: &MachineSpec, processors: usize, sharing: Sharing) -> Outcome<(Vec<u64>, Run<()>)> {
    if spec.caches().is_some() {
        on(CacheSimulator::new(spec, processors, &CLASSES)?, sharing)
    } else {
        on(Simulator::new(spec, processors, &CLASSES)?, sharing)
    }
}

const SHARINGS: [Sharing; 3] = [Sharing::Cyclic, Sharing::Counter { chunk: 1 }, Sharing::Counter { chunk: 8 }];

/// Speedups on simulated machines, each against the same machine with one processor and tasks dealt out beforehand. The
/// limit is the number of processors, or one processor's time by that of the longest chain of work: here, the longest
/// task. Every result is compared with the sequential one.
pub(crate) fn table() -> Outcome<String> {
    let (expected, _) = on(Sequential::new(&CLASSES)?, Sharing::Cyclic)?;
    let my_machine = Path::new(env!("CARGO_MANIFEST_DIR")).join("../simulator/examples/my_machine.toml");
    let specs = [
        (MachineSpec::named("ideal")?, vec![4, 16, 17, 256]),
        (MachineSpec::named("sb-pram")?, vec![4, 16, 17, 256]),
        (MachineSpec::open(&my_machine)?, vec![4, 16, 17, 256]),
        (MachineSpec::named("dash")?, vec![4, 16, 17, 64]),
    ];
    let mut table = format!("{:12}{:>6}{:>9}{:>9}{:>9}{:>9}\n", "machine", "p", "cyclic", "counter", "by 8", "limit");
    for (mut spec, sizes) in specs {
        spec.add_work(COSTS, "own_schedule.rs")?;
        let (_, alone) = on_simulated(&spec, 1, Sharing::Cyclic)?;
        for processors in sizes {
            write!(table, "{:12}{processors:>6}", spec.name())?;
            for sharing in SHARINGS {
                let (factors, run) = on_simulated(&spec, processors, sharing)?;
                assert_eq!(factors, expected, "{} with {processors}", spec.name());
                write!(table, "{:>9.1}", alone.clock as f64 / run.clock as f64)?;
            }
            writeln!(table, "{:>9.1}", (processors as f64).min(alone.clock as f64 / alone.span as f64))?;
        }
    }
    Ok(table)
}

/// Seconds on real threads, and whether the factors are those of one processor.
pub(crate) fn on_threads(processors: usize) -> Outcome<(f64, bool)> {
    let (expected, _) = on(Sequential::new(&CLASSES)?, Sharing::Cyclic)?;
    let (factors, run) = on(Threads::new(processors, &CLASSES)?, Sharing::Counter { chunk: 8 })?;
    Ok((run.clock as f64 / 1e9, factors == expected))
}

#[allow(clippy::print_stdout)]
fn main() -> Outcome<()> {
    print!("{}", table()?);
    for processors in [1, 2] {
        let (seconds, same) = on_threads(processors)?;
        println!(
            "threads, {processors}: {:.1} ms, factors {}",
            seconds * 1e3,
            if same { "the same" } else { "differ" }
        );
    }
    Ok(())
}
