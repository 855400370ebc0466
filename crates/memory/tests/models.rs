//! Random sequences of accesses, answered by the system and by slow models made of sets and lists; the check after each
//! few.

#![allow(clippy::unwrap_used, reason = "tests")]

mod reference;

use isolux_memory::{Held, Home, Kind, Level, Listed, PAGE_BYTES, Spec, System};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use reference::{Finite, Infinite, Shape};

/// Clusters in use, processors in each, and how many of the last cluster's are left out.
#[derive(Clone, Copy, Debug)]
struct Machine {
    clusters: usize,
    per_cluster: usize,
    missing: usize,
    line_bytes: u64,
    word_bytes: u64,
    first: (u64, u64),
    second: Option<(u64, u64)>,
}

const PAGES: u64 = 4;

impl Machine {
    fn processors(&self) -> usize {
        self.clusters * self.per_cluster - self.missing
    }

    fn spec(&self) -> Spec {
        let section = |name: &str, (bytes, ways): (u64, u64)| format!("[{name}]\nbytes = {bytes}\nways = {ways}\n");
        let optional = |wanted: bool, line: &str| if wanted { line.to_owned() } else { String::new() };
        let text = format!(
            "name = 'random'\nclock_mhz = 1\nclusters = {}\nprocessors_per_cluster = {}\nline_bytes = {}\nword_bytes = {}\n\
             {}{}[latency]\nfirst_level = 1\nneighbour = 10\nlocal_memory = 20\n{}{}{}",
            self.clusters,
            self.per_cluster,
            self.line_bytes,
            self.word_bytes,
            section("first_level", self.first),
            self.second.map(|second| section("second_level", second)).unwrap_or_default(),
            optional(self.second.is_some(), "second_level = 3\n"),
            optional(self.clusters > 1, "remote_memory = 100\nremote_cache = 110\n"),
            optional(self.clusters > 2, "third_cluster = 200\n"),
        );
        Spec::parse("random.toml", &text).unwrap()
    }

    /// The system with a page of each kind of home, and what the models need to know of it.
    fn start(&self) -> (System, Shape) {
        let mut system = System::new(&self.spec(), self.processors()).unwrap();
        let last = self.clusters - 1;
        for (name, home, pages) in
            [("touch", Home::FirstTouch, 1), ("robin", Home::RoundRobin, 2), ("last", Home::Cluster(last), 1)]
        {
            let region = system.region(name, home).unwrap();
            system.allocate(region, pages * PAGE_BYTES, PAGE_BYTES).unwrap();
        }
        let homes = vec![None, Some(1 % self.clusters), Some(2 % self.clusters), Some(last)];
        let (per_cluster, line_bytes, word_bytes) = (self.per_cluster, self.line_bytes, self.word_bytes);
        (system, Shape { per_cluster, line_bytes, word_bytes, homes })
    }
}

fn machine() -> impl Strategy<Value = Machine> {
    let shape = prop_oneof![Just((1, 3)), Just((2, 2)), Just((4, 2)), Just((5, 4)), Just((3, 28))];
    let lines = prop_oneof![Just((16, 4)), Just((64, 8)), Just((32, 1))];
    // Lines of each cache: sets, ways, and by what the second level is larger.
    let caches = (0_u32..3, 0_u32..3, 0_u32..3, 0_u32..3, any::<bool>());
    (shape, 0_usize..2, lines, caches).prop_map(|((clusters, per_cluster), missing, (line, word), caches)| {
        let (sets, ways, more_sets, more_ways, two) = caches;
        let size = |sets: u32, ways: u32| ((line << sets) << ways, 1_u64 << ways);
        Machine {
            clusters,
            per_cluster,
            missing,
            line_bytes: line,
            word_bytes: word,
            first: size(sets, ways),
            second: two.then(|| size(sets + more_sets, ways + more_ways)),
        }
    })
}

/// (processor, page, line within few of the page, byte of the line, kind), each reduced to what the machine has.
type Draw = (usize, u64, u64, u64, u8);

fn draws() -> impl Strategy<Value = Vec<Draw>> {
    prop::collection::vec((any::<usize>(), 0..PAGES, 0_u64..9, any::<u64>(), 0_u8..8), 1..600)
}

/// Few processors are asked most, so that lines come back to who lost them.
fn access(machine: &Machine, (who, page, line, byte, kind): Draw) -> (usize, u64, Kind) {
    let some = if who % 4 == 0 { machine.processors() } else { machine.processors().min(7) };
    let processor = machine.processors() - 1 - (who / 4) % some;
    let kind = match kind {
        0..5 => Kind::Read,
        5 | 6 => Kind::Write,
        _ => Kind::ReadModifyWrite,
    };
    (processor, page * PAGE_BYTES + line * machine.line_bytes + byte % machine.line_bytes, kind)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    /// Would catch a wrong holder, owner, level or cause where nothing is ever replaced.
    #[test]
    fn caches_that_never_replace_agree_with_sets(machine in machine(), draws in draws()) {
        // One level with a set for each line of the address space.
        let machine = Machine { first: (PAGES * PAGE_BYTES, 1), second: None, ..machine };
        let (mut system, shape) = machine.start();
        let mut model = Infinite::new(shape);
        for (number, &draw) in draws.iter().enumerate() {
            let (processor, address, kind) = access(&machine, draw);
            let ours = system.access(processor, address, kind).unwrap();
            prop_assert_eq!((ours.level, ours.cause), model.access(processor, address, kind), "access {}", number);
            let line = address / machine.line_bytes;
            let (holders, dirty) = (model.holders(line), model.dirty(line));
            for processor in 0..machine.processors() {
                let expected = match (holders.contains(&processor), dirty) {
                    (false, _) => Held::Nothing,
                    (true, None) => Held::Shared,
                    (true, Some(_)) => Held::Dirty,
                };
                prop_assert_eq!(system.held(processor, address), expected);
            }
            // Nothing is dropped: the directory is exact.
            let clusters = holders.iter().fold(0, |bits, p| bits | 1 << (p / machine.per_cluster));
            let expected = dirty.map_or(Listed::Shared(clusters), |p| Listed::Dirty(p / machine.per_cluster));
            prop_assert_eq!(system.listed(address), expected);
            if number % 16 == 0 {
                prop_assert_eq!(system.check(), Ok(()));
            }
        }
        prop_assert_eq!(system.check(), Ok(()));
    }

    /// Would catch wrong replacement, inclusion, write-back or directory memory, with one level or two, and counts that
    /// are not those of the answers.
    #[test]
    fn caches_that_replace_agree_with_lists(machine in machine(), draws in draws()) {
        let (mut system, shape) = machine.start();
        let mut model = Finite::new(shape, machine.processors(), machine.first, machine.second);
        let (mut clocks, mut misses) = (0, 0);
        for (number, &draw) in draws.iter().enumerate() {
            let (processor, address, kind) = access(&machine, draw);
            let ours = system.access(processor, address, kind).unwrap();
            prop_assert_eq!((ours.level, ours.cause), model.access(processor, address, kind), "access {}", number);
            clocks += u64::from(ours.clocks);
            misses += u64::from(ours.cause.is_some());
            if number % 16 == 0 {
                prop_assert_eq!(system.check(), Ok(()));
            }
        }
        prop_assert_eq!(system.check(), Ok(()));
        for page in 0..PAGES {
            for line in 0..9 {
                let address = page * PAGE_BYTES + line * machine.line_bytes;
                let number = address / machine.line_bytes;
                for processor in 0..machine.processors() {
                    let held = system.held(processor, address);
                    prop_assert_eq!(held != Held::Nothing, model.has(processor, number));
                    prop_assert_eq!(held == Held::Dirty, model.dirty(number) == Some(processor));
                }
                let clusters = model.sharers(number).iter().fold(0, |bits, cluster| bits | 1 << cluster);
                let expected = match (model.dirty(number), clusters) {
                    (Some(owner), _) => Listed::Dirty(owner / machine.per_cluster),
                    (None, 0) => Listed::Uncached,
                    (None, clusters) => Listed::Shared(clusters),
                };
                prop_assert_eq!(system.listed(address), expected);
            }
        }
        let total = system.total();
        prop_assert_eq!((total.accesses(), total.misses()), (draws.len() as u64, misses));
        prop_assert_eq!((system.clocks(&total), total.writebacks, total.invalidations), (clocks, model.writebacks, model.invalidations));
        let by_region: u64 = system.regions().map(|(region, _)| system.region_counts(region).at(Level::First)).sum();
        prop_assert_eq!(by_region, total.at(Level::First));
    }
}
