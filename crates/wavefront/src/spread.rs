//! How an error travels: what irradiance lacks on some elements goes in, what it then lacks everywhere comes out, as what is
//! missing in one place is missing wherever that place throws light.

use crate::evaluate::Evaluator;
use crate::geometry::NONE;
use crate::light::{ClusterSums, Directional, Light, Root, add_times};
use crate::link::{CLUSTER, Link};
use crate::order::View;
use crate::rounds::Transport;
use glam::Vec3;
use isolux_simd::sphere::{clamped_cosine, evaluate};
use rayon::prelude::*;

/// Gathers after which the rest is left out: of reflectances of 0.95 a hundredth is left then.
const MOST_PASSES: usize = 90;

/// Elements whose squares are summed by one task.
const CHUNK: usize = 4096;

/// What all further gathers would change of the mean error, relative to it, at which they are left out.
const ENOUGH: f64 = 0.02;

/// Mean error, relative to its root mean square, below which a share of it is nothing.
const NOTICED: f64 = 0.1;

/// Share of a change that the next gather is taken to bring at most.
const MOST_KEPT: f64 = 0.97;

/// What leaves' errors add up to.
#[derive(Clone, Copy)]
struct Sums<const C: usize> {
    /// Area times error, by channel, m² W/m² or m² lm/m².
    errors: [f64; C],
    /// Area times squared error.
    squares: [f64; C],
    /// Area, m².
    area: f64,
}

impl<const C: usize> Sums<C> {
    const NONE: Sums<C> = Sums { errors: [0.0; C], squares: [0.0; C], area: 0.0 };

    fn count(&mut self, area: f32, error: &[f32; C]) {
        let area = f64::from(area);
        self.area += area;
        for (c, &error) in error.iter().enumerate() {
            self.errors[c] += area * f64::from(error);
            self.squares[c] += area * f64::from(error) * f64::from(error);
        }
    }

    fn and(self, other: &Sums<C>) -> Sums<C> {
        Sums {
            errors: std::array::from_fn(|c| self.errors[c] + other.errors[c]),
            squares: std::array::from_fn(|c| self.squares[c] + other.squares[c]),
            area: self.area + other.area,
        }
    }

    /// RMS of the error over area and the three channels of a part, times the area.
    fn rough(&self, part: usize) -> f64 {
        (self.squares[3 * part..3 * part + 3].iter().sum::<f64>() / 3.0 * self.area).sqrt()
    }
}

/// RMS over the three channels of a part.
fn size<const C: usize>(sums: &[f64; C], part: usize) -> f64 {
    (sums[3 * part..3 * part + 3].iter().map(|sum| sum * sum).sum::<f64>() / 3.0).sqrt()
}

/// Sends what is lacking around over the links until little changes, of each three channels: the error of every leaf, that of
/// `lacking` (by element, parents pass theirs on) included.
pub(crate) fn spread<const C: usize>(lacking: &[[f32; C]], light: &Light, transport: &Transport) -> Vec<[f32; C]> {
    let evaluator = transport.evaluator();
    let Evaluator { elements, order, .. } = evaluator;
    let rows = rows(transport);
    let mut thrown = vec![[0.0; C]; elements.len()];
    let mut error = lacking.to_vec();
    // Errors summed over area after the last gather, by channel, and by what it changed them.
    let mut before = ([0.0; C], vec![f64::INFINITY; C / 3]);
    for pass in 0..=MOST_PASSES {
        if pass > 0 {
            error.par_iter_mut().zip(lacking).with_min_len(1024).for_each(|(error, &lacking)| *error = lacking);
            receive(&mut error, &rows, &thrown, &evaluator);
        }
        push(&mut error, &evaluator);
        let parts: Vec<Sums<C>> = (thrown.par_chunks_mut(CHUNK))
            .zip(error.par_chunks(CHUNK))
            .zip(elements.par_chunks(CHUNK))
            .map(|((thrown, error), elements)| {
                let mut sums = Sums::NONE;
                for ((thrown, &error), element) in thrown.iter_mut().zip(error).zip(elements) {
                    if element.first_child == NONE {
                        let surface = &evaluator.geometry.surfaces[element.polygon as usize];
                        let open = if element.open == 0 { 0.0 } else { 1.0 };
                        *thrown = std::array::from_fn(|c| open * surface.reflectance[c % 3] * error[c]);
                        sums.count(open * element.area, &error);
                    }
                }
                sums
            })
            .collect();
        let pull = |view: &mut View<&mut [[f32; C]]>, index: usize| {
            let first = elements[index].first_child as usize;
            let open: [f32; 4] = std::array::from_fn(|k| elements[first + k].area * light.open[first + k]);
            let whole = open.iter().sum::<f32>().max(f32::MIN_POSITIVE);
            let (values, place) = view.of(first);
            let mean = std::array::from_fn(|c| (0..4).map(|k| open[k] / whole * values[place + k][c]).sum());
            let (values, own) = view.of(index);
            values[own] = mean;
        };
        order.up(elements, &mut thrown[..], pull);
        let (mut view, above) = order.above(&mut thrown[..]);
        above.rev().for_each(|index| pull(&mut view, index));
        let sums = parts.iter().fold(Sums::NONE, Sums::and);
        let change: [f64; C] = std::array::from_fn(|c| sums.errors[c] - before.0[c]);
        let changes: Vec<f64> = (0..C / 3).map(|part| size(&change, part)).collect();
        // All in the same sense is what goes around longest. Each gather brings about the same share of the one before.
        let is_enough = |part: usize| {
            let (change, last) = (changes[part], before.1[part]);
            let ratio = (change / last).min(MOST_KEPT);
            let counts = size(&sums.errors, part).max(NOTICED * sums.rough(part));
            change * ratio / (1.0 - ratio) <= ENOUGH * counts
        };
        if pass == MOST_PASSES || pass > 1 && (0..C / 3).all(is_enough) {
            break;
        }
        before = (sums.errors, changes);
    }
    error
}

/// What arrives at every element, on average over it and over all links of its own and of those above, if elements throw
/// `thrown`.
pub(crate) fn arriving<const C: usize>(thrown: &[[f32; C]], transport: &Transport) -> Vec<[f32; C]> {
    let evaluator = transport.evaluator();
    let mut arriving = vec![[0.0; C]; thrown.len()];
    receive(&mut arriving, &rows(transport), thrown, &evaluator);
    push(&mut arriving, &evaluator);
    arriving
}

/// Links by receiver.
fn rows(transport: &Transport) -> Vec<&[Link]> {
    transport.links.chunk_by(|a, b| a.receiver == b.receiver).collect()
}

/// Adds what comes over the links of elements, and to polygons over those of clusters.
fn receive<const C: usize>(sums: &mut [[f32; C]], rows: &[&[Link]], thrown: &[[f32; C]], evaluator: &Evaluator<'_>) {
    let intensity = intensities(thrown, evaluator);
    let gathered: Vec<(u32, Directional<C>)> = rows
        .par_iter()
        .with_min_len(64)
        .map(|row| (row[0].receiver, gather(row, thrown, &intensity, evaluator)))
        .collect();
    let mut arriving: Vec<Directional<C>> = vec![[[0.0; C]; 9]; intensity.len()];
    for (receiver, values) in gathered {
        if receiver & CLUSTER != 0 {
            arriving[(receiver & !CLUSTER) as usize] = values;
        } else {
            add_times(&mut sums[receiver as usize], 1.0, &values[0]);
        }
    }
    send_down(&mut arriving, sums, evaluator);
}

/// What arrives at polygons over links of the groups that they are in, mean over bands, if elements throw `thrown`; `links`: sorted by
/// receiver. Empty where groups have no links.
pub(crate) fn by_groups(links: &[Link], thrown: &[[f32; 3]], evaluator: &Evaluator<'_>) -> Vec<f32> {
    let to_groups = &links[..links.partition_point(|link| link.receiver & CLUSTER != 0)];
    if to_groups.is_empty() {
        return Vec::new();
    }
    let rows: Vec<&[Link]> = to_groups.chunk_by(|a, b| a.receiver == b.receiver).collect();
    let mut sums = vec![[0.0; 3]; evaluator.geometry.surfaces.len()];
    receive(&mut sums, &rows, thrown, evaluator);
    sums.iter().map(|sum| sum.iter().sum::<f32>().max(0.0) / 3.0).collect()
}

/// Adds to all parts of elements what these have.
fn push<const C: usize>(sums: &mut [[f32; C]], evaluator: &Evaluator<'_>) {
    let Evaluator { elements, order, .. } = *evaluator;
    let hand_down = |view: &mut View<&mut [[f32; C]]>, index: usize| {
        let (values, own) = view.of(index);
        let above = values[own];
        let (values, first) = view.of(elements[index].first_child as usize);
        for child in &mut values[first..first + 4] {
            add_times(child, 1.0, &above);
        }
    };
    let (mut view, above) = order.above(&mut *sums);
    above.for_each(|index| hand_down(&mut view, index));
    order.down(elements, sums, hand_down);
}

/// What clusters throw, by direction.
pub(crate) fn intensities<const C: usize>(thrown: &[[f32; C]], evaluator: &Evaluator<'_>) -> Vec<Directional<C>> {
    let roots: Vec<Root<C>> = (0..evaluator.geometry.surfaces.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|polygon| {
            let cosine = clamped_cosine(evaluator.geometry.surfaces[polygon].normal.to_array());
            (evaluator.geometry.counted_area(&evaluator.elements[polygon]), thrown[polygon], [0.0; 3], cosine)
        })
        .collect();
    let clusters = evaluator.clusters.nodes.len();
    let mut intensity: Vec<Directional<C>> = vec![[[0.0; C]; 9]; clusters];
    let (mut unused, mut ignored) = (vec![0.0; clusters], vec![0.0; clusters]);
    ClusterSums { intensity: &mut intensity, radiosity: &mut unused, irradiance: &mut ignored }.pull(
        0,
        evaluator.clusters,
        &roots,
    );
    intensity
}

/// What arrives over the links of one receiver, mean over it: an element's comes first.
fn gather<const C: usize>(
    row: &[Link],
    thrown: &[[f32; C]],
    intensity: &[Directional<C>],
    evaluator: &Evaluator<'_>,
) -> Directional<C> {
    let mut sum = [[0.0; C]; 9];
    for link in row {
        let (to, from) = (evaluator.ball(link.receiver).0, evaluator.ball(link.source).0);
        let value: [f32; C] = if link.source & CLUSTER == 0 {
            thrown[link.source as usize]
        } else {
            let harmonics = evaluate((to - from).normalize_or(Vec3::X).to_array());
            let intensity = &intensity[(link.source & !CLUSTER) as usize];
            std::array::from_fn(|c| (0..9).map(|k| harmonics[k] * intensity[k][c]).sum())
        };
        if link.receiver & CLUSTER == 0 {
            let receiver = &evaluator.elements[link.receiver as usize];
            let mean = crate::field::mean_over(&link.factors, receiver.count, receiver.lean()).max(0.0);
            add_times(&mut sum[0], mean, &value);
        } else {
            let harmonics = evaluate((from - to).normalize_or(Vec3::X).to_array());
            (0..9).for_each(|k| add_times(&mut sum[k], link.factors[0] * harmonics[k], &value));
        }
    }
    sum
}

/// From clusters to the clusters and polygons below them.
fn send_down<const C: usize>(arriving: &mut [Directional<C>], error: &mut [[f32; C]], evaluator: &Evaluator<'_>) {
    let Evaluator { geometry, clusters, .. } = *evaluator;
    clusters.pass_down(arriving);
    let polygons = error.par_iter_mut().zip(&clusters.home).zip(&geometry.surfaces).with_min_len(1024);
    polygons.filter(|((_, home), _)| **home != NONE).for_each(|((error, &home), surface)| {
        let cosine = clamped_cosine(surface.normal.to_array());
        for c in 0..C {
            error[c] += (0..9).map(|k| cosine[k] * arriving[home as usize][k][c]).sum::<f32>();
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Control;
    use crate::samples::painted;
    use crate::solve::{Prepared, Request};

    /// Catches gathers that end early where much is reflected: what is missing all over a closed box is missing 1 / (1 - ρ) fold
    /// in the end, and claims of bright rooms were a third too low.
    #[test]
    fn what_a_bright_box_lacks_grows_by_what_it_reflects() {
        let [p, q, r, s] = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let level = |y: f64, at: [[f64; 2]; 4]| at.map(|[x, z]| [x, y, z]);
        let upright = |[x, z]: [f64; 2], [u, w]: [f64; 2]| [[x, 0.0, z], [u, 0.0, w], [u, 4.0, w], [x, 4.0, z]];
        let faces = [
            level(0.0, [p, s, r, q]),
            level(4.0, [p, q, r, s]),
            upright(p, q),
            upright(q, r),
            upright(r, s),
            upright(s, p),
        ];
        let faces: Vec<&[[f64; 3]]> = faces.iter().map(|face| &face[..]).collect();
        for reflectance in [0.5, 0.8, 0.9, 0.95] {
            let solved =
                Prepared::new(painted(&faces, reflectance, 1.0)).solve(&Request::new(0.02), &Control::default());
            let mut lacking = vec![[0.0; 3]; solved.transport.elements.len()];
            lacking[..faces.len()].fill([1.0; 3]);
            let grown = 1.0 / (1.0 - reflectance as f32);
            let errors = spread(&lacking, &solved.light, &solved.transport);
            let leaves =
                solved.transport.elements.iter().zip(errors).filter(|(element, _)| element.first_child == NONE);
            let (sum, area) = leaves
                .fold((0.0, 0.0), |(sum, area), (element, error)| (sum + element.area * error[0], area + element.area));
            assert!((sum / area / grown - 1.0).abs() < 0.05, "{reflectance}: {} of {grown}", sum / area);
        }
    }
}
