//! How an error travels: what irradiance lacks on some elements goes in, what it then lacks everywhere comes out, as what is
//! missing in one place is missing wherever that place throws light.

use crate::evaluate::Evaluator;
use crate::geometry::NONE;
use crate::light::{ClusterSums, Directional, Light, Root, add_times, bands, rms};
use crate::link::{CLUSTER, Link};
use crate::order::View;
use crate::rounds::Transport;
use glam::Vec3;
use isolux_simd::sphere::{clamped_cosine, evaluate};
use rayon::prelude::*;

/// Gathers after which the rest is left out: of reflectances of 0.8 a hundredth is left then.
const MOST_PASSES: usize = 20;

/// Elements whose squares are summed by one task.
const CHUNK: usize = 4096;

/// Change of a gather, relative to all, at which the rest is left out.
const ENOUGH: f64 = 0.02;

/// Sends what is lacking around over the links until little changes, of each three channels: the error of every leaf, that of
/// `lacking` (by element, parents pass theirs on) included.
pub(crate) fn spread<const C: usize>(lacking: &[[f32; C]], light: &Light, transport: &Transport) -> Vec<[f32; C]> {
    let evaluator = transport.evaluator();
    let Evaluator { elements, order, .. } = evaluator;
    let rows = rows(transport);
    let mut thrown = vec![[0.0; C]; elements.len()];
    let mut error = lacking.to_vec();
    let mut before = vec![0.0; C / 3];
    for pass in 0..=MOST_PASSES {
        if pass > 0 {
            error.par_iter_mut().zip(lacking).with_min_len(1024).for_each(|(error, &lacking)| *error = lacking);
            receive(&mut error, &rows, &thrown, &evaluator);
        }
        push(&mut error, &evaluator);
        let squares: Vec<Vec<f64>> = (thrown.par_chunks_mut(CHUNK))
            .zip(error.par_chunks(CHUNK))
            .zip(elements.par_chunks(CHUNK))
            .map(|((thrown, error), elements)| {
                let mut squares = vec![0.0; C / 3];
                for ((thrown, &error), element) in thrown.iter_mut().zip(error).zip(elements) {
                    if element.first_child == NONE {
                        let surface = &evaluator.geometry.surfaces[element.polygon as usize];
                        let open = if element.open == 0 { 0.0 } else { 1.0 };
                        *thrown = std::array::from_fn(|c| open * surface.reflectance[c % 3] * error[c]);
                        for (part, square) in squares.iter_mut().enumerate() {
                            let error = rms(bands(&error, part));
                            *square += f64::from(open * element.area * error * error);
                        }
                    }
                }
                squares
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
        let size = |part: usize| squares.iter().map(|squares| squares[part]).sum::<f64>().sqrt();
        let sizes: Vec<f64> = (0..C / 3).map(size).collect();
        let is_enough = |(size, before): (&f64, &f64)| (size - before).abs() <= ENOUGH * size;
        if pass == MOST_PASSES || pass > 1 && sizes.iter().zip(&before).all(is_enough) {
            break;
        }
        before = sizes;
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
fn intensities<const C: usize>(thrown: &[[f32; C]], evaluator: &Evaluator<'_>) -> Vec<Directional<C>> {
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
