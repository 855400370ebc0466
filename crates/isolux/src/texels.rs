//! Light for lightmaps: places on sides of polygons go in, the irradiance at each comes out, and whether something covers it.
//! Where texels lie, and what files are made of them, is left to others.

use crate::pace::Pace;
use crate::render::check_rays;
use crate::{RenderError, Solution};
use isolux_core::DVec3;
use isolux_core::sampling::{Stream, mix};
use isolux_core::scene::{Corners, Polygon};
use isolux_core::solution::{
    Flow, Observer, Obstacles, Phase, Progress, Unobserved, Watch, bilinear_coordinates, smoothing_groups,
};
use isolux_core::tree::ElementId;
use isolux_core::units::Rgb;
use isolux_wavefront::{FinalGather, irradiance_in};
use rayon::prelude::*;

/// What a texel shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Texel {
    /// Irradiance, W/m² or lm/m².
    pub irradiance: Rgb,
    /// Is the place inside something solid, or under another face in its plane? Nobody sees it then, and its irradiance is
    /// not one of the light around.
    pub covered: bool,
}

/// How texels are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TexelSettings {
    /// Rays of a final gather at each place, and half as many to lights; none: values that were solved.
    pub gather: Option<u32>,
    /// Without a gather: are they those of elements, as [`Solution::irradiance_at`] tells them, with steps where elements
    /// meet? Else they are smooth, as pictures show them, and blur shadows that are finer than elements; but a wall that
    /// stands on a line between elements keeps the light of its two sides apart.
    pub elements: bool,
    /// Threads; 0: all cores. Never changes a result.
    pub threads: usize,
}

/// Sets the streams of texels apart from others of the same seed.
const TEXELS: u64 = 0x7465_7865_6c73;

impl Solution {
    /// The light at places, each a side (a polygon of the scene, front or back) and a point on it, metres. A place just
    /// outside of its polygon has the light of the nearest one on it.
    ///
    /// # Errors
    /// [`RenderError`] for no rays or more than make sense, for a side that does not exist, and when the observer stops it,
    /// which is asked every 10 ms or so.
    pub fn texels(
        &self,
        places: &[(u32, DVec3)],
        settings: &TexelSettings,
        observer: &mut dyn Observer,
    ) -> Result<Vec<Texel>, RenderError> {
        let TexelSettings { gather, elements, threads } = *settings;
        check_rays(gather)?;
        let sides = self.scene.polygons.len();
        if let Some(&(side, _)) = places.iter().find(|(side, _)| *side as usize >= sides) {
            return Err(RenderError::NoSuchSide { side, sides });
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|_| RenderError::Threads { threads })?;
        let rays = pool.install(|| {
            self.prepare(gather.is_some() || elements);
            gather.map(|rays| FinalGather::new(self.tracer(), rays, 1))
        });
        let apart = if gather.is_some() || elements { Vec::new() } else { pool.install(|| self.apart(places)) };
        let seed = mix(self.report.settings.seed ^ TEXELS);
        let texel = |(index, &(side, point)): (usize, &(u32, DVec3))| {
            let covered = self.tracer().is_covered(point, side);
            let irradiance = match &rays {
                _ if !self.active[side as usize] => Rgb::ZERO,
                None if elements => self.solved(side, point),
                None => self.smooth(side, point, &apart),
                // Nobody sees it.
                Some(_) if covered => Rgb::ZERO,
                Some(rays) => {
                    let mut stream = Stream::new(seed ^ index as u64);
                    rays.irradiance(point, side, 0, &mut stream, &|side, place| self.solved(side, place))
                }
            };
            Texel { irradiance, covered }
        };
        let mut pace = Pace::starting(8 * pool.current_num_threads());
        let mut texels = Vec::with_capacity(places.len());
        while texels.len() < places.len() {
            let done = texels.len() as f64 / places.len() as f64;
            let elements = self.hierarchy.elements.len();
            if observer.observe(&Progress { done, elements, ..Progress::of(Phase::Render) }) == Flow::Stop {
                return Err(RenderError::Cancelled);
            }
            let from = texels.len();
            let portion = &places[from..(from + pace.size()).min(places.len())];
            pace.begin();
            let part = || portion.par_iter().enumerate().map(|(k, place)| texel((from + k, place))).collect();
            texels.extend(pool.install::<_, Vec<Texel>>(part));
            pace.end();
        }
        Ok(texels)
    }

    /// Smooth irradiance at a point of a side. `apart`: what [`Solution::apart`] found.
    fn smooth(&self, side: u32, point: DVec3, apart: &[Option<[Rgb; 4]>]) -> Rgb {
        let elements = &self.hierarchy.elements;
        let leaf = || elements.locate(ElementId(side), point);
        let found = if apart.is_empty() { None } else { Some(leaf()) };
        let Some((leaf, values)) = found.and_then(|leaf| Some((leaf, apart[leaf.index()]?))) else {
            return self.surfaces().irradiance(&self.scene, side, point);
        };
        let normal = self.scene.polygons[side as usize].plane.normal;
        let corners = &elements.get(leaf).corners;
        let weights = weights_in(corners, normal, point);
        values.iter().zip(weights).map(|(&value, weight)| value * weight).sum()
    }

    /// Values at the corners of leaves, by element, where a surface stands on one of them and parts the leaves around: that
    /// of the leaves on its own side of it. None for all others, and for leaves that hold none of the places.
    fn apart(&self, places: &[(u32, DVec3)]) -> Vec<Option<[Rgb; 4]>> {
        if self.transport.is_none() {
            return Vec::new();
        }
        let elements = &self.hierarchy.elements;
        let mut asked = vec![false; elements.len()];
        let leaves: Vec<ElementId> =
            places.par_iter().map(|&(side, point)| elements.locate(ElementId(side), point)).collect();
        leaves.into_iter().for_each(|leaf| asked[leaf.index()] = true);
        asked
            .par_iter()
            .enumerate()
            .map(|(index, &is_asked)| if is_asked { self.values_apart(ElementId(index as u32)) } else { None })
            .collect()
    }

    fn values_apart(&self, leaf: ElementId) -> Option<[Rgb; 4]> {
        let elements = &self.hierarchy.elements;
        let fields = &self.transport.as_ref()?.fields;
        let element = elements.get(leaf);
        let (side, corners) = (element.polygon, &element.corners);
        let polygon = &self.scene.polygons[side as usize];
        // Far enough from plane and corner that what is met does not count as touched.
        let reach = 8.0 * self.scene.tolerance();
        let count = corners.len();
        let mut values = [None; 4];
        for k in 0..count {
            let corner = corners[k];
            let step = |to: DVec3| (to - corner) * NEARBY;
            let (one, two) = (step(corners[(k + 1) % count]), step(corners[(k + count - 1) % count]));
            if one.length().min(two.length()) < 2.0 * reach {
                continue;
            }
            let own = corner + one + two;
            let mut around = vec![leaf];
            let mut is_parted = false;
            for other in [corner + one - two, corner - one + two, corner - one - two] {
                if !holds(polygon, other) {
                    continue;
                }
                let lift = polygon.plane.normal * reach;
                let way = other - own;
                if self.tracer().is_blocked(own + lift, way.normalize(), way.length()) {
                    is_parted = true;
                    continue;
                }
                let there = elements.locate(ElementId(side), other);
                if !around.contains(&there) && self.hierarchy.light.open_share(there) > 0.0 {
                    around.push(there);
                }
            }
            if is_parted {
                let value = |leaf: &ElementId| {
                    let corners = &elements.get(*leaf).corners;
                    irradiance_in(corners, polygon.plane.normal, corner, &fields[leaf.index()])
                };
                values[k] = Some(around.iter().map(value).sum::<Rgb>() / around.len() as f64);
            }
        }
        if values.iter().all(Option::is_none) {
            return None;
        }
        let smooth = |k: usize| self.surfaces().irradiance(&self.scene, side, corners[k]);
        Some(std::array::from_fn(|k| if k < count { values[k].unwrap_or_else(|| smooth(k)) } else { Rgb::ZERO }))
    }

    /// A group number per polygon: coplanar neighbours with a common edge, and nothing standing on it, are in one group, and
    /// light goes on smoothly across such edges.
    #[must_use]
    pub fn smoothing_groups(&self) -> Vec<u32> {
        let unasked = &mut Unobserved;
        let watch = &mut Watch::new(unasked, Progress::of(Phase::Render));
        smoothing_groups(&self.scene, self.tracer(), watch).unwrap_or_default()
    }
}

/// How far from a corner of a leaf its surroundings are looked at, as a share of the leaf's sides.
const NEARBY: f64 = 0.01;

/// Does a polygon hold a point of its plane?
fn holds(polygon: &Polygon, point: DVec3) -> bool {
    let corners = &polygon.corners;
    (0..corners.len()).all(|k| {
        let (from, to) = (corners[k], corners[(k + 1) % corners.len()]);
        polygon.plane.normal.dot((to - from).cross(point - from)) > 0.0
    })
}

/// What the corners of a leaf count at one of its points; one that rounding puts outside takes those of the border.
fn weights_in(corners: &Corners, normal: DVec3, point: DVec3) -> [f64; 4] {
    if corners.len() == 4 {
        let (s, t) = bilinear_coordinates([0, 1, 2, 3].map(|k| corners[k]), normal, point);
        return [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
    }
    let [a, b, c] = [0, 1, 2].map(|k| corners[k]);
    let whole = normal.dot((b - a).cross(c - a));
    let one = (normal.dot((b - point).cross(c - point)) / whole).clamp(0.0, 1.0);
    let two = (normal.dot((c - point).cross(a - point)) / whole).clamp(0.0, 1.0 - one);
    [one, two, 1.0 - one - two, 0.0]
}
