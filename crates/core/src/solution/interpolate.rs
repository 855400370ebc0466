//! Smooth values from constant elements: leaves with their irradiance go in, vertex values on a restricted mesh
//! without T-junctions come out, and the means to read them at any point.

use super::sides::{Standing, Wedge, sides};
use super::{Flow, Gathered, Light, SurfaceMesh, Watch};
use crate::kernels::NoProbe;
use crate::kernels::visibility::is_open;
use crate::links::Evaluator;
use crate::sampling::{Stream, mix};
use crate::scene::{Corners, Scene};
use crate::tree::{Bsp, Cut, ElementId, Elements};
use crate::units::Rgb;
use glam::DVec3;
use rustc_hash::FxHashMap;
use std::ops::Range;

/// Work on a cell or a leaf, in units of a visibility: each pass over them takes 0.3 to 1 microseconds for one, a
/// visibility 2 to 3.
const CELL_WORK: f64 = 0.5;

/// Marks a cell without children.
const NO_CELL: u32 = u32::MAX;

/// Levels of hanging vertices on one edge that are looked for: more than paths can name.
const MAX_HANGING_DEPTH: u32 = 20;

/// A smooth solution: a mesh to write out, and cells to find a point in.
#[derive(Clone, Debug, Default)]
pub struct SmoothSurfaces {
    mesh: SurfaceMesh,
    cells: Vec<Cell>,
    roots_of: Vec<Range<u32>>,
}

/// A node of the restricted quadtree: an element, or a part of a leaf that was split so that neighbours differ by at
/// most one level.
#[derive(Clone, Debug)]
struct Cell {
    corners: Corners,
    /// The leaf element that gives the value (of inner cells: any).
    element: ElementId,
    polygon: u32,
    first_child: u32,
    /// How its children cut it.
    cut: Cut,
    /// Vertices at the corners (of leaves), in the mesh.
    vertices: [u32; 4],
    /// Triangles of a leaf.
    triangles: Range<u32>,
    /// Do neighbours' vertices hang on its edges?
    hanging: bool,
}

impl SmoothSurfaces {
    /// The mesh with values at its vertices.
    #[must_use]
    pub fn mesh(&self) -> &SurfaceMesh {
        &self.mesh
    }

    /// The mesh alone.
    #[must_use]
    pub fn into_mesh(self) -> SurfaceMesh {
        self.mesh
    }

    /// What the mesh is made of: for each cell without children the element that it lies in, its triangles, and whether
    /// values are bilinear there. A bilinear cell has two triangles, `[a, b, c]` and `[a, c, d]` of its corners a, b, c, d;
    /// others are linear in each triangle.
    pub fn cells(&self) -> impl Iterator<Item = (ElementId, Range<u32>, bool)> + '_ {
        let leaves = self.cells.iter().filter(|cell| cell.first_child == NO_CELL);
        leaves.map(|cell| (cell.element, cell.triangles.clone(), cell.corners.len() == 4 && !cell.hanging))
    }

    /// Irradiance at a point of a polygon, W/m² or lm/m²: bilinear in the leaf that holds the point (linear in the
    /// triangle, where the leaf is one or neighbours' vertices hang on it).
    #[must_use]
    pub fn irradiance(&self, scene: &Scene, polygon: u32, point: DVec3) -> Rgb {
        let normal = scene.polygons[polygon as usize].plane.normal;
        let roots = self.roots_of[polygon as usize].clone();
        let depth = |root: u32| inside_depth(&self.cells[root as usize].corners, normal, point);
        let Some(mut at) = roots.max_by(|&a, &b| depth(a).total_cmp(&depth(b))) else { return Rgb::ZERO };
        while self.cells[at as usize].first_child != NO_CELL {
            let cell = &self.cells[at as usize];
            at = cell.first_child + cell.cut.part_at(&cell.corners, normal, point);
        }
        let cell = &self.cells[at as usize];
        let value = |vertex: u32| self.mesh.irradiance[vertex as usize];
        if cell.corners.len() == 4 && !cell.hanging {
            let corners = [0, 1, 2, 3].map(|k| cell.corners[k]);
            let (s, t) = bilinear_coordinates(corners, normal, point);
            let [a, b, c, d] = cell.vertices.map(value);
            return a * ((1.0 - s) * (1.0 - t)) + b * (s * (1.0 - t)) + c * (s * t) + d * ((1.0 - s) * t);
        }
        let corners_of =
            |triangle: u32| self.mesh.triangles[triangle as usize].map(|v| self.mesh.positions[v as usize]);
        let weights = |triangle: u32| barycentric(corners_of(triangle), normal, point);
        let least = |weights: [f64; 3]| weights[0].min(weights[1]).min(weights[2]);
        let best = cell.triangles.clone().max_by(|&a, &b| least(weights(a)).total_cmp(&least(weights(b))));
        let Some(best) = best else { return Rgb::ZERO };
        // A point that rounding puts outside takes the value on the border.
        let inside = weights(best).map(|weight| weight.clamp(0.0, 1.0));
        let sum: f64 = inside.iter().sum();
        (0..3).map(|k| value(self.mesh.triangles[best as usize][k]) * (inside[k] / sum)).sum()
    }
}

/// Least signed distance of a point to the edges of a convex patch, relative to nothing: positive inside.
fn inside_depth(corners: &Corners, normal: DVec3, point: DVec3) -> f64 {
    (0..corners.len())
        .map(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            normal.dot((b - a).cross(point - a)) / a.distance(b)
        })
        .fold(f64::INFINITY, f64::min)
}

/// Barycentric coordinates in a triangle of a plane.
fn barycentric([a, b, c]: [DVec3; 3], normal: DVec3, point: DVec3) -> [f64; 3] {
    let double_area = |p: DVec3, q: DVec3, r: DVec3| normal.dot((q - p).cross(r - p));
    let whole = double_area(a, b, c);
    let (wa, wb) = (double_area(point, b, c) / whole, double_area(a, point, c) / whole);
    [wa, wb, 1.0 - wa - wb]
}

/// The `(s, t)` in `[0, 1]²` with `(1-s)(1-t) a + s(1-t) b + s t c + (1-s) t d = point`, by Newton's iteration: exact
/// after one step for parallelograms; convex quadrilaterals that turn by `MIN_CORNER_SINE` settle within 8.
#[must_use]
pub fn bilinear_coordinates([a, b, c, d]: [DVec3; 4], normal: DVec3, point: DVec3) -> (f64, f64) {
    let twist = a - b + c - d;
    let (mut s, mut t) = (0.5, 0.5);
    for _ in 0..8 {
        let here = a + (b - a) * s + (d - a) * t + twist * (s * t);
        let (along_s, along_t) = (b - a + twist * t, d - a + twist * s);
        let determinant = normal.dot(along_s.cross(along_t));
        let missing = point - here;
        let (ds, dt) =
            (normal.dot(missing.cross(along_t)) / determinant, normal.dot(along_s.cross(missing)) / determinant);
        s = (s + ds).clamp(0.0, 1.0);
        t = (t + dt).clamp(0.0, 1.0);
        if ds.abs().max(dt.abs()) < 1e-12 {
            break;
        }
    }
    (s, t)
}

/// Tells whether surfaces stand in a short way: all that a mesh asks of whatever finds what rays meet.
pub trait Obstacles {
    /// Does a surface cross the segment of so many metres from `start` along a unit direction? Transparent texels of masks
    /// are passed; a polygon of opacity below 1 is a surface.
    fn is_blocked(&self, start: DVec3, direction: DVec3, length: f64) -> bool;
}

impl Obstacles for (&Scene, &Bsp) {
    fn is_blocked(&self, start: DVec3, direction: DVec3, length: f64) -> bool {
        let (scene, bsp) = *self;
        bsp.closest_hit(scene, start, direction, length, &mut NoProbe).is_some()
    }
}

/// Coplanar neighbours with a common edge, and nothing standing on it, have one irradiance along it. Returns a group
/// number per polygon; `None` when the watch says stop.
pub fn smoothing_groups(scene: &Scene, obstacles: &impl Obstacles, watch: &mut Watch<'_>) -> Option<Vec<u32>> {
    let mut group: Vec<u32> = (0..scene.polygons.len() as u32).collect();
    fn find(group: &mut [u32], mut at: u32) -> u32 {
        while group[at as usize] != at {
            group[at as usize] = group[group[at as usize] as usize];
            at = group[at as usize];
        }
        at
    }
    let mut edges: FxHashMap<[[u64; 3]; 2], Vec<u32>> = FxHashMap::default();
    for (index, polygon) in scene.polygons.iter().enumerate() {
        if watch.step(1.0, 0.0) == Flow::Stop {
            return None;
        }
        let corners = &polygon.corners;
        for k in 0..corners.len() {
            let (from, to) = (corners[k], corners[(k + 1) % corners.len()]);
            // The neighbour runs along the edge the other way.
            for &other in edges.get(&[key(to), key(from)]).map_or(&[][..], Vec::as_slice) {
                if is_smooth_across(scene, obstacles, index as u32, other, from, to) {
                    let (one, two) = (find(&mut group, index as u32), find(&mut group, other));
                    group[one.max(two) as usize] = one.min(two);
                }
            }
            edges.entry([key(from), key(to)]).or_default().push(index as u32);
        }
    }
    Some((0..group.len() as u32).map(|index| find(&mut group, index)).collect())
}

/// Same plane, and a short ray just above the edge passes.
fn is_smooth_across(scene: &Scene, obstacles: &impl Obstacles, one: u32, two: u32, from: DVec3, to: DVec3) -> bool {
    let (p, q) = (&scene.polygons[one as usize], &scene.polygons[two as usize]);
    let tolerance = scene.tolerance();
    let coplanar = q.corners.iter().all(|&corner| p.plane.distance(corner).abs() <= tolerance)
        && p.plane.normal.dot(q.plane.normal) > 0.0;
    if !coplanar {
        return false;
    }
    let middle = (from + to) * 0.5;
    let inward = p.plane.normal.cross(to - from).normalize();
    // Far enough from edge and plane that the ray's ends are not taken for touching.
    let reach = 8.0 * tolerance;
    let start = middle + (inward + p.plane.normal) * reach;
    !obstacles.is_blocked(start, -inward, 2.0 * reach)
}

/// A position as a hash key; both zeros are one.
fn key(point: DVec3) -> [u64; 3] {
    [(point.x + 0.0).to_bits(), (point.y + 0.0).to_bits(), (point.z + 0.0).to_bits()]
}

fn middle(a: DVec3, b: DVec3) -> DVec3 {
    (a + b) * 0.5
}

/// Values at sites, found by point and smoothing group, or by point and leaf where a wall parts the leaves there.
struct Values<'a> {
    index: &'a FxHashMap<(u32, u32), u32>,
    parted: &'a FxHashMap<(u32, ElementId), u32>,
    values: &'a [Rgb],
}

impl Values<'_> {
    /// The site that a leaf has at a point for itself and others on its side of a wall.
    fn parted(&self, point: u32, leaf: ElementId) -> Option<u32> {
        if self.parted.is_empty() { None } else { self.parted.get(&(point, leaf)).copied() }
    }

    fn get(&self, point: u32, group: u32, parted: Option<u32>) -> Option<(Rgb, Origin)> {
        let site = parted.or_else(|| self.index.get(&(point, group)).copied())?;
        Some((self.values[site as usize], Origin::Site(site)))
    }
}

/// A place whose irradiance makes up the smooth solution: a vertex of the leaves, or the centre of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// Where, metres. Vertices at the border of a surface lie a little inside it.
    pub position: DVec3,
    /// The smallest leaf there: its links and those of its ancestors are what the site sees.
    pub leaf: ElementId,
}

/// Vertices at a border are moved towards the middle of the leaves around by this share of the distance, so that a
/// wall that stands on the border is seen at all (in its plane its factor is undefined: 0 from one side, 1/2 from the
/// other). The irradiance changes over a leaf by its size, so this costs about a hundredth of that change.
const INSET: f64 = 0.01;

/// A vertex that sees less than this share of its hemisphere counts as covered, if a surface stands close above it. In
/// a corner where three walls meet a vertex still sees all of it.
const COVERED: f64 = 0.02;

/// The mesh that a smooth solution will have, before it has values.
#[derive(Debug)]
pub struct SmoothPlan<'a> {
    builder: Builder<'a>,
    groups: Vec<u32>,
    index: FxHashMap<(u32, u32), u32>,
    /// Sites of leaves at points where they are not those of the index.
    parted: FxHashMap<(u32, ElementId), u32>,
    /// For each vertex beyond a wall: the one in its place that comes first.
    beyond: Vec<u32>,
    sites: Vec<Site>,
    /// Sites from here on are the centres of the leaves, in order.
    centres: usize,
    leaves: Outlines,
    /// For each vertex: where it is, without an inset, metres.
    positions: Vec<DVec3>,
    /// For each vertex: is it surrounded by leaves?
    inner: Vec<bool>,
}

impl<'a> SmoothPlan<'a> {
    /// Lays out the restricted mesh of the elements' leaves and finds its sites. Where a wall stands on a vertex it has one for
    /// each side. `light` tells which leaves are covered as a whole. `None` when the watch says stop.
    pub fn new(
        scene: &'a Scene,
        obstacles: &impl Obstacles,
        elements: &'a Elements,
        light: &Light,
        watch: &mut Watch<'_>,
    ) -> Option<SmoothPlan<'a>> {
        let mut builder = Builder::new(scene, elements, watch)?;
        builder.restrict(watch)?;
        let groups = smoothing_groups(scene, obstacles, watch)?;
        let mut index: FxHashMap<(u32, u32), u32> = FxHashMap::default();
        let mut corners: Vec<Vertex> = Vec::new();
        let mut leaves = Outlines::default();
        for leaf in elements.leaves() {
            if watch.step(CELL_WORK, 0.0) == Flow::Stop {
                return None;
            }
            let element = elements.get(leaf);
            let (centre, group) = (element.corners.mean(), groups[element.polygon as usize]);
            let outline = builder.outline(&element.corners);
            leaves.begin(leaf);
            for (k, &(point, position, is_corner)) in outline.iter().enumerate() {
                let before = outline[(k + outline.len() - 1) % outline.len()].1;
                let after = outline[(k + 1) % outline.len()].1;
                let site = *index.entry((point, group)).or_insert_with(|| {
                    corners.push(Vertex::new(position, leaf));
                    corners.len() as u32 - 1
                });
                corners[site as usize].add(leaf, angle(before - position, after - position), centre, elements);
                leaves.vertices.push(Shared { site, is_corner, counts: true });
            }
        }
        let mut parted = FxHashMap::default();
        let beyond = part(&builder, obstacles, light, &mut corners, &mut leaves, &mut parted, watch)?;
        let inner: Vec<bool> = corners.iter().map(Vertex::is_inner).collect();
        let mut sites: Vec<Site> = corners.iter().map(Vertex::site).collect();
        let centres = sites.len();
        sites.extend(leaves.iter().map(|(leaf, _)| Site { position: elements.get(leaf).corners.mean(), leaf }));
        let positions = corners.iter().map(|vertex| vertex.position).collect();
        Some(SmoothPlan { builder, groups, index, parted, beyond, sites, centres, leaves, positions, inner })
    }

    /// All places whose irradiance is asked for: vertices first, then the centres of the leaves.
    #[must_use]
    pub fn sites(&self) -> &[Site] {
        &self.sites
    }

    /// Number of vertices: the sites that a mesh needs.
    #[must_use]
    pub fn vertices(&self) -> usize {
        self.centres
    }

    /// Where the vertices are, by site, without an inset, metres.
    #[must_use]
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// Each leaf with each vertex on its outline, as a site, in whose value it has a say: with few exceptions all.
    pub fn around(&self) -> impl Iterator<Item = (usize, ElementId)> {
        self.leaves.iter().flat_map(|(leaf, vertices)| {
            let counting = vertices.iter().filter(|shared| shared.counts);
            counting.map(move |shared| (shared.site as usize, leaf))
        })
    }

    /// Values by vertex of a mesh whose vertices were not parted by walls, as vertices of this one: those of the two sides are
    /// the same. Others as they are.
    #[must_use]
    pub fn with_sides(&self, mut values: Vec<Rgb>) -> Vec<Rgb> {
        if values.len() + self.beyond.len() == self.centres {
            let beyond: Vec<Rgb> = self.beyond.iter().map(|&first| values[first as usize]).collect();
            values.extend(beyond);
        }
        values
    }

    /// Irradiance at the vertices from that of the leaves around them: means weighted by inverse distance to the
    /// leaves' centres; at borders continued linearly, so that a leaf's mean is kept. `None` when the watch says stop.
    pub fn averaged(&self, light: &Light, watch: &mut Watch<'_>) -> Option<Vec<Rgb>> {
        let elements = self.builder.elements;
        let mut around = vec![Blend::default(); self.centres];
        for (leaf, vertices) in self.leaves.iter() {
            if watch.step(CELL_WORK, 0.0) == Flow::Stop {
                return None;
            }
            let centre = elements.get(leaf).corners.mean();
            for &Shared { site, .. } in vertices.iter().filter(|shared| shared.counts) {
                // The vertex itself, not its inset: distances to the leaves around are what counts.
                around[site as usize].add(light.irradiance(leaf), self.sites[site as usize].position.distance(centre));
            }
        }
        let mut values: Vec<Rgb> = around.iter().map(Blend::mean).collect();
        let mut border = vec![Blend::default(); self.centres];
        for (leaf, vertices) in self.leaves.iter() {
            if watch.step(CELL_WORK, 0.0) == Flow::Stop {
                return None;
            }
            let centre = elements.get(leaf).corners.mean();
            let corners: Vec<u32> =
                vertices.iter().filter(|shared| shared.is_corner).map(|shared| shared.site).collect();
            let count = corners.len();
            for (k, &site) in corners.iter().enumerate() {
                let offsets: &[usize] = if count == 4 { &[2] } else { &[1, 2] };
                let opposite: Vec<u32> = offsets.iter().map(|offset| corners[(k + offset) % count]).collect();
                if self.inner[site as usize] || !opposite.iter().all(|&site| self.inner[site as usize]) {
                    continue;
                }
                let known: Rgb = opposite.iter().map(|&site| around[site as usize].mean()).sum();
                let continued = light.irradiance(leaf) * (opposite.len() as f64 + 1.0) - known;
                border[site as usize].add(continued, self.sites[site as usize].position.distance(centre));
            }
        }
        for (value, border) in values.iter_mut().zip(&border).filter(|(_, border)| border.weight > 0.0) {
            *value = border.mean().map(|value| value.max(0.0));
        }
        Some(values)
    }

    /// Which sites something covers, by site: only sites of leaves that are partly covered are looked at. Their values
    /// mean nothing: no light gets there.
    #[must_use]
    pub fn covered(&self, evaluator: &Evaluator<'_>, light: &Light) -> Vec<bool> {
        let mut doubtful = vec![false; self.sites.len()];
        for (index, (leaf, vertices)) in self.leaves.iter().enumerate() {
            if light.open_share(leaf) < 1.0 {
                doubtful[self.centres + index] = true;
                vertices.iter().for_each(|shared| doubtful[shared.site as usize] = true);
            }
        }
        let scene = self.builder.scene;
        let is_covered = |(index, &Site { position, leaf }): (usize, &Site)| {
            let normal = scene.polygons[self.builder.elements.get(leaf).polygon as usize].plane.normal;
            let mut stream = Stream::new(mix(evaluator.seed ^ index as u64));
            doubtful[index] && !is_open(evaluator.bsp, scene, position, normal, &mut stream, &mut NoProbe)
        };
        self.sites.iter().enumerate().map(is_covered).collect()
    }

    /// Covered vertices are dark, but what is seen is the part of their leaves that is not covered: they take the mean
    /// of the open vertices around. Beside those found [by rays](SmoothPlan::covered), vertices count that see nothing
    /// (`openness` below 2 %) and have a surface close above them, a rug with a lit back for one.
    pub fn uncover(&self, obstacles: &impl Obstacles, covered: &[bool], values: &mut [Rgb], openness: &[f64]) {
        let scene = self.builder.scene;
        let covered: Vec<bool> = (0..self.centres)
            .map(|site| {
                let Site { position, leaf } = self.sites[site];
                let element = self.builder.elements.get(leaf);
                let normal = scene.polygons[element.polygon as usize].plane.normal;
                let start = position + normal * (2.0 * scene.tolerance());
                covered[site] || openness[site] < COVERED && obstacles.is_blocked(start, normal, element.area.sqrt())
            })
            .collect();
        let mut around = vec![(Rgb::ZERO, 0.0); self.centres];
        for (_, vertices) in self.leaves.iter() {
            let sites = || vertices.iter().map(|shared| shared.site as usize);
            let open = sites().filter(|&site| !covered[site]);
            let (sum, count) = open.fold((Rgb::ZERO, 0.0), |(sum, count), site| (sum + values[site], count + 1.0));
            for site in sites().filter(|&site| covered[site]) {
                around[site].0 += sum;
                around[site].1 += count;
            }
        }
        for (site, (sum, count)) in around.into_iter().enumerate().filter(|(_, (_, count))| *count > 0.0) {
            values[site] = sum / count;
        }
    }

    /// Mean irradiance of every leaf from that at its corners and centre, in the order of [`Elements::leaves`]:
    /// centre 2/3 and corners 1/3 for a quadrilateral, 3/4 and 1/4 for a triangle. These weights integrate quadratic
    /// functions exactly on parallelograms and triangles: the moments 1, x, x², xy fix them. Covered sites are left
    /// out: it is the mean over the open part; a leaf without open sites is left out, too.
    #[must_use]
    pub fn leaf_means(&self, values: &[Gathered], covered: &[bool]) -> Vec<(ElementId, Rgb)> {
        let means = self.leaves.iter().enumerate().filter_map(|(index, (leaf, vertices))| {
            let corners: Vec<u32> =
                vertices.iter().filter(|shared| shared.is_corner).map(|shared| shared.site).collect();
            let centre_share = if corners.len() == 4 { 2.0 / 3.0 } else { 3.0 / 4.0 };
            let corner_share = (1.0 - centre_share) / corners.len() as f64;
            let centre = (self.centres + index, centre_share);
            let (mut sum, mut weights) = (Rgb::ZERO, 0.0);
            for (site, weight) in corners.iter().map(|&site| (site as usize, corner_share)).chain([centre]) {
                if !covered[site] {
                    sum += values[site].irradiance * weight;
                    weights += weight;
                }
            }
            (weights > 0.0).then(|| (leaf, sum / weights))
        });
        means.collect()
    }

    /// Puts the mesh together. `values`: irradiance by site, at least of the vertices. `None` when the watch says stop.
    pub fn assemble(self, values: &[Rgb], watch: &mut Watch<'_>) -> Option<SmoothSurfaces> {
        self.assemble_blending(values, watch).map(|(surfaces, _)| surfaces)
    }

    /// The same, and how to find the values that the mesh has in another light.
    pub fn assemble_blending(self, values: &[Rgb], watch: &mut Watch<'_>) -> Option<(SmoothSurfaces, Blending)> {
        let SmoothPlan { builder, groups, index, parted, .. } = self;
        builder.assemble(&groups, &Values { index: &index, parted: &parted, values }, watch)
    }
}

/// How values at the vertices of a mesh follow from those at sites: the same for every light.
#[derive(Clone, Debug, Default)]
pub struct Blending {
    /// By vertex.
    origins: Vec<Origin>,
}

impl Blending {
    /// Irradiance by vertex of the mesh from that by site, W/m² or lm/m².
    #[must_use]
    pub fn irradiance(&self, sites: &[Rgb]) -> Vec<Rgb> {
        let mut values: Vec<Rgb> = Vec::with_capacity(self.origins.len());
        for origin in &self.origins {
            values.push(match *origin {
                Origin::Site(site) => sites[site as usize],
                Origin::Between([one, other], along) => {
                    values[one as usize] * (1.0 - along) + values[other as usize] * along
                }
                Origin::Mean(corners, count) => {
                    let known = corners[..count as usize].iter().map(|&corner| values[corner as usize]);
                    known.sum::<Rgb>() / f64::from(count)
                }
                Origin::Dark => Rgb::ZERO,
            });
        }
        values
    }
}

/// Where the value of a vertex comes from.
#[derive(Clone, Copy, Debug)]
enum Origin {
    /// A site.
    Site(u32),
    /// Two vertices that come before, and how far it is from the first to the second, in `[0, 1]`.
    Between([u32; 2], f64),
    /// The mean of so many vertices that come before.
    Mean([u32; 4], u8),
    /// Nothing.
    Dark,
}

impl Origin {
    fn mean(corners: &[u32]) -> Origin {
        let mut of = [0; 4];
        of[..corners.len()].copy_from_slice(corners);
        Origin::Mean(of, corners.len() as u8)
    }
}

/// A mesh that is being laid out, with the origins of its values.
#[derive(Default)]
struct Layout {
    mesh: SurfaceMesh,
    origins: Vec<Origin>,
}

impl Layout {
    fn push(&mut self, position: DVec3, value: Rgb, origin: Origin) -> u32 {
        self.mesh.positions.push(position);
        self.mesh.irradiance.push(value);
        self.origins.push(origin);
        self.origins.len() as u32 - 1
    }

    fn value(&self, vertex: u32) -> Rgb {
        self.mesh.irradiance[vertex as usize]
    }
}

/// A vertex on the outline of a leaf.
#[derive(Clone, Copy, Debug)]
struct Shared {
    site: u32,
    /// Is it a corner of the leaf?
    is_corner: bool,
    /// Has the leaf a say in its value?
    counts: bool,
}

/// For each leaf: its id, and the vertices on its outline.
#[derive(Debug, Default)]
struct Outlines {
    ids: Vec<ElementId>,
    /// Where the vertices of each leaf begin.
    start: Vec<u32>,
    vertices: Vec<Shared>,
}

impl Outlines {
    /// Begins a leaf, whose vertices follow.
    fn begin(&mut self, leaf: ElementId) {
        self.ids.push(leaf);
        self.start.push(self.vertices.len() as u32);
    }

    fn iter(&self) -> impl Iterator<Item = (ElementId, &[Shared])> {
        (0..self.ids.len()).map(|row| (self.ids[row], &self.vertices[self.range(row)]))
    }

    /// Where the vertices of a leaf are.
    fn range(&self, row: usize) -> Range<usize> {
        let end = self.start.get(row + 1).map_or(self.vertices.len(), |&end| end as usize);
        self.start[row] as usize..end
    }
}

/// Gives leaves that a wall parts vertices of their own: appends them, writes into the outlines which is whose, and into
/// `parted` what is not the first. Returns for each that was appended the one that was there; `None` when the watch says stop.
fn part(
    builder: &Builder<'_>,
    obstacles: &impl Obstacles,
    light: &Light,
    corners: &mut Vec<Vertex>,
    leaves: &mut Outlines,
    parted: &mut FxHashMap<(u32, ElementId), u32>,
    watch: &mut Watch<'_>,
) -> Option<Vec<u32>> {
    let Builder { scene, elements, .. } = *builder;
    let plane = |leaf: ElementId| &scene.polygons[elements.get(leaf).polygon as usize].plane;
    // Vertices that several leaves share, and where something stands on one of these.
    let standing = Standing::new(scene);
    let mut doubtful = vec![false; corners.len()];
    for (leaf, vertices) in leaves.iter() {
        if watch.step(CELL_WORK, 0.0) == Flow::Stop {
            return None;
        }
        let shared = |shared: &&Shared| corners[shared.site as usize].count > 1.0;
        if vertices.iter().any(|vertex| shared(&vertex)) && standing.on(&elements.get(leaf).corners, plane(leaf)) {
            vertices.iter().filter(shared).for_each(|shared| doubtful[shared.site as usize] = true);
        }
    }
    // Which leaves these have, as rows and places among the vertices.
    let mut around: FxHashMap<u32, Vec<(usize, usize)>> = FxHashMap::default();
    for row in 0..leaves.ids.len() {
        for place in leaves.range(row) {
            let site = leaves.vertices[place].site;
            if doubtful[site as usize] {
                around.entry(site).or_default().push((row, place));
            }
        }
    }
    let mut beyond = Vec::new();
    for site in (0..doubtful.len() as u32).filter(|&site| doubtful[site as usize]) {
        if watch.step(1.0, 0.0) == Flow::Stop {
            return None;
        }
        let (places, position) = (&around[&site], corners[site as usize].position);
        let wedge = |&(row, place): &(usize, usize)| wedge(leaves, row, place, position, corners, elements, light);
        let wedges: Vec<Wedge> = places.iter().map(wedge).collect();
        let normal = plane(leaves.ids[places[0].0]).normal;
        let Some(sides) = sides(position, normal, &wedges, scene, obstacles) else { continue };
        let point = builder.points[&key(position)];
        for side in 0..=sides.of.iter().copied().max().unwrap_or(0) {
            let mut vertex: Option<Vertex> = None;
            let own = if side == 0 { site } else { corners.len() as u32 };
            for (k, &(row, place)) in places.iter().enumerate().filter(|(k, _)| sides.of[*k] == side) {
                let leaf = leaves.ids[row];
                let turn = angle(wedges[k].before, wedges[k].after);
                let made = vertex.get_or_insert_with(|| Vertex::new(position, leaf));
                made.add(leaf, turn, elements.get(leaf).corners.mean(), elements);
                let shared = &mut leaves.vertices[place];
                (shared.site, shared.counts) = (own, sides.counts[k]);
                if side > 0 {
                    parted.insert((point, leaf), own);
                }
            }
            let Some(vertex) = vertex else { continue };
            if side == 0 {
                corners[site as usize] = vertex;
            } else {
                corners.push(vertex);
                beyond.push(site);
            }
        }
    }
    Some(beyond)
}

/// A leaf at one of the vertices on its outline.
fn wedge(
    leaves: &Outlines,
    row: usize,
    place: usize,
    position: DVec3,
    corners: &[Vertex],
    elements: &Elements,
    light: &Light,
) -> Wedge {
    let (leaf, range) = (leaves.ids[row], leaves.range(row));
    let (outline, own) = (&leaves.vertices[range.clone()], place - range.start);
    let way = |to: DVec3| to - position;
    let next = |steps: usize| way(corners[outline[(own + steps) % outline.len()].site as usize].position);
    let element = elements.get(leaf);
    let number = outline[..own].iter().filter(|shared| shared.is_corner).count();
    let across = (outline[own].is_corner && element.corners.len() == 4).then(|| way(element.corners[(number + 2) % 4]));
    Wedge {
        before: next(outline.len() - 1),
        after: next(1),
        middle: way(element.corners.mean()),
        corners: element.corners.iter().map(|&corner| way(corner)).collect(),
        across,
        is_open: light.open_share(leaf) > 0.0,
    }
}

/// A vertex while leaves are collected around it.
struct Vertex {
    position: DVec3,
    leaf: ElementId,
    /// Sum of the centres of the leaves around, and their number.
    towards: DVec3,
    count: f64,
    /// Angle that they fill, radians.
    angle: f64,
}

impl Vertex {
    fn new(position: DVec3, leaf: ElementId) -> Vertex {
        Vertex { position, leaf, towards: DVec3::ZERO, count: 0.0, angle: 0.0 }
    }

    /// Adds a leaf, which fills so many radians about the vertex.
    fn add(&mut self, leaf: ElementId, angle: f64, centre: DVec3, elements: &Elements) {
        self.angle += angle;
        self.towards += centre;
        self.count += 1.0;
        let (own, finest) = (elements.get(leaf), elements.get(self.leaf));
        if (own.area, own.path) < (finest.area, finest.path) {
            self.leaf = leaf;
        }
    }

    fn is_inner(&self) -> bool {
        // A full turn, less the rounding of about 20 corners that meet.
        self.angle > 2.0 * std::f64::consts::PI - 1e-6
    }

    fn site(&self) -> Site {
        let inset = if self.is_inner() { 0.0 } else { INSET };
        let position = self.position + (self.towards / self.count - self.position) * inset;
        Site { position, leaf: self.leaf }
    }
}

/// Sums of values at a vertex.
#[derive(Clone, Copy, Default)]
struct Blend {
    sum: Rgb,
    weight: f64,
}

impl Blend {
    fn add(&mut self, value: Rgb, distance: f64) {
        self.sum += value * (1.0 / distance);
        self.weight += 1.0 / distance;
    }

    fn mean(&self) -> Rgb {
        self.sum / self.weight
    }
}

#[derive(Debug)]
struct Builder<'a> {
    scene: &'a Scene,
    elements: &'a Elements,
    cells: Vec<Cell>,
    /// Every position that is a corner of some cell.
    points: FxHashMap<[u64; 3], u32>,
    roots_of: Vec<Range<u32>>,
}

impl<'a> Builder<'a> {
    /// Cells that mirror the elements.
    fn new(scene: &'a Scene, elements: &'a Elements, watch: &mut Watch<'_>) -> Option<Builder<'a>> {
        let mut points = FxHashMap::default();
        let mut cells = Vec::with_capacity(elements.len());
        for (index, element) in elements.as_slice().iter().enumerate() {
            if watch.step(CELL_WORK, 0.0) == Flow::Stop {
                return None;
            }
            for &corner in element.corners.iter() {
                let next = points.len() as u32;
                points.entry(key(corner)).or_insert(next);
            }
            cells.push(Cell {
                corners: element.corners,
                element: ElementId(index as u32),
                polygon: element.polygon,
                first_child: element.first_child.some().map_or(NO_CELL, |child| child.0),
                cut: elements.cut(ElementId(index as u32)),
                vertices: [0; 4],
                triangles: 0..0,
                hanging: false,
            });
        }
        let mut roots_of = vec![0..0; scene.polygons.len()];
        for root in 0..elements.roots() as u32 {
            let range = &mut roots_of[cells[root as usize].polygon as usize];
            *range = if range.start == range.end { root..root + 1 } else { range.start..root + 1 };
        }
        Some(Builder { scene, elements, cells, points, roots_of })
    }

    /// Levels of vertices that hang on an edge.
    fn hanging_levels(&self, from: DVec3, to: DVec3, limit: u32) -> u32 {
        let centre = middle(from, to);
        if limit == 0 || !self.points.contains_key(&key(centre)) {
            return 0;
        }
        1 + self.hanging_levels(from, centre, limit - 1).max(self.hanging_levels(centre, to, limit - 1))
    }

    /// Splits leaves until no edge carries more than one level of hanging vertices. `None` when the watch says stop.
    fn restrict(&mut self, watch: &mut Watch<'_>) -> Option<()> {
        let mut pending: Vec<u32> =
            (0..self.cells.len() as u32).filter(|&cell| self.cells[cell as usize].first_child == NO_CELL).collect();
        loop {
            let before = self.cells.len();
            let mut coarse = Vec::new();
            for at in pending {
                if watch.step(CELL_WORK, 0.0) == Flow::Stop {
                    return None;
                }
                let corners = self.cells[at as usize].corners;
                let edges = (0..corners.len()).map(|k| (corners[k], corners[(k + 1) % corners.len()]));
                let levels = edges.map(|(from, to)| self.hanging_levels(from, to, 2)).max().unwrap_or(0);
                if levels > 1 { self.split(at) } else { coarse.push(at) }
            }
            if self.cells.len() == before {
                break;
            }
            coarse.extend(before as u32..self.cells.len() as u32);
            pending = coarse.into_iter().filter(|&cell| self.cells[cell as usize].first_child == NO_CELL).collect();
        }
        Some(())
    }

    fn split(&mut self, at: u32) {
        let first = self.cells.len() as u32;
        let parent = self.cells[at as usize].clone();
        self.cells[at as usize].first_child = first;
        for corners in parent.cut.parts(&parent.corners) {
            for &corner in corners.iter() {
                let next = self.points.len() as u32;
                self.points.entry(key(corner)).or_insert(next);
            }
            self.cells.push(Cell { corners, ..parent.clone() });
        }
    }

    /// Points of the boundary of a patch, in order: its corners and what hangs between them. The flag tells corners.
    fn outline(&self, corners: &Corners) -> Vec<(u32, DVec3, bool)> {
        let mut outline = Vec::with_capacity(8);
        for k in 0..corners.len() {
            let (from, to) = (corners[k], corners[(k + 1) % corners.len()]);
            outline.push((self.points[&key(from)], from, true));
            self.hang(from, to, MAX_HANGING_DEPTH, &mut outline);
        }
        outline
    }

    fn hang(&self, from: DVec3, to: DVec3, limit: u32, outline: &mut Vec<(u32, DVec3, bool)>) {
        let centre = middle(from, to);
        let Some(&point) = self.points.get(&key(centre)).filter(|_| limit > 0) else { return };
        self.hang(from, centre, limit - 1, outline);
        outline.push((point, centre, false));
        self.hang(centre, to, limit - 1, outline);
    }

    /// Puts the mesh together: vertices and triangles polygon by polygon.
    fn assemble(
        mut self,
        groups: &[u32],
        values: &Values<'_>,
        watch: &mut Watch<'_>,
    ) -> Option<(SmoothSurfaces, Blending)> {
        let mut layout = Layout::default();
        for polygon in 0..self.scene.polygons.len() as u32 {
            layout.mesh.vertex_start.push(layout.mesh.positions.len() as u32);
            layout.mesh.triangle_start.push(layout.mesh.triangles.len() as u32);
            let (group, leaf) = (groups[polygon as usize], ElementId::NONE);
            let mut sheet = Sheet { group, leaf, vertices: FxHashMap::default() };
            for root in self.roots_of[polygon as usize].clone() {
                self.lay_out(root, &mut sheet, values, &mut layout, watch)?;
            }
        }
        let Layout { mut mesh, origins } = layout;
        mesh.vertex_start.push(mesh.positions.len() as u32);
        mesh.triangle_start.push(mesh.triangles.len() as u32);
        mesh.radiosity = vec![Rgb::ZERO; mesh.positions.len()];
        for (index, polygon) in self.scene.polygons.iter().enumerate() {
            for vertex in mesh.vertices_of(index as u32) {
                mesh.radiosity[vertex] = polygon.emission + polygon.reflectance * mesh.irradiance[vertex];
            }
        }
        Some((SmoothSurfaces { mesh, cells: self.cells, roots_of: self.roots_of }, Blending { origins }))
    }

    /// Vertices first, corners before what the restriction added inside; then the children, or the triangles. `None` when
    /// the watch says stop.
    fn lay_out(
        &mut self,
        at: u32,
        sheet: &mut Sheet,
        values: &Values<'_>,
        layout: &mut Layout,
        watch: &mut Watch<'_>,
    ) -> Option<()> {
        if watch.step(CELL_WORK, 0.0) == Flow::Stop {
            return None;
        }
        let cell = self.cells[at as usize].clone();
        sheet.leaf = cell.element;
        let element_is_leaf = self.elements.is_leaf(cell.element);
        let outline = self.outline(&cell.corners);
        if cell.first_child != NO_CELL {
            if element_is_leaf {
                // A leaf that the restriction split: what lies on its outline has values of its own or lies between
                // two corners; its centre is the mean of its corners.
                let corners: Vec<u32> = self.corner_vertices(&outline, sheet, values, layout);
                let count = corners.len();
                for k in 0..count {
                    let (from, to) = (cell.corners[k], cell.corners[(k + 1) % count]);
                    let ends = [corners[k], corners[(k + 1) % count]];
                    let between = (layout.value(ends[0]) + layout.value(ends[1])) * 0.5;
                    let point = self.points[&key(middle(from, to))];
                    let fallback = Some((between, Origin::Between(ends, 0.5)));
                    sheet.vertex(point, middle(from, to), values, fallback, layout);
                }
                if count == 4 {
                    let centre =
                        middle(middle(cell.corners[0], cell.corners[2]), middle(cell.corners[1], cell.corners[3]));
                    let mean = corners.iter().map(|&corner| layout.value(corner)).sum::<Rgb>() * 0.25;
                    let fallback = Some((mean, Origin::mean(&corners)));
                    sheet.vertex(self.points[&key(centre)], centre, values, fallback, layout);
                }
            }
            for child in cell.first_child..cell.first_child + 4 {
                self.lay_out(child, sheet, values, layout, watch)?;
            }
            return Some(());
        }
        let corners = self.corner_vertices(&outline, sheet, values, layout);
        let first = layout.mesh.triangles.len() as u32;
        let hanging = outline.len() > corners.len();
        if !hanging {
            layout.mesh.triangles.push([corners[0], corners[1], corners[2]]);
            if let [a, _, c, d] = corners[..] {
                layout.mesh.triangles.push([a, c, d]);
            }
        } else {
            let mean = corners.iter().map(|&corner| layout.value(corner)).sum::<Rgb>() / corners.len() as f64;
            let centre = layout.push(cell.corners.mean(), mean, Origin::mean(&corners));
            let ring = self.ring(&outline, sheet, values, layout);
            for k in 0..ring.len() {
                layout.mesh.triangles.push([centre, ring[k], ring[(k + 1) % ring.len()]]);
            }
        }
        let cell = &mut self.cells[at as usize];
        cell.triangles = first..layout.mesh.triangles.len() as u32;
        cell.hanging = hanging;
        for (slot, corner) in cell.vertices.iter_mut().zip(corners) {
            *slot = corner;
        }
        Some(())
    }

    fn corner_vertices(
        &self,
        outline: &[(u32, DVec3, bool)],
        sheet: &mut Sheet,
        values: &Values<'_>,
        layout: &mut Layout,
    ) -> Vec<u32> {
        let corners = outline.iter().filter(|(.., is_corner)| *is_corner);
        corners.map(|&(point, position, _)| sheet.vertex(point, position, values, None, layout)).collect()
    }

    /// All vertices of an outline. One that hangs there for a neighbour in another plane only lies between its
    /// neighbours on the edge.
    fn ring(
        &self,
        outline: &[(u32, DVec3, bool)],
        sheet: &mut Sheet,
        values: &Values<'_>,
        layout: &mut Layout,
    ) -> Vec<u32> {
        let count = outline.len();
        let corner_at = |mut k: usize, step: usize| {
            while !outline[k].2 {
                k = (k + step) % count;
            }
            outline[k]
        };
        (0..count)
            .map(|k| {
                let (point, position, is_corner) = outline[k];
                let (from, to) = (corner_at(k, count - 1), corner_at(k, 1));
                let fallback = (!is_corner).then(|| {
                    let along = position.distance(from.1) / to.1.distance(from.1);
                    let ends = [from.0, to.0].map(|corner| sheet.known(corner, values));
                    let [a, b] = ends.map(|end| layout.value(end));
                    (a * (1.0 - along) + b * along, Origin::Between(ends, along))
                });
                sheet.vertex(point, position, values, fallback, layout)
            })
            .collect()
    }
}

/// Vertices of one polygon.
struct Sheet {
    group: u32,
    /// The leaf that is laid out.
    leaf: ElementId,
    /// By point, and by site where a wall parts the leaves there.
    vertices: FxHashMap<(u32, Option<u32>), u32>,
}

impl Sheet {
    /// The vertex of the leaf at a point, made on first use with its value there, or with `fallback` where it has none.
    fn vertex(
        &mut self,
        point: u32,
        position: DVec3,
        values: &Values<'_>,
        fallback: Option<(Rgb, Origin)>,
        layout: &mut Layout,
    ) -> u32 {
        let parted = values.parted(point, self.leaf);
        *self.vertices.entry((point, parted)).or_insert_with(|| {
            let found = values.get(point, self.group, parted);
            let (value, origin) = found.or(fallback).unwrap_or((Rgb::ZERO, Origin::Dark));
            layout.push(position, value, origin)
        })
    }

    /// The leaf's vertex at a point that has one.
    fn known(&self, point: u32, values: &Values<'_>) -> u32 {
        self.vertices[&(point, values.parted(point, self.leaf))]
    }
}

/// Angle between two vectors, radians.
fn angle(a: DVec3, b: DVec3) -> f64 {
    libm::atan2(a.cross(b).length(), a.dot(b))
}
