//! Relighting: a solution of `wavefront` and new weights of its light groups go in, the solution of the dimmed scene comes
//! out, without a gather; with new reflectances, after gathers over the links that are there. Rays only tell how wrong that is.

use crate::groups::{LightGroups, light_groups};
use crate::report::{ErrorEstimate, PhaseReport, ReflectanceReport, RelitReport, WeightReport};
use crate::solve::Stopwatch;
use crate::wavefront::{Columns, Transported, solution};
use crate::{RelightError, Report, Settings, Solution, Status};
use isolux_core::scene::{Alpha, Scene};
use isolux_core::solution::Light;
use isolux_core::tree::ElementId;
use isolux_core::units::Rgb;
use isolux_wavefront::{Control, NO_GROUP, PointErrors, Remains, Solved, light_of};
use rayon::prelude::*;
use std::sync::Arc;

/// Irradiance at an element's corners and middle.
pub(crate) type Field = [[f32; 3]; 5];

/// What is to change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changes {
    /// Factor on the emission of light groups, per band, by name; 1 for those that are not named. They refer to the scene
    /// as it was solved, whatever weights a relit solution has already.
    pub weights: Vec<(String, [f64; 3])>,
    /// Diffuse reflectance of materials, per band, by name; those that are not named keep theirs.
    pub reflectance: Vec<(String, [f64; 3])>,
    /// Threads; 0: all cores. Never changes a result.
    pub threads: usize,
}

/// Leaves of the total from those of the columns, by leaf: sums in double precision, as [`Solved::columns`] adds them up.
pub(crate) fn mixed(columns: &[Vec<Field>], weights: &[[f64; 3]]) -> Vec<Field> {
    let leaves = columns.first().map_or(0, Vec::len);
    (0..leaves)
        .into_par_iter()
        .with_min_len(1024)
        .map(|leaf| {
            let mut sum = [[0.0_f64; 3]; 5];
            for (column, weight) in columns.iter().zip(weights) {
                for (sum, value) in sum.iter_mut().zip(&column[leaf]) {
                    (0..3).for_each(|band| sum[band] += weight[band] * f64::from(value[band]));
                }
            }
            sum.map(|at| at.map(|value| value as f32))
        })
        .collect()
}

/// Puts fields of leaves, in ascending order, in their places.
pub(crate) fn place(solution: &isolux_core::tree::Elements, leaves: Vec<Field>, fields: &mut [Field]) {
    for (leaf, field) in solution.leaves().zip(leaves) {
        fields[leaf.index()] = field;
    }
}

impl Solution {
    /// The light by groups. It is made when it is first asked for, by gathers over the links that are there, and checked by
    /// rays, to be dimmed or saved; a solution that was opened or relit has it already.
    ///
    /// # Errors
    /// [`RelightError`] where links for it are missing: of another schedule, an older file or a cancelled solve.
    pub fn columns(&self) -> Result<Arc<Columns>, RelightError> {
        self.columns_until(&Control::default())
    }

    /// The same until `control` says stop. The solution is then as it was, and may be asked again.
    ///
    /// # Errors
    /// As [`Solution::columns`], and [`RelightError::Cancelled`].
    pub fn columns_until(&self, control: &Control) -> Result<Arc<Columns>, RelightError> {
        self.columns_and_phases(control).map(|(columns, _)| columns)
    }

    /// With what it took to make them, if they were not there.
    fn columns_and_phases(&self, control: &Control) -> Result<(Arc<Columns>, Vec<PhaseReport>), RelightError> {
        let Some(transport) = &self.transport else {
            return Err(RelightError::Schedule { schedule: self.report.schedule.name() });
        };
        if let Some(columns) = transport.columns.get() {
            return Ok((columns.clone(), Vec::new()));
        }
        let mut watch = Stopwatch::start();
        let made = Arc::new(columns_of(self, transport, control, &mut watch)?);
        // That of one group is at hand anyway.
        let kept = if made.names.len() > 1 { transport.columns.get_or_init(|| made).clone() } else { made };
        Ok((kept, watch.phases))
    }

    /// The light by groups that a file keeps: with one group, it is all of the light. Nothing where there is none.
    ///
    /// # Errors
    /// [`RelightError::Cancelled`].
    pub(crate) fn kept_columns(&self, control: &Control) -> Result<Option<Arc<Columns>>, RelightError> {
        let Some(transport) = &self.transport else { return Ok(None) };
        if transport.columns.get().is_none() && light_groups(&self.scene).groups.len() == 1 {
            return Ok(None);
        }
        match self.columns_until(control) {
            Err(RelightError::Cancelled) => Err(RelightError::Cancelled),
            made => Ok(made.ok()),
        }
    }

    /// The solution of the same scene with its light groups dimmed, brightened or coloured: exact to rounding, since light
    /// is linear in what is emitted; with the error of the mix. With other reflectances light is gathered anew over the same
    /// links, which were refined for the old ones, and checked anew.
    ///
    /// # Errors
    /// [`RelightError`] for solutions that have no light by groups, and for names and values that make no sense.
    pub fn relight(&self, changes: &Changes) -> Result<Solution, RelightError> {
        self.relight_until(changes, &Control::default())
    }

    /// The same until `control` says stop: it is asked between gathers and between the points of the check.
    ///
    /// # Errors
    /// As [`Solution::relight`], and [`RelightError::Cancelled`].
    pub fn relight_until(&self, changes: &Changes, control: &Control) -> Result<Solution, RelightError> {
        if changes.threads == 0 {
            return relit(self, changes, control);
        }
        let refused = |_| crate::SettingsError::Value {
            name: "threads",
            value: changes.threads.to_string(),
            expected: "as many threads as the system grants",
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(changes.threads).build().map_err(refused)?;
        pool.install(|| relit(self, changes, control))
    }
}

fn relit(old: &Solution, changes: &Changes, control: &Control) -> Result<Solution, RelightError> {
    let Some(transport) = &old.transport else {
        return Err(RelightError::Schedule { schedule: old.report.schedule.name() });
    };
    let (mut columns, phases) = old.columns_and_phases(control)?;
    let mut watch = Stopwatch::start();
    watch.phases = phases;
    let weights = weights_of(&columns.names, &changes.weights)?;
    let known = &old.report.relit;
    let mut origin = known.clone().unwrap_or_else(|| RelitReport {
        scene_hash: old.report.scene_hash.clone(),
        mean_irradiance: old.report.mean_irradiance,
        error_estimate: old.report.error_estimate,
        weights: Vec::new(),
        reflectance: Vec::new(),
        measured: false,
    });
    let mut scene = Scene::clone(&old.scene);
    let elements = &old.hierarchy.elements;
    let open = old.hierarchy.light.open_shares();
    let mut fields = transport.fields.clone();
    if !changes.reflectance.is_empty() {
        let remains = remains(old, transport)?;
        for (name, value) in &changes.reflectance {
            repaint(&mut scene, name, *value)?;
            origin.reflectance.retain(|entry| entry.material != *name);
            origin.reflectance.push(ReflectanceReport { material: name.clone(), reflectance: Rgb(*value) });
        }
        // As all groups are lit as they were solved.
        let whole = vec![[1.0; 3]; columns.names.len()];
        emit(&mut scene, &columns, &whole);
        place(elements, mixed(&columns.fields, &whole), &mut fields);
        let solved = Solved::reopened(Arc::new(scene.clone()), &Remains { fields: &fields, ..remains });
        let gathered = solved.regathered(old.report.settings.error, control);
        watch.lap("gathers");
        let groups = columns.names.len();
        let (anew, points) = by_groups(&gathered, &columns.of, groups, &old.report.settings, control, &mut watch)?;
        columns = Arc::new(Columns { fields: anew, points: Arc::new(points), ..Columns::clone(&columns) });
        place(elements, mixed(&columns.fields, &whole), &mut fields);
        origin.mean_irradiance = mean_irradiance(&scene, &light_of(&scene, elements, &fields, open.to_vec()));
    }
    emit(&mut scene, &columns, &weights);
    scene.hash = scene.compute_hash();
    let mix = || {
        place(elements, mixed(&columns.fields, &weights), &mut fields);
        light_of(&scene, elements, &fields, open.to_vec())
    };
    let (light, elements) = rayon::join(mix, || elements.clone());
    let mean = mean_irradiance(&scene, &light);
    let is_as_solved = origin.reflectance.is_empty() && weights.iter().all(|weight| *weight == [1.0; 3]);
    let (error_estimate, measured) = estimate(&origin, &columns.points, &weights, mean);
    origin.measured = measured;
    origin.weights = columns
        .names
        .iter()
        .zip(&weights)
        .map(|(name, &weight)| WeightReport { group: name.clone(), weight: Rgb(weight) })
        .collect();
    watch.lap("relight");
    let report = Report {
        scene_hash: scene.hash_text(),
        mean_irradiance: mean,
        error_estimate,
        energy: old.report.energy.filter(|_| is_as_solved),
        relit: (!is_as_solved).then_some(origin),
        phases: watch.phases,
        ..old.report.clone()
    };
    let transport = Transported { fields, columns: columns.into(), ..transport.clone() };
    Ok(solution(Arc::new(scene), elements, light, old.active.clone(), transport, report))
}

/// What a solution of `wavefront` has left of its solve.
fn remains<'a>(old: &'a Solution, transport: &'a Transported) -> Result<Remains<'a>, RelightError> {
    if transport.limit <= 0.0 {
        let why = if old.report.status == Status::Cancelled { "it was cancelled" } else { "an older version wrote it" };
        return Err(RelightError::Unprepared { why: why.into() });
    }
    Ok(Remains {
        elements: &old.hierarchy.elements,
        open_shares: old.hierarchy.light.open_shares(),
        fields: &transport.fields,
        sky: &transport.sky,
        links: &transport.links,
        clusters: &transport.clusters,
        limit: transport.limit,
    })
}

/// The light by groups, over the links of a solution, and how wrong it is at points. One group is all of the light; how wrong
/// that is the solve has told.
fn columns_of(
    old: &Solution,
    transport: &Transported,
    control: &Control,
    watch: &mut Stopwatch,
) -> Result<Columns, RelightError> {
    let LightGroups { groups, of, .. } = light_groups(&old.scene);
    let (fields, points) = if groups.len() == 1 {
        let all = old.hierarchy.elements.leaves().map(|leaf| transport.fields[leaf.index()]).collect();
        (vec![all], PointErrors::default())
    } else if old.report.status == Status::Cancelled {
        return Err(RelightError::Unprepared { why: "it was cancelled".into() });
    } else {
        let solved = Solved::reopened(old.scene.clone(), &remains(old, transport)?);
        by_groups(&solved, &of, groups.len(), &old.report.settings, control, watch)?
    };
    let lamps = old.scene.lamps.iter().map(|lamp| lamp.intensity);
    let remote = lamps.chain(old.scene.sky.iter().map(|sky| sky.radiance));
    let emission = old.scene.polygons.iter().map(|polygon| polygon.emission).chain(remote).collect();
    let names = groups.into_iter().map(|group| group.name).collect();
    Ok(Columns { names, of, emission, fields, points: Arc::new(points) })
}

/// Light by groups, and what rays say of it.
fn by_groups(
    solved: &Solved,
    of: &[u32],
    groups: usize,
    settings: &Settings,
    control: &Control,
    watch: &mut Stopwatch,
) -> Result<(Vec<Vec<Field>>, PointErrors), RelightError> {
    let made = solved.columns(of, groups, settings.error, control).ok_or(RelightError::Cancelled)?;
    watch.lap("light by groups");
    let points = solved.check_columns(&made.fields, of, settings.error, settings.seed, control);
    watch.lap("check by groups");
    Ok((made.fields, points.ok_or(RelightError::Cancelled)?))
}

/// Weights by group; each name must exist, each weight be finite and not negative.
fn weights_of(names: &[String], given: &[(String, [f64; 3])]) -> Result<Vec<[f64; 3]>, RelightError> {
    let mut weights = vec![[1.0; 3]; names.len()];
    for (name, weight) in given {
        let Some(row) = names.iter().position(|known| known == name) else {
            return Err(RelightError::NoSuchGroup { name: name.clone(), available: names.join(", ") });
        };
        // What does not fit single precision is a slip.
        if let Some(value) = weight.iter().find(|&&value| !(value >= 0.0 && value <= f64::from(f32::MAX).sqrt())) {
            return Err(RelightError::Weight { name: name.clone(), value: value.to_string() });
        }
        weights[row] = *weight;
    }
    Ok(weights)
}

/// Emissions, lamps' intensities and the sky's radiance as solved times weights; emissions of materials, too, where all that is made of one is dimmed alike.
fn emit(scene: &mut Scene, columns: &Columns, weights: &[[f64; 3]]) {
    let mut of_material: Vec<Vec<Rgb>> = vec![Vec::new(); scene.materials.len()];
    for (index, polygon) in scene.polygons.iter_mut().enumerate() {
        if columns.of[index] == NO_GROUP {
            continue;
        }
        polygon.emission = columns.emission[index] * Rgb(weights[columns.of[index] as usize]);
        let seen = &mut of_material[polygon.material as usize];
        if !seen.contains(&polygon.emission) {
            seen.push(polygon.emission);
        }
    }
    let mut remote = columns.of.iter().zip(&columns.emission).skip(scene.polygons.len());
    for (lamp, (&group, &intensity)) in scene.lamps.iter_mut().zip(remote.by_ref()) {
        lamp.intensity = intensity * Rgb(weights[group as usize]);
    }
    for (sky, (&group, &radiance)) in scene.sky.iter_mut().zip(remote.by_ref()) {
        sky.radiance = radiance * Rgb(weights[group as usize]);
    }
    for (material, seen) in scene.materials.iter_mut().zip(of_material) {
        if let [emission] = *seen {
            material.surface.emission = emission;
        }
    }
}

/// Gives a material another reflectance. Its texture goes, since it says what the reflectance was; a cut-out keeps it, for
/// its holes.
fn repaint(scene: &mut Scene, name: &str, value: [f64; 3]) -> Result<(), RelightError> {
    let Some(row) = scene.materials.iter().position(|material| material.name == name) else {
        let names: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
        return Err(RelightError::NoSuchMaterial { name: name.to_owned(), available: names.join(", ") });
    };
    let own = scene.polygons.iter().filter(|polygon| polygon.material as usize == row);
    let most = own.map(|polygon| polygon.opacity).fold(1.0, f64::min);
    if let Some(&wrong) = value.iter().find(|&&band| !(0.0..1.0).contains(&band) || band > most) {
        return Err(RelightError::Reflectance { name: name.to_owned(), value: wrong.to_string(), most });
    }
    for polygon in scene.polygons.iter_mut().filter(|polygon| polygon.material as usize == row) {
        polygon.reflectance = Rgb(value);
    }
    let material = &mut scene.materials[row];
    material.surface.reflectance = Rgb(value);
    if !matches!(material.alpha, Alpha::Mask(_)) {
        material.texture = None;
    }
    Ok(())
}

/// Mean over the fronts, by area, W/m² or lm/m².
fn mean_irradiance(scene: &Scene, light: &Light) -> Rgb {
    let fronts = scene.polygons[..scene.fronts].iter().enumerate();
    fronts.map(|(root, front)| light.irradiance(ElementId(root as u32)) * front.area).sum::<Rgb>() / scene.area()
}

/// The error of a mix, and whether it was measured for this mix.
///
/// Dimmed alike, all lights keep the relative error that the solve found. Of other mixes, and with other reflectances, rays
/// have told at points how wrong the light of each group is: see [`PointErrors::estimate`]. A file of an older version has no
/// such points. Then what is known is the error of all groups together, e m with the mean irradiance m: where the groups'
/// errors do not cancel each other in that sum, a mix has at most the largest weight w times as much, whatever the other
/// weights are, which relative to the mix's own mean n is `w e m / n`; of the darker half nothing is known.
fn estimate(
    origin: &RelitReport,
    points: &PointErrors,
    weights: &[[f64; 3]],
    mean: Rgb,
) -> (Option<ErrorEstimate>, bool) {
    let all = || weights.iter().flatten().copied();
    let most = all().fold(0.0, f64::max);
    if most == 0.0 {
        return (Some(ErrorEstimate { total: 0.0, dark: None }), true);
    }
    let is_alike = all().all(|weight| weight == most);
    if is_alike && origin.reflectance.is_empty() {
        return (origin.error_estimate, true);
    }
    if let Some(found) = points.estimate(weights) {
        return (Some(ErrorEstimate { total: found.total, dark: Some(found.dark) }), true);
    }
    if is_alike {
        return (origin.error_estimate, false);
    }
    let (before, now) = (origin.mean_irradiance.mean(), mean.mean());
    let bound = |known: ErrorEstimate| ErrorEstimate { total: known.total * most * before / now, dark: None };
    (origin.error_estimate.filter(|_| now > 0.0).map(bound), false)
}
