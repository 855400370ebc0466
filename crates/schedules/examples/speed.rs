//! How fast whole runs of schedules are simulated: the room, with the paper's thresholds. Each is run twice, or more
//! often, with the same memory of pairs; of all but the first, which evaluates kernels, the fastest counts, in processor time
//! where the system tells (on Linux), so that others at work beside it count for less.
//!
//! `cargo run --release -p isolux-schedules --example speed [-- [--bf SHARE] [--times N] [MACHINE] [SCHEDULE] [PROCESSORS]]`; what is not
//! named runs for all values. The digest is of every phase's clock, span, times and counts: a change that only makes runs
//! faster leaves it as it is.

#![expect(clippy::print_stdout, reason = "a table is what it is for")]

use isolux_core::kernels::form_factor::FormFactor;
use isolux_core::kernels::oracle::Thresholds;
use isolux_core::kernels::visibility::{Covered, Rays, Sampling};
use isolux_core::scene::Scene;
use isolux_core::solution::{Parameters, Roots, Stop, Unobserved, Update, pilot_irradiance};
use isolux_core::tree::{Bsp, InsertionOrder};
use isolux_machine::{Cause, Machine, Run};
use isolux_schedules::{CLASSES, COST_MODEL, Memory, Problem, Remembered, Schedule, ScheduleError, Sizes, Tally, run};
use isolux_simulator::{CacheSimulator, MachineSpec, Simulator};
use rustc_hash::FxHasher;
use std::error::Error;
use std::hash::Hasher;
use std::time::Instant;

const SIZES: Sizes =
    Sizes { elements: 1 << 17, links: 1 << 21, pieces: 1 << 14, nodes: 1 << 12, fragments: 1 << 12, tasks: 1 << 18 };

const SCHEDULES: [(&str, Schedule); 3] =
    [("splash", Schedule::SPLASH), ("sbpram", Schedule::SB_PRAM), ("wavefront", Schedule::Wavefront)];

const MACHINES: [(&str, &[usize]); 2] = [("sb-pram", &[1, 64, 1024, 2048, 16384]), ("dash", &[1, 16, 64])];

/// What a solve came to.
#[derive(Default)]
struct Measured {
    seconds: f64,
    events: u64,
    clock: u64,
    work: u64,
    digest: FxHasher,
}

impl Measured {
    fn add(&mut self, phase: &Run<Tally>, events: u64) {
        self.events += events;
        self.clock += phase.clock;
        self.work += phase.work();
        let counts = phase.counts.iter().flat_map(|c| {
            [c.loads, c.stores, c.prefixes, c.polls, c.locks, c.barriers].into_iter().chain(c.work.counts().to_vec())
        });
        let times = phase.time.iter().flat_map(|time| Cause::ALL.map(|cause| time.get(cause)));
        [phase.clock, phase.span].into_iter().chain(times).chain(counts).for_each(|n| self.digest.write_u64(n));
    }
}

/// Seconds of this thread's processor time, else of real time.
struct Stopwatch(Instant, Option<f64>);

impl Stopwatch {
    fn processor_time() -> Option<f64> {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        Some(text.split_whitespace().next()?.parse::<f64>().ok()? / 1e9)
    }

    fn start() -> Stopwatch {
        Stopwatch(Instant::now(), Self::processor_time())
    }

    fn seconds(&self) -> f64 {
        let on_processor = Self::processor_time().zip(self.1).map(|(now, start)| now - start);
        on_processor.unwrap_or_else(|| self.0.elapsed().as_secs_f64())
    }
}

fn solve<M: Machine>(
    mut machine: M,
    problem: &Problem<'_>,
    memory: &Memory,
    schedule: Schedule,
    events: impl Fn(&M) -> u64,
) -> Result<Measured, ScheduleError> {
    let mut measured = Measured::default();
    let watch = Stopwatch::start();
    run(&mut machine, problem, Remembered::new(problem, memory), schedule, SIZES, 50, &mut |machine, _, phase| {
        measured.add(phase, events(machine));
        true
    })?;
    drop(machine);
    measured.seconds = watch.seconds();
    Ok(measured)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut bf = 0.03;
    let mut times = 1;
    let mut only: Vec<String> = Vec::new();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        if argument == "--bf" {
            bf = arguments.next().ok_or("--bf needs a share of the pilot's irradiance")?.parse()?;
        } else if argument == "--times" {
            times = arguments.next().ok_or("--times needs a number")?.parse()?;
        } else {
            only.push(argument);
        }
    }
    // Whatever is named must be one of these, if any of these is.
    let chosen = |names: &[&str], name: &str| {
        !only.iter().any(|o| names.contains(&o.as_str())) || only.iter().any(|o| o == name)
    };

    let path = format!("{}/../../scenes/room.glb", env!("CARGO_MANIFEST_DIR"));
    let scene = Scene::build(isolux_formats::read::read(path.as_ref(), &Default::default())?, &Default::default())?;
    let order = InsertionOrder::FewestCuts;
    let bsp = Bsp::build(&scene, order);
    let pilot = pilot_irradiance(&scene, &bsp, 0, &mut Unobserved).ok_or("nobody stops it")?;
    let parameters = Parameters {
        thresholds: Thresholds {
            bf: bf * pilot,
            partial: 0.0,
            partial_form_factor: 1.0,
            emission: 1.0,
            area: 1e-4 * scene.area(),
        },
        stop: Stop::Change(0.005),
        update: Update::InPlace,
        roots: Roots::Fragments,
        form_factor: FormFactor::Disks,
        sampling: Sampling::from(Rays::Sixteen),
        covered: Covered::Counted,
        seed: 0,
    };
    let problem = Problem::new(&scene, &bsp, order, parameters, &vec![true; scene.polygons.len()]);
    let memory = Memory::default();
    println!(
        "| machine | schedule | processors | million events | seconds | million events a second | work | clock | digest |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, numbers) in MACHINES.into_iter().filter(|m| chosen(&MACHINES.map(|m| m.0), m.0)) {
        let mut spec = MachineSpec::named(name)?;
        spec.add_work(COST_MODEL, "cost_model.toml")?;
        for (title, schedule) in SCHEDULES.into_iter().filter(|s| chosen(&SCHEDULES.map(|s| s.0), s.0)) {
            let texts: Vec<_> = numbers.iter().map(usize::to_string).collect();
            let texts: Vec<_> = texts.iter().map(String::as_str).collect();
            for (&processors, _) in numbers.iter().zip(&texts).filter(|(_, text)| chosen(&texts, text)) {
                let once = || -> Result<Measured, Box<dyn Error>> {
                    Ok(if spec.caches().is_some() {
                        let machine = CacheSimulator::new(&spec, processors, &CLASSES)?;
                        solve(machine, &problem, &memory, schedule, CacheSimulator::events)?
                    } else {
                        let machine = Simulator::new(&spec, processors, &CLASSES)?;
                        solve(machine, &problem, &memory, schedule, Simulator::events)?
                    })
                };
                once()?;
                let mut fastest = once()?;
                for _ in 1..times {
                    let again = once()?;
                    if again.seconds < fastest.seconds {
                        fastest = again;
                    }
                }
                let Measured { seconds, events, clock, work, digest } = fastest;
                let millions = events as f64 / 1e6;
                let (rate, digest) = (millions / seconds, digest.finish());
                println!(
                    "| {name} | {title} | {processors} | {millions:.2} | {seconds:.2} | {rate:.2} | {work} | {clock} | {digest:016x} |"
                );
            }
        }
    }
    Ok(())
}
