//! One run: a problem and a request go in, a machine is made and the schedule runs on it.

use super::{
    IterationResult, Misses, PhaseResult, RunRequest, RunResult, StealResult, Stretch, StudyError, StudyProblem,
    machine_spec,
};
use isolux_core::solution::Update;
use isolux_machine::{Cause, ClockUnit, Counts, Machine, Run, Sequential, Threads};
use isolux_schedules::{CLASSES, Direct, Outcome, Pairs, PhaseName, Problem, Remembered, Schedule, Sizes, Tally, run};
use isolux_simulator::{CacheSimulator, Memory, Simulator, SimulatorOf, Trace};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

/// Room for records. Machines take memory as it is written, so it may be ample: a room of 400 polygons has 4 million links at
/// four times the size of the study.
const ELEMENTS: u64 = 1 << 21;
const LINKS: u64 = 1 << 25;
const PIECES: u64 = 1 << 20;
const TASKS: u64 = 1 << 20;

/// What is heard of a machine beside its runs.
trait Heard: Machine {
    fn events(&self) -> u64 {
        0
    }
    fn trace(&mut self) -> Option<Trace> {
        None
    }
}

impl Heard for Sequential {}
impl Heard for Threads {}
impl<M: Memory> Heard for SimulatorOf<M> {
    fn events(&self) -> u64 {
        SimulatorOf::events(self)
    }
    fn trace(&mut self) -> Option<Trace> {
        self.take_trace()
    }
}

/// What has been heard so far.
#[derive(Default)]
struct Account {
    phases: Vec<PhaseResult>,
    counts: Counts,
    unit: Option<ClockUnit>,
    trace: Vec<Stretch>,
    clock: u64,
    events: u64,
}

impl Account {
    fn hear<M: Heard>(&mut self, machine: &mut M, name: PhaseName, run: &Run<Tally>) {
        let time = run.total_time();
        let events = machine.events();
        self.phases.push(PhaseResult {
            phase: name.number,
            name: name.title,
            iteration: name.iteration,
            time: run.clock,
            span: run.span,
            causes: Cause::ALL.into_iter().map(|cause| (cause.name(), time.get(cause))).collect(),
            events,
        });
        self.counts.add(&run.total_counts());
        self.unit = Some(run.unit);
        let trace = machine.trace();
        let intervals = trace.iter().flat_map(Trace::intervals);
        let shift = self.clock;
        self.trace.extend(intervals.map(|i| (i.processor, i.start + shift, i.end + shift, i.cause.name(), i.label)));
        self.clock += run.clock;
        self.events += events;
    }
}

impl StudyProblem {
    /// Makes the machine and runs the schedule, until `stop` is set.
    ///
    /// # Errors
    ///
    /// A machine that cannot be had, a problem too large, and a run that was stopped.
    pub fn simulate(&self, request: &RunRequest, stop: &Arc<AtomicBool>) -> Result<RunResult, StudyError> {
        let since = Instant::now();
        let schedule = request.schedule();
        // Flat rounds read the last iteration's values by nature.
        let update = if schedule == Schedule::Wavefront { Update::Jacobi } else { request.update };
        let problem = self.problem(update);
        let remembered = Remembered::new(&problem, &self.memory);
        let real = |source| StudyError::Machine { machine: request.machine.clone(), source };
        let mut account = Account::default();
        let mut misses = BTreeMap::new();
        let mut name = request.machine.clone();
        let outcome = match request.machine.as_str() {
            "sequential" => {
                let machine = Sequential::new(&CLASSES).map_err(real)?;
                self.drive(machine, &problem, remembered, schedule, &mut account, stop)?.1
            }
            "threads" => {
                let machine = Threads::new(request.processors, &CLASSES).map_err(real)?;
                self.drive(machine, &problem, Direct::new(&problem), schedule, &mut account, stop)?.1
            }
            other => {
                let spec = machine_spec(other)?;
                spec.name().clone_into(&mut name);
                if spec.caches().is_some() {
                    let machine = CacheSimulator::new(&spec, request.processors, &CLASSES)?
                        .traced(request.trace)
                        .stopped_by(Arc::clone(stop));
                    let (machine, outcome) = self.drive(machine, &problem, remembered, schedule, &mut account, stop)?;
                    misses = misses_of(&machine);
                    outcome
                } else {
                    let machine = Simulator::new(&spec, request.processors, &CLASSES)?
                        .traced(request.trace)
                        .stopped_by(Arc::clone(stop));
                    self.drive(machine, &problem, remembered, schedule, &mut account, stop)?.1
                }
            }
        };
        outcome.check_tree(&problem).map_err(|error| StudyError::Internal { what: error.to_string() })?;
        Ok(result(request, name, update, account, misses, outcome, since.elapsed().as_secs_f64()))
    }

    fn drive<M: Heard, K: Pairs>(
        &self,
        mut machine: M,
        problem: &Problem<'_>,
        pairs: K,
        schedule: Schedule,
        account: &mut Account,
        stop: &Arc<AtomicBool>,
    ) -> Result<(M, Outcome), StudyError> {
        let sizes = Sizes {
            elements: ELEMENTS,
            links: LINKS,
            pieces: PIECES,
            nodes: self.bsp.nodes().len() as u64,
            fragments: self.bsp.fragments().len() as u64,
            tasks: TASKS,
        };
        let mut hear = |machine: &mut M, name: PhaseName, run: &Run<Tally>| {
            account.hear(machine, name, run);
            !stop.load(Relaxed)
        };
        let outcome = run(&mut machine, problem, pairs, schedule, sizes, self.settings.max_iterations, &mut hear)?;
        Ok((machine, outcome))
    }
}

fn misses_of(machine: &CacheSimulator) -> BTreeMap<String, Misses> {
    let counted = machine.region_counts().into_iter().map(|(region, counts)| {
        let causes = isolux_memory::Cause::ALL.into_iter().map(|cause| (cause_name(cause), counts.missed(cause)));
        let mut misses: Misses = causes.collect();
        misses.insert("upgrades", counts.upgrades);
        misses.insert("accesses", counts.accesses());
        (region, misses)
    });
    counted.filter(|(_, misses)| misses["accesses"] > 0).collect()
}

fn cause_name(cause: isolux_memory::Cause) -> &'static str {
    match cause {
        isolux_memory::Cause::Cold => "cold",
        isolux_memory::Cause::Replacement => "replacement",
        isolux_memory::Cause::TrueSharing => "true sharing",
        isolux_memory::Cause::FalseSharing => "false sharing",
    }
}

fn result(
    request: &RunRequest,
    machine: String,
    update: Update,
    account: Account,
    misses: BTreeMap<String, Misses>,
    outcome: Outcome,
    seconds: f64,
) -> RunResult {
    let iterations = outcome.iterations.iter().zip(1..).map(|(it, iteration)| IterationResult {
        iteration,
        residual: it.residual,
        total: it.total.0,
        reads: it.tally.reads,
        updated_reads: it.tally.updated_reads,
        links: it.links,
        elements: it.elements,
    });
    let steals = outcome.tally.steals;
    RunResult {
        machine,
        schedule: request.schedule,
        update,
        processors: if request.machine == "sequential" { 1 } else { request.processors },
        unit: match account.unit {
            Some(ClockUnit::Instructions) => "instructions",
            Some(ClockUnit::Clocks) => "clocks",
            Some(ClockUnit::Nanoseconds) => "nanoseconds",
            Some(ClockUnit::Operations) | None => "operations",
        },
        phases: account.phases,
        iterations: iterations.collect(),
        converged: outcome.converged,
        steals: StealResult { successes: steals.successes, failures: steals.failures, probes: account.counts.polls },
        misses,
        counts: CLASSES.into_iter().zip(account.counts.work.counts().iter().copied()).collect(),
        links: outcome.links,
        elements: outcome.radiosity.len() as u64,
        events: account.events,
        seconds,
        trace: request.trace.then_some(account.trace),
    }
}
