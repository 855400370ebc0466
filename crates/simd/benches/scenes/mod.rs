//! Scenes and rays to measure with: a furnished room of 349 parallelograms, and the same full of bumpy balls, 125,000 triangles.

use isolux_simd::bvh::{Primitive, Rays};

pub type Point = [f32; 3];

/// Numbers that look random and are the same everywhere (SplitMix64, Steele et al. 2014).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }
    pub fn number(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }
    pub fn below(&mut self, bound: usize) -> usize {
        (self.number() * bound as f32) as usize
    }
}

fn parallelogram(origin: Point, u: Point, v: Point) -> Primitive {
    Primitive { origin, u, v, parallelogram: true, opaque: true }
}

pub fn triangle(a: Point, b: Point, c: Point) -> Primitive {
    Primitive { origin: a, u: sub(b, a), v: sub(c, a), parallelogram: false, opaque: true }
}

pub fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn dot(a: Point, b: Point) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The six sides of a box turned about the vertical, normals outwards.
fn cuboid(all: &mut Vec<Primitive>, middle: Point, size: Point, turn: f32) {
    let (sin, cos) = turn.sin_cos();
    let at = |x: f32, y: f32, z: f32| {
        let (x, y) = (x * size[0] * 0.5, y * size[1] * 0.5);
        [middle[0] + cos * x - sin * y, middle[1] + sin * x + cos * y, middle[2] + z * size[2] * 0.5]
    };
    let mut side = |a: Point, b: Point, c: Point| all.push(parallelogram(a, sub(b, a), sub(c, a)));
    side(at(-1., -1., 1.), at(1., -1., 1.), at(-1., 1., 1.));
    side(at(-1., -1., -1.), at(-1., 1., -1.), at(1., -1., -1.));
    side(at(-1., -1., -1.), at(1., -1., -1.), at(-1., -1., 1.));
    side(at(-1., 1., -1.), at(-1., 1., 1.), at(1., 1., -1.));
    side(at(-1., -1., -1.), at(-1., -1., 1.), at(-1., 1., -1.));
    side(at(1., -1., -1.), at(1., 1., -1.), at(1., -1., 1.));
}

/// A room of 6 x 5 x 2.8 m with a table, six chairs, a bed, shelves with books and a lamp: 349 parallelograms.
pub fn room() -> Vec<Primitive> {
    let mut all = Vec::new();
    cuboid(&mut all, [3.0, 2.5, 1.4], [6.0, 5.0, 2.8], 0.0);
    for side in &mut all {
        // Normals inwards.
        std::mem::swap(&mut side.u, &mut side.v);
    }
    // Table.
    cuboid(&mut all, [3.2, 2.4, 0.72], [1.8, 0.9, 0.04], 0.1);
    for (x, y) in [(2.4, 2.05), (4.0, 2.05), (2.4, 2.75), (4.0, 2.75)] {
        cuboid(&mut all, [x, y, 0.35], [0.06, 0.06, 0.7], 0.1);
    }
    // Chairs.
    for (k, (x, y)) in [(2.6, 1.7), (3.2, 1.7), (3.8, 1.7), (2.6, 3.1), (3.2, 3.1), (3.8, 3.1)].into_iter().enumerate()
    {
        let back = if k < 3 { -0.2 } else { 0.2 };
        let turn = 0.2 * (k as f32 - 2.5);
        cuboid(&mut all, [x, y, 0.45], [0.42, 0.42, 0.04], turn);
        cuboid(&mut all, [x, y + back, 0.7], [0.42, 0.03, 0.5], turn);
        for (dx, dy) in [(-0.17, -0.17), (0.17, -0.17), (-0.17, 0.17), (0.17, 0.17)] {
            cuboid(&mut all, [x + dx, y + dy, 0.215], [0.04, 0.04, 0.43], turn);
        }
    }
    // Bed.
    cuboid(&mut all, [1.0, 4.0, 0.25], [1.6, 1.9, 0.3], 0.0);
    cuboid(&mut all, [1.0, 4.94, 0.5], [1.7, 0.06, 1.0], 0.0);
    // Shelves: boards, sides, books.
    for k in 0..5 {
        cuboid(&mut all, [5.8, 1.5, 0.1 + 0.4 * k as f32], [0.3, 1.6, 0.03], 0.0);
    }
    cuboid(&mut all, [5.8, 0.68, 0.9], [0.32, 0.03, 1.8], 0.0);
    cuboid(&mut all, [5.8, 2.32, 0.9], [0.32, 0.03, 1.8], 0.0);
    for k in 0..6 {
        cuboid(&mut all, [5.8, 0.9 + 0.22 * k as f32, 0.24 + 0.4 * (k % 4) as f32], [0.2, 0.12, 0.24], 0.05 * k as f32);
    }
    // Lamp, and its cord.
    cuboid(&mut all, [3.2, 2.4, 1.9], [0.4, 0.4, 0.2], 0.4);
    let cord = [3.2, 2.4, 2.0];
    all.push(parallelogram(cord, [0.01, 0.0, 0.0], [0.0, 0.0, 0.8]));
    all
}

/// The room with 20 bumpy balls of 6,240 triangles each.
pub fn dense() -> Vec<Primitive> {
    let mut all = room();
    let mut random = Random(7);
    for _ in 0..20 {
        let middle = [0.4 + 5.2 * random.number(), 0.4 + 4.2 * random.number(), 0.3 + 2.2 * random.number()];
        let radius = 0.12 + 0.25 * random.number();
        let phase = 6.0 * random.number();
        let (rows, columns) = (40, 80);
        let at = |row: usize, column: usize| {
            let theta = std::f32::consts::PI * row as f32 / rows as f32;
            let phi = 2.0 * std::f32::consts::PI * (column % columns) as f32 / columns as f32;
            let r = radius * (1.0 + 0.15 * (5.0 * theta + phase).sin() * (4.0 * phi).cos());
            let (st, ct) = if row == 0 || row == rows { (0.0, theta.cos()) } else { theta.sin_cos() };
            [middle[0] + r * st * phi.cos(), middle[1] + r * st * phi.sin(), middle[2] + r * ct]
        };
        for row in 0..rows {
            for column in 0..columns {
                let (a, b) = (at(row, column), at(row, column + 1));
                let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
                if row + 1 < rows {
                    all.push(triangle(a, c, d));
                }
                if row > 0 {
                    all.push(triangle(a, d, b));
                }
            }
        }
    }
    all
}

/// Each parallelogram as two triangles: what a library of triangles is given.
pub fn triangles(primitives: &[Primitive]) -> Vec<[Point; 3]> {
    let mut all = Vec::new();
    for primitive in primitives {
        let at = |s: f32, t: f32| -> Point {
            std::array::from_fn(|axis| primitive.origin[axis] + s * primitive.u[axis] + t * primitive.v[axis])
        };
        all.push([at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)]);
        if primitive.parallelogram {
            all.push([at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]);
        }
    }
    all
}

/// A part of a primitive: a corner and two edges.
#[derive(Clone, Copy)]
pub struct Patch {
    pub origin: Point,
    pub u: Point,
    pub v: Point,
    pub parallelogram: bool,
}

impl Patch {
    fn at(&self, s: f32, t: f32) -> Point {
        let (s, t) = if !self.parallelogram && s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
        std::array::from_fn(|axis| self.origin[axis] + s * self.u[axis] + t * self.v[axis])
    }

    pub fn corners(&self) -> Vec<Point> {
        let corners = [self.at(0.0, 0.0), self.at(1.0, 0.0), self.at(0.0, 1.0)];
        if self.parallelogram { vec![corners[0], corners[1], self.at(1.0, 1.0), corners[2]] } else { corners.to_vec() }
    }

    /// One of the sixteen cells of a 4 x 4 raster, its middle.
    fn cell(&self, k: usize) -> Point {
        self.at((k % 4) as f32 * 0.25 + 0.125, (k / 4) as f32 * 0.25 + 0.125)
    }

    fn quarter(&self, k: usize) -> Patch {
        if !self.parallelogram {
            return *self;
        }
        let half = |v: Point| v.map(|x| 0.5 * x);
        let (s, t) = ((k % 2) as f32 * 0.5, (k / 2) as f32 * 0.5);
        Patch { origin: self.at(s, t), u: half(self.u), v: half(self.v), parallelogram: true }
    }
}

fn faces(a: &Patch, b: &Patch) -> bool {
    let towards = |a: &Patch, b: &Patch| dot(cross(a.u, a.v), sub(b.cell(5), a.cell(5))) > 0.0;
    towards(a, b) && towards(b, a)
}

/// Patches as refinement meets them: areas as likely as they are large, cut to a random size, facing each other.
pub fn pairs(primitives: &[Primitive], count: usize, seed: u64) -> Vec<(Patch, Patch)> {
    let mut sums = Vec::new();
    let mut sum = 0.0_f64;
    for primitive in primitives {
        let n = cross(primitive.u, primitive.v);
        sum += f64::from(dot(n, n)).sqrt() * if primitive.parallelogram { 1.0 } else { 0.5 };
        sums.push(sum);
    }
    let mut random = Random(seed);
    let mut patch = || {
        let target = f64::from(random.number()) * sum;
        let primitive = &primitives[sums.partition_point(|&sum| sum < target).min(primitives.len() - 1)];
        let (origin, u, v, parallelogram) = (primitive.origin, primitive.u, primitive.v, primitive.parallelogram);
        let mut patch = Patch { origin, u, v, parallelogram };
        for _ in 0..random.below(6) {
            patch = patch.quarter(random.below(4));
        }
        patch
    };
    let mut all = Vec::new();
    while all.len() < count {
        let (a, b) = (patch(), patch());
        if faces(&a, &b) {
            all.push((a, b));
        }
    }
    all
}

/// All sixteen pairs of quarters of each pair, one after the other: the order in which refinement asks.
pub fn refined(pairs: &[(Patch, Patch)]) -> Vec<(Patch, Patch)> {
    pairs.iter().flat_map(|(a, b)| (0..16).map(|k| (a.quarter(k / 4), b.quarter(k % 4)))).collect()
}

/// Sixteen rays between the cells of two patches.
pub fn packet(a: &Patch, b: &Patch, random: &mut Random) -> Rays<16> {
    let mut order: [usize; 16] = std::array::from_fn(|k| k);
    for k in (1..16).rev() {
        order.swap(k, random.below(k + 1));
    }
    let mut rays = Rays::default();
    for (k, &cell) in order.iter().enumerate() {
        rays.set_between(k, a.cell(k), b.cell(cell), 1e-4);
    }
    rays
}

/// Packets of many pairs.
pub fn packets(pairs: &[(Patch, Patch)], seed: u64) -> Vec<Rays<16>> {
    let mut random = Random(seed);
    pairs.iter().map(|(a, b)| packet(a, b, &mut random)).collect()
}

/// Sixteen rays that leave a point within four by four of `side` by `side` strata of its hemisphere, cosine-weighted; for all
/// strata of points of primitives that are as likely as they are large.
pub fn hemispheres(primitives: &[Primitive], points: usize, side: usize, seed: u64) -> Vec<Rays<16>> {
    let mut random = Random(seed);
    let mut all = Vec::new();
    for (patch, _) in pairs(primitives, points, seed) {
        let unit = |v: Point| v.map(|x| x / dot(v, v).sqrt());
        let (from, normal, tangent) =
            (patch.at(random.number(), random.number()), unit(cross(patch.u, patch.v)), unit(patch.u));
        let bitangent = cross(normal, tangent);
        for block in 0..(side / 4).pow(2) {
            let mut rays = Rays::default();
            for k in 0..16 {
                let (row, column) = (block / (side / 4) * 4 + k / 4, block % (side / 4) * 4 + k % 4);
                let [a, b] = [row, column].map(|stratum| (stratum as f32 + random.number()) / side as f32);
                let ((sine, cosine), rise) = ((std::f32::consts::TAU * b).sin_cos(), (1.0 - a).sqrt());
                for axis in 0..3 {
                    rays.origin[axis][k] = from[axis];
                    let across = cosine * tangent[axis] + sine * bitangent[axis];
                    rays.direction[axis][k] = a.sqrt() * across + rise * normal[axis];
                }
                rays.near[k] = 1e-4 / rise.max(1e-6);
                rays.far[k] = 100.0;
            }
            all.push(rays);
        }
    }
    all
}
