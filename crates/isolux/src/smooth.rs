//! Smooth surfaces from a solve's elements: gathered anew on all cores (D19), averaged, or blended from fields.

use crate::pace::Pace;
use isolux_core::kernels::Counts;
use isolux_core::links::{Evaluator, Hierarchy};
use isolux_core::scene::Scene;
use isolux_core::solution::{
    Flow, Gathered, Light, Observer, Phase, Progress, Shadows, Site, SmoothPlan, SmoothSurfaces, Unobserved, Watch,
    irradiance_at_site,
};
use isolux_core::tree::{Bsp, ElementId, Elements};
use isolux_core::units::Rgb;
use rayon::prelude::*;

/// Rounds end when leaves change by this share of the asked error (RMS, of the mean).
const CHANGE_PER_ERROR: f64 = 0.05;

/// Most rounds: with reflectance 0.9 everywhere what is left after ten is a third of the first change.
const MAX_ROUNDS: u32 = 10;

/// Gathers in rounds: first at vertices and centres of the leaves, which gives every leaf the mean irradiance that its
/// surroundings really throw on it; then, from these, at the vertices alone, now with shadows of their own where a
/// source throws more than `shadows_above` (W/m² or lm/m²). Returns the
/// irradiance by vertex and the surfaces made of it; `None` when the observer stopped it, which is asked every 10 ms or
/// so (leaves then keep what the last whole round gave them).
#[allow(clippy::too_many_arguments, reason = "one call site, each a part of the solve")]
pub(crate) fn gather(
    scene: &Scene,
    evaluator: &Evaluator<'_>,
    hierarchy: &mut Hierarchy,
    shadows_above: f64,
    error: f64,
    threads: usize,
    counts: &mut Counts,
    observer: &mut dyn Observer,
) -> Option<(Vec<Rgb>, SmoothSurfaces)> {
    let elements = hierarchy.elements.clone();
    let links = hierarchy.links.len();
    let stage = |done| Progress { done, elements: elements.len(), links, ..Progress::of(Phase::Interpolation) };
    let plan = SmoothPlan::new(scene, evaluator.bsp, &elements, &mut Watch::new(observer, stage(0.0)))?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok()?;
    let mut pace = Pace::starting(8 * pool.current_num_threads());
    let mut pass = |sites: &[Site], shadows, hierarchy: &Hierarchy, from: f64, to: f64| {
        let mut values = Vec::with_capacity(sites.len());
        let mut rest = sites;
        while !rest.is_empty() {
            let done = from + (to - from) * values.len() as f64 / sites.len() as f64;
            if observer.observe(&stage(done)) == Flow::Stop {
                return None;
            }
            let (chunk, after) = rest.split_at(pace.size().min(rest.len()));
            rest = after;
            pace.begin();
            let part: Vec<(Gathered, Counts)> = pool.install(|| {
                chunk
                    .par_iter()
                    .map(|site| {
                        let mut own = Counts::default();
                        (irradiance_at_site(site, evaluator, hierarchy, shadows, &mut own), own)
                    })
                    .collect()
            });
            for (value, own) in part {
                values.push(value);
                counts.add(&own);
            }
            pace.end();
        }
        Some(values)
    };
    let covered = plan.covered(evaluator, &hierarchy.light);
    let mut from = 0.0;
    for _ in 0..MAX_ROUNDS {
        // Each round is expected to take half of what is left before the last pass.
        let to = 0.5 * (from + 0.6);
        let values = pass(plan.sites(), Shadows::OfLinks, hierarchy, from, to)?;
        from = to;
        let means = plan.leaf_means(&values, &covered);
        let change = relative_change(hierarchy, &means);
        hierarchy.relight_leaves(scene, &means);
        if change <= error * CHANGE_PER_ERROR {
            break;
        }
    }
    let last = pass(&plan.sites()[..plan.vertices()], Shadows::OfSites(shadows_above), hierarchy, from, 1.0)?;
    let mut values: Vec<Rgb> = last.iter().map(|gathered| gathered.irradiance).collect();
    let openness: Vec<f64> = last.iter().map(|gathered| gathered.openness).collect();
    plan.uncover(evaluator.bsp, &covered, &mut values, &openness);
    let surfaces = plan.assemble(&values, &mut Watch::new(observer, stage(1.0)))?;
    Some((values, surfaces))
}

/// Surfaces from the means of leaves; `None` when the observer stopped it.
pub(crate) fn average(
    scene: &Scene,
    bsp: &Bsp,
    hierarchy: &Hierarchy,
    observer: &mut dyn Observer,
) -> Option<(Vec<Rgb>, SmoothSurfaces)> {
    let Hierarchy { elements, light, .. } = hierarchy;
    let mut watch = Watch::new(observer, Progress { elements: elements.len(), ..Progress::of(Phase::Interpolation) });
    let plan = SmoothPlan::new(scene, bsp, elements, &mut watch)?;
    let values = plan.averaged(light, &mut watch)?;
    let surfaces = plan.assemble(&values, &mut watch)?;
    Some((values, surfaces))
}

/// A vertex that has less than this share of what its leaves have on average may be covered: it is looked at whether
/// something stands close above it. Beside a thing that stands on a floor its corner's shadow goes down to a tenth.
const DARK: f64 = 0.02;

/// How far from a vertex towards the middle of a leaf that leaf's field is read, in lengths of that way: far enough to be
/// found in it, and a change of 1e-6 of what the field changes over the leaf.
const NUDGE: f64 = 1e-6;

/// Surfaces from fields of leaves: a vertex has the mean of what the fields around have there.
pub(crate) fn blend(
    scene: &Scene,
    bsp: &Bsp,
    elements: &Elements,
    light: &Light,
    fields: &[[[f32; 3]; 5]],
) -> Option<SmoothSurfaces> {
    let unasked = &mut Unobserved;
    let watch = &mut Watch::new(unasked, Progress::of(Phase::Interpolation));
    let plan = SmoothPlan::new(scene, bsp, elements, watch)?;
    let mut sums = vec![(Rgb::ZERO, 0.0); plan.vertices()];
    let mut means = vec![0.0; plan.vertices()];
    for (site, leaf, position) in plan.around() {
        // What lies under something else is not seen.
        if light.open_share(leaf) == 0.0 {
            continue;
        }
        let element = elements.get(leaf);
        let normal = scene.polygons[element.polygon as usize].plane.normal;
        let centre = element.corners.mean();
        let inside = position + (centre - position) * NUDGE;
        let at = |point| isolux_wavefront::irradiance_at(elements, fields, element.polygon, normal, point);
        sums[site].0 += at(inside);
        sums[site].1 += 1.0;
        means[site] += at(centre).mean();
    }
    let mut values: Vec<Rgb> = sums.iter().map(|&(sum, count)| sum / f64::max(count, 1.0)).collect();
    // Where everything around is as dark nothing is made better by looking.
    let openness: Vec<f64> =
        sums.iter().zip(means).map(|(&(sum, _), mean)| if sum.mean() < DARK * mean { 0.0 } else { 1.0 }).collect();
    plan.uncover(bsp, &vec![false; plan.vertices()], &mut values, &openness);
    plan.assemble(&values, watch)
}

/// Root of the area-weighted mean square by which leaves would change, relative to their mean irradiance.
fn relative_change(hierarchy: &Hierarchy, means: &[(ElementId, Rgb)]) -> f64 {
    let (mut square, mut sum, mut area) = (0.0, 0.0, 0.0);
    for &(leaf, irradiance) in means {
        let weight = hierarchy.elements.get(leaf).area;
        let weight = weight * hierarchy.light.open_share(leaf);
        let open = hierarchy.light.irradiance(leaf).mean() / hierarchy.light.open_share(leaf).max(f64::MIN_POSITIVE);
        let change = irradiance.mean() - open;
        square += weight * change * change;
        sum += weight * irradiance.mean();
        area += weight;
    }
    if sum > 0.0 { (square / area).sqrt() / (sum / area) } else { 0.0 }
}
