//! What an event costs: effects a second of simulated programs, those that issue at every unit and those that wait;
//! accesses a second of machines with caches; and what a run costs that does nothing.

#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use isolux_machine::protocols::{
    DistributedQueues, ParallelLoop, ParallelQueue, StealCounts, Termination, parallel_for,
};
use isolux_machine::{Cause, Home, Machine, Mark, Prefix, Processor};
use isolux_simulator::{CacheProcessor, CacheSimulator, MachineSpec, SimulatedProcessor, Simulator};

const TASKS: u64 = 20_000;

fn machine(processors: usize) -> Simulator {
    Simulator::new(&MachineSpec::named("sb-pram").expect("comes along"), processors, &[])
        .expect("no class of work needs a figure")
}

/// Every processor loads words of its own, one after the other.
fn loads(processors: usize) -> u64 {
    let mut machine = machine(processors);
    let words = machine.allocate("words", processors as u64, Home::RoundRobin).expect("fits");
    let turns = (1 << 18) / processors as u64;
    machine
        .run(async |p: SimulatedProcessor| {
            for _ in 0..turns {
                black_box(p.load(words.at(p.id() as u64)).await);
            }
        })
        .expect("sound");
    machine.events()
}

/// A loop whose indices each take a few multiprefixes.
fn indices(processors: usize) -> u64 {
    let mut machine = machine(processors);
    let cell = machine.allocate("cell", 1, Home::RoundRobin).expect("fits").at(0);
    let indices = ParallelLoop::new(&mut machine, "indices").expect("fits");
    machine
        .run(async |p: SimulatedProcessor| {
            parallel_for(&p, &indices, 1 << 17, 1, async |i| {
                p.prefix(Prefix::Max, cell, i).await;
            })
            .await;
        })
        .expect("sound");
    machine.events()
}

/// A binary tree of tasks through the processors' own queues.
fn distributed(processors: usize) -> u64 {
    let mut machine = machine(processors);
    let queues = DistributedQueues::<1>::new(&mut machine, "queues", 200).expect("fits");
    let open = Termination::new(&mut machine, "open", 1).expect("fits");
    machine
        .run(async |p: SimulatedProcessor| {
            if p.id() == 0 {
                queues.push(&p, 0, [0]).await.expect("empty");
            }
            let mut counts = StealCounts::default();
            while let Some([task]) = queues.next(&p, &open, &mut counts).await {
                let children = 2 * task + 1..(2 * task + 3).min(TASKS);
                open.add(&p, children.end.saturating_sub(children.start)).await;
                for child in children {
                    queues.push(&p, p.id(), [child]).await.expect("a depth-first search needs few entries");
                }
                open.finish(&p).await;
            }
        })
        .expect("sound");
    machine.events()
}

/// The same through the parallel queue.
fn parallel(processors: usize) -> u64 {
    let mut machine = machine(processors);
    let queue = ParallelQueue::<1>::new(&mut machine, "queue", 2 * TASKS).expect("fits");
    let open = Termination::new(&mut machine, "open", 1).expect("fits");
    machine
        .run(async |p: SimulatedProcessor| {
            if p.id() == 0 {
                queue.enqueue(&p, [0]).await.expect("empty");
            }
            while let Some([task]) = queue.next(&p, &open).await {
                let children = 2 * task + 1..(2 * task + 3).min(TASKS);
                open.add(&p, children.end.saturating_sub(children.start)).await;
                for child in children {
                    queue.enqueue(&p, [child]).await.expect("there are more slots than tasks");
                }
                queue.finish(&p, &open).await;
            }
        })
        .expect("sound");
    machine.events()
}

/// A program that does nothing: what the start and the end of a run cost.
fn nothing(machine: &mut Simulator) -> u64 {
    machine.run(async |p: SimulatedProcessor| p.enter(Mark::new(Cause::Work, "nothing"))).expect("sound").clock
}

fn empty_runs(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("empty run");
    for processors in [1024, 16_384] {
        let mut machine = machine(processors);
        machine.allocate("words", 1 << 20, Home::RoundRobin).expect("fits");
        machine.allocate_locks(processors as u32);
        group.bench_function(BenchmarkId::from_parameter(processors), |b| b.iter(|| nothing(&mut machine)));
    }
}

/// A machine with caches: words of their own, records that all read, a counter that wanders.
fn with_caches(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("caches");
    group.sample_size(10);
    for (name, processors) in [("dash", 1), ("dash", 64), ("two-socket", 56)] {
        let spec = MachineSpec::named(name).expect("comes along");
        let mut machine = CacheSimulator::new(&spec, processors, &[]).expect("no class of work needs a figure");
        let words = machine.allocate("words", 512 * processors as u64, Home::FirstTouch).expect("fits");
        let records = machine.allocate("records", 1 << 21, Home::RoundRobin).expect("fits");
        let cell = machine.allocate("cell", 1, Home::RoundRobin).expect("fits").at(0);
        let turns = (1 << 18) / processors as u64;
        let mut measure = |what: &str, accesses: u64, program: &mut dyn FnMut(&mut CacheSimulator)| {
            group.throughput(Throughput::Elements(accesses));
            let id = BenchmarkId::new(what, format!("{name} {processors}"));
            group.bench_function(id, |b| b.iter(|| program(&mut machine)));
        };
        measure("loads", turns * processors as u64, &mut |machine| {
            let run = machine.run(async |p: CacheProcessor| {
                for turn in 0..turns {
                    black_box(p.load(words.at(512 * p.id() as u64 + turn % 512)).await);
                }
            });
            run.expect("sound");
        });
        measure("prefixes", turns * processors as u64, &mut |machine| {
            let run = machine.run(async |p: CacheProcessor| {
                for _ in 0..turns {
                    black_box(p.prefix(Prefix::Add, cell, 1).await);
                }
            });
            run.expect("sound");
        });
        // Half of the records in a small part, which stays in the cache, the others all over 16 MB; 64 bytes each.
        let mix = |i: u64| (i * 2_654_435_761 % if i.is_multiple_of(2) { 1 << 10 } else { 1 << 18 }) as u32;
        let lines = spec.caches().map_or(1, |m| 64 / m.line_bytes());
        measure("touched lines", (1 << 17) * lines, &mut |machine| {
            let run = machine.run(async |p: CacheProcessor| {
                let (own, all) = (p.id() as u64, p.count() as u64);
                for turn in 0..(1 << 17) / 32 / all {
                    let list: [u32; 32] = std::array::from_fn(|i| mix((turn * all + own) * 32 + i as u64));
                    p.touch(records, 8, &list).await;
                }
            });
            run.expect("sound");
        });
    }
}

fn events(criterion: &mut Criterion) {
    type Program = fn(usize) -> u64;
    let programs: [(&str, Program); 4] =
        [("loads", loads), ("indices", indices), ("distributed queues", distributed), ("parallel queue", parallel)];
    for (name, program) in programs {
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        for processors in [1, 64, 1024, 16_384] {
            group.throughput(Throughput::Elements(program(processors)));
            group.bench_with_input(BenchmarkId::from_parameter(processors), &processors, |b, &p| b.iter(|| program(p)));
        }
    }
}

criterion_group!(benches, events, empty_runs, with_caches);
criterion_main!(benches);
