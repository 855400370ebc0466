//! Single rays through a BSP tree: a ray goes in, what it hits comes out, nearest first; cut-out masks are looked up
//! here, what a hit means for light is left to the caller. Fragments stand for whole polygons (D2).

use super::{Bsp, MARGIN, Stack, Surface};
use crate::kernels::{NoProbe, Probe};
use crate::scene::{Plane, Scene};
use glam::DVec3;
use std::ops::ControlFlow;

/// Where a ray meets a polygon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the origin, metres.
    pub distance: f64,
    /// The front polygon that is hit (from either side).
    pub polygon: u32,
    /// Does the ray arrive at the polygon's front?
    pub front_facing: bool,
}

/// The part `[t_min, t_max]` of a line `origin + t delta`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Segment {
    pub(super) origin: [f64; 3],
    pub(super) delta: [f64; 3],
    pub(super) t_min: f64,
    pub(super) t_max: f64,
}

impl Segment {
    /// The segment between points of two patches, without what lies within `tolerance` of either plane: there `t` times
    /// the height of `to` above the plane of `from` is below the tolerance, and likewise from the other end. `None`
    /// where an end does not rise above the other's plane by more than the tolerance.
    #[inline]
    pub(crate) fn between(from: DVec3, to: DVec3, planes: [&Plane; 2], tolerance: f64) -> Option<Segment> {
        let (rise, fall) = (planes[0].distance(to), planes[1].distance(from));
        (rise > tolerance && fall > tolerance).then(|| Segment {
            origin: from.to_array(),
            delta: (to - from).to_array(),
            t_min: tolerance / rise,
            t_max: 1.0 - tolerance / fall,
        })
    }

    /// Heights of each end above the other's plane, metres, and the squared length, m²: `between`'s own numbers back.
    pub(crate) fn heights(&self, tolerance: f64) -> ([f64; 2], f64) {
        let square = self.delta.iter().map(|component| component * component).sum();
        ([tolerance / self.t_min, tolerance / (1.0 - self.t_max)], square)
    }

    /// Parameter at which the segment meets a surface.
    #[inline]
    fn meet(&self, surface: &Surface) -> Option<f64> {
        let t = surface.meet(&self.origin, &self.delta);
        (t >= self.t_min && t <= self.t_max).then_some(t)
    }

    fn at(&self, t: f64) -> DVec3 {
        DVec3::from_array(self.origin) + DVec3::from_array(self.delta) * t
    }
}

impl Bsp {
    /// The nearest polygon that a ray hits, from either side, farther than the tolerance from `origin` and no farther
    /// than `max_distance` (which may be infinite). `direction` is of unit length. Transparent texels of cut-out masks
    /// are passed; a polygon of opacity below 1 is hit. Among polygons at the same distance the first in the scene is
    /// the one.
    pub fn closest_hit<P: Probe>(
        &self,
        scene: &Scene,
        origin: DVec3,
        direction: DVec3,
        max_distance: f64,
        probe: &mut P,
    ) -> Option<Hit> {
        let mut segment = self.segment(origin, direction, max_distance);
        let mut best: Option<Hit> = None;
        probe.ray();
        self.walk(&mut segment, probe, |segment, polygon, surface, t| {
            if let Some(hit) = &best
                && (hit.distance, hit.polygon) <= (t, polygon)
            {
                return ControlFlow::Continue(());
            }
            if opacity(scene, surface, polygon, segment.at(t)) > 0.0 {
                best = Some(Hit { distance: t, polygon, front_facing: surface.faces(&segment.delta) });
                segment.t_max = t;
            }
            ControlFlow::Continue(())
        });
        best
    }

    /// The opaque front that a ray arrives at `distance` from `origin`, to the tolerance; of several the first in the
    /// scene.
    pub(crate) fn front_at(&self, scene: &Scene, origin: DVec3, direction: DVec3, distance: f64) -> Option<u32> {
        let mut segment = self.segment(origin, direction, distance + self.tolerance);
        segment.t_min = distance - self.tolerance;
        let mut found = None;
        self.walk(&mut segment, &mut NoProbe, |segment, polygon, surface, t| {
            let is_first = found.is_none_or(|found| polygon < found);
            if is_first && surface.faces(&segment.delta) && opacity(scene, surface, polygon, segment.at(t)) >= 1.0 {
                found = Some(polygon);
            }
            ControlFlow::Continue(())
        });
        found
    }

    /// Calls `visit` for every polygon that a ray hits, nearest first (equal distances in the scene's order), with the
    /// share of light that it stops there: 1 for an opaque polygon or a solid texel, the polygon's opacity without a
    /// mask; what stops nothing is not told. Ends after the first hit that stops all, or when `visit` breaks. Limits as
    /// for [`Bsp::closest_hit`].
    pub fn for_each_hit<P: Probe>(
        &self,
        scene: &Scene,
        origin: DVec3,
        direction: DVec3,
        max_distance: f64,
        probe: &mut P,
        mut visit: impl FnMut(Hit, f64) -> ControlFlow<()>,
    ) {
        let mut segment = self.segment(origin, direction, max_distance);
        let mut hits: Vec<(Hit, f64)> = Vec::new();
        probe.ray();
        self.walk(&mut segment, probe, |segment, polygon, surface, t| {
            let stopped = opacity(scene, surface, polygon, segment.at(t));
            if stopped > 0.0 {
                let hit = Hit { distance: t, polygon, front_facing: surface.faces(&segment.delta) };
                hits.push((hit, stopped));
                if stopped >= 1.0 {
                    segment.t_max = t;
                }
            }
            ControlFlow::Continue(())
        });
        hits.sort_by(|(p, _), (q, _)| p.distance.total_cmp(&q.distance).then(p.polygon.cmp(&q.polygon)));
        // A polygon is met once for each of its fragments nearby, at the same point.
        hits.dedup_by_key(|(hit, _)| (hit.polygon, hit.distance.to_bits()));
        for (hit, stopped) in hits {
            if visit(hit, stopped).is_break() || stopped >= 1.0 {
                return;
            }
        }
    }

    /// Share of light that passes from point `from` on one patch to point `to` on another: the product of
    /// `1 - opacity` over all polygons between them, 0 at the first opaque one.
    ///
    /// What is hit within `tolerance` of `from_plane` or `to_plane` does not count: neither the patches themselves nor
    /// coplanar neighbours nor what touches them. An end that lies no more than the tolerance above the other end's
    /// plane gets no light: 0.
    #[expect(clippy::too_many_arguments, reason = "a segment with its two planes; kernels bundle them in a `Segment`")]
    pub fn transmittance<P: Probe>(
        &self,
        scene: &Scene,
        from: DVec3,
        to: DVec3,
        from_plane: &Plane,
        to_plane: &Plane,
        tolerance: f64,
        probe: &mut P,
    ) -> f64 {
        probe.ray();
        match Segment::between(from, to, [from_plane, to_plane], tolerance) {
            Some(segment) => self.segment_transmittance(scene, segment, probe),
            None => 0.0,
        }
    }

    /// As [`Bsp::transmittance`], of a segment.
    pub(crate) fn segment_transmittance<P: Probe>(&self, scene: &Scene, mut segment: Segment, probe: &mut P) -> f64 {
        // Factors by polygon: multiplied in the scene's order, so that the order of insertion changes no bit.
        let mut passed: Vec<(u32, f64)> = Vec::new();
        let mut blocked = false;
        self.walk(&mut segment, probe, |segment, polygon, surface, t| {
            let stopped = opacity(scene, surface, polygon, segment.at(t));
            if stopped >= 1.0 {
                blocked = true;
                return ControlFlow::Break(());
            }
            if stopped > 0.0 {
                passed.push((polygon, 1.0 - stopped));
            }
            ControlFlow::Continue(())
        });
        if blocked {
            return 0.0;
        }
        passed.sort_by_key(|&(polygon, _)| polygon);
        passed.dedup_by_key(|&mut (polygon, _)| polygon);
        passed.iter().map(|&(_, share)| share).product()
    }

    /// The segment that `closest_hit` and `for_each_hit` search.
    fn segment(&self, origin: DVec3, direction: DVec3, max_distance: f64) -> Segment {
        Segment { origin: origin.to_array(), delta: direction.to_array(), t_min: self.tolerance, t_max: max_distance }
    }

    /// Visits every fragment whose polygon meets the segment, roughly from near to far: `visit` gets the segment (whose
    /// end it may draw in), the polygon and the parameter. A polygon may come several times.
    fn walk<P: Probe>(
        &self,
        segment: &mut Segment,
        probe: &mut P,
        mut visit: impl FnMut(&mut Segment, u32, &Surface, f64) -> ControlFlow<()>,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let inverse = segment.delta.map(|d| 1.0 / d);
        let slack = MARGIN * self.tolerance;
        let mut stack = Stack::new();
        stack.push(0);
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            let (mut t_near, mut t_far) = (segment.t_min, segment.t_max);
            for (axis, inverse) in inverse.iter().enumerate() {
                let t0 = (node.lower[axis] - segment.origin[axis]) * inverse;
                let t1 = (node.upper[axis] - segment.origin[axis]) * inverse;
                t_near = t_near.max(t0.min(t1));
                t_far = t_far.min(t0.max(t1));
            }
            probe.node_visit(index);
            // Written so that a NaN goes on.
            if t_near > t_far {
                continue;
            }
            let n = node.plane.normal.to_array();
            let start =
                n[0] * segment.origin[0] + n[1] * segment.origin[1] + n[2] * segment.origin[2] - node.plane.offset;
            let slope = n[0] * segment.delta[0] + n[1] * segment.delta[1] + n[2] * segment.delta[2];
            // Heights where the segment enters and leaves the node's box.
            let (enter, leave) = (start + t_near * slope, start + t_far * slope);
            let in_front = enter > slack && leave > slack;
            let behind = enter < -slack && leave < -slack;
            let (near, far) = if enter < 0.0 { (node.back, node.front) } else { (node.front, node.back) };
            if in_front || behind {
                if near != Bsp::NONE {
                    stack.push(near);
                }
                continue;
            }
            let mut next = node.first_fragment;
            while next != Bsp::NONE {
                let fragment = &self.fragments[next as usize];
                probe.fragment_test(next);
                next = fragment.next;
                let surface = &self.surfaces[fragment.polygon as usize];
                if let Some(t) = segment.meet(surface)
                    && visit(segment, fragment.polygon, surface, t).is_break()
                {
                    return;
                }
            }
            for child in [far, near] {
                if child != Bsp::NONE {
                    stack.push(child);
                }
            }
        }
    }
}

/// Share of light that a polygon stops at a point: its opacity, or by its mask all or nothing (all where the polygon has
/// no texture coordinates to look it up with).
fn opacity(scene: &Scene, surface: &Surface, polygon: u32, point: DVec3) -> f64 {
    if surface.opaque {
        return 1.0;
    }
    let properties = &scene.polygons[polygon as usize];
    match properties.mask {
        None => properties.opacity,
        Some(mask) => match properties.texture_coordinates(point) {
            Some(uv) if !scene.masks[mask as usize].is_solid(uv) => 0.0,
            _ => 1.0,
        },
    }
}
