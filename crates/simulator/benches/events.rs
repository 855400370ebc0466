//! What an event costs: effects a second of simulated programs, those that issue at every unit and those that wait.

#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use isolux_machine::protocols::{
    DistributedQueues, ParallelLoop, ParallelQueue, StealCounts, Termination, parallel_for,
};
use isolux_machine::{Home, Machine, Prefix, Processor};
use isolux_simulator::{MachineSpec, SimulatedProcessor, Simulator};

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

criterion_group!(benches, events);
criterion_main!(benches);
