//! A scene in single precision about its middle: surfaces, the quadtrees above them that grow by need, and the tree that
//! rays walk.

use crate::contacts::Contacts;
use crate::overlaps::Overlaps;
use crate::rays::RAYS;
use crate::sky::Dome;
use glam::{DVec3, Vec3};
use isolux_core::sampling::Stream;
use isolux_core::scene::{Corners, Scene};
use isolux_core::tree::{Cut, Path};
use isolux_simd::bvh::{Bvh8, Filter, Hit, Primitive, Rays};
use isolux_simd::lanes::Backend;
use std::sync::Arc;

/// Distance below which things count as touching, in the scene's diameters. Coordinates about the middle carry a rounding
/// of 3e-8 diameters, a ray's hit a few times that: 40 micrometres in a room of 10 m are a hundred of them, and a 25th of
/// the gap of 1 mm that must be resolved there.
const RELATIVE_TOLERANCE: f64 = 4e-6;

/// No index: parent of a root, child of a leaf.
pub(crate) const NONE: u32 = u32::MAX;

/// What a polygon is to light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// Unit normal on the lit side.
    pub(crate) normal: Vec3,
    /// Distance of the plane from the middle, along the normal, metres.
    pub(crate) offset: f32,
    pub(crate) reflectance: [f32; 3],
    pub(crate) emission: [f32; 3],
}

/// A node of a polygon's quadtree: the polygon itself, or a quarter of its parent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element {
    /// Counter-clockwise; the last of a triangle is its third again.
    pub(crate) corners: [Vec3; 4],
    pub(crate) area: f32,
    pub(crate) polygon: u32,
    pub(crate) parent: u32,
    pub(crate) first_child: u32,
    /// 3 or 4.
    pub(crate) count: u8,
    /// Does a line of contact run through it?
    pub(crate) crossed: bool,
    /// Which of its sixteen parts, in the order of the quadtree, such a line may run through or along.
    pub(crate) lined: u16,
    /// Is it open on both sides of such a line, so that it may be lit on one and dark on the other?
    pub(crate) divided: bool,
    /// Which of its sixteen parts, in the order of the quadtree, nothing covers.
    pub(crate) open: u16,
    /// How it is cut into parts, when it is.
    pub(crate) cut: Cut,
    pub(crate) path: Path,
}

impl Element {
    /// Its middle: mean of its corners.
    pub(crate) fn centre(&self) -> Vec3 {
        let sum = self.corners[0] + self.corners[1] + self.corners[2];
        if self.count == 4 { (sum + self.corners[3]) * 0.25 } else { sum / 3.0 }
    }

    /// Share that nothing covers.
    pub(crate) fn open_share(&self) -> f32 {
        self.open.count_ones() as f32 / 16.0
    }

    /// Greatest distance of a corner from the middle, metres.
    pub(crate) fn radius(&self) -> f32 {
        let centre = self.centre();
        self.corners.iter().map(|corner| corner.distance_squared(centre)).fold(0.0, f32::max).sqrt()
    }

    /// [`lean`] of its corners.
    pub(crate) fn lean(&self) -> [f32; 2] {
        if self.count == 4 { lean(self.corners) } else { [0.0; 2] }
    }

    pub(crate) fn new(corners: [Vec3; 4], count: u8, polygon: u32, parent: u32, path: Path) -> Element {
        let [a, b, c, d] = corners;
        let area = 0.5 * (c - a).cross(d - b).length();
        let area = if count == 4 { area } else { 0.5 * (b - a).cross(c - a).length() };
        Element {
            corners,
            area,
            polygon,
            parent,
            first_child: NONE,
            count,
            crossed: false,
            lined: 0,
            divided: false,
            open: u16::MAX,
            cut: Cut::Quarters,
            path,
        }
    }

    /// The cut that makes it less long: see [`Cut::of_sides`].
    pub(crate) fn compact_cut(&self) -> Cut {
        if self.count == 3 {
            return Cut::Quarters;
        }
        let [a, b, c, d] = self.corners;
        let (along, across) = (b - a + c - d, d - a + c - b);
        Cut::of_sides(along.length_squared().into(), across.length_squared().into())
    }

    /// What it is cut into. Strips may be long themselves; quarters are as long as it is.
    pub(crate) fn parts(&self, own: u32) -> [Element; 4] {
        if self.cut == Cut::Quarters {
            return self.quarters(own);
        }
        let [a, b, c, d] = self.corners;
        let middle = |a: Vec3, b: Vec3| (a + b) * 0.5;
        let quartered = |from: Vec3, to: Vec3| {
            let half = middle(from, to);
            [from, middle(from, half), half, middle(half, to), to]
        };
        let along = self.cut == Cut::Along;
        let (near, far) = if along { (quartered(a, b), quartered(d, c)) } else { (quartered(a, d), quartered(b, c)) };
        std::array::from_fn(|k| {
            let corners = if along {
                [near[k], near[k + 1], far[k + 1], far[k]]
            } else {
                [near[k], far[k], far[k + 1], near[k + 1]]
            };
            let part = Element::new(corners, 4, self.polygon, own, self.path.child(k as u32));
            Element { cut: part.compact_cut(), ..part }
        })
    }

    /// Its quarters: quarter k < n touches corner k, the fourth of a triangle is its middle.
    pub(crate) fn quarters(&self, own: u32) -> [Element; 4] {
        let [a, b, c, d] = self.corners;
        let middle = |a: Vec3, b: Vec3| (a + b) * 0.5;
        let (ab, bc) = (middle(a, b), middle(b, c));
        let corners = if self.count == 4 {
            let (cd, da, centre) = (middle(c, d), middle(d, a), middle(middle(a, c), middle(b, d)));
            [[a, ab, centre, da], [ab, b, bc, centre], [centre, bc, c, cd], [da, centre, cd, d]]
        } else {
            let ca = middle(c, a);
            [[a, ab, ca, ca], [ab, b, bc, bc], [ca, bc, c, c], [bc, ca, ab, ab]]
        };
        let path = |k: usize| self.path.child(k as u32);
        std::array::from_fn(|k| Element::new(corners[k], self.count, self.polygon, own, path(k)))
    }
}

/// What slopes count in the mean over a quadrilateral: of a function that is `u` (`v`) of its coordinates from -1 to 1, along
/// the first and the second side. Where these are not parallel to those across from them, one end of it is larger than the
/// other: a third of what the determinant of the bilinear map grows, over its middle. 0 on parallelograms.
pub(crate) fn lean([a, b, c, d]: [Vec3; 4]) -> [f32; 2] {
    let bent = a - b + c - d;
    let (along, across) = (b - a + c - d, d - a + c - b);
    let normal = along.cross(across);
    let whole = normal.length_squared();
    if bent.length_squared() <= BENT * whole.sqrt() {
        return [0.0; 2];
    }
    [along.cross(bent).dot(normal), bent.cross(across).dot(normal)].map(|grows| grows / (3.0 * whole))
}

/// Square of what the corners of a quadrilateral miss to be those of a parallelogram, over four times its area, below which it
/// is rounding.
const BENT: f32 = 1e-10;

/// Everything that light does not change.
pub(crate) struct Geometry {
    pub(crate) scene: Arc<Scene>,
    /// What was taken from every coordinate.
    pub(crate) middle: DVec3,
    pub(crate) tolerance: f32,
    pub(crate) surfaces: Vec<Surface>,
    pub(crate) bvh: Bvh8,
    /// Front polygon of each primitive of the tree.
    pub(crate) polygon_of: Vec<u32>,
    primitives: Vec<Primitive>,
    /// Is every surface opaque?
    pub(crate) opaque: bool,
    pub(crate) backend: Backend,
    /// Lines along which other polygons touch or cross each polygon.
    pub(crate) contacts: Contacts,
    /// What lies on each side in its plane.
    pub(crate) overlaps: Overlaps,
    /// The sky, where there is one.
    pub(crate) dome: Option<Dome>,
}

impl Geometry {
    pub(crate) fn new(scene: Arc<Scene>) -> Geometry {
        Geometry::build(scene, true)
    }

    /// The same with two triangles for each parallelogram.
    pub(crate) fn in_triangles(&self) -> Geometry {
        Geometry { contacts: self.contacts.clone(), ..Geometry::build(self.scene.clone(), false) }
    }

    fn build(scene: Arc<Scene>, parallelograms: bool) -> Geometry {
        let fronts = &scene.polygons[..scene.fronts];
        let corners = || fronts.iter().flat_map(|polygon| polygon.corners.iter().copied());
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        let middle = (low + high) * 0.5;
        let point = |corner: DVec3| (corner - middle).as_vec3();
        let surfaces = scene.polygons.iter().map(|polygon| {
            let normal = polygon.plane.normal.as_vec3();
            let offset = (polygon.plane.offset - polygon.plane.normal.dot(middle)) as f32;
            let bands = |rgb: isolux_core::units::Rgb| rgb.0.map(|value| value as f32);
            Surface { normal, offset, reflectance: bands(polygon.reflectance), emission: bands(polygon.emission) }
        });
        let surfaces: Vec<Surface> = surfaces.collect();
        let tolerance = (scene.diameter * RELATIVE_TOLERANCE) as f32;
        let mut primitives = Vec::with_capacity(fronts.len());
        let mut polygon_of = Vec::with_capacity(fronts.len());
        for (index, polygon) in fronts.iter().enumerate() {
            let opaque = polygon.mask.is_none() && polygon.opacity >= 1.0;
            let mut push = |a: DVec3, b: DVec3, c: DVec3, parallelogram| {
                let (origin, b, c) = (point(a), point(b), point(c));
                let (u, v) = ((b - origin).to_array(), (c - origin).to_array());
                primitives.push(Primitive { origin: origin.to_array(), u, v, parallelogram, opaque });
                polygon_of.push(index as u32);
            };
            match *polygon.corners {
                [a, b, c] => push(a, b, c, false),
                [a, b, c, d] if parallelograms && is_parallelogram(a, b, c, d, scene.tolerance()) => {
                    push(a, b, d, true);
                }
                [a, b, c, d] => {
                    push(a, b, c, false);
                    push(a, c, d, false);
                }
                _ => unreachable!("corners are three or four"),
            }
        }
        let opaque = primitives.iter().all(|primitive| primitive.opaque);
        let bvh = Bvh8::build(&primitives);
        let backend = Backend::best();
        let (contacts, overlaps) = (Contacts::default(), Overlaps::default());
        let dome = Dome::new(&scene);
        let mut geometry = Geometry {
            scene,
            middle,
            tolerance,
            surfaces,
            bvh,
            polygon_of,
            primitives,
            opaque,
            backend,
            contacts,
            overlaps,
            dome,
        };
        geometry.overlaps = Overlaps::new(&geometry);
        geometry
    }

    /// One element for each polygon, named by its index.
    pub(crate) fn bare_roots(&self) -> Vec<Element> {
        (0..self.scene.polygons.len() as u32).map(|polygon| self.root(polygon)).collect()
    }

    /// A polygon as an element.
    pub(crate) fn root(&self, polygon: u32) -> Element {
        self.part(&self.scene.polygons[polygon as usize].corners, polygon)
    }

    /// A part of a polygon as an element. It has the polygon's name.
    pub(crate) fn part(&self, corners: &Corners, polygon: u32) -> Element {
        Element::new(self.corners(corners), corners.len() as u8, polygon, NONE, Path::root(polygon))
    }

    fn corners(&self, corners: &Corners) -> [Vec3; 4] {
        std::array::from_fn(|k| (corners[k.min(corners.len() - 1)] - self.middle).as_vec3())
    }
}

/// Are opposite sides equal, to a tolerance in metres?
fn is_parallelogram(a: DVec3, b: DVec3, c: DVec3, d: DVec3, tolerance: f64) -> bool {
    (a - b + c - d).length() <= tolerance
}

/// What light passes through surfaces that are not opaque: opacity, or a texel of a mask.
impl Filter for Geometry {
    fn passes(&self, primitive: u32, u: f32, v: f32) -> f32 {
        let polygon = &self.scene.polygons[self.polygon_of[primitive as usize] as usize];
        if polygon.mask.is_none() {
            return (1.0 - polygon.opacity) as f32;
        }
        if self.is_solid(primitive, u, v) { 0.0 } else { 1.0 }
    }
}

/// What a ray ends on.
pub(crate) enum End {
    /// A side that surfaces have, and where.
    Side(u32, Vec3),
    /// A back that is black.
    Back,
    /// Nothing: it leaves the scene.
    Nowhere,
}

/// Most surfaces that let light pass which one ray goes through.
const MOST_PASSED: u32 = 64;

impl Geometry {
    /// Is a primitive solid at a place, or is there a hole of its mask?
    pub(crate) fn is_solid(&self, primitive: u32, u: f32, v: f32) -> bool {
        let polygon = &self.scene.polygons[self.polygon_of[primitive as usize] as usize];
        let Some(mask) = polygon.mask else { return true };
        let shape = &self.primitives[primitive as usize];
        let point = Vec3::from(shape.origin) + Vec3::from(shape.u) * u + Vec3::from(shape.v) * v;
        let uv = polygon.texture_coordinates(point.as_dvec3() + self.middle);
        uv.is_none_or(|uv| self.scene.masks[mask as usize].is_solid(uv))
    }

    /// Area of a polygon as groups of polygons count it, m²: none where other faces lie on all of it.
    pub(crate) fn counted_area(&self, root: &Element) -> f32 {
        if root.open == 0 && self.overlaps.any(root.polygon) { 0.0 } else { root.area }
    }

    /// The lit side that a ray meets which hits a front, from either side, at a place; nothing for a black back. And whether
    /// that side is not the front's own: it lies on it, or back to back with it, and is opaque.
    pub(crate) fn met(&self, front: u32, place: Vec3, direction: Vec3) -> (Option<u32>, bool) {
        let faces = self.surfaces[front as usize].normal.dot(direction) < 0.0;
        let own = if faces { Some(front) } else { self.scene.polygons[front as usize].twin };
        let other = match own {
            Some(side) => self.overlaps.on_top(side, place),
            None => self.overlaps.before_back(front, place),
        };
        (other.or(own), other.is_some())
    }

    /// The lit side that a ray from a surface sees, and where; chance decides at surfaces that let light pass. Nothing for
    /// black backs, and where the ray leaves the scene.
    pub(crate) fn look(&self, from: Vec3, normal: Vec3, direction: Vec3, stream: &mut Stream) -> Option<(u32, Vec3)> {
        match self.end(from, normal, direction, stream) {
            End::Side(side, place) => Some((side, place)),
            End::Back | End::Nowhere => None,
        }
    }

    /// The lit sides that up to sixteen rays from a place of a surface see, and where, as [`Geometry::look`] for each, but
    /// all at once.
    pub(crate) fn look_along(
        &self,
        from: Vec3,
        normal: Vec3,
        directions: &[Vec3],
        stream: &mut Stream,
    ) -> [Option<(u32, Vec3)>; RAYS] {
        let mut probes = Probes::new();
        directions.iter().for_each(|&direction| probes.push(from, direction, self.start(normal, direction)));
        let hits = self.first_hits(&probes);
        let mut seen = [None; RAYS];
        for ((seen, &direction), hit) in seen.iter_mut().zip(directions).zip(hits) {
            if let End::Side(side, place) = self.end_after(hit, from, direction, stream) {
                *seen = Some((side, place));
            }
        }
        seen
    }

    /// What a ray from a surface ends on; chance decides at surfaces that let light pass.
    pub(crate) fn end(&self, from: Vec3, normal: Vec3, direction: Vec3, stream: &mut Stream) -> End {
        let hit = self.first_hit(from, direction, self.start(normal, direction));
        self.end_after(hit, from, direction, stream)
    }

    /// What a ray ends on that first hits that.
    fn end_after(&self, first: Option<Hit>, from: Vec3, direction: Vec3, stream: &mut Stream) -> End {
        let mut first = first;
        for _ in 0..MOST_PASSED {
            let Some(hit) = first else { return End::Nowhere };
            let polygon = self.polygon_of[hit.primitive as usize];
            let front = &self.scene.polygons[polygon as usize];
            let place = from + direction * hit.t;
            let (side, lies_there) = self.met(polygon, place, direction);
            let stops = lies_there
                || front.mask.is_none() && front.opacity >= 1.0
                || stream.next_unit() as f32 >= self.passes(hit.primitive, hit.u, hit.v);
            if stops {
                return side.map_or(End::Back, |side| End::Side(side, place));
            }
            first = self.first_hit(from, direction, hit.t + 2.0 * self.tolerance);
        }
        End::Nowhere
    }

    /// How far from a surface a ray starts, in its direction's length.
    fn start(&self, normal: Vec3, direction: Vec3) -> f32 {
        self.tolerance / normal.dot(direction).max(1e-6)
    }

    /// How far a ray goes that leaves the scene, metres.
    fn far(&self) -> f32 {
        4.0 * self.scene.diameter as f32
    }

    /// What a ray along a unit vector hits first, from `near` on, metres.
    pub(crate) fn first_hit(&self, from: Vec3, direction: Vec3, near: f32) -> Option<Hit> {
        self.bvh.closest(self.backend, from.to_array(), direction.to_array(), near, self.far())
    }

    /// [`Geometry::first_hit`] of each ray of a packet.
    pub(crate) fn first_hits(&self, probes: &Probes) -> [Option<Hit>; RAYS] {
        let mut rays = probes.rays.clone();
        rays.far = [self.far(); RAYS];
        let hits = self.bvh.closest16(self.backend, &rays, (1 << probes.count) - 1);
        hits.map(|hit| (hit != Hit::NONE).then_some(hit))
    }
}

/// Up to sixteen rays that look for what they hit first.
pub(crate) struct Probes {
    rays: Rays<RAYS>,
    pub(crate) count: usize,
}

impl Probes {
    pub(crate) fn new() -> Probes {
        Probes { rays: Rays::default(), count: 0 }
    }

    /// Adds a ray as of [`Geometry::first_hit`]. There are fewer than sixteen yet.
    pub(crate) fn push(&mut self, from: Vec3, direction: Vec3, near: f32) {
        for axis in 0..3 {
            self.rays.origin[axis][self.count] = from[axis];
            self.rays.direction[axis][self.count] = direction[axis];
        }
        self.rays.near[self.count] = near;
        self.count += 1;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use isolux_core::scene::BuildOptions;
    use isolux_formats::read::{ReadOptions, read};

    fn of_file(name: &str) -> Geometry {
        let path = format!("{}/../../scenes/{name}", env!("CARGO_MANIFEST_DIR"));
        let input = read(path.as_ref(), &ReadOptions::default()).unwrap();
        Geometry::new(Arc::new(Scene::build(input, &BuildOptions::default()).unwrap()))
    }

    /// Catches a packet that sees other things than its rays one after the other, and draws that chance does not make in
    /// their order: in a room, and at a mask and a pane that rays go through.
    #[test]
    fn rays_of_a_packet_see_what_each_sees_alone() {
        let mut passed = 0;
        for name in ["room.glb", "test-inputs/mask-checker.glb", "test-inputs/blend-quarter.glb"] {
            let geometry = of_file(name);
            let root = geometry.bare_roots();
            let (mut one, mut other, mut places) = (Stream::new(5), Stream::new(5), Stream::new(7));
            let mut seen = 0;
            for index in 0..2000 {
                let element = &root[index % geometry.scene.fronts];
                let normal = geometry.surfaces[element.polygon as usize].normal;
                // From the surface, or from in front of it back to it.
                let share = places.next_unit() as f32;
                let inside = element.centre().lerp(element.corners[index / 7 % 4], share);
                let (from, normal) = if index % 2 == 0 { (inside, normal) } else { (inside + normal, -normal) };
                let directions: Vec<Vec3> =
                    (0..1 + index % RAYS).map(|_| places.cosine_direction(normal.as_dvec3()).as_vec3()).collect();
                let together = geometry.look_along(from, normal, &directions, &mut one);
                for (ray, &direction) in directions.iter().enumerate() {
                    let alone = geometry.look(from, normal, direction, &mut other);
                    assert_eq!(together[ray], alone, "{name}: ray {ray} of {index}");
                    let hit = geometry.first_hit(from, direction, geometry.start(normal, direction));
                    let goes_on = |hit: Hit| {
                        let place = from + direction * hit.t;
                        alone.is_none_or(|(_, end)| end.distance(place) > 10.0 * geometry.tolerance)
                    };
                    let front = hit.map(|hit| geometry.polygon_of[hit.primitive as usize] as usize);
                    let holey = front.is_some_and(|front| {
                        geometry.scene.polygons[front].mask.is_some() || geometry.scene.polygons[front].opacity < 1.0
                    });
                    passed += usize::from(holey && hit.is_some_and(goes_on));
                    seen += usize::from(alone.is_some());
                }
                assert!(together[directions.len()..].iter().all(Option::is_none));
            }
            assert_eq!(one.next_bits(), other.next_bits(), "{name}");
            // Most rays go past the pane or through it: 857 of 17,000 end there.
            assert!(seen > 500, "{name}: {seen}");
        }
        assert!(passed > 1000, "{passed}");
    }
}
