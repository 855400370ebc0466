//! Pictures of a solve that goes on: what stands now and then comes in, packed for a viewer it goes out; when, and on which
//! thread, is decided here.

use crate::{Solution, SolveError, ViewLimits};
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Least time between the beginnings of two pictures: fast stages at the beginning are not worth more.
const INTERVAL: Duration = Duration::from_millis(500);

/// What a picture of a solve that goes on holds at most: a page keeps some of them.
const LIMITS: ViewLimits = ViewLimits { links: 500_000, field_bytes: 64 << 20, groups: false };

/// What stands at the end of a stage or an iteration, packed for a viewer.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Stages (`wavefront`) or iterations (`sequential`) that are finished; 1 after the first.
    pub stage: u32,
    /// Elements.
    pub elements: u64,
    /// Links.
    pub links: u64,
    /// How wrong it may be, relative to the mean irradiance; none where nothing is claimed yet.
    pub error: Option<f64>,
    /// As [`Solution::view_data`] packs it, with all light as one column and at most half a million links and 64 MiB of
    /// fields. Its report says `cancelled`, as that of a solve that ended here would.
    pub data: Vec<u8>,
}

/// Who looks: called on a thread of its own, with one picture after the other.
pub type Onlooker = Box<dyn Fn(Picture) + Send>;

/// Makes a solution of what was copied.
pub(crate) type Job = Box<dyn FnOnce() -> Solution + Send>;

/// Packs pictures on a thread of its own, one at a time; what comes while it is busy is left out. Where nobody looks it does
/// nothing.
#[derive(Default)]
pub(crate) struct Packer {
    working: Option<Working>,
    last: Option<Instant>,
}

struct Working {
    jobs: Sender<Job>,
    /// Set by whoever gives a job, cleared when that is done. It guards nothing.
    is_busy: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Packer {
    /// Starts the thread if somebody looks.
    pub(crate) fn start(onlooker: Option<Onlooker>) -> Result<Packer, SolveError> {
        let Some(onlooker) = onlooker else { return Ok(Packer::default()) };
        let refused = |error: String| SolveError::Internal(format!("no thread for pictures: {error}"));
        // All cores belong to the solve: a picture takes a part of one.
        let pool =
            rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| refused(error.to_string()))?;
        let (jobs, given) = channel::<Job>();
        let is_busy = Arc::new(AtomicBool::new(false));
        let busy = is_busy.clone();
        let work = move || {
            for job in given {
                onlooker(pool.install(|| picture(&job())));
                busy.store(false, Ordering::Relaxed);
            }
        };
        let thread = std::thread::Builder::new().name("pictures".into()).spawn(work);
        let thread = thread.map_err(|error| refused(error.to_string()))?;
        Ok(Packer { working: Some(Working { jobs, is_busy, thread }), last: None })
    }

    /// Packs what `copy` copies, if somebody looks, the last picture is done, and it was begun half a second ago. Else nothing is
    /// copied.
    pub(crate) fn offer(&mut self, copy: impl FnOnce() -> Job) {
        let Some(Working { jobs, is_busy, .. }) = &self.working else { return };
        if is_busy.load(Ordering::Relaxed) || self.last.is_some_and(|last| last.elapsed() < INTERVAL) {
            return;
        }
        self.last = Some(Instant::now());
        is_busy.store(true, Ordering::Relaxed);
        // If its thread was lost, that is told in the end.
        let _ = jobs.send(copy());
    }

    /// Waits for the picture that is being packed: none comes after this. A panic of its thread goes on here.
    pub(crate) fn finish(self) {
        let Some(Working { jobs, thread, .. }) = self.working else { return };
        drop(jobs);
        if let Err(panic) = thread.join() {
            resume_unwind(panic);
        }
    }
}

fn picture(solution: &Solution) -> Picture {
    let report = solution.report();
    Picture {
        stage: report.stages.len().max(report.iterations.len()) as u32,
        elements: report.elements,
        links: report.links.total,
        error: report.error_estimate.map(|estimate| estimate.total),
        data: solution.view_data(&LIMITS),
    }
}
