//! Exchange areas of pairs: two patches and a method go in, `A_a F_ab = A_b F_ba` comes out, the same bits in either
//! order; visibility is left to its own kernel.

use super::disk;
use super::lambert::{Source, point_kernel};
use super::outline::{MOST_CORNERS, Outline, heights};
use super::quadrature::{Piece, ball};
use crate::kernels::{Patch, Probe};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// How a form factor between two patches is evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FormFactor {
    /// Four points to four disks (Wallace et al. 1989): the paper's.
    Disks,
    /// The closed form (Lambert 1760) from points on the smaller patch, as many as the pair needs (D5).
    #[default]
    Lambert,
}

/// Exchange area `G = A_a F_ab = A_b F_ba` of two patches, unoccluded, m².
///
/// **Formula.** `G = int_a int_b cos cos' / (pi r^2) dA dA'` over those parts of both that are in front of the other's
/// plane. [`FormFactor::Lambert`] has three regimes:
///
/// 1. *Apart*: every corner in front of the other's plane, and not nearly in it; the middles more than six radii apart;
///    the kernel's values spread little: `sum_k sum_l w_k w_l cos cos' / (pi r_kl^2)`, three points on a triangle, four
///    on a quadrilateral.
/// 2. *Closer*: `sum_k w_k F(x_k)` with the point-to-polygon closed form `F` towards the larger patch (clipped at the
///    smaller one's plane) and points `x_k` on the smaller (clipped at the larger one's plane), where the middle of the
///    smaller is at least three of its radii from every edge of the larger: three or four points where their values
///    spread little, else nine.
/// 3. *Near*: the smaller patch is cut into pieces until each meets 2, or until the rules of few and of nine points
///    agree within 2e-4 of the whole; the nine-point value counts.
///
/// [`FormFactor::Disks`] is described with its kernel: `docs/theory/form-factors.md`, formulas 8 and 9.
///
/// **Symbols.** `A`: areas, m²; `F_ab`: share of what leaves a that reaches b; `cos`, `cos'`: cosines at both ends;
/// `r`: distance, metres; `w`: area that a quadrature point stands for, m². A patch's radius is the largest distance of
/// a corner from the mean of its corners.
///
/// **Source.** Reciprocity and the double integral: H. C. Hottel, A. F. Sarofim, *Radiative Transfer* (1967).
/// Points to polygon: Baum, Rushmeier, Winget (SIGGRAPH 1989).
///
/// **Preconditions.** Planar convex patches, corners counter-clockwise about their planes' normals. Any position is
/// allowed, overlap included. Points in each other's plane exchange nothing, so two coincident patches have `G = 0`.
///
/// **Error bound.** Lambert: relative 1e-3 for 99 in 100 random pairs that do not touch and 3e-3 for all (test
/// `separate_pairs_meet_their_bound`), 3e-3 for pairs that share an edge and all but one in 3,000 that cross
/// (`touching_pairs_meet_their_bound`, `what_is_known_to_be_worse`), 1e-2 for parallel squares with a gap below a
/// hundredth of their side (`parallel_rectangles`). What is short and closer to a long smaller patch than 1e-4 of its
/// radius is not seen (`what_is_known_to_be_worse`). `0 <= G <= min(A_a, A_b)`.
///
/// Swapping a and b gives the same bits (test `swapping_gives_the_same_bits`).
pub fn exchange_area<P: Probe>(a: &Patch, b: &Patch, method: FormFactor, probe: &mut P) -> f64 {
    let (small, large) = if order(a, b) == Ordering::Greater { (b, a) } else { (a, b) };
    match method {
        FormFactor::Disks => {
            probe.form_factor(DISK_TERMS);
            disk::exchange_area(small, large)
        }
        FormFactor::Lambert => lambert(small, large, &SETTINGS, probe),
    }
}

/// Four points times four disks.
const DISK_TERMS: u32 = 16;

/// Areas this close count as equal, so that scaling a scene (which rounds areas) cannot change which patch has the
/// points: some thousand units of rounding, and far below any difference that matters to the choice.
const EQUAL_AREAS: f64 = 1e-12;

/// The canonical order of a pair (D6): smaller area first, then by corners; equal only for identical corners.
fn order(a: &Patch, b: &Patch) -> Ordering {
    if (a.area - b.area).abs() > EQUAL_AREAS * a.area.max(b.area) {
        return a.area.total_cmp(&b.area);
    }
    a.corners.total_cmp(b.corners)
}

/// Where one regime of [`exchange_area`] ends and the next begins.
#[derive(Clone, Copy, Debug)]
struct Settings {
    /// Distance of the middles in radii of the larger-radius patch from which few points on both sides do.
    apart: f64,
    /// Distance from the middle of a piece to the edges of the larger patch, in radii of the piece, from which few
    /// points do.
    few: f64,
    /// Largest minus smallest value at the few points, relative to their mean, up to which few points do on a
    /// quadrilateral.
    spread: f64,
    /// The same on a triangle, whose rule is of one degree less.
    spread_triangle: f64,
    /// Lowest corner of each patch above the other's plane, in heights of its highest, from which few points may do:
    /// below it a cosine that nearly vanishes can hide from the spread behind a distance that grows.
    level: f64,
    /// Difference of the two rules on a piece that counts as agreement, relative to the whole pair's exchange area.
    agreement: f64,
    /// Most times a piece is split.
    depth: u32,
    /// Height above the smaller patch's plane, in radii of the smaller, up to which an edge of the larger is taken to lie
    /// in it. Towards such an edge the closed form is smooth: the edge's own term is the angle it subtends.
    /// With 0, crossing pairs take a fifth more points; with 1e-3, needles over squares of a
    /// hundredth of their length are off by 1.4e-2 instead of 3.4e-4.
    /// What is short and nearer than this to a long smaller patch is not seen at all by its points
    /// (test `what_is_known_to_be_worse`).
    in_plane: f64,
    /// Distance of the middle of a piece to a steep edge, in radii of the piece, within which the edge may pass through it.
    /// With 0.7, crossing pairs are off by 2.5e-3 instead of 3.3e-4; 1.4 gains nothing and takes a third more points.
    touched: f64,
    /// How many times more a function must vary in one direction for a cut across that direction only. With 2, crossing
    /// pairs are off by 6.2e-4 instead of 3.3e-4; with 6, hinges by 2.2e-3 instead of 1.8e-3.
    one_sided: f64,
    /// Largest radius of a piece, in radii of the larger patch's visible part, at which two rules that agree are believed:
    /// a piece that is longer can pass close to the source between its points. Without it the same needles are off by
    /// 2.1e-3; 1 takes 1 % more points, gains nothing here, and in another 6,000 takes the worst from 8.4e-3 to 2.0e-3.
    compact: f64,
    /// Most times a pair is integrated with a smaller scale. With 1, the same needles are off by 1.8e-3; 3 changes nothing.
    most_rounds: u32,
    /// Points after which a pair is refined no more: a bound on work (a millisecond). The most that a pair takes of 3,000
    /// that cross and 6,000 needles is 1,941; with 500, crossing pairs are off by 2.0e-2.
    most_terms: u32,
}

const SETTINGS: Settings = Settings {
    apart: 6.0,
    few: 3.0,
    spread: 0.4,
    spread_triangle: 0.25,
    level: 0.2,
    agreement: 2e-4,
    depth: 12,
    in_plane: 1e-4,
    touched: 1.0,
    one_sided: 3.0,
    compact: 2.0,
    most_rounds: 2,
    most_terms: 20_000,
};

fn lambert<P: Probe>(small: &Patch, large: &Patch, settings: &Settings, probe: &mut P) -> f64 {
    let (small_centre, small_radius) = ball(small.corners);
    let (large_centre, large_radius) = ball(large.corners);
    let mut small_heights = Range::NONE;
    small.corners.iter().for_each(|&p| small_heights.add(large.plane.distance(p)));
    let mut large_heights = Range::NONE;
    large.corners.iter().for_each(|&p| large_heights.add(small.plane.distance(p)));
    let in_front = small_heights.0 > 0.0 && large_heights.0 > 0.0;
    let level =
        small_heights.0 > settings.level * small_heights.1 && large_heights.0 > settings.level * large_heights.1;
    let reach = settings.apart * small_radius.max(large_radius);
    let mut terms = 0;
    let mut sum = None;
    if level && (large_centre - small_centre).length_squared() > reach * reach {
        sum = points_to_points(small, large, settings, &mut terms);
    }
    let sum = sum.unwrap_or_else(|| {
        if in_front {
            let source = Source::new(&Outline::new(large.corners), small.plane.normal, large.plane.normal);
            Near::new(&source, small, small_radius, level, settings).whole(&[Piece::new(small.corners)], &mut terms)
        } else {
            clipped(small, large, small_radius, settings, &mut terms)
        }
    });
    probe.form_factor(terms);
    // A NaN, which only patches without extent can cause, counts as nothing.
    if sum > 0.0 { sum.min(small.area) } else { 0.0 }
}

/// Smallest and largest of the values seen, for the spread tests.
#[derive(Clone, Copy)]
struct Range(f64, f64);

impl Range {
    const NONE: Range = Range(f64::INFINITY, f64::NEG_INFINITY);

    fn add(&mut self, value: f64) {
        self.0 = self.0.min(value);
        self.1 = self.1.max(value);
    }

    /// Spread at most `limit` of the middle of the range: cheaper than the mean, and within a few percent of it where
    /// the answer is yes.
    fn within(self, limit: f64) -> bool {
        self.1 - self.0 <= limit * (0.5 * (self.0 + self.1))
    }
}

/// Few points on both patches; none where the kernel varies too much between them.
fn points_to_points(small: &Patch, large: &Patch, settings: &Settings, terms: &mut u32) -> Option<f64> {
    let (from, from_count) = Piece::new(small.corners).few(small.plane.normal);
    let (to, to_count) = Piece::new(large.corners).few(large.plane.normal);
    *terms += (from_count * to_count) as u32;
    let mut sum = 0.0;
    let mut range = Range::NONE;
    for &(p, p_area) in &from[..from_count] {
        let mut inner = 0.0;
        for &(q, q_area) in &to[..to_count] {
            let kernel = point_kernel(p, small.plane.normal, q, large.plane.normal);
            range.add(kernel);
            inner += q_area * kernel;
        }
        sum += p_area * inner;
    }
    let limit = if from_count.min(to_count) == TRIANGLE_POINTS { settings.spread_triangle } else { settings.spread };
    // Two patches' variations add up in the spread; each may have its own.
    range.within(PATCHES * limit).then_some(sum)
}

/// Points of the few-point rule on a triangle.
const TRIANGLE_POINTS: usize = 3;

/// Patches of a pair.
const PATCHES: f64 = 2.0;

/// Both patches cut down to what is in front of the other's plane.
#[cold]
fn clipped(small: &Patch, large: &Patch, radius: f64, settings: &Settings, terms: &mut u32) -> f64 {
    let source = Outline::in_front(large.corners, &heights(large.corners, small.plane));
    let receiver = Outline::in_front(small.corners, &heights(small.corners, large.plane));
    if source.is_empty() || receiver.is_empty() {
        return 0.0;
    }
    let source = Source::new(&source, small.plane.normal, large.plane.normal);
    let near = Near::new(&source, small, radius, false, settings);
    match *receiver.corners() {
        [a, b, c, d, e] => near.whole(&[Piece::new(&[a, b, c, d]), Piece::new(&[a, d, e])], terms),
        ref corners => near.whole(&[Piece::new(corners)], terms),
    }
}

/// Points on pieces of the smaller patch, closed form towards the larger.
struct Near<'a> {
    source: &'a Source,
    normal: DVec3,
    /// Edges of the source near which the closed form is steep: start, edge, 1/|edge|²; the count is beside it.
    edges: [(DVec3, DVec3, f64); MOST_CORNERS],
    edge_count: usize,
    centre: DVec3,
    radius: f64,
    /// Whether few points may do at all: see [`Settings::level`].
    level: bool,
    settings: &'a Settings,
}

impl<'a> Near<'a> {
    fn new(source: &'a Source, small: &Patch, small_radius: f64, level: bool, settings: &'a Settings) -> Near<'a> {
        let corners = source.corners();
        let (centre, radius) = ball(corners);
        let mut near = Near {
            source,
            normal: small.plane.normal,
            edges: [(DVec3::ZERO, DVec3::ZERO, 0.0); MOST_CORNERS],
            edge_count: 0,
            centre,
            radius,
            level,
            settings,
        };
        let in_plane = |p: DVec3| small.plane.distance(p) <= settings.in_plane * small_radius;
        for i in 0..corners.len() {
            let j = if i + 1 == corners.len() { 0 } else { i + 1 };
            if !(in_plane(corners[i]) && in_plane(corners[j])) {
                let edge = corners[j] - corners[i];
                let square = edge.length_squared();
                near.edges[near.edge_count] = (corners[i], edge, if square > 0.0 { 1.0 / square } else { 0.0 });
                near.edge_count += 1;
            }
        }
        near
    }

    /// Sum over `pieces` of the integral of the closed form, m².
    fn whole(&self, pieces: &[Piece], terms: &mut u32) -> f64 {
        if let [piece] = pieces
            && self.distance(piece) > self.settings.few
        {
            if self.level
                && let (sum, true) = self.few(piece, terms)
            {
                return sum;
            }
            return self.nine(piece, terms).sum;
        }
        let mut scale: f64 = pieces.iter().map(|piece| self.nine(piece, terms).sum).sum();
        let mut sum = 0.0;
        for _ in 0..self.settings.most_rounds {
            let tolerance = self.settings.agreement * scale;
            sum = pieces.iter().map(|piece| self.refine(piece, tolerance, self.settings.depth, terms)).sum();
            if sum >= 0.5 * scale {
                break;
            }
            // The first nine points caught a peak and promised too much.
            scale = sum;
        }
        sum
    }

    fn refine(&self, piece: &Piece, tolerance: f64, depth: u32, terms: &mut u32) -> f64 {
        let (few, smooth) = self.few(piece, terms);
        let distance = self.distance(piece);
        if smooth && distance > self.settings.few {
            return few;
        }
        let Nine { sum: nine, area, values } = self.nine(piece, terms);
        if distance > self.settings.few || depth == 0 || *terms > self.settings.most_terms {
            return nine;
        }
        let mut range = Range::NONE;
        values.iter().for_each(|&value| range.add(value));
        // Two rules may agree by accident where an edge passes through the piece: there the range of values bounds what
        // they can both have missed.
        let bounded = distance > self.settings.touched || MISSED * area * (range.1 - range.0) <= tolerance;
        let root = depth == self.settings.depth;
        let compact = piece.ball().1 <= self.settings.compact * self.radius;
        if compact && !root && bounded && (nine - few).abs() <= tolerance {
            return nine;
        }
        let (pieces, count) = piece.split(piece.cut(&values, self.settings.one_sided));
        pieces[..count].iter().map(|piece| self.refine(piece, tolerance, depth - 1, terms)).sum()
    }

    /// The few-point value, and whether the points' spread allows it.
    fn few(&self, piece: &Piece, terms: &mut u32) -> (f64, bool) {
        let (points, count) = piece.few(self.normal);
        *terms += count as u32;
        let mut sum = 0.0;
        let mut range = Range::NONE;
        for &(p, area) in &points[..count] {
            let factor = self.source.factor(p);
            range.add(factor);
            sum += area * factor;
        }
        let settings = self.settings;
        let limit = if count == TRIANGLE_POINTS { settings.spread_triangle } else { settings.spread };
        (sum, self.level && range.within(limit))
    }

    fn nine(&self, piece: &Piece, terms: &mut u32) -> Nine {
        let points = piece.nine(self.normal);
        *terms += points.len() as u32;
        let mut nine = Nine { sum: 0.0, area: 0.0, values: [0.0; 9] };
        for (value, &(p, area)) in nine.values.iter_mut().zip(&points) {
            *value = self.source.factor(p);
            nine.sum += area * *value;
            nine.area += area;
        }
        nine
    }

    /// Distance from the middle of the piece to the nearest steep edge, in radii of the piece (a lower bound of it where
    /// that is already enough for few points).
    fn distance(&self, piece: &Piece) -> f64 {
        let (centre, radius) = piece.ball();
        // The cheap bound first: from the ball about the source.
        let reach = self.settings.few * radius + self.radius;
        let apart = (centre - self.centre).length_squared();
        if apart > reach * reach {
            return f64::INFINITY;
        }
        let mut square = f64::INFINITY;
        for &(start, edge, inverse) in &self.edges[..self.edge_count] {
            let offset = centre - start;
            let along = (offset.dot(edge) * inverse).clamp(0.0, 1.0);
            square = square.min((offset - edge * along).length_squared());
        }
        square.sqrt() / radius
    }
}

/// Nine points on a piece: the integral, m², the piece's area, m², and the form factors at the points.
struct Nine {
    sum: f64,
    area: f64,
    values: [f64; 9],
}

/// Share of a piece's area times the range of its values that both rules are allowed to have missed by accident.
/// Without this term (0) a wall that crosses the edge of a floor is off by 1.4e-3, with it by 9e-5 (test
/// `a_wall_across_the_edge_of_a_floor`); 0.1 gains nothing on hinges and boxes and costs a quarter more points.
const MISSED: f64 = 0.03;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::{Counts, NoProbe};
    use crate::scene::{Corners, Plane};

    /// Knuth's 64-bit linear congruential generator (TAOCP 3.3.4), so that the cases are the same everywhere.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }

        fn direction(&mut self) -> DVec3 {
            loop {
                let p = DVec3::new(self.next(), self.next(), self.next()) * 2.0 - DVec3::ONE;
                if p.length_squared() < 1.0 && p.length_squared() > 0.01 {
                    return p.normalize();
                }
            }
        }
    }

    struct Owned(Corners, Plane);

    impl Owned {
        fn patch(&self) -> Patch<'_> {
            Patch { corners: &self.0, plane: &self.1, area: self.0.area() }
        }
    }

    /// A random triangle (one in three) or quadrilateral, sides 1 to 3 long relative to each other.
    fn random_patch(random: &mut Random, centre: DVec3, normal: DVec3, size: f64) -> Owned {
        let u = normal.cross(random.direction()).normalize();
        let v = normal.cross(u);
        let aspect = 1.0 + 2.0 * random.next();
        let at = |x: f64, y: f64| centre + u * (x * size) + v * (y * size / aspect);
        let mut jitter = || 0.25 * random.next();
        let corners = if jitter() < 0.08 {
            Corners::triangle(at(-0.5 - jitter(), -0.5), at(0.5, -0.5 + jitter()), at(jitter() - 0.2, 0.5))
        } else {
            Corners::quad(
                at(-0.5 - jitter(), -0.5 - jitter()),
                at(0.5 + jitter(), -0.5 - jitter()),
                at(0.5 + jitter(), 0.5 + jitter()),
                at(-0.5 - jitter(), 0.5 + jitter()),
            )
        };
        let normal = corners.area_vector().normalize();
        Owned(corners, Plane { normal, offset: normal.dot(corners[0]) })
    }

    /// `count` pairs with sides about 1 and `ratio`, their middles `distances` apart, facing one another at least in
    /// part; G above 1e-6 of the smaller area.
    fn pairs(seed: u64, count: usize, distances: (f64, f64), ratio: f64) -> Vec<(Owned, Owned)> {
        let mut random = Random(seed);
        let mut out = Vec::new();
        while out.len() < count {
            let direction = random.direction();
            let distance = distances.0 + (distances.1 - distances.0) * random.next();
            let (n, m) = (random.direction(), random.direction());
            let a = random_patch(&mut random, DVec3::ZERO, n * n.dot(direction).signum(), 1.0);
            let b = random_patch(&mut random, direction * distance, -m * m.dot(direction).signum(), ratio);
            if exchange_area(&a.patch(), &b.patch(), FormFactor::Lambert, &mut NoProbe) > 1e-6 * b.patch().area {
                out.push((a, b));
            }
        }
        out
    }

    fn with(settings: &Settings, (a, b): &(Owned, Owned)) -> f64 {
        let (a, b) = (a.patch(), b.patch());
        let (small, large) = if order(&a, &b) == Ordering::Greater { (b, a) } else { (a, b) };
        lambert(&small, &large, settings, &mut NoProbe)
    }

    /// No few-point rule at all, and pieces that agree to 1e-7.
    const REFERENCE: Settings = Settings {
        apart: 1e9,
        few: 1e9,
        spread: 0.0,
        spread_triangle: 0.0,
        level: 0.0,
        agreement: 1e-6,
        depth: 16,
        in_plane: 0.0,
        compact: 0.25,
        most_rounds: 4,
        most_terms: 4_000_000,
        ..SETTINGS
    };

    /// Sorted relative errors of `settings`.
    fn errors(settings: &Settings, pairs: &[(Owned, Owned)]) -> Vec<f64> {
        let mut errors: Vec<f64> =
            pairs.iter().map(|pair| (with(settings, pair) / with(&REFERENCE, pair) - 1.0).abs()).collect();
        errors.sort_by(f64::total_cmp);
        errors
    }

    fn share(errors: &[f64], share: f64) -> f64 {
        errors[((errors.len() - 1) as f64 * share) as usize]
    }

    /// Would catch a reference that is no better than what it judges: half the agreement and more depth move it by
    /// less than 1e-5 (a hundredth of the bound it serves).
    #[test]
    fn reference_has_converged() {
        let finer = Settings { agreement: 1e-7, depth: 18, ..REFERENCE };
        for pair in pairs(3, 40, (0.6, 3.0), 1.0) {
            let change = with(&finer, &pair) / with(&REFERENCE, &pair) - 1.0;
            assert!(change.abs() < 1e-5, "{change:e}");
        }
    }

    const CASES: [((f64, f64), f64); 9] = [
        ((0.6, 1.0), 0.25),
        ((1.0, 2.0), 1.0),
        ((1.0, 2.0), 0.25),
        ((2.0, 3.0), 1.0),
        ((2.0, 3.0), 0.25),
        ((3.0, 4.0), 1.0),
        ((4.0, 6.0), 1.0),
        ((4.0, 6.0), 0.25),
        ((6.0, 20.0), 1.0),
    ];

    /// Would catch a regime that starts too early, a wrong weight, a lost clip: 99 in 100 random pairs that do not touch
    /// meet 1e-3, all meet 3e-3. Measured over these 9,000 pairs: medians 5e-7 to 8e-6, 99th percentiles 4e-5 to 6e-4,
    /// worst 2.3e-3 (a grazing pair).
    #[test]
    fn separate_pairs_meet_their_bound() {
        for (distances, ratio) in CASES {
            let errors = errors(&SETTINGS, &pairs(7, 1000, distances, ratio));
            assert!(share(&errors, 0.99) < 1e-3, "{distances:?} {ratio}: {:e}", share(&errors, 0.99));
            assert!(share(&errors, 1.0) < 3e-3, "{distances:?} {ratio}: {:e}", share(&errors, 1.0));
        }
    }

    /// Two rectangles that share the x axis: the unit square in z = 0, the other one turned out of it by `degrees`,
    /// `width` along x from `shift` on, `length` away from the axis.
    fn hinge(degrees: f64, width: f64, length: f64, shift: f64) -> (Owned, Owned) {
        let out = DVec3::new(0.0, degrees.to_radians().cos(), degrees.to_radians().sin()) * length;
        let (p, q) = (DVec3::X * shift, DVec3::X * (shift + width));
        let owned = |a, b, c, d| {
            let corners = Corners::quad(a, b, c, d);
            let normal = corners.area_vector().normalize();
            Owned(corners, Plane { normal, offset: normal.dot(a) })
        };
        (owned(DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y), owned(p + out, q + out, q, p))
    }

    /// Would catch a boundary layer left to few points: hinged rectangles from 5 to 175 degrees, aligned, shifted, and
    /// of other widths and lengths, and crossing patches. Measured: 1.9e-3 on the hinge of 5 degrees, crossings 1.5e-3.
    #[test]
    fn touching_pairs_meet_their_bound() {
        for degrees in [5.0, 30.0, 60.0, 90.0, 120.0, 150.0, 175.0] {
            for (width, length) in [(1.0, 1.0), (1.0, 0.2), (0.3, 1.0), (1.0, 5.0)] {
                for shift in [0.0, 0.5] {
                    let pair = hinge(degrees, width, length, shift);
                    let error = with(&SETTINGS, &pair) / with(&REFERENCE, &pair) - 1.0;
                    assert!(error.abs() < 3e-3, "{degrees} {width} {length} {shift}: {error:e}");
                }
            }
        }
        let crossing = errors(&SETTINGS, &pairs(7, 500, (0.3, 0.6), 1.0));
        assert!(share(&crossing, 1.0) < 3e-3, "{:e}", share(&crossing, 1.0));
    }

    /// Would catch settings that could be loosened for free: each alone, let go, misses a stated bound.
    #[test]
    fn settings_are_bracketed() {
        let cases: Vec<Vec<(Owned, Owned)>> =
            CASES.iter().map(|&(distances, ratio)| pairs(11, 400, distances, ratio)).collect();
        let worst =
            |settings: &Settings| cases.iter().map(|pairs| share(&errors(settings, pairs), 0.99)).fold(0.0, f64::max);
        for (name, settings) in [
            // Measured: 2.5e-3.
            ("few", Settings { few: 1.5, ..SETTINGS }),
            // 1.2e-3.
            ("apart", Settings { apart: 3.0, ..SETTINGS }),
            // 1.4e-3.
            ("spread", Settings { spread: 1.2, spread_triangle: 0.75, ..SETTINGS }),
            // 4.1e-3; depth 2 does for these pairs, the rest is for narrow gaps and slender crossings.
            ("depth", Settings { depth: 1, ..SETTINGS }),
        ] {
            let error = worst(&settings);
            assert!(error > 1e-3, "{name}: {error:e}");
        }
        // The agreement is for boundary layers: 1.6e-3 to 1.9e-3 on a flat hinge as it is, 6.3e-3 at 5e-4.
        let loose = Settings { agreement: 5e-4, ..SETTINGS };
        assert!(errors(&loose, &[hinge(5.0, 1.0, 0.2, 0.0)])[0] > 3e-3);
        // The level alone does not show at the 99th percentile; it takes the worst pair of a thousand at 2 to 3 sizes
        // from 1.6e-3 to below 1e-3.
        let grazing = pairs(7, 1000, (2.0, 3.0), 1.0);
        assert!(share(&errors(&Settings { level: 0.0, ..SETTINGS }, &grazing), 1.0) > 1.2e-3);
        assert!(share(&errors(&SETTINGS, &grazing), 1.0) < 1e-3);
    }

    /// A quadrilateral with its plane.
    fn quad(corners: [DVec3; 4]) -> Owned {
        let [a, b, c, d] = corners;
        let corners = Corners::quad(a, b, c, d);
        let normal = corners.area_vector().normalize();
        Owned(corners, Plane { normal, offset: normal.dot(a) })
    }

    /// A strip of 2 by `2 * width` along x, and a larger square of side `size` at `at` above it, turned about y by `tilt`.
    fn needle(width: f64, size: f64, at: DVec3, tilt: f64) -> (Owned, Owned) {
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        let strip = quad([p(-1.0, -width), p(1.0, -width), p(1.0, width), p(-1.0, width)]);
        let along = DVec3::new(tilt.cos(), 0.0, tilt.sin()) * size;
        let across = DVec3::Y * size;
        (strip, quad([at, at + across, at + along + across, at + along]))
    }

    /// Random needles with squares of `low` to `high`.
    fn needles(seed: u64, count: usize, low: f64, high: f64) -> Vec<(Owned, Owned)> {
        let mut random = Random(seed);
        let mut next = || {
            let size = low + (high - low) * random.next();
            let width = size * size / 4.0 * 0.9 * random.next();
            let (x, y) = (2.0 * random.next() - 1.0, size * (2.0 * random.next() - 1.5));
            let height = (3.0 * size * random.next() * random.next()).max(1e-3);
            needle(width, size, DVec3::new(x, y, height), 1.5 * random.next())
        };
        (0..count).map(|_| next()).collect()
    }

    /// Pairs with their exchange areas by the reference.
    struct Judged(Vec<(Owned, Owned)>, Vec<f64>);

    impl Judged {
        fn new(pairs: Vec<(Owned, Owned)>) -> Judged {
            let exact = pairs.iter().map(|pair| with(&REFERENCE, pair)).collect();
            Judged(pairs, exact)
        }

        /// Largest relative error of `settings`.
        fn worst(&self, settings: &Settings) -> f64 {
            let Judged(pairs, exact) = self;
            pairs.iter().zip(exact).map(|(pair, exact)| (with(settings, pair) / exact - 1.0).abs()).fold(0.0, f64::max)
        }
    }

    /// Points for all pairs together.
    fn points(settings: &Settings, pairs: &[(Owned, Owned)]) -> f64 {
        let mut counts = Counts::default();
        for (a, b) in pairs {
            let (a, b) = (a.patch(), b.patch());
            let (small, large) = if order(&a, &b) == Ordering::Greater { (b, a) } else { (a, b) };
            lambert(&small, &large, settings, &mut counts);
        }
        counts.form_factor_terms as f64
    }

    /// Would catch limits that could be loosened, or tightened for free: what their docs say of either side.
    #[test]
    fn limits_are_bracketed() {
        let crossing = Judged::new(pairs(7, 300, (0.3, 0.6), 1.0));
        // Measured 3.3e-4; 2.5e-3, 6.2e-4 and 2.0e-2.
        assert!(crossing.worst(&SETTINGS) < 4e-4);
        assert!(crossing.worst(&Settings { touched: 0.7, ..SETTINGS }) > 2e-3);
        assert!(crossing.worst(&Settings { one_sided: 2.0, ..SETTINGS }) > 5e-4);
        assert!(crossing.worst(&Settings { most_terms: 500, ..SETTINGS }) > 1e-2);
        // Measured 376 points a pair; 450 and 505.
        let cost = |settings: Settings| points(&settings, &crossing.0) / points(&SETTINGS, &crossing.0);
        assert!(cost(Settings { in_plane: 0.0, ..SETTINGS }) > 1.15);
        assert!(cost(Settings { touched: 1.4, ..SETTINGS }) > 1.3);
        let hinges = [5.0, 90.0, 175.0].into_iter().flat_map(|degrees| {
            [(1.0, 1.0), (1.0, 0.2), (1.0, 20.0), (20.0, 1.0)].map(|(w, l)| hinge(degrees, w, l, 0.0))
        });
        let hinges = Judged::new(hinges.collect());
        // Measured 1.84e-3 and 2.16e-3.
        assert!(hinges.worst(&SETTINGS) < 1.9e-3);
        assert!(hinges.worst(&Settings { one_sided: 6.0, ..SETTINGS }) > 2.1e-3);
        let needles = Judged::new(needles(9, 1000, 0.01, 0.05));
        // Measured 3.4e-4; 1.4e-2, 2.1e-3 and 1.8e-3; 3.4e-4 again.
        assert!(needles.worst(&SETTINGS) < 4e-4);
        assert!(needles.worst(&Settings { in_plane: 1e-3, ..SETTINGS }) > 1e-2);
        assert!(needles.worst(&Settings { compact: 1e9, ..SETTINGS }) > 1.5e-3);
        assert!(needles.worst(&Settings { most_rounds: 1, ..SETTINGS }) > 1.5e-3);
        let more = Settings { most_rounds: 3, most_terms: 1_000_000, ..SETTINGS };
        assert_eq!(needles.worst(&more), needles.worst(&SETTINGS));
    }

    /// Pairs outside of the bounds, so that whoever mends them learns which text to change: one crossing pair in 3,000, and
    /// a strip so close under a short square that all its edges count as lying in the strip's plane.
    #[test]
    fn what_is_known_to_be_worse() {
        // The others of 3,000 are off by less than 2e-3.
        let crossing = Judged::new(pairs(7, 1404, (0.3, 0.6), 1.0).split_off(1403));
        let error = crossing.worst(&SETTINGS);
        assert!((6e-3..9e-3).contains(&error), "{error:e}");
        let over = |height| needle(5e-4, 0.06, DVec3::new(0.21, -0.03, height), 0.0);
        let low = |height| Judged::new(vec![over(height)]).worst(&SETTINGS);
        // Measured 5.2e-5 and 1.0; the strip's radius is 1.
        assert!(low(1.2e-4) < 1e-4);
        assert!(low(9e-5) > 0.9);
    }

    /// D6. Would catch an order that depends on the argument's place: random pairs and pairs of equal areas, both methods.
    #[test]
    fn swapping_gives_the_same_bits() {
        let mut all = pairs(5, 300, (0.3, 6.0), 1.0);
        all.extend([30.0, 90.0, 150.0].map(|degrees| hinge(degrees, 1.0, 1.0, 0.0)));
        for (a, b) in &all {
            for method in [FormFactor::Lambert, FormFactor::Disks] {
                let there = exchange_area(&a.patch(), &b.patch(), method, &mut NoProbe);
                let back = exchange_area(&b.patch(), &a.patch(), method, &mut NoProbe);
                assert_eq!(there.to_bits(), back.to_bits());
            }
        }
    }

    /// Would catch a count that is forgotten or doubled: disks 16, few points on both sides 16, near pairs more.
    #[test]
    fn terms_are_told_to_the_probe() {
        let count = |pair: &(Owned, Owned), method| {
            let mut counts = Counts::default();
            exchange_area(&pair.0.patch(), &pair.1.patch(), method, &mut counts);
            assert_eq!(counts.form_factors, 1);
            counts.form_factor_terms
        };
        let (floor, _) = hinge(90.0, 1.0, 1.0, 0.0);
        let lifted: Vec<DVec3> = floor.0.reversed().iter().map(|&p| p + DVec3::Z * 20.0).collect();
        let lid = Corners::from_slice(&lifted).unwrap();
        let far = (floor, Owned(lid, Plane { normal: -DVec3::Z, offset: -20.0 }));
        assert_eq!(count(&far, FormFactor::Disks), 16);
        assert_eq!(count(&far, FormFactor::Lambert), 16);
        // Nine for the scale, thirteen on the root, and at least thirteen on each of its quarters.
        assert!(count(&hinge(90.0, 1.0, 1.0, 0.0), FormFactor::Lambert) >= 74);
    }
}
