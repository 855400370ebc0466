//! Machines with caches: costs by hand, misses by region and cause, and the same run twice.

#![allow(clippy::unwrap_used)]

use isolux_machine::protocols::{DistributedQueues, StealCounts, Termination};
use isolux_machine::{
    Address, Cause, ClockUnit, Condition, Home, Machine, Mark, Prefix, Processor, Run, Work, WorkClass,
};
use isolux_memory::Cause::{Cold, FalseSharing, Replacement, TrueSharing};
use isolux_memory::Level;
use isolux_simulator::{CacheProcessor, CacheSimulator, MachineSpec, Simulator};

fn machine(name: &str, processors: usize) -> CacheSimulator {
    let mut spec = MachineSpec::named(name).unwrap();
    spec.add_work("[work]\nstep = 1", "test").unwrap();
    CacheSimulator::new(&spec, processors, &["step"]).unwrap()
}

/// A page whose home is that of processor 0.
fn page(machine: &mut CacheSimulator, name: &str) -> impl Fn(u64) -> Address + use<> {
    let region = machine.allocate(name, 512, Home::At(0)).unwrap();
    move |word| region.at(word)
}

async fn steps(p: &CacheProcessor, count: u64) {
    p.charge(&Work::of(WorkClass(0), count)).await;
}

fn stalls(run: &Run<impl Sized>) -> Vec<u64> {
    run.time.iter().map(|t| t.get(Cause::Stall)).collect()
}

/// Catches a miss that costs as a hit or as another level, stalls that go to work, and words that miss the lines they
/// share.
#[test]
fn accesses_cost_the_level_that_serves_them() {
    let mut machine = machine("dash", 12);
    let at = page(&mut machine, "page");
    let run = machine
        .run(async |p: CacheProcessor| match p.id() {
            0 => {
                // Local memory, a hit, the other word of the line, then a line of its own to write and to add to.
                p.load(at(0)).await;
                p.load(at(0)).await;
                p.load(at(1)).await;
                p.store(at(2), 7).await;
                p.prefix(Prefix::Add, at(3), 1).await;
            }
            4 => {
                // Dirty at home, in another cluster; then ownership of a line that home has, too.
                steps(&p, 1000).await;
                p.load(at(2)).await;
                p.store(at(2), 8).await;
            }
            8 => {
                // Dirty in a third cluster.
                steps(&p, 2000).await;
                p.prefix(Prefix::Max, at(3), 9).await;
            }
            _ => {}
        })
        .unwrap();
    assert_eq!(run.unit, ClockUnit::Clocks);
    let mut expected = vec![0; 12];
    (expected[0], expected[4], expected[8]) = (29 + 29, 99 + 99, 134);
    assert_eq!(stalls(&run), expected);
    let works = [0, 4, 8].map(|p| run.time[p].get(Cause::Work));
    assert_eq!((works, run.clock), ([5, 1002, 2001], 2001 + 134));
    let counts = machine.counts_of("page").unwrap();
    assert_eq!([Cold, Replacement, TrueSharing, FalseSharing].map(|c| counts.missed(c)), [4, 0, 0, 0]);
    assert_eq!((counts.accesses(), counts.at(Level::First), counts.upgrades), (8, 3, 1));
    assert_eq!(machine.counts_of("pages"), None);
}

/// Catches misses that are booked to another region or cause, a reset that empties caches, and caches that forget
/// between runs.
#[test]
fn misses_are_counted_by_region_and_cause() {
    let mut machine = machine("dash", 8);
    let (shared, large) = (page(&mut machine, "shared"), machine.allocate("large", 4 << 15, Home::FirstTouch).unwrap());
    let barrier = machine.allocate_barriers(1);
    let run = machine.run(async |p: CacheProcessor| match p.id() {
        0 => {
            p.load_block::<2>(shared(0)).await;
            p.barrier(barrier).await;
            p.barrier(barrier).await;
            // Word 0 has been written, word 1 of the same line by the same token only brings it again.
            p.load(shared(0)).await;
            // 1 MB through 256 KB, twice: all lines are replaced before they come again.
            for _ in 0..2 {
                p.touch(large, 1 << 15, &[0, 1, 2, 3]).await;
            }
        }
        id => {
            p.barrier(barrier).await;
            if id == 4 {
                p.store(shared(0), 1).await;
            }
            p.barrier(barrier).await;
        }
    });
    let lines = (4 << 15) / 2;
    let by_cause = |m: &CacheSimulator, name: &str| {
        let counts = m.counts_of(name).unwrap();
        [Cold, Replacement, TrueSharing, FalseSharing].map(|c| counts.missed(c))
    };
    assert_eq!(by_cause(&machine, "large"), [lines, lines, 0, 0]);
    assert_eq!(by_cause(&machine, "shared"), [2, 0, 1, 0]);
    // Cold at home 30, then 100 back from the other cluster's cache; first touch makes the large region local.
    assert_eq!(stalls(&run.unwrap())[0], 29 + 99 + 2 * lines * 29);
    let names: Vec<_> = machine.region_counts().into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["shared", "large"]);

    machine.reset_counts();
    assert_eq!(by_cause(&machine, "large"), [0; 4]);
    let last = (4 << 15) - 2;
    let again = machine
        .run(async |p: CacheProcessor| {
            if p.id() == 0 {
                p.load(large.at(last)).await;
            }
        })
        .unwrap();
    assert_eq!((again.clock, machine.counts_of("large").unwrap().accesses()), (1, 1), "the caches stay");
    assert_eq!(machine.processor_counts()[0].at(Level::First), 1);
}

/// Catches a waiting processor that misses with every poll, or never; and a last poll that is free.
#[test]
fn who_waits_looks_at_a_copy_until_it_is_taken_away() {
    let mut machine = machine("dash", 8);
    let at = page(&mut machine, "page");
    let run = machine
        .run(async |p: CacheProcessor| match p.id() {
            0 => {
                steps(&p, 1000).await;
                p.store(at(0), 1).await;
            }
            4 => drop(p.wait_while(at(0), Condition::Equal(0)).await),
            _ => {}
        })
        .unwrap();
    // The first poll at 0 brings the line over two hops, 99 beyond a hit; the next come at 99 + 3 k. The store at 1000
    // takes the line from a cluster that is not home; the poll at 1002 sees it, 99 beyond a hit again.
    assert_eq!(stalls(&run)[4], 99 + 99);
    assert_eq!((run.counts[4].polls, run.time[4].get(Cause::Idle)), (302, 906 + run.clock - (1002 + 3 + 99)));
    assert_eq!(run.clock, 1000 + 1 + 99 + 4);
    assert_eq!(machine.counts_of("page").unwrap().accesses(), 3);
}

/// D27. Catches a model of waiting that has changed without its description: ten writes that end no wait.
#[test]
fn d27_a_write_that_ends_no_wait_costs_the_waiting_nothing() {
    let mut machine = machine("dash", 8);
    let at = page(&mut machine, "page");
    let run = machine
        .run(async |p: CacheProcessor| match p.id() {
            0 => {
                for value in 1..=10 {
                    steps(&p, 1000).await;
                    p.store(at(0), value).await;
                }
            }
            4 => drop(p.wait_while(at(0), Condition::Below(10)).await),
            _ => {}
        })
        .unwrap();
    // The first write takes the copy away, 99 beyond a hit; the others hit. DASH would have each of the nine polls
    // after a write miss, and each write but the first pay for the copy.
    assert_eq!((stalls(&run)[0], stalls(&run)[4]), (99, 99 + 99));
}

/// D28. Catches locks that cost the same wherever they were last, and a barrier that costs other than its formula.
#[test]
fn locks_are_words_and_barriers_a_formula() {
    let mut machine = machine("dash", 8);
    let lock = machine.allocate_locks(2);
    let barrier = machine.allocate_barriers(1);
    let run = machine
        .run(async |p: CacheProcessor| {
            let locked = async || {
                p.lock(lock).await;
                p.unlock(lock).await;
            };
            if p.id() == 0 {
                locked().await;
                locked().await;
            }
            p.barrier(barrier).await;
            if p.id() == 4 {
                locked().await;
            }
        })
        .unwrap();
    // Local memory to take, then only hits; dirty at home for the other cluster.
    assert_eq!((stalls(&run)[0], stalls(&run)[4]), (29, 99));
    assert_eq!(run.clock, 2 * (3 + 1) + 29 + (8 + 8 * 135) + (3 + 1) + 99);
    assert_eq!(machine.counts_of("locks 0").unwrap().accesses(), 6);
}

/// A binary tree of tasks, each of which reads and writes records.
fn tasks(name: &str, processors: usize) -> (Run<u64>, String) {
    let mut machine = machine(name, processors).traced(true);
    let queues = DistributedQueues::<2>::new(&mut machine, "queues", 50).unwrap();
    let open = Termination::new(&mut machine, "open", 1).unwrap();
    let cells = machine.allocate("cells", 4000, Home::RoundRobin).unwrap();
    let results = machine.allocate("results", 8000, Home::FirstTouch).unwrap();
    let read = machine.allocate("read only", 8000, Home::FirstTouch).unwrap();
    let run = machine
        .run(async |p: CacheProcessor| {
            assert!(p.has_caches());
            if p.id() == 0 {
                queues.push(&p, 0, [0, 0]).await.unwrap();
            }
            let mut steals = StealCounts::default();
            while let Some([task, _]) = queues.next(&p, &open, &mut steals).await {
                let before = p.enter(Mark::new(Cause::Work, "task"));
                p.touch(read, 8, &[(task % 1000) as u32, (task * 7 % 1000) as u32]).await;
                let cell: [u64; 4] = p.load_block(cells.at(task % 999 * 4)).await;
                p.prefix(Prefix::Add, cells.at(task % 999 * 4), 1).await;
                p.store_block(results.at(task * 4), cell.map(|word| word + 1)).await;
                steps(&p, 2000 + task % 50).await;
                p.enter(before);
                for child in 2 * task + 1..(2 * task + 3).min(2000) {
                    open.add(&p, 1).await;
                    queues.push(&p, p.id(), [child, 0]).await.unwrap();
                }
                open.finish(&p).await;
            }
            steals.successes
        })
        .unwrap();
    let total: u64 = (0..4000).map(|word| machine.peek(cells.at(word))).sum();
    assert_eq!(total, 2000, "a task ran twice or never");
    (run, machine.take_trace().unwrap().to_text())
}

/// Catches anything that varies from run to run, on both machines and up to their full size; and one that gains
/// nothing.
#[test]
fn the_same_program_gives_the_same_trace() {
    for (name, processors) in [("dash", 1), ("dash", 16), ("dash", 64), ("two-socket", 56)] {
        let [one, two] = [0; 2].map(|_| tasks(name, processors));
        assert!(one == two, "{name}, {processors} processors");
        let (run, trace) = one;
        assert!(trace.contains("stall\ttask") && run.span > 0);
        assert!(run.clock >= run.span.max(run.work() / processors as u64));
        if processors > 1 {
            assert!(run.clock < tasks(name, 1).0.clock / 4, "{name}, {processors} processors: {}", run.clock);
            assert!(run.values.iter().sum::<u64>() > 0);
        }
    }
}

/// Catches records of a region that are read beyond its end.
#[test]
fn records_that_are_not_there_are_refused() {
    let mut machine = machine("dash", 2);
    let region = machine.allocate("records", 30, Home::RoundRobin).unwrap();
    let run = machine.run(async |p: CacheProcessor| p.touch(region, 8, &[0, p.id() as u32 * 3]).await);
    assert!(matches!(run, Err(isolux_machine::RunError::Fault { processor: 1, .. })), "{run:?}");
}

/// Catches a machine that no file describes, and an error that does not say so by name.
#[test]
fn impossible_machines_are_refused_by_file_and_bound() {
    let dash = MachineSpec::named("dash").unwrap();
    for asked in [0, 65, 1_000_000] {
        let error = CacheSimulator::new(&dash, asked, &[]).unwrap_err().to_string();
        assert_eq!(error, format!("dash.toml: {asked} processors; the machine has 1 to 64"));
        let error = Simulator::new(&MachineSpec::named("sb-pram").unwrap(), asked * 1000, &[]).map(|_| ());
        let told = format!("sb_pram/spec.toml: {} processors; the machine has 1 to 16384", asked * 1000);
        assert_eq!(error.unwrap_err().to_string(), told);
    }
    assert_eq!(Simulator::new(&dash, 4, &[]).unwrap_err().to_string(), "dash.toml: the machine has caches");
    let ideal = MachineSpec::named("ideal").unwrap();
    let error = CacheSimulator::new(&ideal, 4, &[]).unwrap_err().to_string();
    assert_eq!(error, "ideal/spec.toml: the machine has no caches");
    let two_socket = MachineSpec::named("two-socket").unwrap();
    let told = CacheSimulator::new(&two_socket, 2, &["ray"]).unwrap_err().to_string();
    assert_eq!(told, "two-socket.toml: work.ray is missing");
}
