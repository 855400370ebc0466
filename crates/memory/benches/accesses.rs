//! What an access costs the host: hits, a stream through memory, lines that wander between processors, and a mixture,
//! on DASH with 64 processors and on two sockets with 56.
//!
//! `cargo bench -p isolux-memory` reports accesses per second.

#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use isolux_memory::{Address, Home, Kind, Spec, System};
use std::hint::black_box;

const ACCESSES: usize = 1 << 16;
const BYTES: u64 = 64 << 20;

type Sequence = Vec<(usize, Address, Kind)>;

/// The same numbers in every run (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014).
struct Random(u64);

impl Random {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % bound
    }
}

fn kind(random: &mut Random) -> Kind {
    if random.below(4) == 0 { Kind::Write } else { Kind::Read }
}

/// Each processor works 64 accesses at a time in 8 KB of its own.
fn hits(processors: usize) -> Sequence {
    let mut random = Random(1);
    (0..ACCESSES)
        .map(|number| {
            let processor = number / 64 % processors;
            (processor, processor as u64 * 8192 + random.below(1024) * 8, kind(&mut random))
        })
        .collect()
}

/// All processors read on and on, each in a part of memory of its own.
fn stream(processors: usize, turn: u64) -> Sequence {
    let part = BYTES / processors as u64 / 4096 * 4096;
    (0..ACCESSES)
        .map(|number| {
            let step = turn * (ACCESSES / processors) as u64 + (number / processors) as u64;
            let processor = number % processors;
            (processor, processor as u64 * part + step * 64 % part, Kind::Read)
        })
        .collect()
}

/// Two processors of different clusters increment 16 counters in turn.
fn ping_pong(processors: usize) -> Sequence {
    (0..ACCESSES)
        .map(|number| ((number % 2) * (processors - 1), (number / 2 % 16) as u64 * 64, Kind::ReadModifyWrite))
        .collect()
}

/// 90 in 100 accesses in 8 KB of one's own, 9 read 8 MB that all share, 1 writes there.
fn mixture(processors: usize) -> Sequence {
    let mut random = Random(2);
    (0..ACCESSES)
        .map(|number| {
            let processor = number / 16 % processors;
            match random.below(100) {
                0..90 => (processor, processor as u64 * 8192 + random.below(1024) * 8, kind(&mut random)),
                90..99 => (processor, (1 << 20) + random.below(1 << 20) * 8, Kind::Read),
                _ => (processor, (1 << 20) + random.below(1 << 20) * 8, Kind::Write),
            }
        })
        .collect()
}

fn accesses(criterion: &mut Criterion) {
    for spec in [Spec::dash().unwrap(), Spec::two_socket().unwrap()] {
        let processors = spec.processors();
        let mut group = criterion.benchmark_group(spec.name());
        group.throughput(Throughput::Elements(ACCESSES as u64)).sample_size(20);
        let turns = BYTES / 64 / ACCESSES as u64;
        let streams: Vec<_> = (0..turns).map(|turn| stream(processors, turn)).collect();
        for (name, sequences) in [
            ("hits", vec![hits(processors)]),
            ("stream", streams),
            ("ping-pong", vec![ping_pong(processors)]),
            ("mixture", vec![mixture(processors)]),
        ] {
            let mut system = System::new(&spec, processors).unwrap();
            let region = system.region("all", Home::RoundRobin).unwrap();
            system.allocate(region, BYTES, 4096).unwrap();
            let mut next = 0;
            let mut run = || {
                next = (next + 1) % sequences.len();
                let mut clocks = 0_u64;
                for &(processor, address, kind) in &sequences[next] {
                    clocks += u64::from(system.access(processor, address, kind).unwrap().clocks);
                }
                clocks
            };
            // Cold misses and first touches of the host's memory come before the measurement.
            for _ in 0..sequences.len() {
                run();
            }
            group.bench_function(name, |bencher| bencher.iter(|| black_box(run())));
        }
        group.finish();
    }
}

criterion_group!(benches, accesses);
criterion_main!(benches);
