//! Light for lightmaps: places on sides of polygons go in, the irradiance at each comes out, and whether something covers it.
//! Where texels lie, and what files are made of them, is left to others.

use crate::pace::Pace;
use crate::render::check_rays;
use crate::{RenderError, Solution};
use isolux_core::DVec3;
use isolux_core::sampling::{Stream, mix};
use isolux_core::solution::{Flow, Observer, Phase, Progress, Unobserved, Watch, smoothing_groups};
use isolux_core::units::Rgb;
use isolux_wavefront::FinalGather;
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
    /// meet? Else they are smooth, as pictures show them, and blur shadows that are finer than elements.
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
        let seed = mix(self.report.settings.seed ^ TEXELS);
        let texel = |(index, &(side, point)): (usize, &(u32, DVec3))| {
            let covered = self.tracer().is_covered(point, side);
            let irradiance = match &rays {
                _ if !self.active[side as usize] => Rgb::ZERO,
                None if elements => self.solved(side, point),
                None => self.surfaces().irradiance(&self.scene, side, point),
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

    /// A group number per polygon: coplanar neighbours with a common edge, and nothing standing on it, are in one group, and
    /// light goes on smoothly across such edges.
    #[must_use]
    pub fn smoothing_groups(&self) -> Vec<u32> {
        let unasked = &mut Unobserved;
        let watch = &mut Watch::new(unasked, Progress::of(Phase::Render));
        smoothing_groups(&self.scene, self.tracer(), watch).unwrap_or_default()
    }
}
