//! Pictures of a solution by ray casting, on all cores.

use crate::pace::Pace;
use crate::{RenderError, Solution};
use isolux_core::DVec3;
use isolux_core::sampling::{Stream, mix};
use isolux_core::scene::{Camera, Projection, Scene, Sky};
use isolux_core::solution::{Flow, Observer, Phase, Progress};
use isolux_core::units::Rgb;
use isolux_wavefront::FinalGather;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Where to look from.
#[derive(Clone, Debug, PartialEq)]
pub enum View {
    /// The scene's first camera, or a computed view where it has none.
    Default,
    /// A camera of the scene, by name.
    Camera(String),
    /// From a point to a point, +Y up.
    LookAt {
        /// Eye point, metres.
        eye: DVec3,
        /// Point looked at, metres.
        at: DVec3,
        /// Vertical field of view, radians.
        vertical_angle: f64,
    },
}

/// How to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RenderSettings {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples per pixel are the square of this.
    pub samples_per_side: u32,
    /// Rays of a final gather per pixel, spread over its samples, and half as many to lights: the irradiance that rays find
    /// stands for what lies between the values at vertices. None: no gather.
    pub gather: Option<u32>,
    /// Threads; 0: all cores. Never changes a result.
    pub threads: usize,
}

/// Surfaces that a camera ray passes before it is given up: stacked panes of glass.
const MAX_LAYERS: usize = 64;

/// Light that still passes stacked panes is lost below this share: half a step of an 8-bit picture.
const LEAST_TRANSMITTANCE: f64 = 1.0 / 512.0;

/// Vertical opening of computed views, radians (60 degrees).
const DEFAULT_ANGLE: f64 = PI / 3.0;

/// By how much more than needed a computed view stands away from what it shows.
const MARGIN: f64 = 1.05;

/// Rays that tell whether an eye stands in a room.
const ROOM_RAYS: usize = 256;

/// Share of them that meets lit sides in a room; measured: 0.64 and more in the rooms of `scenes`, one of which has no
/// front, 0.53 in a cupboard, 0.46 and less in the open beside models.
const ROOM_SHARE: f64 = 0.6;

/// Of what an eye in a room sees, a quarter is at least so far away, relative to half the diagonal of the scene's
/// bounding box; measured: 0.27 and more in the rooms of `scenes`, 0.05 inside the top of a table.
const LEAST_ROOM: f64 = 0.15;

/// Largest picture, pixels: 16,384 squared, 6 GB of linear values.
const MAX_PIXELS: u64 = 1 << 28;

/// Draws linear radiance (radiosity over pi), row by row from the top. Single-sided surfaces are not there seen from
/// behind; where a ray leaves the scene the picture shows the sky and the ground, and is black without a sky.
///
/// # Errors
/// [`RenderError`] for views that make no sense and when the observer stops it, which is asked every 10 ms or so.
pub fn render(
    solution: &Solution,
    view: &View,
    settings: &RenderSettings,
    observer: &mut dyn Observer,
) -> Result<Vec<Rgb>, RenderError> {
    let RenderSettings { width, height, samples_per_side, gather, threads } = *settings;
    let nonsense = |what: String| RenderError::View { what };
    if width == 0 || height == 0 || u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(nonsense(format!("a picture of {width} x {height} pixels (1 to {MAX_PIXELS} in all)")));
    }
    if samples_per_side == 0 || samples_per_side > 64 {
        return Err(nonsense(format!("{samples_per_side} samples per side of a pixel (1 to 64)")));
    }
    check_rays(gather)?;
    let camera = resolve(solution, view)?;
    let aspect = f64::from(width) / f64::from(height);
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|_| RenderError::Threads { threads })?;
    let mut picture = vec![Rgb::ZERO; width as usize * height as usize];
    // Surfaces may be made when they are first asked for: not by every thread at once.
    let prepare = || gather.map(|rays| FinalGather::new(solution.tracer(), rays, samples_per_side));
    let gather = pool.install(|| {
        solution.prepare(gather.is_some());
        prepare()
    });
    let beyond = Beyond::new(&solution.scene);
    let beyond = |direction: DVec3| beyond.radiance(direction);
    let seed = mix(solution.report.settings.seed ^ PIXELS);
    let mut pace = Pace::starting(pool.current_num_threads());
    let mut done = 0;
    while done < picture.len() {
        let portion = pace.size().min(picture.len() - done);
        let pixels = &mut picture[done..done + portion];
        pace.begin();
        pool.install(|| {
            pixels.par_iter_mut().enumerate().for_each(|(index, pixel)| {
                let (column, row) = ((done + index) % width as usize, (done + index) / width as usize);
                let mut sum = Rgb::ZERO;
                let mut stream = Stream::new(seed ^ (done + index) as u64);
                for sample in 0..samples_per_side * samples_per_side {
                    let offset = |k: u32| (f64::from(k) + 0.5) / f64::from(samples_per_side);
                    let x = (column as f64 + offset(sample % samples_per_side)) / f64::from(width);
                    let y = (row as f64 + offset(sample / samples_per_side)) / f64::from(height);
                    let (origin, direction) = camera_ray(&camera, aspect, 2.0 * x - 1.0, 1.0 - 2.0 * y);
                    let mut irradiance = |side, position| match &gather {
                        Some(gather) => {
                            let solved = |side, place| solution.solved(side, place);
                            gather.irradiance(position, side, sample, &mut stream, &solved)
                        }
                        None => solution.surfaces().irradiance(&solution.scene, side, position),
                    };
                    sum += radiance(solution, origin, direction, &mut irradiance, &beyond);
                }
                *pixel = sum / f64::from(samples_per_side * samples_per_side);
            });
        });
        pace.end();
        done += portion;
        let share = done as f64 / picture.len() as f64;
        let elements = solution.hierarchy.elements.len();
        if observer.observe(&Progress { done: share, elements, ..Progress::of(Phase::Render) }) == Flow::Stop {
            return Err(RenderError::Cancelled);
        }
    }
    Ok(picture)
}

/// Most rays of a final gather at one place: noise is a 256th of what it is by one.
pub(crate) const MOST_RAYS: u32 = 65_536;

/// Sets the streams of pixels apart from others of the same seed.
const PIXELS: u64 = 0x7069_7865_6c73;

/// Refuses gathers by no rays, and by more than make sense.
pub(crate) fn check_rays(gather: Option<u32>) -> Result<(), RenderError> {
    match gather {
        Some(rays) if rays == 0 || rays > MOST_RAYS => Err(RenderError::Gather { rays, most: MOST_RAYS }),
        _ => Ok(()),
    }
}

pub(crate) fn resolve(solution: &Solution, view: &View) -> Result<Camera, RenderError> {
    let cameras = &solution.scene.cameras;
    match view {
        View::Default => Ok(cameras.first().cloned().unwrap_or_else(|| best_view(solution))),
        View::Camera(name) => cameras.iter().find(|camera| camera.name == *name).cloned().ok_or_else(|| {
            let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
            let available = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            RenderError::NoSuchCamera { name: name.clone(), available }
        }),
        &View::LookAt { eye, at, vertical_angle } => {
            let sound = eye.is_finite() && at.is_finite() && eye.distance(at) > 0.0;
            if !sound {
                return Err(RenderError::View { what: format!("eye {eye} and target {at} must be two points") });
            }
            if !(vertical_angle > 0.0 && vertical_angle < PI) {
                let degrees = vertical_angle.to_degrees();
                return Err(RenderError::View { what: format!("a field of view of {degrees} degrees (0 to 180)") });
            }
            Ok(look_at(eye, at, vertical_angle))
        }
    }
}

fn look_at(eye: DVec3, at: DVec3, vertical_angle: f64) -> Camera {
    let forward = (at - eye).normalize();
    // Looking straight up or down, the picture's up is -z.
    let upright = if forward.cross(DVec3::Y).length() < 1e-9 { DVec3::NEG_Z } else { DVec3::Y };
    let right = forward.cross(upright).normalize();
    let projection = Projection::Perspective { vertical_angle };
    Camera { name: "computed".into(), eye, forward, up: right.cross(forward), projection }
}

/// A view for scenes without a camera. Where eyes just inside the bounding box's walls stand in a room, one of them;
/// else one from outside that shows it all. Of several the one whose picture shows most lit surface; from outside the
/// side of +Z, a glTF model's front, goes before the others unless they show a fifth more.
fn best_view(solution: &Solution) -> Camera {
    let scene = &solution.scene;
    let corners = || scene.polygons[..scene.fronts].iter().flat_map(|polygon| polygon.corners.iter());
    let low = corners().fold(DVec3::INFINITY, |low, corner| low.min(*corner));
    let high = corners().fold(DVec3::NEG_INFINITY, |high, corner| high.max(*corner));
    let (centre, half) = ((low + high) * 0.5, (high - low) * 0.5);
    let signs = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
    // A little above the middle.
    let inside = signs.map(|(x, z)| centre + half * DVec3::new(0.92 * x, 0.3, 0.92 * z));
    let rooms: Vec<Camera> = inside
        .into_iter()
        .filter(|&eye| stands_in_room(solution, eye, half.length()))
        .map(|eye| look_at(eye, centre, DEFAULT_ANGLE))
        .collect();
    let cameras = if rooms.is_empty() {
        signs.map(|(x, z)| from_outside(centre, half, DVec3::new(x, 0.7, z).normalize())).to_vec()
    } else {
        rooms
    };
    let shown = |camera: &Camera| {
        let at = |k: usize, of: usize| (2.0 * k as f64 + 1.0) / of as f64 - 1.0;
        let grid = (0..24).flat_map(|row| (0..32).map(move |column| (at(column, 32), at(row, 24))));
        let lit = grid.filter(|&(x, y)| {
            let (origin, direction) = camera_ray(camera, 4.0 / 3.0, x, y);
            let mut solved = |side, position| solution.solved(side, position);
            // The sky is no surface.
            radiance(solution, origin, direction, &mut solved, &|_| Rgb::ZERO) != Rgb::ZERO
        });
        // In fifths and sixths of a ray, so that whole numbers compare.
        lit.count() * if camera.eye.z > high.z { 6 } else { 5 }
    };
    let best = cameras.into_iter().map(|camera| (shown(&camera), camera)).reduce(|a, b| if b.0 > a.0 { b } else { a });
    best.map_or_else(|| from_outside(centre, half, DVec3::ONE.normalize()), |(_, camera)| camera)
}

/// From outside along a direction, so far away that a box of half the extents fits into a square picture.
fn from_outside(centre: DVec3, half: DVec3, direction: DVec3) -> Camera {
    let ahead = look_at(centre + direction, centre, DEFAULT_ANGLE);
    let right = ahead.forward.cross(ahead.up);
    let widest = (DEFAULT_ANGLE / 2.0).tan();
    let away = (0..8).fold(0.0_f64, |away, corner| {
        let sign = |bit: u32| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 };
        let corner = half * DVec3::new(sign(0), sign(1), sign(2));
        away.max(corner.dot(direction) + corner.dot(right).abs().max(corner.dot(ahead.up).abs()) / widest)
    });
    look_at(centre + direction * (MARGIN * away), centre, DEFAULT_ANGLE)
}

/// Does an eye stand in a room: are lit sides all around it, and some of them not near? `size` is half the diagonal of
/// the scene's bounding box.
fn stands_in_room(solution: &Solution, eye: DVec3, size: f64) -> bool {
    let (scene, tracer) = (&*solution.scene, solution.tracer());
    let mut distances: Vec<f64> = (0..ROOM_RAYS)
        .filter_map(|k| {
            // Evenly spread: equal steps of height, turned by the golden angle.
            let height = 1.0 - (2.0 * k as f64 + 1.0) / ROOM_RAYS as f64;
            let (across, turn) = ((1.0 - height * height).sqrt(), k as f64 * PI * (3.0 - 5.0_f64.sqrt()));
            let direction = DVec3::new(across * turn.cos(), height, across * turn.sin());
            let hit = tracer.closest(eye, direction, f64::INFINITY)?;
            let is_lit_side = hit.front_facing || scene.polygons[hit.polygon as usize].twin.is_some();
            is_lit_side.then_some(hit.distance)
        })
        .collect();
    distances.sort_by(f64::total_cmp);
    let far = distances.get(distances.len() * 3 / 4).is_some_and(|distance| *distance >= LEAST_ROOM * size);
    distances.len() as f64 >= ROOM_SHARE * ROOM_RAYS as f64 && far
}

/// Ray through a point of the picture; `x` to the right and `y` up, both in `[-1, 1]`.
fn camera_ray(camera: &Camera, aspect: f64, x: f64, y: f64) -> (DVec3, DVec3) {
    let right = camera.forward.cross(camera.up);
    match camera.projection {
        Projection::Perspective { vertical_angle } => {
            let scale = (vertical_angle / 2.0).tan();
            let direction = camera.forward + right * (x * aspect * scale) + camera.up * (y * scale);
            (camera.eye, direction.normalize())
        }
        Projection::Orthographic { height } => {
            let offset = right * (x * aspect * height / 2.0) + camera.up * (y * height / 2.0);
            (camera.eye + offset, camera.forward)
        }
    }
}

/// Sky and ground as camera rays see them.
struct Beyond<'a> {
    sky: Option<&'a Sky>,
    /// The ground's radiance.
    ground: Rgb,
}

impl Beyond<'_> {
    fn new(scene: &Scene) -> Beyond<'_> {
        Beyond { sky: scene.sky.as_ref(), ground: scene.ground_radiance() }
    }

    fn radiance(&self, direction: DVec3) -> Rgb {
        match self.sky {
            Some(sky) if sky.up.dot(direction) > 0.0 => sky.radiance_from(direction),
            Some(_) => self.ground,
            None => Rgb::ZERO,
        }
    }
}

/// Radiance that arrives along a ray. `irradiance`: at a point of a lit side. `beyond`: radiance from a direction in which there is
/// no surface any more.
fn radiance(
    solution: &Solution,
    origin: DVec3,
    direction: DVec3,
    irradiance: &mut impl FnMut(u32, DVec3) -> Rgb,
    beyond: &impl Fn(DVec3) -> Rgb,
) -> Rgb {
    let (scene, tracer) = (&*solution.scene, solution.tracer());
    let step = scene.tolerance();
    let (mut start, mut passing, mut sum) = (origin, 1.0, Rgb::ZERO);
    for _ in 0..MAX_LAYERS {
        let Some(hit) = tracer.closest(start, direction, f64::INFINITY) else {
            return sum + beyond(direction) * passing;
        };
        let position = start + direction * hit.distance;
        let surface = &scene.polygons[hit.polygon as usize];
        let side = if hit.front_facing { Some(hit.polygon) } else { surface.twin };
        if let Some(side) = side {
            let polygon = &scene.polygons[side as usize];
            let reflects = polygon.reflectance != Rgb::ZERO;
            let irradiance = if reflects { irradiance(side, position) } else { Rgb::ZERO };
            // Emission and reflectance of a cut-out are means over its holes; the texel that was hit is solid.
            let share = if surface.mask.is_some() { 1.0 / polygon.opacity } else { 1.0 };
            sum += (polygon.emission + polygon.reflectance * irradiance) * (share * passing / PI);
            passing *= if surface.mask.is_some() { 0.0 } else { 1.0 - polygon.opacity };
            if passing < LEAST_TRANSMITTANCE {
                break;
            }
        }
        start = position + direction * step;
    }
    sum
}
