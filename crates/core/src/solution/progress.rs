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

/// What an observer answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Go on.
    Continue,
    /// Stop as soon as the state is consistent.
    Stop,
}

/// Watches a computation. Called often (about every thousand kernel evaluations): must be quick.
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
