//! What a point in the air sees around it: is it in a room, inside something solid, or outside?

use crate::tracer::Tracer;
use glam::DVec3;
use isolux_core::sampling::Stream;
use std::f64::consts::PI;

/// Directions looked into, over the whole sphere, are the square of this: a share of a half is off by a sixteenth at most,
/// mostly by far less, for they are spread evenly.
const SIDE: usize = 8;

/// Surfaces that a look passes which let light pass.
const MOST_LAYERS: usize = 64;

/// Shares of all directions from a point, by what is met there first; panes are looked through.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outlook {
    /// Sides that surfaces have and that light may reach.
    pub fronts: f64,
    /// Such sides where they lie under something else, or inside it.
    pub covered: f64,
    /// Backs without a lit side, and backs that no light reaches.
    pub backs: f64,
    /// Nothing.
    pub open: f64,
}

/// Backs that count a point out are this share of all that it meets at least, and this many times the fronts. A point on a
/// box's top sees as many backs through it as fronts above, one inside a box without a bottom as much covered floor as backs,
/// one in a room no backs but those of thin things: three times are far from both.
const LEAST_BACKS: f64 = 0.25;
const BACKS_PER_FRONT: f64 = 3.0;

impl Outlook {
    /// Is the point no place where people could measure: inside something solid, or behind a room's walls? Its backs outweigh
    /// what has a lit side; or nothing is to be seen at all.
    #[must_use]
    pub fn is_out(&self) -> bool {
        let met = self.fronts + self.covered + self.backs;
        met == 0.0 || self.backs >= LEAST_BACKS * met && self.backs >= BACKS_PER_FRONT * self.fronts
    }
}

impl Tracer {
    /// Looks around a point. `is_dark`: does no light reach a side there?
    pub fn outlook(&self, point: DVec3, stream: &mut Stream, is_dark: &impl Fn(u32, DVec3) -> bool) -> Outlook {
        let (mut backs, mut open, mut fronts) = (0, 0, Vec::new());
        for stratum in 0..SIDE * SIDE {
            let mut within = |part: usize| (part as f64 + stream.next_unit()) / SIDE as f64;
            let (rise, around) = (1.0 - 2.0 * within(stratum / SIDE), 2.0 * PI * within(stratum % SIDE));
            let run = (1.0 - rise * rise).max(0.0).sqrt();
            let (sine, cosine) = libm::sincos(around);
            match self.seen(point, DVec3::new(run * cosine, rise, run * sine)) {
                None => open += 1,
                Some(None) => backs += 1,
                Some(Some((side, place, is_front))) if !is_front && is_dark(side, place) => backs += 1,
                Some(Some((side, place, _))) => fronts.push((side, place)),
            }
        }
        // Asked only where it can change the verdict: it takes rays of its own.
        let is_doubtful = backs as f64 >= LEAST_BACKS * (fronts.len() + backs) as f64;
        let is_covered = |&&(side, place): &&(u32, DVec3)| is_doubtful && self.is_covered(place, side);
        let covered = fronts.iter().filter(is_covered).count();
        let share = |count: usize| count as f64 / (SIDE * SIDE) as f64;
        Outlook {
            fronts: share(fronts.len() - covered),
            covered: share(covered),
            backs: share(backs),
            open: share(open),
        }
    }

    /// The first thing along a direction that is no pane: nothing, a back without a lit side, or a side, where, and whether from
    /// its front.
    fn seen(&self, point: DVec3, direction: DVec3) -> Option<Option<(u32, DVec3, bool)>> {
        let scene = &*self.geometry.scene;
        let mut start = point;
        for _ in 0..MOST_LAYERS {
            let meeting = self.closest(start, direction, f64::INFINITY)?;
            let place = start + direction * meeting.distance;
            let met = &scene.polygons[meeting.polygon as usize];
            if met.mask.is_some() || met.opacity >= 1.0 {
                let side = if meeting.front_facing { Some(meeting.polygon) } else { met.twin };
                return Some(side.map(|side| (side, place, meeting.front_facing)));
            }
            start = place + direction * f64::from(self.geometry.tolerance);
        }
        None
    }
}
