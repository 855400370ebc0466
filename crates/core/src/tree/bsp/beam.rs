//! Beams: all rays between two patches walk the BSP tree together; the patches' boxes go in, the fragments that may
//! block come out, each with a verdict that holds for every ray (D8); counting rays is left to the visibility kernel.

#![expect(clippy::needless_range_loop, reason = "three coordinates of several points, side by side")]

use super::surface::projection;
use super::{Bsp, MARGIN, ROUNDING, Segment, Stack, Surface};
use crate::kernels::Probe;
use crate::scene::{Corners, Plane, Scene};
use std::ops::ControlFlow;

/// The hull of all segments from one box to another, and how near to its ends hits do not count.
#[derive(Clone, Debug)]
pub(crate) struct Beam {
    /// Middles and half sizes of the boxes around the two patches.
    from: [f64; 3],
    from_half: [f64; 3],
    to: [f64; 3],
    to_half: [f64; 3],
    /// Box around both, as twice its middle and twice its half size.
    middle_2: [f64; 3],
    half_2: [f64; 3],
    /// From middle to middle.
    axis: [f64; 3],
    axis_size: [f64; 3],
    /// Twice the half width of the hull seen along each coordinate axis, times the length of `axis` seen so.
    width_2: [f64; 3],
    /// Limits of the rays' own `t_min` and `t_max`: no ray counts hits outside of `outer`, every ray does inside of
    /// `inner`.
    outer: [f64; 2],
    inner: [f64; 2],
    rounding: f64,
}

/// What a polygon does to the rays of a beam.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Some may meet it.
    Maybe,
    /// All meet it.
    All,
}

impl Beam {
    /// The beam between two patches; `None` where no segment of it rises above both planes by more than `tolerance`.
    /// See [`Segment::between`] for a single one.
    pub(crate) fn between(from: (&Corners, &Plane), to: (&Corners, &Plane), tolerance: f64) -> Option<Beam> {
        let range = |plane: &Plane, corners: &Corners| {
            corners
                .iter()
                .map(|&corner| plane.distance(corner))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, u), d| (l.min(d), u.max(d)))
        };
        let rise = range(from.1, to.0);
        if rise.1 <= tolerance {
            return None;
        }
        let fall = range(to.1, from.0);
        if fall.1 <= tolerance {
            return None;
        }
        let box_of = |corners: &Corners| {
            let (mut lower, mut upper) = (corners[0], corners[0]);
            for &corner in &corners[1..] {
                lower = lower.min(corner);
                upper = upper.max(corner);
            }
            (lower, upper)
        };
        let (a, b) = (box_of(from.0), box_of(to.0));
        let (lower, upper) = (a.0.min(b.0), a.1.max(b.1));
        let middle = |(lower, upper): (glam::DVec3, glam::DVec3)| (lower + upper) * 0.5;
        let half = |(lower, upper): (glam::DVec3, glam::DVec3)| ((upper - lower) * 0.5).to_array();
        let axis = middle(b) - middle(a);
        let (from_half, to_half, axis_size) = (half(a), half(b), axis.abs().to_array());
        let width_2 = [0, 1, 2].map(|x| {
            let (y, z) = ((x + 1) % 3, (x + 2) % 3);
            let width = |half: &[f64; 3]| half[y] * axis_size[z] + half[z] * axis_size[y];
            2.0 * width(&from_half).max(width(&to_half))
        });
        // Where some segment does not rise above both planes, none of the beam is taken for granted.
        let limit = |lowest: f64| {
            let lowest = lowest - ROUNDING * tolerance;
            if lowest > tolerance { tolerance / lowest } else { f64::INFINITY }
        };
        Some(Beam {
            from: middle(a).to_array(),
            from_half,
            to: middle(b).to_array(),
            to_half,
            middle_2: (lower + upper).to_array(),
            half_2: (upper - lower).to_array(),
            axis: axis.to_array(),
            axis_size,
            width_2,
            outer: [tolerance / (rise.1 * (1.0 + ROUNDING)), 1.0 - tolerance / (fall.1 * (1.0 + ROUNDING))],
            inner: [limit(rise.0), 1.0 - limit(fall.0)],
            rounding: ROUNDING * tolerance,
        })
    }

    /// Do all segments of the beam rise above both planes, so that all of them count?
    #[inline]
    pub(crate) fn is_whole(&self) -> bool {
        self.inner[0].is_finite() && self.inner[1].is_finite()
    }

    /// May a segment of the beam meet the box? (Separating axes: those of coordinates, and their products with the
    /// beam's axis.)
    #[inline]
    fn meets_box(&self, lower: &[f64; 3], upper: &[f64; 3]) -> bool {
        let mut size_2 = [0.0; 3];
        let mut apart_2 = [0.0; 3];
        let mut meets = true;
        for k in 0..3 {
            size_2[k] = upper[k] - lower[k];
            let middle_2 = upper[k] + lower[k];
            meets &= (middle_2 - self.middle_2[k]).abs() <= size_2[k] + self.half_2[k];
            apart_2[k] = middle_2 - 2.0 * self.from[k];
        }
        if !meets {
            return false;
        }
        for x in 0..3 {
            let (y, z) = ((x + 1) % 3, (x + 2) % 3);
            let apart = (apart_2[y] * self.axis[z] - apart_2[z] * self.axis[y]).abs();
            meets &= apart <= size_2[y] * self.axis_size[z] + size_2[z] * self.axis_size[y] + self.width_2[x];
        }
        meets
    }

    /// Heights of the two boxes above a plane: middles, and half sizes along its normal.
    #[inline]
    fn heights(&self, normal: &[f64; 3], offset: f64) -> [f64; 4] {
        let mut heights = [-offset, 0.0, -offset, 0.0];
        for k in 0..3 {
            heights[0] += normal[k] * self.from[k];
            heights[1] += normal[k].abs() * self.from_half[k];
            heights[2] += normal[k] * self.to[k];
            heights[3] += normal[k].abs() * self.to_half[k];
        }
        heights
    }

    /// Where the rays may cross a plane, given the heights of both boxes above it: `None` where they do not, or only so
    /// near to an end that it does not count.
    ///
    /// A ray from height `d0` to height `d1` meets the plane at `t = d0 / (d0 - d1)`, which bounds `t` for all rays; the
    /// points of all rays at `t` lie in a box that moves linearly with `t`, so that the ends of the range of `t` bound
    /// each coordinate, and each linear function of them.
    #[inline]
    fn crossing(&self, heights: [f64; 4], axes: [usize; 2]) -> Option<Crossing> {
        let [from, from_half, to, to_half] = heights;
        let (from_half, to_half) = (from_half + self.rounding, to_half + self.rounding);
        let (from, to) = if from >= to { (from, to) } else { (-from, -to) };
        let (low, high) = (from - from_half, from + from_half);
        let (end_low, end_high) = (to - to_half, to + to_half);
        if (low > 0.0 && end_low > 0.0) || (high < 0.0 && end_high < 0.0) {
            return None;
        }
        let t_low = if low > 0.0 { low / (low - end_low) } else { 0.0 };
        let t_high = if end_high < 0.0 { high / (high - end_high) } else { 1.0 };
        if t_high < self.outer[0] || t_low > self.outer[1] {
            return None;
        }
        let at = |axis: usize, t: f64| {
            [
                self.from[axis] + t * self.axis[axis],
                self.from_half[axis] + t * (self.to_half[axis] - self.from_half[axis]),
            ]
        };
        let moving = axes.map(|axis| [at(axis, t_low), at(axis, t_high)]);
        Some(Crossing {
            moving,
            lower: moving.map(|[[m0, h0], [m1, h1]]| (m0 - h0).min(m1 - h1) - self.rounding),
            upper: moving.map(|[[m0, h0], [m1, h1]]| (m0 + h0).max(m1 + h1) + self.rounding),
            all: low > 0.0 && end_high < 0.0 && t_low > self.inner[0] && t_high < self.inner[1],
            rounding: self.rounding,
        })
    }

    /// What a polygon does to the rays: `None` where none meets it.
    fn verdict(&self, surface: &Surface) -> Option<Verdict> {
        let heights = self.heights(&surface.normal, surface.offset);
        self.crossing(heights, [surface.axis_u as usize, surface.axis_v as usize])?.verdict(surface)
    }
}

/// The part of a plane in which a beam may cross it.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    /// Middle and half size, along `u` and `v`, of the moving box where the crossing begins and ends.
    moving: [[[f64; 2]; 2]; 2],
    /// Box around the crossing, along `u` and `v`, slack for rounding included.
    lower: [f64; 2],
    upper: [f64; 2],
    /// Does every ray cross the plane, at a place that counts?
    all: bool,
    rounding: f64,
}

impl Crossing {
    /// What a polygon of the plane does to the rays: `None` where none meets it.
    #[inline]
    fn verdict(&self, surface: &Surface) -> Option<Verdict> {
        let mut all = self.all;
        for k in 0..2 {
            let (low, high) = (surface.middle[k] - surface.half[k], surface.middle[k] + surface.half[k]);
            if self.lower[k] > high || self.upper[k] < low {
                return None;
            }
            all &= self.lower[k] > low && self.upper[k] < high;
        }
        for &[a, b, c, h] in surface.bands() {
            let value = |end: usize| a * self.moving[0][end][0] + b * self.moving[1][end][0] + c;
            let spread = |end: usize| a.abs() * self.moving[0][end][1] + b.abs() * self.moving[1][end][1];
            let (f0, r0, f1, r1) = (value(0), spread(0), value(1), spread(1));
            let (lower, upper) = ((f0 - r0).min(f1 - r1), (f0 + r0).max(f1 + r1));
            if lower > h + self.rounding || upper < -h - self.rounding {
                return None;
            }
            all &= lower > -h + self.rounding && upper < h - self.rounding;
        }
        Some(if all { Verdict::All } else { Verdict::Maybe })
    }
}

/// Number of rays in a packet.
const LANES: usize = 16;

/// Sixteen segments, coordinate by coordinate, so that one polygon is tested against all of them in one loop.
#[derive(Clone, Debug)]
pub(crate) struct Packet {
    origin: [[f64; LANES]; 3],
    delta: [[f64; LANES]; 3],
    t_min: [f64; LANES],
    t_max: [f64; LANES],
}

impl Packet {
    /// Packs segments; a `None` meets nothing.
    pub(crate) fn new(segments: impl Fn(usize) -> Option<Segment>) -> (Packet, u16) {
        let mut packet = Packet {
            origin: [[0.0; LANES]; 3],
            delta: [[0.0; LANES]; 3],
            t_min: [f64::INFINITY; LANES],
            t_max: [f64::NEG_INFINITY; LANES],
        };
        let mut present = 0;
        for lane in 0..LANES {
            if let Some(segment) = segments(lane) {
                present |= 1 << lane;
                for k in 0..3 {
                    packet.origin[k][lane] = segment.origin[k];
                    packet.delta[k][lane] = segment.delta[k];
                }
                packet.t_min[lane] = segment.t_min;
                packet.t_max[lane] = segment.t_max;
            }
        }
        (packet, present)
    }

    pub(crate) fn segment(&self, lane: usize) -> Segment {
        Segment {
            origin: [0, 1, 2].map(|k| self.origin[k][lane]),
            delta: [0, 1, 2].map(|k| self.delta[k][lane]),
            t_min: self.t_min[lane],
            t_max: self.t_max[lane],
        }
    }

    /// Which segments meet the surface: the same operations in the same order as [`Surface::meet`].
    ///
    /// Every condition is kept as what it is fulfilled by (`h - |f| >= 0` exactly when `|f| <= h`), the least of which
    /// decides: minima of numbers make shorter code than conjunctions of truth values (`lesser` is one instruction).
    pub(crate) fn meet(&self, surface: &Surface) -> u16 {
        let lesser = |a: f64, b: f64| if a < b { a } else { b };
        let n = &surface.normal;
        let (u, v) = (surface.axis_u as usize, surface.axis_v as usize);
        let (along_u, along_v) = ((&self.origin[u], &self.delta[u]), (&self.origin[v], &self.delta[v]));
        let mut t = [0.0; LANES];
        let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
        let mut spare = [0.0; LANES];
        for k in 0..LANES {
            let [ox, oy, oz] = [self.origin[0][k], self.origin[1][k], self.origin[2][k]];
            let [dx, dy, dz] = [self.delta[0][k], self.delta[1][k], self.delta[2][k]];
            t[k] = -(n[0] * ox + n[1] * oy + n[2] * oz - surface.offset) / (n[0] * dx + n[1] * dy + n[2] * dz);
        }
        for k in 0..LANES {
            x[k] = along_u.0[k] + t[k] * along_u.1[k];
            y[k] = along_v.0[k] + t[k] * along_v.1[k];
            spare[k] = lesser(
                surface.half[0] - (x[k] - surface.middle[0]).abs(),
                surface.half[1] - (y[k] - surface.middle[1]).abs(),
            );
        }
        for &[a, b, c, h] in surface.bands() {
            for k in 0..LANES {
                spare[k] = lesser(spare[k], h - (a * x[k] + b * y[k] + c).abs());
            }
        }
        let mut met = 0;
        for k in 0..LANES {
            // A `t` that is NaN or infinite (a segment along the plane) fails here, whatever came of x and y.
            let counts = (t[k] >= self.t_min[k]) & (t[k] <= self.t_max[k]) & (spare[k] >= 0.0);
            met |= u16::from(counts) << k;
        }
        met
    }
}

impl Bsp {
    /// Visits every fragment whose polygon may meet a ray of the beam, until `visit` breaks.
    pub(crate) fn walk_beam<P: Probe, B>(
        &self,
        beam: &Beam,
        probe: &mut P,
        mut visit: impl FnMut(&mut P, u32, &Surface, Verdict) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let mut stack = Stack::new();
        if !self.nodes.is_empty() {
            stack.push(0);
        }
        let slack = MARGIN * self.tolerance;
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            probe.node_visit(index);
            if !beam.meets_box(&node.lower, &node.upper) {
                continue;
            }
            let heights = beam.heights(&node.plane.normal.to_array(), node.plane.offset);
            let [from, from_half, to, to_half] = heights;
            let (from_half, to_half) = (from_half + slack, to_half + slack);
            if from > from_half && to > to_half {
                if node.front != Bsp::NONE {
                    stack.push(node.front);
                }
                continue;
            }
            if from < -from_half && to < -to_half {
                if node.back != Bsp::NONE {
                    stack.push(node.back);
                }
                continue;
            }
            let (mut crossing, mut next) = (None, node.first_fragment);
            if node.flat {
                let [u, v, _] = projection(node.plane.normal);
                crossing = beam.crossing(heights, [u, v]);
                if crossing.is_none() {
                    next = Bsp::NONE;
                }
            }
            while next != Bsp::NONE {
                let (index, fragment) = (next, &self.fragments[next as usize]);
                probe.fragment_test(index);
                next = fragment.next;
                let surface = &self.surfaces[fragment.polygon as usize];
                let verdict = match &crossing {
                    Some(crossing) => crossing.verdict(surface),
                    None => beam.verdict(surface),
                };
                if let Some(verdict) = verdict {
                    visit(probe, index, surface, verdict)?;
                }
            }
            for child in [node.back, node.front] {
                if child != Bsp::NONE {
                    stack.push(child);
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// Does the polygon of this fragment stop every ray of the beam?
    pub(crate) fn blocks<P: Probe>(&self, beam: &Beam, fragment: u32, probe: &mut P) -> bool {
        let Some(piece) = self.fragments.get(fragment as usize) else { return false };
        probe.fragment_test(fragment);
        let surface = &self.surfaces[piece.polygon as usize];
        surface.opaque && beam.verdict(surface) == Some(Verdict::All)
    }

    /// Share of light that passes a segment of a packet.
    pub(crate) fn lane_transmittance<P: Probe>(
        &self,
        scene: &Scene,
        packet: &Packet,
        lane: usize,
        probe: &mut P,
    ) -> f64 {
        self.segment_transmittance(scene, packet.segment(lane), probe)
    }
}
