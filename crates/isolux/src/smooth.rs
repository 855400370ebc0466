//! Smooth surfaces from a solve's elements: gathered anew on all cores, over links (D19) or by rays; averaged; or blended
//! from fields.

use crate::RenderError;
use crate::pace::Pace;
use crate::relight::Field;
use isolux_core::DVec3;
use isolux_core::kernels::Counts;
use isolux_core::links::{Evaluator, Hierarchy};
use isolux_core::sampling::{Stream, mix};
use isolux_core::scene::Scene;
use isolux_core::solution::{
    Flow, Gathered, Light, Observer, Phase, Progress, Shadows, Site, SmoothPlan, SmoothSurfaces, Unobserved, Watch,
    irradiance_at_site,
};
use isolux_core::tree::{Bsp, ElementId, Elements};
use isolux_core::units::Rgb;
use isolux_wavefront::{FinalGather, Tracer};
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
    let plan = SmoothPlan::new(
        scene,
        &(scene, evaluator.bsp),
        &elements,
        &hierarchy.light,
        &mut Watch::new(observer, stage(0.0)),
    )?;
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
    plan.uncover(&(scene, evaluator.bsp), &covered, &mut values, &openness);
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
    let plan = SmoothPlan::new(scene, &(scene, bsp), elements, light, &mut watch)?;
    let values = plan.averaged(light, &mut watch)?;
    let surfaces = plan.assemble(&values, &mut watch)?;
    Some((values, surfaces))
}

/// A vertex that has less than this share of what its leaves have on average may be covered: it is looked at whether
/// something stands close above it. Beside a thing that stands on a floor its corner's shadow goes down to a tenth.
const DARK: f64 = 0.02;

/// Surfaces from fields of leaves: a vertex has the mean of what the fields around have there.
pub(crate) fn blend(
    scene: &Scene,
    tracer: &Tracer,
    elements: &Elements,
    light: &Light,
    fields: &[Field],
) -> Option<SmoothSurfaces> {
    blend_columns(scene, tracer, elements, light, fields, &[]).map(|(surfaces, _)| surfaces)
}

/// The same, and irradiance by column and vertex of the mesh, below 0 where a part of the light is: a sum of them is to be cut
/// off at nothing. `columns`: fields of leaves in ascending order, of parts of the light. What is decided by looking at the
/// light is decided by all of it.
pub(crate) fn blend_columns(
    scene: &Scene,
    tracer: &Tracer,
    elements: &Elements,
    light: &Light,
    fields: &[Field],
    columns: &[Vec<Field>],
) -> Option<(SmoothSurfaces, Vec<Vec<Rgb>>)> {
    let unasked = &mut Unobserved;
    let watch = &mut Watch::new(unasked, Progress::of(Phase::Interpolation));
    let plan = SmoothPlan::new(scene, tracer, elements, light, watch)?;
    let mut around = vec![Around::default(); plan.vertices()];
    // What lies under something else is not seen.
    let is_open = |leaf| light.open_share(leaf) > 0.0;
    for (site, leaf) in plan.around().filter(|&(_, leaf)| is_open(leaf)) {
        around[site].add(leaf, elements, light);
    }
    let covered = (0..plan.vertices()).filter(|&site| around[site].count == 0.0);
    let tops: Vec<(usize, ElementId, DVec3)> = covered
        .filter_map(|site| {
            let (side, position) = on_top(&plan, tracer, elements, site)?;
            Some((site, elements.locate(ElementId(side), position), position))
        })
        .collect();
    let normal = |leaf| scene.polygons[elements.get(leaf).polygon as usize].plane.normal;
    // Light is cut off at nothing, band by band. Parts of it are where all of it is, and nowhere else: so they add up.
    let in_leaf = |leaf: ElementId, position: DVec3, part: Option<&Field>| {
        let (corners, normal) = (&elements.get(leaf).corners, normal(leaf));
        let all = isolux_wavefront::irradiance_in(corners, normal, position, &fields[leaf.index()]);
        let Some(part) = part else { return all };
        let part = isolux_wavefront::signed_irradiance_in(corners, normal, position, part);
        Rgb([0, 1, 2].map(|band| if all[band] > 0.0 { part[band] } else { 0.0 }))
    };
    let mut rows = vec![0; elements.len()];
    elements.leaves().enumerate().for_each(|(row, leaf)| rows[leaf.index()] = row);
    let at_sites = |column: Option<&Vec<Field>>| {
        let part = |leaf: ElementId| column.map(|column| &column[rows[leaf.index()]]);
        let mut values = vec![Rgb::ZERO; plan.vertices()];
        for (site, leaf) in plan.around().filter(|&(_, leaf)| is_open(leaf)) {
            values[site] += in_leaf(leaf, plan.positions()[site], part(leaf));
        }
        for (value, around) in values.iter_mut().zip(&around).filter(|(_, around)| around.count > 0.0) {
            *value = *value / around.count;
        }
        for &(site, leaf, position) in &tops {
            values[site] = in_leaf(leaf, position, part(leaf));
        }
        values
    };
    let mut values = at_sites(None);
    let (covered, openness) = shaded(&plan, tracer, elements, &values, &around);
    plan.uncover(tracer, &covered, &mut values, &openness);
    let at_column = |column: &Vec<Field>| {
        let mut values = at_sites(Some(column));
        plan.uncover(tracer, &covered, &mut values, &openness);
        values
    };
    let columns: Vec<Vec<Rgb>> = columns.par_iter().map(at_column).collect();
    let (surfaces, blending) = plan.assemble_blending(&values, watch)?;
    let columns = columns.par_iter().map(|values| blending.irradiance(values)).collect();
    Some((surfaces, columns))
}

/// The side that lies on a vertex in its plane, and where. A covered face then shows the light of what covers it: they are in
/// one place, and a viewer may draw either.
fn on_top(plan: &SmoothPlan<'_>, tracer: &Tracer, elements: &Elements, site: usize) -> Option<(u32, DVec3)> {
    let Site { position, leaf } = plan.sites()[site];
    let own = elements.get(leaf).polygon;
    let side = tracer.on_top(own, position);
    (side != own).then_some((side, position))
}

/// Open leaves around a vertex.
#[derive(Clone, Copy, Debug, Default)]
struct Around {
    /// Their number.
    count: f64,
    /// Sum of the mean irradiances of their open parts.
    mean: f64,
    /// Sum of their middles.
    towards: DVec3,
}

impl Around {
    /// Adds a leaf that is open, at least in part.
    fn add(&mut self, leaf: ElementId, elements: &Elements, light: &Light) {
        self.count += 1.0;
        self.mean += light.irradiance(leaf).mean() / light.open_share(leaf);
        self.towards += elements.get(leaf).corners.mean();
    }
}

/// Surfaces from values at vertices. Those that are dark since something stands on them take the light beside it.
fn uncovered(
    plan: SmoothPlan<'_>,
    tracer: &Tracer,
    elements: &Elements,
    mut values: Vec<Rgb>,
    around: &[Around],
    watch: &mut Watch<'_>,
) -> Option<SmoothSurfaces> {
    let (covered, openness) = shaded(&plan, tracer, elements, &values, around);
    plan.uncover(tracer, &covered, &mut values, &openness);
    plan.assemble(&values, watch)
}

/// Vertices that are dark since something stands on them, and how open each is, as [`SmoothPlan::uncover`] takes it.
fn shaded(
    plan: &SmoothPlan<'_>,
    tracer: &Tracer,
    elements: &Elements,
    values: &[Rgb],
    around: &[Around],
) -> (Vec<bool>, Vec<f64>) {
    // Where everything around is as dark nothing is made better by looking.
    let is_dark = |site: usize| values[site].mean() * around[site].count < DARK * around[site].mean;
    let openness: Vec<f64> = (0..values.len()).map(|site| if is_dark(site) { 0.0 } else { 1.0 }).collect();
    let covered: Vec<bool> = plan.sites()[..values.len()]
        .iter()
        .zip(&openness)
        .map(|(site, &open)| open == 0.0 && tracer.is_covered(site.position, elements.get(site.leaf).polygon))
        .collect();
    (covered, openness)
}

/// Vertices at the border of what is open are gathered at by this share of the way to the middles of the leaves around: in
/// the plane of a wall that stands there its form factor is undefined. It is what the paper's schedule moves them by.
const INSET: f64 = 0.01;

/// What a final gather at vertices works from.
pub(crate) struct Gathering<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) tracer: &'a Tracer,
    pub(crate) elements: &'a Elements,
    pub(crate) light: &'a Light,
    /// Polygons that take part.
    pub(crate) active: &'a [bool],
    pub(crate) rays: u32,
    pub(crate) seed: u64,
    pub(crate) threads: usize,
}

impl Gathering<'_> {
    /// Surfaces from the irradiance that rays find at each vertex; `solved` is the irradiance that they read where they end.
    /// The observer is asked every 10 ms or so.
    pub(crate) fn surfaces(
        &self,
        solved: &(impl Fn(u32, DVec3) -> Rgb + Sync),
        observer: &mut dyn Observer,
    ) -> Result<SmoothSurfaces, RenderError> {
        let Gathering { scene, tracer, elements, light, .. } = *self;
        let stage = |done| Progress { done, elements: elements.len(), ..Progress::of(Phase::Interpolation) };
        let plan = SmoothPlan::new(scene, tracer, elements, light, &mut Watch::new(observer, stage(0.0)));
        let plan = plan.ok_or(RenderError::Cancelled)?;
        let mut around = vec![Around::default(); plan.vertices()];
        let mut is_border = vec![false; plan.vertices()];
        for (site, leaf) in plan.around() {
            if light.open_share(leaf) < 1.0 {
                is_border[site] = true;
            }
            if light.open_share(leaf) > 0.0 {
                around[site].add(leaf, elements, light);
            }
        }
        let positions = plan.positions();
        let gather = FinalGather::new(tracer, self.rays, 1);
        let value = |site: usize| {
            let Site { position, leaf } = plan.sites()[site];
            let Around { count, towards, .. } = around[site];
            let (polygon, position) = if count == 0.0 {
                let Some(top) = on_top(&plan, tracer, elements, site) else { return Rgb::ZERO };
                top
            } else if is_border[site] {
                (elements.get(leaf).polygon, positions[site] + (towards / count - positions[site]) * INSET)
            } else {
                (elements.get(leaf).polygon, position)
            };
            if !self.active[polygon as usize] {
                return Rgb::ZERO;
            }
            let mut stream = Stream::new(mix(self.seed ^ VERTICES) ^ site as u64);
            gather.irradiance(position, polygon, 0, &mut stream, solved)
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build();
        let pool = pool.map_err(|_| RenderError::Threads { threads: self.threads })?;
        let mut pace = Pace::starting(8 * pool.current_num_threads());
        let mut values = Vec::with_capacity(plan.vertices());
        while values.len() < plan.vertices() {
            if observer.observe(&stage(values.len() as f64 / plan.vertices() as f64)) == Flow::Stop {
                return Err(RenderError::Cancelled);
            }
            let portion = values.len()..(values.len() + pace.size()).min(plan.vertices());
            pace.begin();
            values.extend(pool.install(|| portion.into_par_iter().map(value).collect::<Vec<Rgb>>()));
            pace.end();
        }
        let made = uncovered(plan, tracer, elements, values, &around, &mut Watch::new(observer, stage(1.0)));
        made.ok_or(RenderError::Cancelled)
    }
}

/// Sets the streams of vertices apart from others of the same seed.
const VERTICES: u64 = 0x7665_7274_6963_6573;

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
