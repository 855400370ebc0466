//! Costs and states computed by hand from the tables of `crates/memory/README.md`, on DASH and on small machines.

#![allow(clippy::unwrap_used, reason = "tests")]

use Kind::{Read, ReadModifyWrite, Write};
use isolux_memory::{
    AccessError, Address, Cause, Counts, Held, Home, Kind, Level, Listed, MachineError, Region, Spec, System,
};

/// DASH, whose processors 0 to 3 are cluster 0, 4 to 7 cluster 1 and so on, with one page at home in cluster 0.
fn dash(processors: usize) -> (System, Region, Address) {
    let mut system = System::new(&Spec::dash().unwrap(), processors).unwrap();
    let region = system.region("page", Home::Cluster(0)).unwrap();
    let address = system.allocate(region, 4096, 4096).unwrap();
    (system, region, address)
}

/// A machine of clusters of two, lines of four words of 4 bytes, with levels whose costs tell them apart.
fn small(caches: &str) -> Spec {
    let second = if caches.contains("second_level") { "second_level = 3" } else { "" };
    let text = format!(
        "name = 'small'\nclock_mhz = 1\nclusters = 4\nprocessors_per_cluster = 2\nline_bytes = 16\nword_bytes = 4\n{caches}\n\
         [latency]\nfirst_level = 1\n{second}\nneighbour = 10\nlocal_memory = 20\nremote_memory = 100\nremote_cache = 110\n\
         third_cluster = 200\n"
    );
    Spec::parse("small.toml", &text).unwrap()
}

fn ask(system: &mut System, processor: usize, address: Address, kind: Kind) -> (Level, u32) {
    let access = system.access(processor, address, kind).unwrap();
    system.check().unwrap();
    (access.level, access.clocks)
}

/// Would catch a miss that costs as another level, and a hit that is none.
#[test]
fn first_reads_cost_the_distance_of_their_home() {
    let (mut system, region, address) = dash(8);
    assert_eq!(ask(&mut system, 0, address, Read), (Level::LocalMemory, 30));
    assert_eq!(ask(&mut system, 0, address + 12, Read), (Level::First, 1));
    assert_eq!(ask(&mut system, 4, address, Read), (Level::RemoteMemory, 100));
    // The neighbour of either finds it on the bus.
    assert_eq!(ask(&mut system, 1, address, Read), (Level::Neighbour, 30));
    assert_eq!(ask(&mut system, 5, address, Read), (Level::Neighbour, 30));
    assert_eq!(system.listed(address), Listed::Shared(0b11));
    let counts = system.region_counts(region);
    assert_eq!((counts.missed(Cause::Cold), counts.misses(), counts.accesses()), (4, 4, 5));
    assert_eq!(system.clocks(&counts), 30 + 1 + 100 + 30 + 30);
}

/// Would catch an owner that is not told, a cost that forgets the third cluster, and a sharing miss taken for another.
#[test]
fn producer_and_consumer_pay_for_every_turn() {
    // Producer in cluster 1, consumer in cluster 2, home in cluster 0.
    let (mut system, region, address) = dash(12);
    let (producer, consumer) = (4, 8);
    assert_eq!(ask(&mut system, producer, address, Write), (Level::RemoteMemory, 100));
    assert_eq!(ask(&mut system, consumer, address, Read), (Level::ThirdCluster, 135));
    for _ in 0..10 {
        // The producer holds it shared and has to have the consumer's copy, in a third cluster, made invalid.
        assert_eq!(ask(&mut system, producer, address, Write), (Level::ThirdCluster, 135));
        assert_eq!(system.listed(address), Listed::Dirty(1));
        assert_eq!(ask(&mut system, producer, address, Write), (Level::First, 1));
        assert_eq!(ask(&mut system, consumer, address, Read), (Level::ThirdCluster, 135));
        assert_eq!(ask(&mut system, consumer, address, Read), (Level::First, 1));
    }
    let (made, used) = (system.counts(region, producer), system.counts(region, consumer));
    assert_eq!((made.upgrades, made.invalidations, made.writebacks, made.missed(Cause::Cold)), (10, 10, 11, 1));
    assert_eq!(
        (used.missed(Cause::Cold), used.missed(Cause::TrueSharing), used.missed(Cause::FalseSharing)),
        (1, 10, 0)
    );
    assert_eq!(system.clocks(&system.total()), 100 + 135 + 10 * (135 + 1 + 135 + 1));
}

/// Would catch a counter that ping-pongs for free, and read-modify-writes that are counted as something else.
#[test]
fn counter_wanders_from_cluster_to_cluster() {
    let (mut system, region, address) = dash(12);
    assert_eq!(ask(&mut system, 0, address, ReadModifyWrite), (Level::LocalMemory, 30));
    assert_eq!(ask(&mut system, 0, address, ReadModifyWrite), (Level::First, 1));
    assert_eq!(ask(&mut system, 4, address, ReadModifyWrite), (Level::RemoteCache, 100)); // owner at home
    assert_eq!(ask(&mut system, 8, address, ReadModifyWrite), (Level::ThirdCluster, 135));
    assert_eq!(ask(&mut system, 0, address, ReadModifyWrite), (Level::RemoteCache, 100)); // asker at home
    assert_eq!(ask(&mut system, 3, address, ReadModifyWrite), (Level::Neighbour, 30));
    let total = system.region_counts(region);
    assert_eq!((total.at(Level::RemoteCache), total.served(ReadModifyWrite, Level::RemoteCache)), (2, 2));
    assert_eq!((total.missed(Cause::Cold), total.missed(Cause::TrueSharing), total.writebacks), (4, 1, 0));
}

/// Would catch invalidations that are forgotten, or paid one by one.
#[test]
fn many_readers_cost_the_writer_one_journey() {
    let (mut system, region, address) = dash(64);
    let mut clocks = 0;
    for processor in 0..64 {
        clocks += ask(&mut system, processor, address, Read).1;
    }
    // Cluster 0: memory, then three neighbours; 15 others: home, then three neighbours.
    assert_eq!(clocks, 64 / 4 * 3 * 30 + 30 + 15 * 100);
    assert_eq!(system.listed(address), Listed::Shared(0xffff));
    // At home, all sharers are two hops away, however many.
    assert_eq!(ask(&mut system, 2, address, Write), (Level::RemoteCache, 100));
    assert_eq!(system.listed(address), Listed::Dirty(0));
    assert!((0..64).all(|p| system.held(p, address) == if p == 2 { Held::Dirty } else { Held::Nothing }));
    let counts = system.counts(region, 2);
    assert_eq!((counts.invalidations, counts.upgrades, counts.misses()), (63, 1, 1));
}

/// D25. Would catch an upgrade that is free, a miss, or costs the wrong distance: all five ways to obtain ownership.
#[test]
fn ownership_costs_the_furthest_answer() {
    let far = |readers: &[usize], writer: usize| {
        let (mut system, region, address) = dash(12);
        for &reader in readers {
            ask(&mut system, reader, address, Read);
        }
        let answer = ask(&mut system, writer, address, Write);
        assert_eq!(system.counts(region, writer).upgrades, readers.contains(&writer) as u64);
        answer
    };
    assert_eq!(far(&[0], 0), (Level::Neighbour, 30)); // own bus: home is here, nobody else has it
    assert_eq!(far(&[0, 1], 0), (Level::Neighbour, 30));
    assert_eq!(far(&[1], 0), (Level::Neighbour, 30)); // the neighbour has the data
    assert_eq!(far(&[], 0), (Level::LocalMemory, 30));
    assert_eq!(far(&[0, 4], 0), (Level::RemoteCache, 100)); // home here, a sharer there
    assert_eq!(far(&[4], 4), (Level::RemoteMemory, 100)); // home must know
    assert_eq!(far(&[4, 5], 4), (Level::RemoteMemory, 100));
    assert_eq!(far(&[4, 0], 4), (Level::RemoteMemory, 100)); // sharers at home are on home's bus
    assert_eq!(far(&[4, 8], 4), (Level::ThirdCluster, 135));
    assert_eq!(far(&[8], 4), (Level::ThirdCluster, 135));
}

/// Would catch a dirty line that is lost when replaced, and a directory that still believes in its owner.
#[test]
fn dirty_line_is_written_back_when_it_makes_room() {
    // One set of one line for each 16 bytes of 64: lines 64 bytes apart are rivals.
    let mut system = System::new(&small("first_level = { bytes = 64, ways = 1 }"), 8).unwrap();
    let region = system.region("page", Home::Cluster(0)).unwrap();
    let line = system.allocate(region, 4096, 4096).unwrap();
    assert_eq!(ask(&mut system, 2, line, Write), (Level::RemoteMemory, 100));
    assert_eq!(system.listed(line), Listed::Dirty(1));
    assert_eq!(ask(&mut system, 2, line + 64, Read), (Level::RemoteMemory, 100));
    assert_eq!((system.held(2, line), system.listed(line)), (Held::Nothing, Listed::Uncached));
    assert_eq!(system.counts(region, 2).writebacks, 1);
    // Memory has it: a third cluster is not asked.
    assert_eq!(ask(&mut system, 4, line, Read), (Level::RemoteMemory, 100));
    // The one that lost it to its own reading finds it by replacement, not sharing.
    let again = system.access(2, line, Read).unwrap();
    assert_eq!((again.level, again.cause), (Level::RemoteMemory, Some(Cause::Replacement)));
    // A clean line goes silently: the directory keeps cluster 1, and the writer at home pays for it.
    assert_eq!(ask(&mut system, 2, line + 64, Read), (Level::RemoteMemory, 100));
    assert_eq!(ask(&mut system, 4, line + 64, Read), (Level::RemoteMemory, 100));
    assert_eq!((system.listed(line), system.counts(region, 2).writebacks), (Listed::Shared(0b110), 1));
    assert_eq!(ask(&mut system, 0, line, Write), (Level::RemoteCache, 110));
    assert_eq!(system.counts(region, 0).invalidations, 0);
}

/// D26. Would catch traffic that leaves the cluster although a neighbour has the line, and a line that stays dirty
/// then.
#[test]
fn neighbours_share_without_leaving_the_cluster() {
    let (mut system, region, address) = dash(8);
    ask(&mut system, 4, address, Write);
    // Written by one neighbour after the other: the directory sees none of it.
    for turn in 0..6 {
        assert_eq!(ask(&mut system, 5 + turn % 2, address, Write), (Level::Neighbour, 30));
        assert_eq!(system.listed(address), Listed::Dirty(1));
    }
    // Read by a neighbour: written back, shared, and ownership is at home again.
    assert_eq!(ask(&mut system, 7, address, Read), (Level::Neighbour, 30));
    assert_eq!(system.listed(address), Listed::Shared(0b10));
    assert_eq!(ask(&mut system, 7, address, Write), (Level::RemoteMemory, 100));
    let total = system.region_counts(region);
    assert_eq!((total.at(Level::Neighbour), total.at(Level::RemoteMemory), total.writebacks), (7, 2, 1));
}

/// Would catch true and false sharing mixed up.
#[test]
fn sharing_is_judged_by_the_word() {
    let cause = |word: u64, writes: &[u64]| {
        let (mut system, _, address) = dash(12);
        ask(&mut system, 0, address, Read);
        for &written in writes {
            ask(&mut system, 4, address + 4 * written, Write);
        }
        system.access(0, address + 4 * word, Read).unwrap().cause.unwrap()
    };
    assert_eq!(cause(1, &[1]), Cause::TrueSharing);
    assert_eq!(cause(2, &[1]), Cause::FalseSharing);
    // A word written later, as a hit of the owner, counts too.
    assert_eq!(cause(2, &[1, 2]), Cause::TrueSharing);

    // What was written before the loss is known, and what other owners wrote after it is not.
    let (mut system, _, address) = dash(12);
    ask(&mut system, 4, address, Write);
    ask(&mut system, 0, address, Read);
    ask(&mut system, 4, address + 4, Write);
    ask(&mut system, 8, address + 8, Write);
    let mut other = system.clone();
    assert_eq!(system.access(0, address, Read).unwrap().cause, Some(Cause::FalseSharing));
    assert_eq!(other.access(0, address + 8, Read).unwrap().cause, Some(Cause::TrueSharing));
}

/// Would catch homes by the wrong rule, or by the second to come.
#[test]
fn homes_follow_their_rule() {
    let mut system = System::new(&Spec::dash().unwrap(), 16).unwrap();
    let robin = system.region("round robin", Home::RoundRobin).unwrap();
    let touch = system.region("first touch", Home::FirstTouch).unwrap();
    let spread = system.allocate(robin, 6 * 4096, 4096).unwrap();
    let touched = system.allocate(touch, 3 * 4096, 4096).unwrap();
    let homes = |system: &System, start: Address, pages: u64| -> Vec<_> {
        (0..pages).map(|page| system.home(start + page * 4096)).collect()
    };
    assert_eq!(homes(&system, spread, 6), [0, 1, 2, 3, 0, 1].map(Some));
    assert_eq!(homes(&system, touched, 3), [None; 3]);
    // Each page goes to its first reader or writer, and stays.
    assert_eq!(ask(&mut system, 9, touched, Read), (Level::LocalMemory, 30));
    assert_eq!(ask(&mut system, 13, touched + 2 * 4096 + 8, Write), (Level::LocalMemory, 30));
    assert_eq!(ask(&mut system, 0, touched + 16, Write), (Level::RemoteMemory, 100));
    assert_eq!(homes(&system, touched, 3), [Some(2), None, Some(3)]);
    // The same sweep by processor 9 costs more where three pages of four are elsewhere.
    let sweep = |system: &mut System, start| -> u32 {
        (0..3 * 4096 / 16).map(|line| system.access(9, start + line * 16, Read).unwrap().clocks).sum()
    };
    let mut fresh = System::new(&Spec::dash().unwrap(), 16).unwrap();
    let own = fresh.region("own", Home::FirstTouch).unwrap();
    let own = fresh.allocate(own, 3 * 4096, 1).unwrap();
    assert_eq!(sweep(&mut fresh, own), 3 * 256 * 30);
    assert_eq!(sweep(&mut system, spread), 2 * 256 * 100 + 256 * 30); // pages at home in clusters 0, 1 and 2
    assert_eq!(system.region_counts(robin).at(Level::RemoteMemory), 512);
}

/// Would catch a first level that answers for lines the second has lost, and levels that cost as each other.
#[test]
fn two_levels_include_each_other() {
    // First level 2 sets of 1, second 4 sets of 1: lines 64 bytes apart are rivals in both, 32 bytes apart in the
    // first.
    let spec = small("first_level = { bytes = 32, ways = 1 }\nsecond_level = { bytes = 64, ways = 1 }");
    let mut system = System::new(&spec, 2).unwrap();
    let region = system.region("page", Home::Cluster(0)).unwrap();
    let line = system.allocate(region, 4096, 4096).unwrap();
    assert_eq!(ask(&mut system, 0, line, Read), (Level::LocalMemory, 20));
    assert_eq!(ask(&mut system, 0, line, Read), (Level::First, 1));
    assert_eq!(ask(&mut system, 0, line + 32, Read), (Level::LocalMemory, 20));
    assert_eq!(ask(&mut system, 0, line, Read), (Level::Second, 3));
    assert_eq!(ask(&mut system, 0, line, Write), (Level::Neighbour, 10));
    assert_eq!(ask(&mut system, 0, line + 32, Read), (Level::Second, 3));
    assert_eq!(ask(&mut system, 0, line, Write), (Level::Second, 3)); // dirty below
    assert_eq!(ask(&mut system, 0, line, Write), (Level::First, 1));
    assert_eq!(ask(&mut system, 0, line + 64, Read), (Level::LocalMemory, 20));
    assert_eq!(system.held(0, line), Held::Nothing);
    assert_eq!(ask(&mut system, 1, line, Read), (Level::LocalMemory, 20));
    assert_eq!(system.total().writebacks, 1);
}

/// Would catch replacement by anything but the least recent use.
#[test]
fn least_recently_used_makes_room() {
    // One set of four lines.
    let mut system = System::new(&small("first_level = { bytes = 64, ways = 4 }"), 1).unwrap();
    let region = system.region("page", Home::RoundRobin).unwrap();
    let line = system.allocate(region, 4096, 4096).unwrap();
    for number in [0, 1, 2, 3, 0, 2, 4, 5] {
        ask(&mut system, 0, line + 16 * number, Read);
    }
    let held: Vec<_> = (0..6).filter(|number| system.held(0, line + 16 * number) != Held::Nothing).collect();
    assert_eq!(held, [0, 2, 4, 5]);
}

/// Would catch a bad request that panics, or that changes anything.
#[test]
fn what_is_not_there_is_refused() {
    let spec = Spec::dash().unwrap();
    for processors in [0, 65] {
        let error = MachineError::Processors { machine: "dash".into(), processors, most: 64 };
        assert_eq!(System::new(&spec, processors).unwrap_err(), error);
    }
    let (mut system, _, address) = dash(8);
    assert_eq!(system.access(8, address, Read), Err(AccessError::NoSuchProcessor { processor: 8, processors: 8 }));
    for beyond in [4096, u64::MAX] {
        let error = AccessError::NotAllocated { address: beyond, end: 4096 };
        assert_eq!(system.access(0, beyond, Write), Err(error));
    }
    assert_eq!(system.total(), Counts::default());
    system.check().unwrap();
}

/// Would catch counts that survive their reset, or caches that do not.
#[test]
fn counts_are_reset_and_caches_stay() {
    let (mut system, region, address) = dash(8);
    ask(&mut system, 7, address, Write);
    system.reset_counts();
    assert_eq!(system.total(), Counts::default());
    assert_eq!(ask(&mut system, 7, address, Write), (Level::First, 1));
    assert_eq!(system.processor_counts(7), system.region_counts(region));
    assert_eq!(system.total().accesses(), 1);
}
