//! A final gather: a point, of a surface or in the air, and a solved radiosity go in, the irradiance there comes out, by rays
//! from the point itself. Shadows and contacts are then as sharp as they are, where a solve's own values end at its elements.

use crate::geometry::{Element, Geometry};
use crate::lamps::at_receiver;
use crate::rays::{Packet, RAYS, point_of};
use crate::receiver::Receiver;
use crate::sky::Care;
use crate::tracer::Tracer;
use glam::{DVec3, Vec3};
use isolux_core::kernels::Patch;
use isolux_core::sampling::Stream;
use isolux_core::scene::Corners;
use isolux_core::solution::seen_factor;
use isolux_core::tree::quarter;
use isolux_core::units::Rgb;
use std::f64::consts::PI;

/// Emitters that each count by themselves at every point; of more, neighbours are grouped into as many groups.
const MOST_SINGLE: usize = 64;

/// Rays to emitters, over those around.
const TO_LIGHTS: f64 = 0.5;

/// Rays to the sky at least, however few there are around: eight cells.
const SKY_RAYS: usize = 256;

/// Surfaces that one ray passes before it is given up: stacked panes of glass.
const MOST_LAYERS: usize = 64;

/// Below this share of light what lies behind panes counts for nothing: a tenth of the noise of 256 rays.
const LEAST_PASSING: f64 = 1.0 / 512.0;

/// Steps of a sequence that fills the unit square evenly: 1/g and 1/g² with g³ = g + 1 (M. Roberts 2018, "The unreasonable
/// effectiveness of quasirandom sequences").
const STEPS: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];

/// Share of its surroundings that a point sees in one part of an emitter, at most, and in one that is larger than it is far.
/// Places in a part are as likely as its area says, so that a part must not throw much more from one end than from the other.
/// A sky of 1 km over streets 100 m below comes in some 40 parts.
const MOST_SEEN: f64 = 1.0 / 16.0;
const MOST_SEEN_NEARBY: f64 = 1.0 / 256.0;

/// Most times that an emitter is quartered.
const DEEPEST: u32 = 6;

/// An emitter as a point sees it, or a part of it.
struct Part {
    element: Element,
    /// What it throws on the point unoccluded, mean over the bands, by its area.
    density: f64,
    /// What it and all parts before it throw.
    until: f64,
}

/// Emitters that lie together.
struct Group {
    /// A run of [`Emitters::polygons`].
    from: usize,
    to: usize,
    centre: DVec3,
    radius: f64,
    /// Mean over the bands, W or lm.
    power: f64,
}

/// All polygons that emit, neighbours side by side, in groups.
struct Emitters {
    polygons: Vec<u32>,
    groups: Vec<Group>,
}

impl Emitters {
    fn new(geometry: &Geometry) -> Emitters {
        let scene = &geometry.scene;
        let is_lit = |&polygon: &u32| scene.polygons[polygon as usize].emission != Rgb::ZERO;
        let mut polygons: Vec<u32> = (0..scene.polygons.len() as u32).filter(is_lit).collect();
        let centre = |polygon: u32| scene.polygons[polygon as usize].corners.mean();
        let size = polygons.len().div_ceil(MOST_SINGLE).max(1);
        cluster(&mut polygons, size, &centre);
        let groups = (0..polygons.len()).step_by(size).map(|from| {
            let to = (from + size).min(polygons.len());
            let members = || polygons[from..to].iter().map(|&polygon| &scene.polygons[polygon as usize]);
            let middle = members().map(|polygon| polygon.corners.mean()).sum::<DVec3>() / (to - from) as f64;
            let corners = members().flat_map(|polygon| polygon.corners.iter());
            let radius = corners.map(|corner| corner.distance(middle)).fold(0.0, f64::max);
            let power = members().map(|polygon| polygon.emission.mean() * polygon.area).sum();
            Group { from, to, centre: middle, radius, power }
        });
        let groups = groups.collect();
        Emitters { polygons, groups }
    }
}

/// Orders polygons so that runs of `size` lie together: halves by the median of the longest side, each a multiple of it.
fn cluster(polygons: &mut [u32], size: usize, centre: &impl Fn(u32) -> DVec3) {
    if polygons.len() <= size {
        return;
    }
    let (low, high) = polygons.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &polygon| {
        (low.min(centre(polygon)), high.max(centre(polygon)))
    });
    let sides = high - low;
    let axis = if sides.x >= sides.y.max(sides.z) { 0 } else { 1 + usize::from(sides.z > sides.y) };
    polygons.sort_by(|&a, &b| centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(&b)));
    let half = polygons.len().div_ceil(size).div_ceil(2) * size;
    let (one, two) = polygons.split_at_mut(half);
    cluster(one, size, centre);
    cluster(two, size, centre);
}

/// Gathers light at points. Values do not depend on who asks, in which order.
///
/// What lamps without a surface throw: by a shadow ray to each. What the sky throws: by rays in a hierarchy of directions,
/// about as many as around.
///
/// What is emitted: each emitter counts by its form factor at the point, in closed form, times the share of it that the point
/// sees. Rays to places on emitters tell that share, more of them to emitters that throw more. Where nothing stands between,
/// nothing is left to chance. What is reflected: rays in strata around the normal, by the cosine, read the solved radiosity of
/// what they meet.
pub struct FinalGather<'a> {
    tracer: &'a Tracer,
    emitters: Emitters,
    /// Strata of height and of turn.
    side: usize,
    /// Gathers next to each other that share finer strata, along each axis.
    shares: u32,
    to_lights: usize,
}

impl<'a> FinalGather<'a> {
    /// Prepares gathers by at least `rays` rays, rounded up to square numbers, and half as many to emitters. The rays of
    /// `shares` squared gathers, which are next to each other and meant to be averaged, fill finer strata together.
    #[must_use]
    pub fn new(tracer: &'a Tracer, rays: u32, shares: u32) -> FinalGather<'a> {
        let shares = shares.max(1);
        let side = ((f64::from(rays.max(1)).sqrt() / f64::from(shares)).ceil() as usize).max(1);
        let to_lights = (side * side) as f64 * TO_LIGHTS;
        let to_lights = (to_lights as usize).div_ceil(RAYS).max(1) * RAYS;
        FinalGather { tracer, emitters: Emitters::new(&tracer.geometry), side, shares, to_lights }
    }

    /// Irradiance at a point on the lit side of a polygon, front or back, W/m² or lm/m². `solved`: the irradiance that was
    /// solved, at a point of such a side. `share`: which of the gathers that share strata this is.
    pub fn irradiance(
        &self,
        point: DVec3,
        side: u32,
        share: u32,
        stream: &mut Stream,
        solved: &impl Fn(u32, DVec3) -> Rgb,
    ) -> Rgb {
        let geometry = &self.tracer.geometry;
        let exact = geometry.scene.polygons[side as usize].plane.normal;
        // Rays to lamps know the normal in single precision, as a solve's do.
        let rough = geometry.surfaces[side as usize].normal.as_dvec3();
        self.gathered(point, [Receiver::Plane(exact), Receiver::Plane(rough)], share, stream, solved)
    }

    /// What a receiver in the air takes in, W/m² or lm/m²: see [`Receiver`]. Otherwise as [`FinalGather::irradiance`]; the
    /// direct light of emitters on receivers that are not flat is found by rays to places on them, each weighted by what its
    /// place throws, without a form factor in closed form.
    pub fn received(
        &self,
        point: DVec3,
        receiver: &Receiver,
        share: u32,
        stream: &mut Stream,
        solved: &impl Fn(u32, DVec3) -> Rgb,
    ) -> Rgb {
        self.gathered(point, [*receiver; 2], share, stream, solved)
    }

    /// By a receiver, and by the one that lamps see.
    fn gathered(
        &self,
        point: DVec3,
        [receiver, for_lamps]: [Receiver; 2],
        share: u32,
        stream: &mut Stream,
        solved: &impl Fn(u32, DVec3) -> Rgb,
    ) -> Rgb {
        let emitted = if self.emitters.groups.len() == self.emitters.polygons.len() {
            self.emitted_by_each(point, &receiver, share, stream)
        } else {
            self.emitted_by_groups(point, &receiver, share, stream)
        };
        let (place, geometry) = (self.tracer.place(point), &self.tracer.geometry);
        let lamps = at_receiver(place, &for_lamps, geometry, |_| true);
        let sky = match &geometry.dome {
            Some(_) => {
                let care = Care::by_rays(SKY_RAYS.max(self.side * self.side), 0.0);
                crate::sky::at_receiver(place, &receiver, geometry, stream.next_bits(), care)
            }
            None => [0.0; 3],
        };
        emitted
            + Rgb(lamps.map(f64::from))
            + Rgb(sky.map(f64::from))
            + self.reflected(point, &receiver, share, stream, solved)
    }

    /// What is reflected towards a point: `pi` times the mean radiance over directions as they count.
    fn reflected(
        &self,
        point: DVec3,
        receiver: &Receiver,
        share: u32,
        stream: &mut Stream,
        solved: &impl Fn(u32, DVec3) -> Rgb,
    ) -> Rgb {
        let scene = &*self.tracer.geometry.scene;
        let directions = receiver.directions();
        let step = f64::from(self.tracer.geometry.tolerance);
        let mut sum = Rgb::ZERO;
        let count = self.side * self.side;
        for stratum in 0..count {
            let (row, column) = (share / self.shares, share % self.shares);
            let mut within = |part: u32| (f64::from(part) + stream.next_unit()) / f64::from(self.shares);
            let u = ((stratum / self.side) as f64 + within(row)) / self.side as f64;
            let v = ((stratum % self.side) as f64 + within(column)) / self.side as f64;
            let direction = directions.at(u, v);
            let (mut start, mut passing) = (point, 1.0);
            for _ in 0..MOST_LAYERS {
                let Some(meeting) = self.tracer.closest(start, direction, f64::INFINITY) else { break };
                let place = start + direction * meeting.distance;
                let met = &scene.polygons[meeting.polygon as usize];
                let seen = if meeting.front_facing { Some(meeting.polygon) } else { met.twin };
                // A back that has no lit side reflects nothing.
                let lit = seen.filter(|&seen| scene.polygons[seen as usize].reflectance != Rgb::ZERO);
                if let Some(seen) = lit {
                    let polygon = &scene.polygons[seen as usize];
                    // Reflectance of a cut-out is a mean over its holes; the texel that was met is solid.
                    let share = if polygon.mask.is_some() { 1.0 / polygon.opacity } else { 1.0 };
                    sum += polygon.reflectance * solved(seen, place) * (share * passing);
                }
                passing *= if met.mask.is_some() { 0.0 } else { 1.0 - met.opacity };
                if passing < LEAST_PASSING {
                    break;
                }
                start = place + direction * step;
            }
        }
        sum / count as f64
    }

    /// Form factor of an emitter at a point, and what it throws there unoccluded, as a mean over the bands.
    fn thrown(&self, point: DVec3, receiver: &Receiver, emitter: u32) -> (f64, f64) {
        let polygon = &self.tracer.geometry.scene.polygons[emitter as usize];
        let patch = Patch { corners: &polygon.corners, plane: &polygon.plane, area: polygon.area };
        let factor = factor_at(point, receiver, &patch);
        (factor, factor * polygon.emission.mean())
    }

    /// A number in [0, 1), one in each stratum of all rays to emitters that are averaged.
    fn stratum(&self, ray: usize, share: u32, stream: &mut Stream) -> f64 {
        let within = (f64::from(share) + stream.next_unit()) / f64::from(self.shares * self.shares);
        (ray as f64 + within) / self.to_lights as f64
    }

    /// Sets ray `k` of a packet to a place on an emitter, or on a part of it; its weight is what counts at the receiver. Says
    /// what area the place stands for, over that of a place on average, and whether another face lies there, in the emitter's
    /// plane.
    fn aim(
        &self,
        packet: &mut Packet,
        k: usize,
        point: Vec3,
        receiver: &Receiver,
        part: &Element,
        jitter: [f64; 2],
    ) -> (f64, bool) {
        let geometry = &self.tracer.geometry;
        let (place, within) = point_of(part, 0, 0, jitter.map(|along| along as f32));
        let other = geometry.surfaces[part.polygon as usize].normal;
        if let Receiver::Plane(normal) = receiver {
            packet.set(k, point, normal.as_vec3(), place, other, geometry.tolerance);
        } else {
            // As a piece that faces the place would have it, times what that direction counts.
            let towards = (place - point).normalize_or_zero();
            packet.set(k, point, towards, place, other, geometry.tolerance);
            packet.weights[k] *= receiver.weight(towards.as_dvec3()) as f32;
        }
        (stands_for(part, within, geometry.tolerance), geometry.overlaps.on_top(part.polygon, place).is_some())
    }

    /// Appends an emitter, in parts where a point sees much of it or is near. Returns its form factor.
    fn take_apart(
        &self,
        view: (DVec3, &Receiver),
        emitter: u32,
        corners: &Corners,
        depth: u32,
        parts: &mut Vec<Part>,
    ) -> f64 {
        let (point, receiver) = view;
        let polygon = &self.tracer.geometry.scene.polygons[emitter as usize];
        let patch = Patch { corners, plane: &polygon.plane, area: corners.area() };
        let factor = factor_at(point, receiver, &patch);
        let (middle, size) = (corners.mean(), corners[0].distance_squared(corners[2]));
        let is_near = size > middle.distance_squared(point);
        if depth < DEEPEST && (factor > MOST_SEEN || is_near && factor > MOST_SEEN_NEARBY) {
            let quarters = quarter(corners);
            return quarters.iter().map(|part| self.take_apart(view, emitter, part, depth + 1, parts)).sum();
        }
        if factor > 0.0 {
            let before = parts.last().map_or(0.0, |part| part.until);
            let thrown = factor * polygon.emission.mean();
            let element = self.tracer.geometry.part(corners, emitter);
            parts.push(Part { element, density: thrown / patch.area, until: before + thrown });
        }
        factor
    }

    /// Few emitters: all factors are known, and rays tell the share that is seen of all that they throw together, each
    /// weighted by what its place throws. On what is not flat, rays tell what they throw.
    fn emitted_by_each(&self, point: DVec3, receiver: &Receiver, share: u32, stream: &mut Stream) -> Rgb {
        let geometry = &self.tracer.geometry;
        let polygons = &geometry.scene.polygons;
        let (mut whole, mut parts) = (Rgb::ZERO, Vec::new());
        for &emitter in &self.emitters.polygons {
            let polygon = &polygons[emitter as usize];
            whole += polygon.emission * self.take_apart((point, receiver), emitter, &polygon.corners, 0, &mut parts);
        }
        let Some(Part { until: sum, .. }) = parts.last() else { return Rgb::ZERO };
        let place = self.tracer.place(point);
        let (mut seen, mut sent) = (Rgb::ZERO, Rgb::ZERO);
        let mut square = Square::new(stream);
        for first in (0..self.to_lights).step_by(RAYS) {
            let mut packet = Packet::new();
            let (mut weights, mut hidden) = ([Rgb::ZERO; RAYS], [false; RAYS]);
            for k in 0..RAYS {
                let area;
                let wanted = self.stratum(first + k, share, stream) * sum;
                let part = &parts[parts.partition_point(|part| part.until <= wanted).min(parts.len() - 1)];
                (area, hidden[k]) = self.aim(&mut packet, k, place, receiver, &part.element, square.next());
                let emission = polygons[part.element.polygon as usize].emission;
                weights[k] = emission * (f64::from(packet.weights[k]) * area / part.density);
            }
            let through = packet.through(geometry);
            for k in 0..RAYS {
                seen += weights[k] * if hidden[k] { 0.0 } else { f64::from(through[k]) };
                sent += weights[k];
            }
        }
        if !matches!(receiver, Receiver::Plane(_)) {
            // Over the chance of each place, and the pi of a radiance.
            return seen * (sum / (PI * self.to_lights as f64));
        }
        Rgb(std::array::from_fn(
            |band| if sent.0[band] > 0.0 { whole.0[band] * seen.0[band] / sent.0[band] } else { 0.0 },
        ))
    }

    /// Many emitters: a group by what it may throw at most, one of its members by what that throws.
    fn emitted_by_groups(&self, point: DVec3, receiver: &Receiver, share: u32, stream: &mut Stream) -> Rgb {
        let geometry = &self.tracer.geometry;
        let polygons = &geometry.scene.polygons;
        let mut before = Vec::with_capacity(self.emitters.groups.len() + 1);
        let mut sum = 0.0;
        before.push(0.0);
        for group in &self.emitters.groups {
            let towards = group.centre - point;
            let rise = match receiver {
                Receiver::Plane(normal) => normal.dot(towards),
                Receiver::Cylinder(_) | Receiver::SemiCylinder { .. } => towards.length(),
            };
            let rise = rise + group.radius;
            let square = towards.length_squared().max(group.radius * group.radius);
            sum += if rise > 0.0 { group.power * (rise / square.sqrt()).min(1.0) / square } else { 0.0 };
            before.push(sum);
        }
        if sum <= 0.0 {
            return Rgb::ZERO;
        }
        let place = self.tracer.place(point);
        let mut square = Square::new(stream);
        let mut members: (usize, Vec<(f64, f64)>, f64) = (usize::MAX, Vec::new(), 0.0);
        let mut found = Rgb::ZERO;
        for first in (0..self.to_lights).step_by(RAYS) {
            let mut packet = Packet::new();
            let (mut weights, mut hidden) = ([Rgb::ZERO; RAYS], [false; RAYS]);
            for k in 0..RAYS {
                let wanted = self.stratum(first + k, share, stream) * sum;
                let index = before.partition_point(|&before| before <= wanted).clamp(1, before.len() - 1) - 1;
                let (group, own) = (&self.emitters.groups[index], before[index + 1] - before[index]);
                if members.0 != index {
                    let mut total = 0.0;
                    let run = self.emitters.polygons[group.from..group.to].iter().map(|&emitter| {
                        let (factor, thrown) = self.thrown(point, receiver, emitter);
                        total += thrown;
                        (factor, total)
                    });
                    let run = run.collect();
                    members = (index, run, total);
                }
                let (_, run, total) = &members;
                if *total <= 0.0 || own <= 0.0 {
                    continue;
                }
                let within = (wanted - before[index]) / own * total;
                let member = run.partition_point(|&(_, until)| until <= within).min(run.len() - 1);
                let emitter = self.emitters.polygons[group.from + member];
                let area;
                (area, hidden[k]) = self.aim(&mut packet, k, place, receiver, &geometry.root(emitter), square.next());
                let emission = polygons[emitter as usize].emission;
                // What it throws over the chance that it was picked: its own factor falls out.
                let thrown = emission * (total / emission.mean() * (sum / own) * area);
                weights[k] = if matches!(receiver, Receiver::Plane(_)) {
                    thrown
                } else {
                    // By this place in place of the factor.
                    let (factor, _) = run[member];
                    let density = factor / polygons[emitter as usize].area;
                    thrown * (f64::from(packet.weights[k]) / (PI * density))
                };
            }
            let through = packet.through(geometry);
            for k in 0..RAYS {
                // Rays that carry nothing are not sent, and do not pass.
                let is_sent = packet.weights[k] > 0.0 && !hidden[k];
                found += weights[k] * if is_sent { f64::from(through[k]) } else { 0.0 };
            }
        }
        found / self.to_lights as f64
    }
}

/// Area that a place of [`point_of`] stands for, over the mean: bilinear maps of quadrilaterals that are no parallelograms are
/// denser here than there.
fn stands_for(part: &Element, [s, t]: [f32; 2], tolerance: f32) -> f64 {
    let [a, b, c, d] = part.corners;
    let twist = a - b + c - d;
    if part.count == 3 || twist.length_squared() <= tolerance * tolerance {
        return 1.0;
    }
    let (along, across) = (b - a + twist * t, d - a + twist * s);
    f64::from(along.cross(across).length() / part.area)
}

/// Form factor of a patch at a receiver that is flat; of others, at a flat piece that faces the patch's middle.
fn factor_at(point: DVec3, receiver: &Receiver, patch: &Patch<'_>) -> f64 {
    let normal = match *receiver {
        Receiver::Plane(normal) => normal,
        Receiver::Cylinder(axis) | Receiver::SemiCylinder { axis, .. } => {
            (patch.corners.mean() - point).normalize_or(axis)
        }
    };
    seen_factor(point, normal, patch).max(0.0)
}

/// Places that fill a unit square evenly, from a random one on.
struct Square([f64; 2]);

impl Square {
    fn new(stream: &mut Stream) -> Square {
        Square([stream.next_unit(), stream.next_unit()])
    }

    fn next(&mut self) -> [f64; 2] {
        for (along, step) in self.0.iter_mut().zip(STEPS) {
            *along = (*along + step).fract();
        }
        self.0
    }
}
