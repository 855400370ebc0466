//! How a long computation tells what is left to do, and hears that it should stop.

/// What is being done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Inserting polygons in the BSP tree.
    Tree,
    /// Tracing a few paths for the scene's mean irradiance.
    Pilot,
    /// Form factors and visibilities between roots.
    RootLinks,
    /// Refining links and gathering over them.
    Iteration,
    /// Smooth values at vertices.
    Interpolation,
    /// Rays that check the energy balance.
    Balance,
    /// Drawing a picture.
    Render,
    /// Gathering light at points.
    Measure,
}

/// State of a computation.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// What is being done.
    pub phase: Phase,
    /// Share of the whole computation that is done, in `[0, 1]`, in units of estimated work; never decreases.
    pub done: f64,
    /// Iterations finished.
    pub iteration: u32,
    /// Relative change of total radiosity in the last iteration; infinite before the first has ended.
    pub residual: f64,
    /// Elements so far.
    pub elements: usize,
    /// Links so far.
    pub links: usize,
}

impl Progress {
    /// Nothing is done yet.
    #[must_use]
    pub fn of(phase: Phase) -> Progress {
        Progress { phase, done: 0.0, iteration: 0, residual: f64::INFINITY, elements: 0, links: 0 }
    }
}

/// What an observer answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Go on.
    Continue,
    /// Stop as soon as the state is consistent.
    Stop,
}

/// Watches a computation. Called every few milliseconds at the latest (see [`Watch`]): must be quick.
pub trait Observer {
    /// Takes note of the state; the answer is obeyed within a millisecond or so.
    fn observe(&mut self, progress: &Progress) -> Flow;
}

/// Watches nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unobserved;

impl Observer for Unobserved {
    fn observe(&mut self, _progress: &Progress) -> Flow {
        Flow::Continue
    }
}

/// Work between two calls of an observer, in units of a visibility (some microseconds): about a millisecond.
pub const WATCH_INTERVAL: f64 = 256.0;

/// Asks an observer now and then, from the inside of a loop.
///
/// A loop tells it the work of every step; the observer is asked whenever that has added up to [`WATCH_INTERVAL`]. So no
/// more time passes between two questions than that interval and one step take.
pub struct Watch<'a> {
    observer: &'a mut dyn Observer,
    progress: Progress,
    work: f64,
    stopped: bool,
}

impl<'a> Watch<'a> {
    /// A watch over a computation that stands at `progress`.
    pub fn new(observer: &'a mut dyn Observer, progress: Progress) -> Watch<'a> {
        Watch { observer, progress, work: 0.0, stopped: false }
    }

    /// A step of so much work has been done, which makes it `done` in all. Once the observer has said stop, so does
    /// this, without asking again.
    pub fn step(&mut self, work: f64, done: f64) -> Flow {
        self.work += work;
        if self.work >= WATCH_INTERVAL && !self.stopped {
            self.work = 0.0;
            self.progress.done = done.clamp(self.progress.done, 1.0);
            self.stopped = self.observer.observe(&self.progress) == Flow::Stop;
        }
        if self.stopped { Flow::Stop } else { Flow::Continue }
    }

    /// Asks now, whatever was done since the last time.
    pub fn ask(&mut self, done: f64) -> Flow {
        self.step(WATCH_INTERVAL, done)
    }
}
