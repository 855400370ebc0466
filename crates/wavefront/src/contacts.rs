//! Where surfaces touch: the lines along which other polygons stand on a polygon, lie in it or cut through it go in; which
//! elements have such a line within, and which are covered, comes out.
//!
//! Light on a surface changes at once only along such lines. An element without one is open or covered as a whole, which
//! one ray tells; an element with one is split until what it may be wrong by does not count.

use crate::clusters::Clusters;
use crate::geometry::{Element, Geometry, NONE, Probes};
use crate::packed::{Extent, Packed};
use crate::rays::{RAYS, own_point};
use crate::read::quadrant;
use glam::Vec3;
use isolux_core::tree::Cut;
use isolux_simd::bvh::Hit;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::LazyLock;

/// A segment in the plane of a polygon.
type Line = [Vec3; 2];

impl Extent for Line {
    fn extent(&self) -> (Vec3, Vec3) {
        (self[0].min(self[1]), self[0].max(self[1]))
    }
}

/// Segments in the planes of polygons, by polygon.
#[derive(Clone, Default)]
pub(crate) struct Contacts(Packed<Line>);

impl Contacts {
    /// Finds all lines of contact.
    pub(crate) fn new(geometry: &Geometry, clusters: &Clusters, roots: &[Element]) -> Contacts {
        let found: Vec<Vec<Line>> = (0..roots.len() as u32)
            .into_par_iter()
            .map(|polygon| touching(polygon, geometry, clusters, roots))
            .collect();
        Contacts(Packed::new(found))
    }

    /// Does a polygon have any?
    fn any(&self, polygon: u32) -> bool {
        self.0.any(polygon)
    }

    /// Is there a line of contact between two points of a polygon?
    pub(crate) fn between(&self, from: Vec3, to: Vec3, polygon: u32, geometry: &Geometry) -> bool {
        let normal = geometry.surfaces[polygon as usize].normal;
        let side = |a: Vec3, b: Vec3, point: Vec3| normal.dot((b - a).cross(point - a));
        let apart = |a: Vec3, b: Vec3, p: Vec3, q: Vec3| side(a, b, p) * side(a, b, q) <= 0.0;
        let reach = geometry.tolerance;
        let mut near = self.0.near(polygon, from.min(to) - reach, from.max(to) + reach);
        near.any(|&[a, b]| apart(a, b, from, to) && apart(from, to, a, b))
    }

    /// Lines of a polygon whose box meets that of one of its elements.
    fn near<'a>(&'a self, element: &Element, tolerance: f32) -> impl Iterator<Item = &'a Line> + 'a {
        let (low, high) = bounds(element);
        self.0.near(element.polygon, low - tolerance, high + tolerance)
    }
}

/// Is a point of an element so close to a line of contact that rounding decides on which side it is?
pub(crate) fn is_on_line(point: Vec3, element: &Element, geometry: &Geometry) -> bool {
    let reach = BESIDE * geometry.tolerance;
    geometry.contacts.near(element, reach).any(|&[from, to]| is_closer(point, from, to, reach))
}

/// Is a point of a polygon so close to its border that rounding decides on which side it is of what meets it there?
pub(crate) fn is_on_border(point: Vec3, root: &Element, geometry: &Geometry) -> bool {
    let count = root.count as usize;
    let reach = BESIDE * geometry.tolerance;
    (0..count).any(|k| is_closer(point, root.corners[k], root.corners[(k + 1) % count], reach))
}

/// Is a point closer than `reach` to a segment?
fn is_closer(point: Vec3, from: Vec3, to: Vec3, reach: f32) -> bool {
    let along = to - from;
    let share = ((point - from).dot(along) / along.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    point.distance_squared(from + along * share) < reach * reach
}

/// Segments in which other polygons meet the inside of `polygon`.
fn touching(polygon: u32, geometry: &Geometry, clusters: &Clusters, roots: &[Element]) -> Vec<Line> {
    let (root, tolerance) = (&roots[polygon as usize], geometry.tolerance);
    let (low, high) = bounds(root);
    let (low, high) = (low - tolerance, high + tolerance);
    let surface = &geometry.surfaces[polygon as usize];
    let apart = |a: Vec3, b: Vec3| a.cmpgt(high).any() || b.cmplt(low).any();
    let mut found = Vec::new();
    let mut open = vec![0_u32];
    while let Some(index) = open.pop() {
        let node = &clusters.nodes[index as usize];
        if apart(node.low, node.high) {
            continue;
        }
        if node.second != 0 {
            open.extend([index + 1, node.second]);
            continue;
        }
        for &other in clusters.members(index) {
            let root = &roots[other as usize];
            let (a, b) = bounds(root);
            if other == polygon || geometry.scene.polygons[polygon as usize].twin == Some(other) || apart(a, b) {
                continue;
            }
            if is_under(other, polygon, geometry) {
                // Where it ends nobody sees.
                continue;
            }
            let corners = &root.corners[..root.count as usize];
            let heights: Vec<f32> = corners.iter().map(|&corner| surface.normal.dot(corner) - surface.offset).collect();
            for k in 0..corners.len() {
                let next = (k + 1) % corners.len();
                if heights[k].abs() <= tolerance && heights[next].abs() <= tolerance {
                    found.push([corners[k], corners[next]]);
                }
            }
            // Where it cuts through the plane.
            let mut ends = Vec::new();
            for k in 0..corners.len() {
                let next = (k + 1) % corners.len();
                let (p, q) = (heights[k], heights[next]);
                if p.min(q) < -tolerance && p.max(q) > tolerance {
                    ends.push(corners[k] + (corners[next] - corners[k]) * (p / (p - q)));
                } else if p.abs() <= tolerance && q.abs() > tolerance {
                    ends.push(corners[k]);
                }
            }
            if let [from, to] = ends[..] {
                found.push([from, to]);
            }
        }
    }
    found.retain(|segment| crosses(root, segment, surface.normal, tolerance));
    found
}

/// Does a surface lie in one plane with another one, and under it?
fn is_under(side: u32, other: u32, geometry: &Geometry) -> bool {
    let polygons = &geometry.scene.polygons;
    let sides = |side: u32| [Some(side), polygons[side as usize].twin];
    !geometry.overlaps.is_empty()
        && sides(side).into_iter().flatten().any(|under| {
            let lies_on = |over: u32| geometry.overlaps.lies_on(over, under, &geometry.root(over).corners);
            sides(other).into_iter().flatten().any(lies_on)
        })
}

fn bounds(root: &Element) -> (Vec3, Vec3) {
    root.corners
        .iter()
        .fold((root.corners[0], root.corners[0]), |(low, high), &corner| (low.min(corner), high.max(corner)))
}

/// The part of a segment of an element's plane that runs through its inside, further than a tolerance from its sides.
fn within(element: &Element, segment: &[Vec3; 2], normal: Vec3, tolerance: f32) -> Option<[Vec3; 2]> {
    clipped(element, segment, normal, |side| tolerance.max(1e-3 * side))
}

/// What of a segment is farther from all sides of an element, inwards, than `margin` says of a side of that length.
fn clipped(element: &Element, segment: &[Vec3; 2], normal: Vec3, margin: impl Fn(f32) -> f32) -> Option<[Vec3; 2]> {
    let corners = &element.corners[..element.count as usize];
    // The part of the segment that is left of all sides.
    let (mut from, mut to) = (0.0_f32, 1.0_f32);
    for k in 0..corners.len() {
        let side = corners[(k + 1) % corners.len()] - corners[k];
        let inward = normal.cross(side).normalize_or_zero();
        let margin = margin(side.length());
        let depth = [0, 1].map(|end: usize| inward.dot(segment[end] - corners[k]) - margin);
        match (depth[0] > 0.0, depth[1] > 0.0) {
            (false, false) => return None,
            (true, true) => {}
            (true, false) => to = to.min(depth[0] / (depth[0] - depth[1])),
            (false, true) => from = from.max(depth[0] / (depth[0] - depth[1])),
        }
    }
    (from < to).then(|| [from, to].map(|share| segment[0] + (segment[1] - segment[0]) * share))
}

fn crosses(element: &Element, segment: &[Vec3; 2], normal: Vec3, tolerance: f32) -> bool {
    within(element, segment, normal, tolerance).is_some()
}

/// Marks roots: crossed or not (if there are `lines`), covered or not.
pub(crate) fn mark(elements: &mut [Element], geometry: &Geometry, lines: bool) {
    elements.par_iter_mut().for_each(|element| {
        element.crossed = lines && geometry.contacts.any(element.polygon);
        element.lined = lined_parts(element, u16::MAX, geometry);
        (element.open, element.divided) = open_parts(element, geometry);
    });
}

/// The parts of an element, of those in `among`, that a line of contact may run through or along.
fn lined_parts(element: &Element, among: u16, geometry: &Geometry) -> u16 {
    if !element.crossed {
        return 0;
    }
    let (normal, beside) = (geometry.surfaces[element.polygon as usize].normal, BESIDE * geometry.tolerance);
    let lines: Vec<&Line> = geometry.contacts.near(element, beside).collect();
    let mut lined = 0;
    for (quadrant, quarter) in element.quarters(0).iter().enumerate() {
        if among >> (4 * quadrant) & 0b1111 == 0 {
            continue;
        }
        for (k, part) in quarter.quarters(0).iter().enumerate() {
            let meets = |line: &&Line| clipped(part, line, normal, |_| -beside).is_some();
            lined |= u16::from(lines.iter().any(meets)) << (4 * quadrant + k);
        }
    }
    lined & among
}

/// The parts of an element whose own points nothing covers (of one that nothing stands on all or none), and whether there are
/// open places on either side of a line of contact.
fn open_parts(element: &Element, geometry: &Geometry) -> (u16, bool) {
    if !element.crossed {
        // Under what hangs free it may be dark at the middle only.
        let mut places = [Vec3::ZERO; 5];
        places[0] = element.centre();
        (0..4).for_each(|k| places[k + 1] = places[0].lerp(element.corners[k], TOWARDS_CORNERS));
        let covered = places.iter().all(|&place| is_covered(place, element.polygon, geometry));
        return (if covered { 0 } else { u16::MAX }, false);
    }
    let own: [Vec3; 16] = std::array::from_fn(|part| own_point(element, part).0);
    let open = !covered(&own, element.polygon, geometry);
    let mut lit: Vec<Vec3> = (0..16).filter(|part| open >> part & 1 == 1).map(|part| own[part]).collect();
    let normal = geometry.surfaces[element.polygon as usize].normal;
    let is_divided = |lit: &[Vec3]| {
        geometry.contacts.near(element, geometry.tolerance).any(|line| {
            let Some([from, to]) = within(element, line, normal, geometry.tolerance) else { return false };
            let left = |point: &Vec3| normal.dot((to - from).cross(*point - from)) > 0.0;
            lit.iter().any(left) && !lit.iter().all(left)
        })
    };
    if open != 0 && is_divided(&lit) {
        return (open, true);
    }
    let from_strips = strips(element, geometry, &mut lit);
    let divided = open == 0 && from_strips != 0 || is_divided(&lit);
    (if open == 0 { from_strips } else { open }, divided)
}

/// How far from the middle to the corners an element that nothing stands on is asked whether it is covered.
const TOWARDS_CORNERS: f32 = 0.95;

/// Places along a line of contact at which both sides are asked, as shares of its part within an element.
const PLACES: [f32; 5] = [0.03, 0.27, 0.5, 0.73, 0.97];

/// Distance from a line of contact at which its sides are asked, in tolerances.
const BESIDE: f32 = 8.0;

/// The parts of an element that hold something open beside a line of contact: what is open ends at such lines. Appends the
/// places.
fn strips(element: &Element, geometry: &Geometry, lit: &mut Vec<Vec3>) -> u16 {
    let normal = geometry.surfaces[element.polygon as usize].normal;
    let mut open = 0;
    for line in geometry.contacts.near(element, geometry.tolerance) {
        let Some([from, to]) = within(element, line, normal, geometry.tolerance) else { continue };
        let aside = normal.cross(to - from).normalize_or_zero() * (BESIDE * geometry.tolerance);
        let places = PLACES.iter().flat_map(|place| [aside, -aside].map(|side| from + (to - from) * place + side));
        let places: Vec<Vec3> = places.filter(|&place| is_inside(element, place, normal)).collect();
        let covered = covered(&places, element.polygon, geometry);
        for (k, &place) in places.iter().enumerate() {
            if covered >> k & 1 == 0 {
                open |= 1 << part_at(element, place, normal);
                lit.push(place);
            }
        }
    }
    open
}

fn is_inside(element: &Element, point: Vec3, normal: Vec3) -> bool {
    let corners = &element.corners[..element.count as usize];
    (0..corners.len()).all(|k| {
        let side = corners[(k + 1) % corners.len()] - corners[k];
        normal.dot(side.cross(point - corners[k])) >= 0.0
    })
}

/// Which of the sixteen parts of an element holds a point.
fn part_at(element: &Element, point: Vec3, normal: Vec3) -> usize {
    let quarter = quadrant(element, normal, point);
    quarter << 2 | quadrant(&element.quarters(0)[quarter], normal, point)
}

/// Directions that a point looks in, as height over its plane and turn about its normal, radians: up and around, then
/// around closer to the plane. What is open sees out in one of the first, mostly.
const LOOKS: [(f32, f32); 13] = [
    (0.8, 0.4),
    (0.8, 3.5),
    (1.57, 0.0),
    (0.8, 2.0),
    (0.8, 5.1),
    (0.25, 0.0),
    (0.25, 0.8),
    (0.25, 1.6),
    (0.25, 2.4),
    (0.25, 3.1),
    (0.25, 3.9),
    (0.25, 4.7),
    (0.25, 5.5),
];

/// Low looks that may see out though the point is inside something solid: modellers leave out the faces where parts meet, and
/// edges do not close.
const STRAY: usize = 2;

/// Looks that are high: what one of them sees lights the point.
const HIGH: usize = 5;

/// Looks that see backs where a point may be inside something solid that other surfaces close: behind a skirting board that
/// has no back, wall and floor are in view too, and beside the line where these meet fill half of it.
const MOST: usize = 5;

/// Looks after which a point that has seen no back is open.
const FIRST: usize = 3;

/// Does another face lie on a point of a polygon, in its plane, or is the point inside something solid: does it see nothing
/// but backs of surfaces without a lit back, and fronts that see little else themselves, whichever way it looks? Under a
/// table's top, whose underside may be such a back, it sees out at the sides.
pub(crate) fn is_covered(point: Vec3, polygon: u32, geometry: &Geometry) -> bool {
    covered(&[point], polygon, geometry) != 0
}

/// Bit k: point k of up to sixteen of a polygon is covered, as [`is_covered`] says. They look together: rays to one side
/// from places close to each other meet the same things.
fn covered(points: &[Vec3], polygon: u32, geometry: &Geometry) -> u16 {
    let under = |point: Vec3| geometry.overlaps.on_top(polygon, point).is_some();
    let under = points.iter().enumerate().fold(0, |bits, (k, &point)| bits | u16::from(under(point)) << k);
    let (doubtful, seen) = look_around(points, !under, polygon, geometry);
    let inside = (0..points.len()).filter(|&k| doubtful >> k & 1 == 1 && is_inside_solid(&seen[k], geometry));
    inside.fold(under, |covered, k| covered | 1 << k)
}

/// Is what a point sees nothing but backs, and fronts that see little else themselves?
fn is_inside_solid(seen: &[Seen; LOOKS.len()], geometry: &Geometry) -> bool {
    let backs = |seen: &[Seen]| seen.iter().filter(|seen| matches!(seen, Seen::Back)).count();
    if backs(seen) < MOST {
        return false;
    }
    let is_out = |seen: &Seen| match *seen {
        Seen::Back => false,
        Seen::Front(place, side) => {
            let (doubtful, seen) = look_around(&[place], 1, side, geometry);
            doubtful == 0 || backs(&seen[0]) < MOST
        }
        Seen::Nothing => true,
    };
    let (high, low) = seen.split_at(HIGH);
    !high.iter().any(is_out) && low.iter().filter(|seen| is_out(seen)).count() <= STRAY
}

/// What a look sees.
#[derive(Clone, Copy)]
enum Seen {
    /// The back of something solid.
    Back,
    /// A place on a front, and whose.
    Front(Vec3, u32),
    Nothing,
}

/// What those of up to sixteen points of a polygon see, look by look, that `among` has a bit of; and bits of those that see
/// a back in the first looks. Others look no further.
fn look_around(points: &[Vec3], among: u16, polygon: u32, geometry: &Geometry) -> (u16, Vec<[Seen; LOOKS.len()]>) {
    let mut seen = vec![[Seen::Nothing; LOOKS.len()]; points.len()];
    look(points, among, 0..FIRST, polygon, geometry, &mut seen);
    let sees_back = |seen: &[Seen; LOOKS.len()]| seen[..FIRST].iter().any(|seen| matches!(seen, Seen::Back));
    let doubtful = seen.iter().enumerate().fold(0, |bits, (k, seen)| bits | u16::from(sees_back(seen)) << k);
    look(points, doubtful, FIRST..LOOKS.len(), polygon, geometry, &mut seen);
    (doubtful, seen)
}

/// A look as a direction.
struct Direction {
    /// Height over the plane, and what is left for the plane's two axes, of a length of 1.
    rise: f32,
    along: f32,
    across: f32,
}

static DIRECTIONS: LazyLock<[Direction; LOOKS.len()]> = LazyLock::new(|| {
    LOOKS.map(|(height, turn)| {
        let ((rise, run), (across, along)) = (libm::sincosf(height), libm::sincosf(turn));
        Direction { rise, along: run * along, across: run * across }
    })
});

/// Finds what some of the [`LOOKS`] see from those of up to sixteen points of a polygon that `among` has a bit of: look by
/// look, so that rays of a packet are parallel where there are many points.
fn look(
    points: &[Vec3],
    among: u16,
    looks: Range<usize>,
    polygon: u32,
    geometry: &Geometry,
    seen: &mut [[Seen; LOOKS.len()]],
) {
    let normal = geometry.surfaces[polygon as usize].normal;
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let (mut probes, mut rays) = (Probes::new(), [(0, 0, Vec3::ZERO); RAYS]);
    let mut find = |probes: &mut Probes, rays: &[(usize, usize, Vec3)]| {
        for (&(look, k, direction), hit) in rays.iter().zip(geometry.first_hits(probes)) {
            seen[k][look] = seen_along(points[k], direction, hit, geometry);
        }
        *probes = Probes::new();
    };
    for look in looks {
        let Direction { rise, along, across } = DIRECTIONS[look];
        let direction = tangent * along + bitangent * across + normal * rise;
        for k in (0..points.len()).filter(|k| among >> k & 1 == 1) {
            rays[probes.count] = (look, k, direction);
            probes.push(points[k], direction, 2.0 * geometry.tolerance / rise);
            if probes.count == RAYS {
                find(&mut probes, &rays);
            }
        }
    }
    if probes.count > 0 {
        let count = probes.count;
        find(&mut probes, &rays[..count]);
    }
}

/// Most places at which one look goes on from where two single-sided faces lie back to back.
const MOST_TURNS: usize = 16;

/// Height of looks that go on from there, radians: that of the low ones.
const TURNED: f32 = 0.25;

/// What a look from a point sees that first hits that.
///
/// Where two single-sided faces lie back to back, the wall of the next room and the side of the next box of a stack
/// look alike: the front of one, and the black back of the other. There a look goes on, low over that place, until it
/// sees something else. Between the floors of a house it finds the walls of the storey, in a stack the sides of the
/// box.
fn seen_along(point: Vec3, direction: Vec3, hit: Option<Hit>, geometry: &Geometry) -> Seen {
    let (mut from, mut direction, mut hit) = (point, direction, hit);
    let (rise, run) = libm::sincosf(TURNED);
    for _ in 0..=MOST_TURNS {
        let Some(first) = hit else { return Seen::Nothing };
        let polygon = geometry.polygon_of[first.primitive as usize];
        let front = &geometry.scene.polygons[polygon as usize];
        let solid = front.twin.is_none() && front.mask.is_none() && front.opacity >= 1.0;
        let place = from + direction * first.t;
        if !solid {
            return Seen::Front(place, polygon);
        }
        let faces = geometry.surfaces[polygon as usize].normal.dot(direction) <= 0.0;
        let other = geometry.overlaps.before_back(polygon, place);
        let side = if faces {
            polygon
        } else if let Some(other) = other {
            other
        } else {
            return Seen::Back;
        };
        // Of polygons that face the same way only lit backs are met before a black one.
        let is_single = |side: u32| {
            (side as usize) < geometry.scene.fronts && geometry.scene.polygons[side as usize].twin.is_none()
        };
        if !other.is_some_and(is_single) {
            return Seen::Front(place, side);
        }
        from = place;
        let normal = geometry.surfaces[side as usize].normal;
        let flat = direction - normal * normal.dot(direction);
        let along = flat.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
        direction = along * run + normal * rise;
        hit = geometry.first_hit(from, direction, 2.0 * geometry.tolerance / rise);
    }
    // As far as it went there were rooms without an end.
    Seen::Nothing
}

/// Cuts elements, those that are not yet; which places of the parts are covered is found side by side.
pub(crate) fn split(elements: &mut Vec<Element>, nodes: impl IntoIterator<Item = u32>, geometry: &Geometry) {
    let mut parents = Vec::new();
    for node in nodes {
        if elements[node as usize].first_child == NONE {
            elements[node as usize].first_child = (elements.len() + 4 * parents.len()) as u32;
            parents.push(node);
        }
    }
    let parts: Vec<[Element; 4]> =
        parents.par_iter().map(|&node| parts_of(&elements[node as usize], node, geometry)).collect();
    elements.extend(parts.into_iter().flatten());
}

fn parts_of(element: &Element, own: u32, geometry: &Geometry) -> [Element; 4] {
    let normal = geometry.surfaces[element.polygon as usize].normal;
    let mut parts = element.parts(own);
    for (index, part) in parts.iter_mut().enumerate() {
        part.open = element.open;
        if element.crossed {
            let mut lines = geometry.contacts.near(part, geometry.tolerance);
            part.crossed = lines.any(|line| crosses(part, line, normal, geometry.tolerance));
            // Quarters of a quarter are among the sixteen parts of the element; strips lie across them.
            let among = (0..4).filter(|k| element.lined >> (4 * index + k) & 1 == 1);
            let among = among.fold(0, |parts, k| parts | 0b1111 << (4 * k));
            part.lined = lined_parts(part, if element.cut == Cut::Quarters { among } else { u16::MAX }, geometry);
            (part.open, part.divided) = open_parts(part, geometry);
        }
    }
    parts
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::samples::painted;

    /// A floor of 4 x 4 about the middle, and a wall that stands on it at x = 0 from z = -1 to z = 1.
    fn floor_and_wall() -> Geometry {
        single_sided(&[
            [[-2.0, 0.0, -2.0], [-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0]],
            [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 1.0, -1.0]],
        ])
    }

    fn single_sided(faces: &[[[f64; 3]; 4]]) -> Geometry {
        let faces: Vec<&[[f64; 3]]> = faces.iter().map(|face| &face[..]).collect();
        let mut geometry = Geometry::new(painted(&faces, 0.5, 0.0));
        let roots = geometry.bare_roots();
        let clusters = Clusters::new(&roots, &vec![true; roots.len()]);
        geometry.contacts = Contacts::new(&geometry, &clusters, &roots);
        geometry
    }

    /// Catches parts of elements that pass for free of lines of contact though one runs through them: rays would start behind
    /// it. The foot of a slanting wall cuts through parts, and ends within them.
    #[test]
    fn no_line_of_contact_lies_between_places_of_a_part_that_has_none() {
        let geometry = single_sided(&[
            [[-2.0, 0.0, -2.0], [-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0]],
            [[0.3, 0.0, -1.1], [0.9, 0.0, 1.3], [0.9, 1.0, 1.3], [0.3, 1.0, -1.1]],
        ]);
        let mut elements = vec![geometry.root(0)];
        mark(&mut elements, &geometry, true);
        for _ in 0..2 {
            let leaves: Vec<u32> =
                (0..elements.len() as u32).filter(|&node| elements[node as usize].first_child == NONE).collect();
            split(&mut elements, leaves, &geometry);
        }
        let (mut lined, mut free) = (0, 0);
        for element in elements.iter().filter(|element| element.crossed) {
            lined += element.lined.count_ones();
            let unlined = (0..16).filter(|part| element.lined >> part & 1 == 0);
            for part in unlined {
                free += 1;
                let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
                let places = corners.map(|jitter| crate::rays::point_of(element, 2, part, jitter).0);
                let pairs = [(0, 2), (1, 3), (0, 1), (1, 2), (2, 3), (3, 0)];
                let is_between = |&(k, l): &(usize, usize)| {
                    geometry.contacts.between(places[k], places[l], element.polygon, &geometry)
                };
                assert!(!pairs.iter().any(is_between), "{part} of {element:?}");
            }
        }
        // Measured 24 and 88: four parts of the floor, and about twice as many half as large at each further level.
        assert!((20..30).contains(&lined) && free > 50, "{lined} {free}");
    }

    /// Catches points of a check that stand where rounding decides which side of a wall they are on, and points that
    /// are left out though they do not: the wall's foot ends inside the floor.
    #[test]
    fn a_point_is_on_a_line_within_a_few_tolerances_of_it() {
        let geometry = floor_and_wall();
        let (floor, wall) = (geometry.root(0), geometry.root(1));
        let (tolerance, height) = (geometry.tolerance, floor.corners[0].y);
        let is_on = |x: f32, z: f32, element: &Element| is_on_line(Vec3::new(x, height, z), element, &geometry);
        for (distance, expected) in [(0.0, true), (BESIDE - 1.0, true), (BESIDE + 1.0, false), (1000.0, false)] {
            let off = distance * tolerance;
            for z in [-0.9, 0.0, 0.3] {
                assert_eq!(is_on(off, z, &floor), expected, "{distance} {z}");
                assert_eq!(is_on(-off, z, &floor), expected, "{distance} {z}");
            }
            // Beyond either end, and in all directions about it alike.
            for end in [-1.0_f32, 1.0] {
                assert_eq!(is_on(0.0, end + end * off, &floor), expected, "{distance} {end}");
                let aside = off * std::f32::consts::FRAC_1_SQRT_2;
                assert_eq!(is_on(aside, end + end * aside, &floor), expected, "{distance} {end}");
            }
        }
        // The wall only ends there; nothing stands on it.
        assert!(!is_on(0.0, 0.0, &wall));
        // Of the floor's quarters those that the line does not come near have none.
        let near: Vec<bool> = floor.quarters(0).iter().map(|quarter| is_on(0.0, 0.5, quarter)).collect();
        assert!(near.contains(&true), "{near:?}");
        let corner = floor.quarters(0)[0].quarters(0)[0];
        assert!(!is_on(corner.centre().x, corner.centre().z, &corner));
    }

    /// Catches an answer that belongs to another of the points that look together, and points under a box that stands on the
    /// floor that are taken for open because others are.
    #[test]
    fn points_that_look_together_are_covered_as_each_is_alone() {
        // A box without a bottom on a floor.
        let box_at = |x: f64, z: f64, y: f64| [x, y, z];
        let (low, high) = (-0.5, 0.5);
        let geometry = single_sided(&[
            [[-2.0, 0.0, -2.0], [-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0]],
            [box_at(low, low, 1.0), box_at(low, high, 1.0), box_at(high, high, 1.0), box_at(high, low, 1.0)],
            [box_at(low, low, 0.0), box_at(low, low, 1.0), box_at(high, low, 1.0), box_at(high, low, 0.0)],
            [box_at(high, high, 0.0), box_at(high, high, 1.0), box_at(low, high, 1.0), box_at(low, high, 0.0)],
            [box_at(low, high, 0.0), box_at(low, high, 1.0), box_at(low, low, 1.0), box_at(low, low, 0.0)],
            [box_at(high, low, 0.0), box_at(high, low, 1.0), box_at(high, high, 1.0), box_at(high, high, 0.0)],
        ]);
        let middle = geometry.middle.as_vec3();
        let mut stream = isolux_core::sampling::Stream::new(3);
        let mut both = 0;
        for turn in 0..200 {
            let mut across = || 1.6 * (stream.next_unit() as f32 - 0.5);
            let points: Vec<Vec3> = (0..=turn % 16).map(|_| Vec3::new(across(), 0.0, across()) - middle).collect();
            let covered = covered(&points, 0, &geometry);
            for (k, &point) in points.iter().enumerate() {
                let at = point + middle;
                let is_under = at.x.abs().max(at.z.abs()) < 0.5;
                assert_eq!(covered >> k & 1 == 1, is_covered(point, 0, &geometry), "{k} of {turn}");
                assert_eq!(covered >> k & 1 == 1, is_under, "{at}");
            }
            assert_eq!(u32::from(covered) >> points.len(), 0);
            both += usize::from(covered != 0 && covered.count_ones() < points.len() as u32);
        }
        assert!(both > 50, "{both}");
    }

    /// Catches light behind a skirting board: of the strips of floor and wall that it hides, those close to the line where
    /// floor and wall meet see as much of these as of the board's back.
    #[test]
    fn what_a_skirting_board_hides_is_covered_up_to_the_foot_of_the_wall() {
        // Floor, wall at x = 0, and a board of 8 cm in front of it, 15 mm deep, without a back and without a bottom; open ends
        // are far away.
        let geometry = single_sided(&[
            [[0.0, 0.0, -2.0], [0.0, 0.0, 2.0], [4.0, 0.0, 2.0], [4.0, 0.0, -2.0]],
            [[0.0, 0.0, -2.0], [0.0, 2.0, -2.0], [0.0, 2.0, 2.0], [0.0, 0.0, 2.0]],
            [[0.015, 0.0, -2.0], [0.015, 0.08, -2.0], [0.015, 0.08, 2.0], [0.015, 0.0, 2.0]],
            [[0.0, 0.08, -2.0], [0.0, 0.08, 2.0], [0.015, 0.08, 2.0], [0.015, 0.08, -2.0]],
        ]);
        let middle = geometry.middle.as_vec3();
        let is_hidden = |polygon: u32, x: f32, y: f32| is_covered(Vec3::new(x, y, 0.3) - middle, polygon, &geometry);
        for step in 1..30 {
            let share = step as f32 / 30.0;
            assert!(is_hidden(0, 0.015 * share, 0.0), "floor, {share}");
            assert!(is_hidden(1, 0.0, 0.08 * share), "wall, {share}");
            assert!(!is_hidden(0, 0.015 + 0.03 * share, 0.0), "floor in front, {share}");
            assert!(!is_hidden(1, 0.0, 0.08 + 0.1 * share), "wall above, {share}");
        }
    }

    /// Catches points at which a ray starts on the other side of what stands on an element, and such as are taken for that.
    #[test]
    fn a_line_of_contact_lies_between_its_sides_and_nowhere_else() {
        let geometry = floor_and_wall();
        let height = geometry.root(0).corners[0].y;
        let between = |from: [f32; 2], to: [f32; 2]| {
            let [from, to] = [from, to].map(|[x, z]| Vec3::new(x, height, z));
            geometry.contacts.between(from, to, 0, &geometry)
        };
        assert!(between([-0.1, 0.2], [0.1, 0.3]));
        assert!(between([-1.5, -1.5], [1.5, 1.5]));
        assert!(!between([-0.1, 0.2], [-0.01, -0.9]));
        // Past the wall's ends.
        assert!(!between([-0.1, 1.2], [0.1, 1.2]));
        assert!(!between([-1.9, 0.5], [0.3, 1.9]));
    }

    /// Catches points of a check that rounding puts behind what meets the border, and others that are left out.
    #[test]
    fn a_point_is_on_the_border_within_a_few_tolerances_of_it() {
        let geometry = floor_and_wall();
        let (wall, middle, tolerance) = (geometry.root(1), geometry.middle.as_vec3(), geometry.tolerance);
        let is_on = |y: f32, z: f32| is_on_border(Vec3::new(0.0, y, z) - middle, &wall, &geometry);
        for (distance, expected) in [(0.0, true), (BESIDE - 1.0, true), (BESIDE + 1.0, false), (1000.0, false)] {
            let off = distance * tolerance;
            for (y, z) in [(off, 0.0), (1.0 - off, 0.5), (0.5, 1.0 - off), (0.3, off - 1.0)] {
                assert_eq!(is_on(y, z), expected, "{distance}: {y} {z}");
            }
        }
    }
}
