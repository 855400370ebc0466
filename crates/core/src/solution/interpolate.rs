//! Smooth values from constant elements: leaves with their irradiance go in, vertex values on a restricted mesh
//! without T-junctions come out, and the means to read them at any point.

use super::{Light, SurfaceMesh};
use crate::kernels::NoProbe;
use crate::scene::{Corners, Scene};
use crate::tree::{Bsp, ElementId, Elements, quadrant_of, quarter};
use crate::units::Rgb;
use glam::DVec3;
use rustc_hash::FxHashMap;
use std::ops::Range;

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
    /// Vertices at the corners (of leaves), in the mesh.
    vertices: [u32; 4],
    /// Triangles of a leaf.
    triangles: Range<u32>,
    /// Do neighbours' vertices hang on its edges?
    hanging: bool,
}

impl SmoothSurfaces {
    /// Interpolates the leaves of `elements`.
    #[must_use]
    pub fn new(scene: &Scene, bsp: &Bsp, elements: &Elements, light: &Light) -> SmoothSurfaces {
        let mut builder = Builder::new(scene, elements);
        builder.restrict();
        let groups = smoothing_groups(scene, bsp);
        let values = builder.vertex_values(&groups, light);
        builder.assemble(&groups, &values)
    }

    /// The mesh with values at its vertices.
    #[must_use]
    pub fn mesh(&self) -> &SurfaceMesh {
        &self.mesh
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
            at = cell.first_child + quadrant_of(&cell.corners, normal, point);
        }
        let cell = &self.cells[at as usize];
        let value = |vertex: u32| self.mesh.irradiance[vertex as usize];
        if cell.corners.len() == 4 && !cell.hanging {
            let (s, t) = bilinear_coordinates(&cell.corners, normal, point);
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
fn bilinear_coordinates(corners: &Corners, normal: DVec3, point: DVec3) -> (f64, f64) {
    let (a, b, c, d) = (corners[0], corners[1], corners[2], corners[3]);
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

/// Coplanar neighbours with a common edge, and nothing standing on it, have one irradiance along it. Returns a group
/// number per polygon.
fn smoothing_groups(scene: &Scene, bsp: &Bsp) -> Vec<u32> {
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
        let corners = &polygon.corners;
        for k in 0..corners.len() {
            let (from, to) = (corners[k], corners[(k + 1) % corners.len()]);
            // The neighbour runs along the edge the other way.
            for &other in edges.get(&[key(to), key(from)]).map_or(&[][..], Vec::as_slice) {
                if is_smooth_across(scene, bsp, index as u32, other, from, to) {
                    let (one, two) = (find(&mut group, index as u32), find(&mut group, other));
                    group[one.max(two) as usize] = one.min(two);
                }
            }
            edges.entry([key(from), key(to)]).or_default().push(index as u32);
        }
    }
    (0..group.len() as u32).map(|index| find(&mut group, index)).collect()
}

/// Same plane, and a short ray just above the edge passes.
fn is_smooth_across(scene: &Scene, bsp: &Bsp, one: u32, two: u32, from: DVec3, to: DVec3) -> bool {
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
    bsp.closest_hit(scene, start, -inward, 2.0 * reach, &mut NoProbe).is_none()
}

/// A position as a hash key; both zeros are one.
fn key(point: DVec3) -> [u64; 3] {
    [(point.x + 0.0).to_bits(), (point.y + 0.0).to_bits(), (point.z + 0.0).to_bits()]
}

fn middle(a: DVec3, b: DVec3) -> DVec3 {
    (a + b) * 0.5
}

/// Sums of values at a vertex.
#[derive(Clone, Copy, Default)]
struct Gathered {
    sum: Rgb,
    weight: f64,
    angle: f64,
}

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
    fn new(scene: &'a Scene, elements: &'a Elements) -> Builder<'a> {
        let mut points = FxHashMap::default();
        let mut cells = Vec::with_capacity(elements.len());
        for (index, element) in elements.as_slice().iter().enumerate() {
            for &corner in element.corners.iter() {
                let next = points.len() as u32;
                points.entry(key(corner)).or_insert(next);
            }
            cells.push(Cell {
                corners: element.corners,
                element: ElementId(index as u32),
                polygon: element.polygon,
                first_child: element.first_child.some().map_or(NO_CELL, |child| child.0),
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
        Builder { scene, elements, cells, points, roots_of }
    }

    /// Levels of vertices that hang on an edge.
    fn hanging_levels(&self, from: DVec3, to: DVec3, limit: u32) -> u32 {
        let centre = middle(from, to);
        if limit == 0 || !self.points.contains_key(&key(centre)) {
            return 0;
        }
        1 + self.hanging_levels(from, centre, limit - 1).max(self.hanging_levels(centre, to, limit - 1))
    }

    /// Splits leaves until no edge carries more than one level of hanging vertices.
    fn restrict(&mut self) {
        let mut pending: Vec<u32> =
            (0..self.cells.len() as u32).filter(|&cell| self.cells[cell as usize].first_child == NO_CELL).collect();
        loop {
            let before = self.cells.len();
            let mut coarse = Vec::new();
            for at in pending {
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
    }

    fn split(&mut self, at: u32) {
        let first = self.cells.len() as u32;
        let parent = self.cells[at as usize].clone();
        self.cells[at as usize].first_child = first;
        for corners in quarter(&parent.corners) {
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

    /// Irradiance by (point, smoothing group): the mean of the leaves around, weighted by inverse distance to their
    /// centres; at borders continued linearly, so that a leaf's mean is kept.
    fn vertex_values(&self, groups: &[u32], light: &Light) -> FxHashMap<(u32, u32), Rgb> {
        let mut gathered: FxHashMap<(u32, u32), Gathered> = FxHashMap::default();
        let leaves: Vec<(ElementId, Vec<(u32, DVec3, bool)>)> =
            self.elements.leaves().map(|leaf| (leaf, self.outline(&self.elements.get(leaf).corners))).collect();
        for (leaf, outline) in &leaves {
            let element = self.elements.get(*leaf);
            let (centre, group) = (element.corners.mean(), groups[element.polygon as usize]);
            for (k, &(point, position, _)) in outline.iter().enumerate() {
                let before = outline[(k + outline.len() - 1) % outline.len()].1;
                let after = outline[(k + 1) % outline.len()].1;
                let entry = gathered.entry((point, group)).or_default();
                let weight = 1.0 / position.distance(centre);
                entry.sum += light.irradiance(*leaf) * weight;
                entry.weight += weight;
                entry.angle += angle(before - position, after - position);
            }
        }
        let average = |gathered: &Gathered| gathered.sum / gathered.weight;
        let mut values: FxHashMap<(u32, u32), Rgb> =
            gathered.iter().map(|(&place, gathered)| (place, average(gathered))).collect();
        // A full turn, less rounding: at most about 20 corners meet.
        let is_inner = |place: &(u32, u32)| gathered[place].angle > 2.0 * std::f64::consts::PI - 1e-6;
        let mut border: FxHashMap<(u32, u32), Gathered> = FxHashMap::default();
        for (leaf, outline) in &leaves {
            let element = self.elements.get(*leaf);
            let group = groups[element.polygon as usize];
            let corners: Vec<(u32, DVec3)> = outline
                .iter()
                .filter(|(.., is_corner)| *is_corner)
                .map(|&(point, position, _)| (point, position))
                .collect();
            let own = light.irradiance(*leaf);
            for k in 0..corners.len() {
                let place = (corners[k].0, group);
                let others: &[usize] = if corners.len() == 4 { &[2] } else { &[1, 2] };
                let opposite: Vec<(u32, u32)> =
                    others.iter().map(|offset| (corners[(k + offset) % corners.len()].0, group)).collect();
                if is_inner(&place) || !opposite.iter().all(is_inner) {
                    continue;
                }
                let share = opposite.len() as f64;
                let known: Rgb = opposite.iter().map(|place| average(&gathered[place])).sum();
                let weight = 1.0 / corners[k].1.distance(element.corners.mean());
                let entry = border.entry(place).or_default();
                entry.sum += (own * (share + 1.0) - known) * weight;
                entry.weight += weight;
            }
        }
        for (place, continued) in border {
            values.insert(place, average(&continued).map(|value| value.max(0.0)));
        }
        values
    }

    /// Puts the mesh together: vertices and triangles polygon by polygon.
    fn assemble(mut self, groups: &[u32], values: &FxHashMap<(u32, u32), Rgb>) -> SmoothSurfaces {
        let mut mesh = SurfaceMesh::default();
        for polygon in 0..self.scene.polygons.len() as u32 {
            mesh.vertex_start.push(mesh.positions.len() as u32);
            mesh.triangle_start.push(mesh.triangles.len() as u32);
            let mut sheet = Sheet { group: groups[polygon as usize], vertices: FxHashMap::default() };
            for root in self.roots_of[polygon as usize].clone() {
                self.lay_out(root, &mut sheet, values, &mut mesh);
            }
        }
        mesh.vertex_start.push(mesh.positions.len() as u32);
        mesh.triangle_start.push(mesh.triangles.len() as u32);
        mesh.radiosity = vec![Rgb::ZERO; mesh.positions.len()];
        for (index, polygon) in self.scene.polygons.iter().enumerate() {
            for vertex in mesh.vertices_of(index as u32) {
                mesh.radiosity[vertex] = polygon.emission + polygon.reflectance * mesh.irradiance[vertex];
            }
        }
        SmoothSurfaces { mesh, cells: self.cells, roots_of: self.roots_of }
    }

    /// Vertices first, corners before what the restriction added inside; then the children, or the triangles.
    fn lay_out(&mut self, at: u32, sheet: &mut Sheet, values: &FxHashMap<(u32, u32), Rgb>, mesh: &mut SurfaceMesh) {
        let cell = self.cells[at as usize].clone();
        let element_is_leaf = self.elements.is_leaf(cell.element);
        let outline = self.outline(&cell.corners);
        if cell.first_child != NO_CELL {
            if element_is_leaf {
                // A leaf that the restriction split: what lies on its outline has values of its own or lies between
                // two corners; its centre is the mean of its corners.
                let corners: Vec<u32> = self.corner_vertices(&outline, sheet, values, mesh);
                let count = corners.len();
                for k in 0..count {
                    let (from, to) = (cell.corners[k], cell.corners[(k + 1) % count]);
                    let between = (mesh.irradiance[corners[k] as usize]
                        + mesh.irradiance[corners[(k + 1) % count] as usize])
                        * 0.5;
                    let point = self.points[&key(middle(from, to))];
                    sheet.vertex(point, middle(from, to), values, Some(between), mesh);
                }
                if count == 4 {
                    let centre =
                        middle(middle(cell.corners[0], cell.corners[2]), middle(cell.corners[1], cell.corners[3]));
                    let mean = corners.iter().map(|&corner| mesh.irradiance[corner as usize]).sum::<Rgb>() * 0.25;
                    sheet.vertex(self.points[&key(centre)], centre, values, Some(mean), mesh);
                }
            }
            for child in cell.first_child..cell.first_child + 4 {
                self.lay_out(child, sheet, values, mesh);
            }
            return;
        }
        let corners = self.corner_vertices(&outline, sheet, values, mesh);
        let first = mesh.triangles.len() as u32;
        let hanging = outline.len() > corners.len();
        if !hanging {
            mesh.triangles.push([corners[0], corners[1], corners[2]]);
            if let [a, _, c, d] = corners[..] {
                mesh.triangles.push([a, c, d]);
            }
        } else {
            let centre = mesh.positions.len() as u32;
            mesh.positions.push(cell.corners.mean());
            let mean =
                corners.iter().map(|&corner| mesh.irradiance[corner as usize]).sum::<Rgb>() / corners.len() as f64;
            mesh.irradiance.push(mean);
            let ring = self.ring(&outline, sheet, values, mesh);
            for k in 0..ring.len() {
                mesh.triangles.push([centre, ring[k], ring[(k + 1) % ring.len()]]);
            }
        }
        let cell = &mut self.cells[at as usize];
        cell.triangles = first..mesh.triangles.len() as u32;
        cell.hanging = hanging;
        for (slot, corner) in cell.vertices.iter_mut().zip(corners) {
            *slot = corner;
        }
    }

    fn corner_vertices(
        &self,
        outline: &[(u32, DVec3, bool)],
        sheet: &mut Sheet,
        values: &FxHashMap<(u32, u32), Rgb>,
        mesh: &mut SurfaceMesh,
    ) -> Vec<u32> {
        let corners = outline.iter().filter(|(.., is_corner)| *is_corner);
        corners.map(|&(point, position, _)| sheet.vertex(point, position, values, None, mesh)).collect()
    }

    /// All vertices of an outline. One that hangs there for a neighbour in another plane only lies between its
    /// neighbours on the edge.
    fn ring(
        &self,
        outline: &[(u32, DVec3, bool)],
        sheet: &mut Sheet,
        values: &FxHashMap<(u32, u32), Rgb>,
        mesh: &mut SurfaceMesh,
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
                    let [a, b] = [from.0, to.0].map(|corner| mesh.irradiance[sheet.vertices[&corner] as usize]);
                    a * (1.0 - along) + b * along
                });
                sheet.vertex(point, position, values, fallback, mesh)
            })
            .collect()
    }
}

/// Vertices of one polygon.
struct Sheet {
    group: u32,
    vertices: FxHashMap<u32, u32>,
}

impl Sheet {
    /// The vertex at a point, made on first use with the point's value, or with `fallback` where it has none.
    fn vertex(
        &mut self,
        point: u32,
        position: DVec3,
        values: &FxHashMap<(u32, u32), Rgb>,
        fallback: Option<Rgb>,
        mesh: &mut SurfaceMesh,
    ) -> u32 {
        *self.vertices.entry(point).or_insert_with(|| {
            let value = values.get(&(point, self.group)).copied().or(fallback).unwrap_or(Rgb::ZERO);
            mesh.positions.push(position);
            mesh.irradiance.push(value);
            mesh.positions.len() as u32 - 1
        })
    }
}

/// Angle between two vectors, radians.
fn angle(a: DVec3, b: DVec3) -> f64 {
    libm::atan2(a.cross(b).length(), a.dot(b))
}
