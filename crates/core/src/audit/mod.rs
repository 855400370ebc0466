//! Geometry that will not light as its maker meant: a scene goes in, findings by object come out; nothing is mended
//! here.
//!
//! Three things are looked for: polygons that turn their black backs to the light (`flipped`), corners that lie inside
//! a neighbour's edge (`joints`), and polygons that cover each other in one plane (`overlaps`). Each module says what it
//! takes for a fault and what it leaves alone.

mod flipped;
mod joints;
mod overlaps;
mod rays;

use crate::scene::{Issue, IssueKind, Scene, Severity};
use flipped::Flipped;
use std::collections::BTreeMap;

/// All findings: warnings before notes, then by kind and in the order of objects, one per object and kind (two for
/// T-joints, see [`t_joints`]).
#[must_use]
pub fn audit(scene: &Scene) -> Vec<Issue> {
    let mut issues = flipped_faces(scene);
    issues.extend(t_joints(scene));
    issues.extend(coplanar_overlaps(scene));
    issues.sort_by_key(|issue| std::cmp::Reverse(issue.severity));
    issues
}

/// Polygons of an object that are asked whether they are flipped: of more, so many evenly spaced ones. Objects are turned
/// inside out as a whole, and a mesh of 96,000 triangles that is took 110 s in full.
const MOST_ASKED: usize = 1024;

/// Polygons that turn a black back to the light and get none themselves, by object.
#[must_use]
pub fn flipped_faces(scene: &Scene) -> Vec<Issue> {
    let asked = Flipped::new(scene);
    let mut of_object: Vec<Vec<u32>> = vec![Vec::new(); scene.objects.len()];
    for polygon in 0..scene.fronts as u32 {
        of_object[scene.polygons[polygon as usize].object as usize].push(polygon);
    }
    let mut found: Findings<()> = Findings::default();
    for polygons in of_object {
        let count = polygons.len().min(MOST_ASKED);
        for polygon in (0..count).map(|k| polygons[k * polygons.len() / count]) {
            if asked.is_flipped(polygon) {
                found.add(scene, polygon, None);
            }
        }
    }
    found.issues(scene, |finding, count, total| {
        let face = face(scene, finding.polygon);
        let asked = if total > MOST_ASKED { format!("{MOST_ASKED} (of {total})") } else { total.to_string() };
        let message = format!(
            "{count} of {asked} polygons turn a black back to the light and get none in front (the first is face \
             {face}): turn their winding round, or make the material double-sided"
        );
        (Severity::Warning, IssueKind::FlippedFace, message)
    })
}

/// Corners inside a neighbour's edge, by object: a warning for those that divide a flat surface, where light will step; a
/// note for those at creases and outlines, where at most a crack of a pixel shows.
#[must_use]
pub fn t_joints(scene: &Scene) -> Vec<Issue> {
    let (mut flat, mut others) = (Findings::default(), Findings::default());
    for joint in joints::find(scene) {
        let group = if joint.flat { &mut flat } else { &mut others };
        group.add(scene, joint.edge_of, Some(joint));
    }
    let mut issues = flat.issues(scene, |finding, count, _| {
        let message = format!(
            "{count} corners lie inside edges of neighbours in the same plane (T-joints; {}): light will step there; split \
             the edges at the corners",
            describe(scene, finding),
        );
        (Severity::Warning, IssueKind::TJoint, message)
    });
    issues.extend(others.issues(scene, |finding, count, _| {
        let message = format!(
            "{count} corners lie inside edges at creases and outlines (T-joints; {}): hairline cracks may show there in \
             lit files",
            describe(scene, finding),
        );
        (Severity::Note, IssueKind::TJoint, message)
    }));
    issues
}

fn describe(scene: &Scene, finding: &Finding<joints::Joint>) -> String {
    let Some(joint) = &finding.first else { return String::new() };
    let [x, y, z] = joint.position.to_array();
    let (edge, corner) = (face(scene, joint.edge_of), face(scene, joint.corner_of));
    format!("the first: a corner of face {corner} inside an edge of face {edge} at {x:.4}, {y:.4}, {z:.4} m")
}

/// Polygons that cover another one in its plane and face the same way, by object (that of the smaller polygon).
#[must_use]
pub fn coplanar_overlaps(scene: &Scene) -> Vec<Issue> {
    let mut found = Findings::default();
    for overlap in overlaps::find(scene) {
        found.add(scene, overlap.polygon, Some(overlap));
    }
    found.issues(scene, |finding, count, _| {
        let other = finding.first.map_or(finding.polygon, |overlap| overlap.other);
        let message = format!(
            "{count} polygons lie in the plane of another one, overlap it and face the same way (the first: face {} \
             with face {} of '{}'): with schedule wavefront the later one lies on top, with sequential light is there \
             twice; move one away or leave the hidden part out",
            face(scene, finding.polygon),
            face(scene, other),
            scene.object_name(other),
        );
        (Severity::Warning, IssueKind::CoplanarOverlap, message)
    })
}

/// The face index that stands for a polygon: its first.
fn face(scene: &Scene, polygon: u32) -> u32 {
    scene.polygons[polygon as usize].faces[0]
}

/// Findings of one kind, by object: how many, and the first.
struct Findings<T> {
    objects: BTreeMap<u32, Finding<T>>,
}

struct Finding<T> {
    count: usize,
    polygon: u32,
    first: Option<T>,
}

impl<T> Default for Findings<T> {
    fn default() -> Findings<T> {
        Findings { objects: BTreeMap::new() }
    }
}

impl<T> Findings<T> {
    /// Counts a finding about the object of a polygon; the first one added is the one that is told.
    fn add(&mut self, scene: &Scene, polygon: u32, detail: Option<T>) {
        let object = scene.polygons[polygon as usize].object;
        let new = Finding { count: 0, polygon, first: detail };
        self.objects.entry(object).or_insert(new).count += 1;
    }

    /// One issue per object; `tell` gets the first finding, how many there are, and how many polygons the object has.
    fn issues(
        &self,
        scene: &Scene,
        tell: impl Fn(&Finding<T>, usize, usize) -> (Severity, IssueKind, String),
    ) -> Vec<Issue> {
        let mut totals = vec![0; scene.objects.len()];
        for polygon in &scene.polygons[..scene.fronts] {
            totals[polygon.object as usize] += 1;
        }
        let issue = |(&object, finding): (&u32, &Finding<T>)| {
            let (severity, kind, message) = tell(finding, finding.count, totals[object as usize]);
            Issue { severity, kind, object: scene.objects[object as usize].name.clone(), message }
        };
        self.objects.iter().map(issue).collect()
    }
}
