//! A whole solve on a machine: phase after phase, each a program that all processors run; times, accounts and light come
//! out. Between phases nothing runs.

use crate::pairs::Pairs;
use crate::problem::Problem;
use crate::queues::Queues;
use crate::store::{self, Counter, Sizes, Store};
use crate::task::Task;
use crate::variant::{Grain, Schedule, Switches};
use crate::wavefront::Flat;
use crate::worker::{Context, LOOPS, Tally, Worker};
use isolux_core::solution::{Stop, tree_sum};
use isolux_core::tree::{Bsp, Path};
use isolux_core::units::Rgb;
use isolux_machine::protocols::{ParallelLoop, parallel_for};
use isolux_machine::{Cause, Machine, Mark, MemoryError, Processor, Run, RunError};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use thiserror::Error;

/// Why a schedule did not run to its end.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ScheduleError {
    /// The machine refused something.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The machine has no room.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// A kind of record needs more room than was given to it.
    #[error("{what}: {needed} are needed, there is room for {room}")]
    Full {
        /// What.
        what: &'static str,
        /// How many there would have to be, at least.
        needed: u64,
        /// How many there may be.
        room: u64,
    },
    /// The caller stopped it between two phases.
    #[error("stopped")]
    Stopped,
}

/// A phase, as the paper names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PhaseName {
    /// Its number: 1, 2, 3, or 1', 1'', 2', 3'; a name in flat rounds, which the paper does not have.
    pub number: &'static str,
    /// What it does.
    pub title: &'static str,
    /// Of the iteration: which one, from 1.
    pub iteration: Option<u32>,
}

/// What an iteration came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IterationOutcome {
    /// Sum of area times radiosity, W or lm.
    pub total: Rgb,
    /// Relative change of the total.
    pub residual: f64,
    /// Reads of radiosities by gathers, and how many of them saw a value of the same iteration.
    pub tally: Tally,
    /// Links that were made so far, counted as in [`Outcome`].
    pub links: u64,
    /// Elements so far.
    pub elements: u64,
}

/// A solve that ran to its end.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Iterations.
    pub iterations: Vec<IterationOutcome>,
    /// Did the last one change the total by no more than was asked?
    pub converged: bool,
    /// Radiosity of every element, in the order of names.
    pub radiosity: Vec<(Path, Rgb)>,
    /// Values at the corners of every leaf, in the order of names.
    pub vertices: Vec<(Path, Vec<Rgb>)>,
    /// Links that were made: of tasks, records that were taken (one that is split gives its record to the first link in its
    /// place); of flat rounds, all links.
    pub links: u64,
    /// Nodes of the tree: plane's polygon, then the children and the number of fragments, in the order of places; what the
    /// tree of kernels is compared with.
    pub nodes: Vec<[u64; 4]>,
    /// What all processors did that machines do not count, over all phases.
    pub tally: Tally,
    /// Bytes that the program of a processor takes while it waits: the largest of all phases.
    pub program_bytes: usize,
}

/// A node that the tasks' tree and that of the kernels do not have alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("node {0} of the tree differs")]
pub struct TreeDiffers(pub u32);

impl Outcome {
    /// Compares the tree that was built with the one that rays walk (D30): the same planes, children, and numbers of
    /// fragments, from the root on, wherever nodes lie.
    ///
    /// # Errors
    ///
    /// The first node that differs, by its number in the kernels' tree.
    pub fn check_tree(&self, problem: &Problem<'_>) -> Result<(), TreeDiffers> {
        let nodes = problem.bsp.nodes();
        let mut pairs = vec![(0_u64, 0_u32)];
        while let Some((built, node)) = pairs.pop() {
            let fail = Err(TreeDiffers(node));
            let Some(&[polygon, front, back, in_plane]) = self.nodes.get(built as usize) else { return fail };
            let expected = &nodes[node as usize];
            let polygon = problem.scene.polygons.get(polygon as usize);
            let fragments = problem.bsp.fragments_of(node).count() as u64;
            if polygon.is_none_or(|polygon| polygon.plane != expected.plane) || in_plane != fragments {
                return fail;
            }
            for (built, node) in [(front, expected.front), (back, expected.back)] {
                match (built.checked_sub(1), node) {
                    (None, Bsp::NONE) => {}
                    (None, _) | (Some(_), Bsp::NONE) => return fail,
                    (Some(built), node) => pairs.push((built, node)),
                }
            }
        }
        Ok(())
    }
}

/// Hears of every phase as it ends: its name and its run. False stops the solve.
pub type Hear<'a, M> = &'a mut dyn FnMut(&mut M, PhaseName, &Run<Tally>) -> bool;

/// Runs a schedule on a machine made for it: one with the classes of work [`crate::CLASSES`], on which nothing was allocated.
///
/// # Errors
///
/// What the machine refuses, room that runs out, and that `hear` stopped it.
pub fn run<M: Machine, K: Pairs>(
    machine: &mut M,
    problem: &Problem<'_>,
    pairs: K,
    schedule: Schedule,
    sizes: Sizes,
    max_iterations: u32,
    hear: Hear<'_, M>,
) -> Result<Outcome, ScheduleError> {
    let (switches, grain) = match schedule {
        Schedule::Tasks { switches, grain } => (switches, grain),
        Schedule::Wavefront => (Switches::SB_PRAM, Grain::FINEST),
    };
    let store = Store::new(machine, sizes, problem.roots() as u64)?;
    let mut loops = [ParallelLoop::new(machine, "loop 0")?; LOOPS];
    for (number, indices) in loops.iter_mut().enumerate().skip(1) {
        *indices = ParallelLoop::new(machine, &format!("loop {number}"))?;
    }
    let flat = match schedule {
        Schedule::Tasks { .. } => None,
        Schedule::Wavefront => Some(Flat::new(machine, sizes)?),
    };
    machine.poke(store.counter(Counter::Elements), problem.roots() as u64);
    machine.poke(store.counter(Counter::Pieces), problem.order.len() as u64);
    let context = Context {
        problem,
        pairs,
        switches,
        grain,
        store,
        queues: Queues::new(machine, switches, grain, sizes.tasks)?,
        loops,
        flat,
        barrier: machine.allocate_barriers(1),
        updated: (0..sizes.elements).map(|_| AtomicU32::new(0)).collect(),
        full: AtomicBool::new(false),
    };
    let mut solve = Solve { machine, context, outcome: Outcome::default(), hear };
    solve.build()?;
    solve.iterate(max_iterations)?;
    solve.interpolate()?;
    Ok(solve.finish())
}

struct Solve<'a, 'h, M, K> {
    machine: &'a mut M,
    context: Context<'a, K>,
    outcome: Outcome,
    hear: Hear<'h, M>,
}

/// A phase's program: what one processor does.
macro_rules! phase {
    ($solve:expr, $name:expr, $iteration:expr, |$worker:ident| $body:block) => {{
        let context = &$solve.context;
        let program = |p| async move {
            let $worker = Worker::new(p, context, $iteration);
            $body
            $worker.tally.into_inner()
        };
        $solve.outcome.program_bytes = $solve.outcome.program_bytes.max(bytes_of(&program));
        let run = $solve.machine.run(program)?;
        $solve.end_phase($name, run)?
    }};
}

/// Bytes of what a program makes for each processor.
fn bytes_of<P, R>(_: &impl Fn(P) -> R) -> usize {
    size_of::<R>()
}

impl<M: Machine, K: Pairs> Solve<'_, '_, M, K> {
    fn name(&self, number: [&'static str; 2], primed: bool, title: &'static str) -> PhaseName {
        PhaseName { number: number[usize::from(primed)], title, iteration: None }
    }

    fn end_phase(&mut self, name: PhaseName, run: Run<Tally>) -> Result<Tally, ScheduleError> {
        if self.context.full.load(Relaxed) {
            return Err(self.overflow());
        }
        let mut tally = Tally::default();
        run.values.iter().for_each(|t| tally.add(t));
        self.outcome.tally.add(&tally);
        if (self.hear)(self.machine, name, &run) { Ok(tally) } else { Err(ScheduleError::Stopped) }
    }

    fn count(&self, counter: Counter) -> u64 {
        self.machine.peek(self.context.store.counter(counter))
    }

    /// Which kind of record ran out.
    fn overflow(&self) -> ScheduleError {
        let sizes = self.context.store.sizes;
        let kinds = [
            ("elements", Counter::Elements, sizes.elements),
            ("links", Counter::Links, sizes.links),
            ("pieces of polygons", Counter::Pieces, sizes.pieces),
            ("nodes of the tree", Counter::Nodes, sizes.nodes),
            ("links of a round", Counter::Fresh, sizes.links),
            ("links to be split", Counter::Splits, sizes.links),
            ("links in rows", Counter::Rows, sizes.links),
        ];
        let over = kinds.into_iter().map(|(what, counter, room)| (what, self.count(counter), room));
        let (what, needed, room) =
            over.max_by_key(|&(_, needed, room)| needed.saturating_sub(room)).unwrap_or_default();
        ScheduleError::Full { what, needed, room }
    }

    /// Phase 1: the tree and the links between roots.
    fn build(&mut self) -> Result<(), ScheduleError> {
        if let Some(flat) = self.context.flat {
            let name = |number, title| PhaseName { number, title, iteration: None };
            phase!(self, name("tree", "tree"), 0, |worker| {
                worker.begin(0).await;
                worker.grow_tree(&flat).await;
            });
            phase!(self, name("pairs", "initial pairs"), 0, |worker| {
                worker.begin(0).await;
                worker.link_pairs(&flat).await;
            });
            // Each fresh pair stands for two links.
            self.outcome.links = 2 * self.count(Counter::Fresh);
            return Ok(());
        }
        let Switches { parallel_bsp, pair_loop, .. } = self.context.switches;
        let title = if pair_loop || parallel_bsp { "BSP" } else { "BSP and form factors" };
        let name = self.name(["1", "1'"], parallel_bsp, title);
        let first = if parallel_bsp { Task::Partition { node: 0, first: 0 } } else { Task::Insert { at: 0 } };
        phase!(self, name, 0, |worker| {
            worker.begin(1).await;
            if parallel_bsp {
                worker.list_polygons().await;
                worker.barrier().await;
            }
            if worker.is_first() {
                worker.deal(0, first).await;
            }
            worker.run_tasks().await;
            worker.barrier().await;
        });
        if pair_loop {
            let name = PhaseName { number: "1''", title: "initial pairs", iteration: None };
            phase!(self, name, 0, |worker| {
                worker.begin(0).await;
                worker.pair_loop().await;
                worker.barrier().await;
            });
        } else if parallel_bsp {
            let name = PhaseName { number: "1", title: "form factors", iteration: None };
            phase!(self, name, 0, |worker| {
                let roots = &worker.cx.problem.active_roots;
                worker.begin(roots.len() as u64).await;
                worker.deal_all(roots, |at, root| Task::Factors { root, at: at as u32 }).await;
                worker.run_tasks().await;
                worker.barrier().await;
            });
        }
        Ok(())
    }

    /// Phase 2: refinement and gathering in turn, until the total settles.
    fn iterate(&mut self, max_iterations: u32) -> Result<(), ScheduleError> {
        let epsilon = match self.context.problem.parameters.stop {
            Stop::Change(epsilon) | Stop::Remainder(epsilon) => epsilon,
        };
        let mut before = self.total(0, 0);
        for iteration in 0..max_iterations {
            let name = match self.context.flat {
                Some(_) => PhaseName { number: "iteration", title: "iteration", iteration: None },
                None => self.name(["2", "2'"], self.context.switches.fine_tasks, "iteration"),
            };
            let name = PhaseName { iteration: Some(iteration + 1), ..name };
            let mean = before.mean();
            let tally = match self.context.flat {
                Some(flat) => phase!(self, name, iteration, |worker| {
                    worker.begin_rounds().await;
                    worker.rounds(&flat).await;
                    worker.gather_rows(&flat).await;
                    worker.measure(mean).await;
                }),
                None => phase!(self, name, iteration, |worker| {
                    let roots = &worker.cx.problem.active_roots;
                    worker.begin(roots.len() as u64).await;
                    worker.deal_all(roots, |_, element| Task::Refine { element }).await;
                    worker.run_tasks().await;
                    worker.barrier().await;
                    worker.measure(mean).await;
                }),
            };
            before = self.total(iteration, 1);
            let residual = f64::from_bits(self.count(Counter::Residual));
            self.outcome.links = match self.context.flat {
                Some(_) => self.outcome.links + self.count(Counter::Fresh),
                None => self.count(Counter::Links),
            };
            let (links, elements) = (self.outcome.links, self.count(Counter::Elements));
            self.outcome.iterations.push(IterationOutcome { total: before, residual, tally, links, elements });
            self.outcome.converged = residual <= epsilon;
            if self.outcome.converged {
                break;
            }
        }
        Ok(())
    }

    /// Phase 3: values at vertices.
    fn interpolate(&mut self) -> Result<(), ScheduleError> {
        let in_loop = self.context.switches.interpolation_loop;
        let name = match self.context.flat {
            Some(_) => PhaseName { number: "interpolation", title: "interpolation", iteration: None },
            None => self.name(["3", "3'"], in_loop, "interpolation"),
        };
        let last = (self.outcome.iterations.len() as u32).saturating_sub(1);
        phase!(self, name, last, |worker| {
            let roots = &worker.cx.problem.active_roots;
            worker.begin(if in_loop { 0 } else { roots.len() as u64 }).await;
            if in_loop {
                worker.interpolation_loop().await;
            } else {
                worker.deal_all(roots, |_, element| Task::Interpolate { element }).await;
                worker.run_tasks().await;
            }
            worker.barrier().await;
        });
        Ok(())
    }

    /// Sum of area times radiosity over the roots, of the slot that an iteration reads (0) or writes (1).
    fn total(&self, iteration: u32, which: usize) -> Rgb {
        let problem = self.context.problem;
        let slot = Store::slots(problem.parameters.update, iteration)[which];
        let light = |root: u32| {
            let words = [0, 1, 2].map(|k| self.machine.peek(self.context.store.element(root, slot + k)));
            store::rgb(words) * problem.place(Path::root(root)).area
        };
        tree_sum(&(0..problem.roots() as u32).map(light).collect::<Vec<Rgb>>(), Rgb::ZERO)
    }

    fn finish(mut self) -> Outcome {
        let Solve { machine, context, outcome, .. } = &mut self;
        let store = &context.store;
        let last = (outcome.iterations.len() as u32).saturating_sub(1);
        let slot = Store::slots(context.problem.parameters.update, last)[1];
        let words = |at: isolux_machine::Address| machine.peek(at);
        let elements = words(store.counter(Counter::Elements)) as u32;
        for element in 0..elements {
            let path = Store::path(words(store.element(element, store::PATH)));
            let rgb = store::rgb([0, 1, 2].map(|k| words(store.element(element, slot + k))));
            outcome.radiosity.push((path, rgb));
            if words(store.element(element, store::FIRST_CHILD)) == 0 {
                let corners = context.problem.place(path).corners.len() as u64;
                let value = |corner| store::rgb([0, 1, 2].map(|k| words(store.vertex_word(element, corner, k))));
                outcome.vertices.push((path, (0..corners).map(value).collect()));
            }
        }
        outcome.radiosity.sort_unstable_by_key(|&(path, _)| path);
        outcome.vertices.sort_unstable_by_key(|&(path, _)| path);
        let nodes = context.problem.bsp.nodes().len() as u32;
        let node = |node: u32| {
            [store::FOUNDER, store::FRONT, store::BACK, store::IN_PLANE].map(|word| words(store.node(node, word)))
        };
        outcome.nodes = (0..nodes).map(node).collect();
        self.outcome
    }
}

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// Puts one of a phase's first tasks into a queue, or runs it.
    async fn deal(&self, to: usize, task: Task) {
        if self.cx.queues.deal(&self.p, to, task).await.is_err() {
            Box::pin(self.run(task)).await;
            self.cx.queues.finish(&self.p).await;
        }
    }

    /// Puts a task for every root: one processor all of them, four roots to a queue, as SPLASH-2 does; or everyone a share
    /// into the queue for all.
    async fn deal_all(&self, roots: &[u32], task: impl Fn(usize, u32) -> Task) {
        let before = self.p.enter(Mark::new(Cause::Queue, "deal"));
        if self.cx.switches.parallel_queue {
            parallel_for(&self.p, &self.cx.loops[1], roots.len() as u64, 1, async |at| {
                self.deal(0, task(at as usize, roots[at as usize])).await;
            })
            .await;
        } else if self.is_first() {
            for (at, &root) in roots.iter().enumerate() {
                self.deal(at / 4, task(at, root)).await;
            }
        }
        self.p.enter(before);
    }
}
