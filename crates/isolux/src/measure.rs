//! Light at points in the air: a solution, points and what takes light in there go in, irradiances with standard errors come
//! out, by rays, on all cores.

use crate::pace::Pace;
use crate::{MeasureError, Solution};
use isolux_core::DVec3;
use isolux_core::sampling::{Stream, mix};
use isolux_core::solution::{Flow, Observer, Phase, Progress};
use isolux_core::units::Rgb;
use isolux_wavefront::{FinalGather, Outlook, Receiver};
use rayon::prelude::*;

/// How to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasureSettings {
    /// Rays around each point, at least, in all gathers together, and half as many to emitters.
    pub rays: u32,
    /// What each band counts in the one number whose error is told beside those of the bands.
    pub weights: Rgb,
    /// Threads; 0: all cores. Never changes a result.
    pub threads: usize,
}

/// What arrives at a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Received {
    /// Irradiance, W/m² or lm/m².
    pub irradiance: Rgb,
    /// Its standard error, by band: what the choice of rays may leave wrong. How wrong the solved light is that they read is
    /// the solution's to tell.
    pub standard_error: Rgb,
    /// Standard error of the sum of bands by their weights.
    pub total_error: f64,
}

/// Gathers of a point that know nothing of each other: the scatter of their results is what the standard error is told by. Of
/// eight it is known to a quarter of itself; strata of fewer, finer gathers would leave less noise, and less to tell it by.
const GATHERS: u32 = 8;

/// Most rays around a point: those of a pixel.
const MOST_RAYS: u32 = crate::render::MOST_RAYS;

/// Sets the streams of points in the air apart from others of the same seed.
const POINTS: u64 = 0x0061_6972_706f_696e;
const LOOKS: u64 = 0x6c6f_6f6b_7321;

/// How far a unit vector may be from unit length, and two from a right angle: single precision misses it by 2e-7, degrees
/// that were rounded to a tenth by 2e-3.
const UNIT: f64 = 1e-5;
const RIGHT_ANGLE: f64 = 2e-3;

/// Irradiance of receivers at points, which may lie anywhere: one value for each. `receivers`: as many as points.
///
/// Lamps without a surface come by shadow rays, emitters and reflected light as in a final gather ([`FinalGather::received`]);
/// from directions in which nothing is met comes nothing. Equal points and receivers have equal values in every run, whatever
/// else is asked beside them, with any number of threads.
///
/// # Errors
/// [`MeasureError`] naming the point or direction that makes no sense, and when the observer stops it, which is asked every
/// 10 ms or so.
pub fn measure(
    solution: &Solution,
    points: &[DVec3],
    receivers: &[Receiver],
    settings: &MeasureSettings,
    observer: &mut dyn Observer,
) -> Result<Vec<Received>, MeasureError> {
    let MeasureSettings { rays, weights, threads } = *settings;
    if !(GATHERS..=MOST_RAYS).contains(&rays) {
        return Err(MeasureError::Rays { rays, least: GATHERS, most: MOST_RAYS });
    }
    if points.len() != receivers.len() {
        return Err(MeasureError::Count { points: points.len(), receivers: receivers.len() });
    }
    check_points(points)?;
    receivers.iter().enumerate().try_for_each(|(index, receiver)| check_receiver(index, receiver))?;
    let pool = Pool::new(solution, threads)?;
    let gather = pool.install(|| FinalGather::new(solution.tracer(), rays.div_ceil(GATHERS), 1));
    let seed = mix(solution.report.settings.seed ^ POINTS);
    pool.each(points.len(), observer, |index| {
        let (point, receiver) = (points[index], &receivers[index]);
        let name = named(named(seed, point), direction_of(receiver));
        let found: [Rgb; GATHERS as usize] = std::array::from_fn(|number| {
            let mut stream = Stream::new(mix(name ^ number as u64));
            let solved = |side, place| solution.solved(side, place);
            gather.received(point, receiver, 0, &mut stream, &solved)
        });
        scattered(&found, weights)
    })
}

/// What points see around them, see [`Outlook::is_out`].
///
/// # Errors
/// As [`measure`].
pub fn looks(
    solution: &Solution,
    points: &[DVec3],
    threads: usize,
    observer: &mut dyn Observer,
) -> Result<Vec<Outlook>, MeasureError> {
    check_points(points)?;
    let pool = Pool::new(solution, threads)?;
    let seed = mix(solution.report.settings.seed ^ LOOKS);
    let (scene, tracer) = (&*solution.scene, solution.tracer());
    let is_dark = |side: u32, place| {
        scene.polygons[side as usize].emission == Rgb::ZERO && solution.solved(side, place) == Rgb::ZERO
    };
    pool.each(points.len(), observer, |index| {
        let mut stream = Stream::new(named(seed, points[index]));
        tracer.outlook(points[index], &mut stream, &is_dark)
    })
}

/// Mean and standard error of gathers.
fn scattered(found: &[Rgb], weights: Rgb) -> Received {
    let count = found.len() as f64;
    let irradiance = found.iter().copied().sum::<Rgb>() / count;
    let total = |value: Rgb| (value * weights).0.iter().sum::<f64>();
    let (mut squares, mut of_total) = (Rgb::ZERO, 0.0);
    for &value in found {
        let apart = value - irradiance;
        squares += apart * apart;
        of_total += total(apart) * total(apart);
    }
    let error = |square: f64| (square / (count * (count - 1.0))).sqrt();
    Received { irradiance, standard_error: squares.map(error), total_error: error(of_total) }
}

/// A seed that goes by a place's name: its coordinates.
fn named(seed: u64, place: DVec3) -> u64 {
    // Both zeros are one place.
    place.to_array().iter().fold(seed, |seed, &along| mix(seed ^ (along + 0.0).to_bits()))
}

/// What tells receivers of one kind apart; those of two kinds differ anyway.
fn direction_of(receiver: &Receiver) -> DVec3 {
    match *receiver {
        Receiver::Plane(normal) => normal,
        Receiver::Cylinder(axis) => axis,
        Receiver::SemiCylinder { axis, facing } => axis + facing * 2.0,
    }
}

fn check_points(points: &[DVec3]) -> Result<(), MeasureError> {
    match points.iter().position(|point| !point.is_finite()) {
        Some(index) => Err(MeasureError::Point { index, point: points[index] }),
        None => Ok(()),
    }
}

fn check_receiver(index: usize, receiver: &Receiver) -> Result<(), MeasureError> {
    let check = |what, direction: DVec3| {
        let is_unit = (direction.length_squared() - 1.0).abs() <= 2.0 * UNIT;
        let expected = "a unit vector";
        if is_unit { Ok(()) } else { Err(MeasureError::Direction { what, index, direction, expected }) }
    };
    match *receiver {
        Receiver::Plane(normal) => check("normals", normal),
        Receiver::Cylinder(axis) => check("axes", axis),
        Receiver::SemiCylinder { axis, facing } => {
            check("axes", axis)?;
            check("facing", facing)?;
            let expected = "a direction across the axis";
            if axis.dot(facing).abs() <= RIGHT_ANGLE {
                Ok(())
            } else {
                Err(MeasureError::Direction { what: "facing", index, direction: facing, expected })
            }
        }
    }
}

/// Threads that go through a list in portions, of which the observer hears.
struct Pool {
    threads: rayon::ThreadPool,
    elements: usize,
}

impl Pool {
    /// Threads, and a solution that is ready for all of them.
    fn new(solution: &Solution, threads: usize) -> Result<Pool, MeasureError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = Pool {
            threads: pool.map_err(|_| MeasureError::Threads { threads })?,
            elements: solution.hierarchy.elements.len(),
        };
        // Surfaces may be made when they are first asked for: not by every thread at once.
        pool.install(|| solution.prepare(true));
        Ok(pool)
    }

    fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.threads.install(work)
    }

    /// One value for each index below `count`, in their order.
    fn each<T: Send>(
        &self,
        count: usize,
        observer: &mut dyn Observer,
        value: impl Fn(usize) -> T + Sync,
    ) -> Result<Vec<T>, MeasureError> {
        let mut pace = Pace::starting(self.threads.current_num_threads());
        let mut values = Vec::with_capacity(count);
        loop {
            let done = if count == 0 { 1.0 } else { values.len() as f64 / count as f64 };
            let state = Progress { done, elements: self.elements, ..Progress::of(Phase::Measure) };
            if observer.observe(&state) == Flow::Stop {
                return Err(MeasureError::Cancelled);
            }
            if values.len() == count {
                return Ok(values);
            }
            let portion = values.len()..(values.len() + pace.size()).min(count);
            pace.begin();
            values.extend(self.install(|| portion.into_par_iter().map(&value).collect::<Vec<T>>()));
            pace.end();
        }
    }
}
