//! Validation of a scene's input: everything that a file may get wrong is found or mended here, and said.

use super::{
    Alpha, Corners, Face, Issue, IssueKind, Lamp, LampShape, Material, Object, Plane, Polygon, RELATIVE_TOLERANCE,
    Scene, SceneError, SceneInput, Severity, Side, Sky, SkyPattern, Surface,
};
use crate::tree::Path;
use crate::units::Rgb;
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, HashSet};

/// How [`Scene::build`] treats its input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildOptions {
    /// Join two consecutive triangles of an object and material into one polygon where they are coplanar and form a
    /// convex quadrilateral.
    pub join: bool,
}

impl Default for BuildOptions {
    fn default() -> BuildOptions {
        BuildOptions { join: true }
    }
}

/// Largest reflectance that is let in: 1 or more would never settle; at 0.99 light survives 100 bounces, brighter
/// than any real paint (barium sulphate: 0.98).
const MAX_REFLECTANCE: f64 = 0.99;

/// Corners of a quadrilateral turn by at least this sine: below it a corner lies on the line of its neighbours to
/// within what single-precision files can tell (1e-3 of a 1 m edge is 1 mm).
const MIN_CORNER_SINE: f64 = 1e-3;

pub(super) fn build(input: SceneInput, options: &BuildOptions) -> Result<Scene, SceneError> {
    let scale = input.metres_per_unit;
    if !(scale.is_finite() && scale > 0.0) {
        return Err(SceneError::Unit { metres_per_unit: scale });
    }
    let SceneInput {
        name,
        unit,
        mut objects,
        faces,
        mut materials,
        images,
        masks,
        mut cameras,
        lamps,
        sky,
        issues,
        ..
    } = input;
    let mut notes = Notes { issues, groups: BTreeMap::new() };
    make_unique(objects.iter_mut().map(|object| &mut object.name), "object");
    make_unique(materials.iter_mut().map(|material| &mut material.name), "material");
    for material in &mut materials {
        let label = material.name.clone();
        material.surface = admit(material.surface, &label, &mut notes)?;
        check_index("mask", &label, mask_of(material), masks.len())?;
        check_index("image", &label, material.texture.as_ref().map(|texture| texture.image), images.len())?;
    }
    for (index, mask) in masks.iter().enumerate() {
        let texels = u64::from(mask.width) * u64::from(mask.height);
        if texels == 0 || texels != mask.solid.len() as u64 {
            let holder = materials.iter().find(|material| mask_of(material) == Some(index as u32));
            return Err(SceneError::MaskSize {
                material: holder.map_or_else(|| "no material".to_owned(), |material| material.name.clone()),
                mask: index,
                width: mask.width,
                height: mask.height,
                texels: mask.solid.len(),
            });
        }
    }
    let mut pieces = Vec::with_capacity(faces.len());
    let mut triangles = Vec::with_capacity(faces.len());
    for (index, face) in faces.iter().enumerate() {
        admit_face(index, face, scale, &objects, &materials, &mut triangles, &mut pieces, &mut notes)?;
    }
    let is_empty_mask: Vec<bool> = masks.iter().map(|mask| !mask.solid.contains(&true)).collect();
    let before = pieces.len();
    pieces.retain(|piece| {
        let mask = mask_of(&materials[piece.material as usize]);
        let is_there = piece.surface.opacity > 0.0 && !mask.is_some_and(|mask| is_empty_mask[mask as usize]);
        // A pane may shine and let everything pass; the holes of a mask may not.
        let counts = is_there || (piece.surface.emission != Rgb::ZERO && mask.is_none());
        if !counts {
            notes.count(IssueKind::Ignored, &objects[piece.object as usize].name, piece.faces[0]);
        }
        counts
    });
    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    for corner in pieces.iter().flat_map(|piece| piece.corners.iter()) {
        low = low.min(*corner);
        high = high.max(*corner);
    }
    let diameter = (high - low).length();
    let tolerance = diameter * RELATIVE_TOLERANCE;
    let invisible = before - pieces.len();
    pieces.retain(|piece| {
        let sound = piece.is_thicker_than(tolerance);
        if !sound {
            notes.count(IssueKind::DegenerateFace, &objects[piece.object as usize].name, piece.faces[0]);
        }
        sound
    });
    if pieces.is_empty() {
        return Err(SceneError::Empty { dropped: before - invisible, invisible });
    }
    let before = pieces.len();
    let pieces = if options.join { join(pieces) } else { pieces };
    let joined = before - pieces.len();
    let mut polygons: Vec<Polygon> = pieces.iter().map(|piece| piece.polygon(&materials)).collect();
    let fronts = polygons.len();
    for front in 0..fronts {
        if materials[polygons[front].material as usize].two_sided {
            let back = backside(&polygons[front], front as u32);
            polygons[front].twin = Some(polygons.len() as u32);
            polygons.push(back);
        }
    }
    if polygons.len() > Path::MAX_ROOTS {
        return Err(SceneError::TooLarge { count: polygons.len(), limit: Path::MAX_ROOTS });
    }
    let mut face_polygon = vec![Scene::NO_POLYGON; triangles.len()];
    for (index, polygon) in polygons[..fronts].iter().enumerate() {
        for face in polygon.faces.into_iter().filter(|&face| face != Scene::NO_POLYGON) {
            face_polygon[face as usize] = index as u32;
        }
    }
    for camera in &mut cameras {
        camera.eye *= scale;
        if let super::Projection::Orthographic { height } = &mut camera.projection {
            *height *= scale;
        }
    }
    let lamps = admit_lamps(lamps, scale, &mut notes)?;
    let sky = sky.map(admit_sky).transpose()?;
    if lamps.is_empty() && sky.is_none() && polygons.iter().all(|polygon| polygon.emission == Rgb::ZERO) {
        let message = "no surface emits light, and there is no lamp and no sky: everything would be black".to_owned();
        notes.issues.push(Issue {
            severity: Severity::Warning,
            kind: IssueKind::NoLight,
            object: name.clone(),
            message,
        });
    }
    let mut scene = Scene {
        front_area: Scene::area_of(&polygons[..fronts]),
        polygons,
        fronts,
        joined,
        objects,
        materials,
        images,
        masks,
        cameras,
        lamps,
        sky,
        triangles,
        face_polygon,
        issues: Vec::new(),
        diameter,
        unit,
        hash: [0; 32],
        name,
    };
    scene.issues = notes.finish();
    scene.hash = scene.compute_hash();
    Ok(scene)
}

/// Lamps in metres, their vectors of unit length and orthogonal, those that throw nothing left out.
fn admit_lamps(mut lamps: Vec<Lamp>, scale: f64, notes: &mut Notes) -> Result<Vec<Lamp>, SceneError> {
    make_unique(lamps.iter_mut().map(|lamp| &mut lamp.name), "lamp");
    let mut admitted = Vec::with_capacity(lamps.len());
    for mut lamp in lamps {
        let wrong = |what| SceneError::Lamp { lamp: lamp.name.clone(), what };
        lamp.position *= scale;
        if !lamp.position.is_finite() || !lamp.intensity.is_finite() {
            return Err(wrong("its place or intensity is not a finite number"));
        }
        let forward = lamp.forward.try_normalize().ok_or_else(|| wrong("it has no direction"))?;
        let side = lamp.side.reject_from_normalized(forward).try_normalize();
        match &lamp.shape {
            LampShape::Point | LampShape::Parallel => {}
            LampShape::Spot { inner, outer } => {
                // Half a sphere may be missed by rounding.
                if !(*inner >= 0.0 && inner < outer && *outer <= std::f64::consts::FRAC_PI_2 + 1e-6) {
                    return Err(wrong("its cone is none: 0 <= inner angle < outer angle <= 90 degrees is wanted"));
                }
            }
            LampShape::Web(web) => {
                let ascends = |list: &[f64], most: f64| {
                    list.iter().all(|angle| (0.0..=most).contains(angle))
                        && list.windows(2).all(|pair| pair[0] < pair[1])
                };
                let is_whole = web.polar.len() > 1
                    && !web.around.is_empty()
                    && web.intensity.len() == web.polar.len() * web.around.len()
                    && ascends(&web.polar, 180.0)
                    && ascends(&web.around, 360.0)
                    && (web.around.len() == 1 || (web.around[0], web.around[web.around.len() - 1]) == (0.0, 360.0));
                if !is_whole || web.intensity.iter().any(|value| !(value.is_finite() && *value >= 0.0)) {
                    return Err(wrong("its table of intensities is not whole"));
                }
            }
        }
        if lamp.intensity.min_component() < 0.0 {
            notes.value(IssueKind::NegativeValue, &lamp.name, lamp.intensity.min_component());
        }
        lamp.intensity = lamp.intensity.map(|value| value.max(0.0));
        lamp.forward = forward;
        lamp.side = side.unwrap_or_else(|| forward.any_orthonormal_vector());
        if lamp.intensity == Rgb::ZERO || lamp.power() == Some(Rgb::ZERO) {
            let message = "left out: it throws no light".to_owned();
            let (severity, kind) = (Severity::Note, IssueKind::Ignored);
            notes.issues.push(Issue { severity, kind, object: lamp.name, message });
        } else {
            admitted.push(lamp);
        }
    }
    Ok(admitted)
}

/// A sky that can be: unit vectors, coefficients that give light from everywhere above and no more than that, a ground that
/// throws back no more than it gets.
fn admit_sky(mut sky: Sky) -> Result<Sky, SceneError> {
    let wrong = |what: &str| SceneError::Sky { what: what.to_owned() };
    sky.up = sky.up.try_normalize().ok_or_else(|| wrong("its zenith has no direction"))?;
    sky.sun = sky.sun.try_normalize().ok_or_else(|| wrong("its sun has no direction"))?;
    let SkyPattern { gradation, indicatrix } = sky.pattern;
    if !gradation.iter().chain(&indicatrix).all(|value| value.is_finite()) {
        return Err(wrong("its coefficients are not finite numbers"));
    }
    if gradation[1] > 0.0 {
        return Err(wrong(&format!("its coefficient b is {}: above 0 the horizon is infinitely bright", gradation[1])));
    }
    let whole = sky.pattern.horizontal(sky.sun.dot(sky.up));
    if !(whole.is_finite() && whole > 0.0) {
        return Err(wrong("its coefficients give no light"));
    }
    for (what, value) in [("radiance", sky.radiance), ("ground's reflectance", sky.ground)] {
        if !value.is_finite() || value.min_component() < 0.0 {
            return Err(wrong(&format!("its {what} is not a number of 0 or more")));
        }
    }
    if sky.ground.max_component() > 1.0 {
        return Err(wrong(&format!("its ground reflects {}, more than falls on it", sky.ground.max_component())));
    }
    Ok(sky)
}

/// A face that has passed: corners in metres, values clamped.
#[derive(Clone, Debug)]
struct Piece {
    corners: Corners,
    uv: Option<[DVec2; 4]>,
    surface: Surface,
    object: u32,
    material: u32,
    faces: [u32; 2],
}

impl Piece {
    /// Is every height of the polygon above `tolerance`?
    fn is_thicker_than(&self, tolerance: f64) -> bool {
        let longest = longest_edge(&self.corners);
        // Twice the area over the longest edge is the height of a triangle.
        longest > 0.0 && self.corners.area_vector().length() / longest > tolerance
    }

    fn polygon(&self, materials: &[Material]) -> Polygon {
        let normal = self.corners.area_vector().normalize();
        let Surface { reflectance, emission, opacity } = self.surface;
        Polygon {
            corners: self.corners,
            plane: Plane { normal, offset: normal.dot(self.corners.mean()) },
            area: self.corners.area(),
            reflectance: reflectance * opacity,
            emission,
            opacity,
            mask: mask_of(&materials[self.material as usize]),
            object: self.object,
            material: self.material,
            side: Side::Front,
            twin: None,
            faces: self.faces,
            uv: self.uv,
        }
    }
}

fn mask_of(material: &Material) -> Option<u32> {
    match material.alpha {
        Alpha::Mask(mask) => Some(mask),
        Alpha::Opaque | Alpha::Attenuate => None,
    }
}

fn backside(front: &Polygon, index: u32) -> Polygon {
    let uv = front
        .uv
        .map(|uv| if front.corners.len() == 3 { [uv[0], uv[2], uv[1], uv[1]] } else { [uv[0], uv[3], uv[2], uv[1]] });
    Polygon {
        corners: front.corners.reversed(),
        plane: front.plane.reversed(),
        side: Side::Back,
        twin: Some(index),
        uv,
        ..front.clone()
    }
}

#[allow(clippy::too_many_arguments, reason = "one call site; the arguments are the parts of the scene in the making")]
fn admit_face(
    index: usize,
    face: &Face,
    scale: f64,
    objects: &[Object],
    materials: &[Material],
    triangles: &mut Vec<[DVec3; 3]>,
    pieces: &mut Vec<Piece>,
    notes: &mut Notes,
) -> Result<(), SceneError> {
    check_index("object", &format!("face {index}"), Some(face.object), objects.len())?;
    let object = &objects[face.object as usize].name;
    check_index("material", object, Some(face.material), materials.len())?;
    let count = face.corners.len();
    if !(3..=4).contains(&count) {
        return Err(SceneError::CornerCount { object: object.clone(), face: index, corners: count });
    }
    let uv_is_sound = face.uv.as_ref().is_none_or(|uv| uv.len() == count && uv.iter().all(|uv| uv.is_finite()));
    if !uv_is_sound || face.corners.iter().any(|corner| !(*corner * scale).is_finite()) {
        return Err(SceneError::NotFinite { object: object.clone(), face: index });
    }
    let points: Vec<DVec3> = face.corners.iter().map(|&corner| corner * scale).collect();
    let material = &materials[face.material as usize];
    let surface = match face.surface {
        Some(surface) => admit(surface, &material.name, notes)?,
        None => material.surface,
    };
    let first = triangles.len() as u32;
    let piece = |corners: Corners, uv: Option<[DVec2; 4]>, faces: [u32; 2]| Piece {
        corners,
        uv,
        surface,
        object: face.object,
        material: face.material,
        faces,
    };
    let uv_of = |picks: [usize; 4]| face.uv.as_ref().map(|uv| picks.map(|pick| uv[pick]));
    if let [a, b, c, d] = points[..] {
        triangles.push([a, b, c]);
        triangles.push([a, c, d]);
        let corners = Corners::quad(a, b, c, d);
        if is_planar_convex(&corners) && uv_is_affine(&corners, uv_of([0, 1, 2, 3])) {
            pieces.push(piece(corners, uv_of([0, 1, 2, 3]), [first, first + 1]));
        } else {
            if !is_planar_convex(&corners) {
                notes.count(IssueKind::NonPlanarQuad, object, first);
            }
            pieces.push(piece(Corners::triangle(a, b, c), uv_of([0, 1, 2, 2]), [first, Scene::NO_POLYGON]));
            pieces.push(piece(Corners::triangle(a, c, d), uv_of([0, 2, 3, 3]), [first + 1, Scene::NO_POLYGON]));
        }
    } else {
        triangles.push([points[0], points[1], points[2]]);
        let corners = Corners::triangle(points[0], points[1], points[2]);
        pieces.push(piece(corners, uv_of([0, 1, 2, 2]), [first, Scene::NO_POLYGON]));
    }
    Ok(())
}

fn check_index(what: &'static str, holder: &str, index: Option<u32>, count: usize) -> Result<(), SceneError> {
    match index {
        Some(index) if index as usize >= count => {
            Err(SceneError::OutOfRange { what, object: holder.to_owned(), index: index as usize, count })
        }
        _ => Ok(()),
    }
}

/// Clamps what is out of range, and says so.
fn admit(surface: Surface, material: &str, notes: &mut Notes) -> Result<Surface, SceneError> {
    let not_finite = |what| SceneError::MaterialNotFinite { material: material.to_owned(), what };
    let Surface { reflectance, emission, opacity } = surface;
    if !reflectance.is_finite() {
        return Err(not_finite("reflectance"));
    }
    if !emission.is_finite() {
        return Err(not_finite("emission"));
    }
    if !opacity.is_finite() {
        return Err(not_finite("opacity"));
    }
    if reflectance.max_component() >= 1.0 {
        notes.value(IssueKind::ReflectanceClamped, material, reflectance.max_component());
    }
    let negative = reflectance.min_component().min(emission.min_component());
    if negative < 0.0 {
        notes.value(IssueKind::NegativeValue, material, negative);
    }
    if !(0.0..=1.0).contains(&opacity) {
        notes.value(IssueKind::OpacityClamped, material, opacity);
    }
    let clamped = |value: f64| if value >= 1.0 { MAX_REFLECTANCE } else { value.max(0.0) };
    Ok(Surface {
        reflectance: reflectance.map(clamped),
        emission: emission.map(|value| value.max(0.0)),
        opacity: opacity.clamp(0.0, 1.0),
    })
}

fn longest_edge(corners: &Corners) -> f64 {
    edges(corners).map(|(a, b)| a.distance(b)).fold(0.0, f64::max)
}

fn edges(corners: &Corners) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
    (0..corners.len()).map(|k| (corners[k], corners[(k + 1) % corners.len()]))
}

/// Flat to within single-precision rounding of its coordinates, and every corner turning left.
fn is_planar_convex(corners: &Corners) -> bool {
    let Some(normal) = corners.area_vector().try_normalize() else { return false };
    let centre = corners.mean();
    let magnitude = corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
    // Coordinates of single precision are off by 6e-8 of their magnitude, and a few of them add up in a transform.
    let flat = corners.iter().all(|&corner| normal.dot(corner - centre).abs() <= 5e-7 * magnitude);
    let count = corners.len();
    let convex = (0..count).all(|k| {
        let (before, at, after) = (corners[(k + count - 1) % count], corners[k], corners[(k + 1) % count]);
        let (incoming, outgoing) = (at - before, after - at);
        normal.dot(incoming.cross(outgoing)) > MIN_CORNER_SINE * incoming.length() * outgoing.length()
    });
    flat && convex
}

/// Do the texture coordinates of corner 3 continue the affine map of corners 0, 1, 2?
fn uv_is_affine(corners: &Corners, uv: Option<[DVec2; 4]>) -> bool {
    let Some(uv) = uv else { return true };
    let (e1, e2, e3) = (corners[1] - corners[0], corners[2] - corners[0], corners[3] - corners[0]);
    let (d11, d12, d22) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
    let (p1, p2) = (e3.dot(e1), e3.dot(e2));
    let determinant = d11 * d22 - d12 * d12;
    let (s, t) = ((d22 * p1 - d12 * p2) / determinant, (d11 * p2 - d12 * p1) / determinant);
    let expected = uv[0] + (uv[1] - uv[0]) * s + (uv[2] - uv[0]) * t;
    // A thousandth of the texture: below what averaging over the polygon resolves.
    (expected - uv[3]).abs().max_element() <= 1e-3
}

/// Joins consecutive triangles where they make a planar convex quadrilateral.
fn join(pieces: Vec<Piece>) -> Vec<Piece> {
    let mut joined: Vec<Piece> = Vec::with_capacity(pieces.len());
    let mut rest = pieces.into_iter().peekable();
    while let Some(piece) = rest.next() {
        match rest.peek().and_then(|next| joined_pair(&piece, next)) {
            Some(quad) => {
                joined.push(quad);
                rest.next();
            }
            None => joined.push(piece),
        }
    }
    joined
}

fn joined_pair(one: &Piece, two: &Piece) -> Option<Piece> {
    let alike = one.object == two.object && one.material == two.material && one.faces[0] + 1 == two.faces[0];
    if !alike || one.corners.len() != 3 || two.corners.len() != 3 || one.uv.is_some() != two.uv.is_some() {
        return None;
    }
    // The edge k -> k+1 of one is the edge m+1 -> m of two: the quad starts at the end of that edge, so that its
    // diagonal (0, 2) is the shared edge.
    for k in 0..3 {
        for m in 0..3 {
            if one.corners[k] != two.corners[(m + 1) % 3] || one.corners[(k + 1) % 3] != two.corners[m] {
                continue;
            }
            let (start, apex) = ((k + 1) % 3, (k + 2) % 3);
            let far = (m + 2) % 3;
            let quad = Corners::quad(one.corners[start], one.corners[apex], one.corners[k], two.corners[far]);
            let uv = one.uv.zip(two.uv).map(|(a, b)| [a[start], a[apex], a[k], b[far]]);
            let seam_is_smooth = one.uv.zip(two.uv).is_none_or(|(a, b)| {
                let off = (a[k] - b[(m + 1) % 3]).abs().max((a[start] - b[m]).abs());
                off.max_element() <= 1e-6
            });
            if !(seam_is_smooth && is_planar_convex(&quad) && uv_is_affine(&quad, uv)) {
                return None;
            }
            let (a1, a2) = (one.corners.area(), two.corners.area());
            let mean = |x: Rgb, y: Rgb| if x == y { x } else { (x * a1 + y * a2) / (a1 + a2) };
            let (s1, s2) = (one.surface, two.surface);
            let opacity =
                if s1.opacity == s2.opacity { s1.opacity } else { (s1.opacity * a1 + s2.opacity * a2) / (a1 + a2) };
            let surface = Surface {
                reflectance: mean(s1.reflectance, s2.reflectance),
                emission: mean(s1.emission, s2.emission),
                opacity,
            };
            let faces = [one.faces[0], two.faces[0]];
            return Some(Piece { corners: quad, uv, surface, faces, ..one.clone() });
        }
    }
    None
}

/// Appends `#2`, `#3`, ... to repeated names; empty ones become `KIND 0`, `KIND 1`, ...
fn make_unique<'a>(names: impl Iterator<Item = &'a mut String>, kind: &str) {
    let mut taken: HashSet<String> = HashSet::new();
    for (index, name) in names.enumerate() {
        if name.is_empty() {
            *name = format!("{kind} {index}");
        }
        let mut candidate = name.clone();
        let mut copy = 1;
        while !taken.insert(candidate.clone()) {
            copy += 1;
            candidate = format!("{name}#{copy}");
        }
        *name = candidate;
    }
}

/// Findings, gathered by object so that a thousand bad faces give one line.
struct Notes {
    issues: Vec<Issue>,
    groups: BTreeMap<(IssueKind, String), (usize, u32, f64)>,
}

impl Notes {
    fn count(&mut self, kind: IssueKind, object: &str, face: u32) {
        self.groups.entry((kind, object.to_owned())).or_insert((0, face, 0.0)).0 += 1;
    }

    fn value(&mut self, kind: IssueKind, object: &str, value: f64) {
        let group = self.groups.entry((kind, object.to_owned())).or_insert((0, 0, value));
        group.0 += 1;
        if value.abs() > group.2.abs() {
            group.2 = value;
        }
    }

    fn finish(mut self) -> Vec<Issue> {
        for ((kind, object), (count, face, value)) in self.groups {
            let severity = if kind == IssueKind::Ignored { Severity::Note } else { Severity::Warning };
            let message = match kind {
                IssueKind::Ignored => {
                    format!("{count} faces without any opacity, which emit nothing, left out; the first is face {face}")
                }
                IssueKind::DegenerateFace => format!("{count} faces without area dropped, the first is face {face}"),
                IssueKind::NonPlanarQuad => {
                    format!("{count} quadrilaterals are not planar and convex, cut in two; the first is face {face}")
                }
                IssueKind::OpacityClamped => format!("opacity {value} is not within 0 and 1, clamped"),
                IssueKind::ReflectanceClamped => {
                    // What rounding adds to a mean tells nobody anything: four digits.
                    let rounded = (value * 1e4).round() / 1e4;
                    format!("reflectance {rounded} clamped to {MAX_REFLECTANCE}")
                }
                _ => format!("negative value {value} set to 0"),
            };
            self.issues.push(Issue { severity, kind, object, message });
        }
        self.issues.sort_by_key(|issue| std::cmp::Reverse(issue.severity));
        self.issues
    }
}

#[cfg(test)]
mod tests {
    use super::super::{AlphaMask, Wrap};
    use super::*;

    /// A unit square at height `z` of a material of its own.
    fn add(input: &mut SceneInput, z: f64, opacity: f64, emission: f64, alpha: Alpha) {
        let object = input.objects.len() as u32;
        let name = format!("pane {object}");
        let surface = Surface { reflectance: Rgb::splat(0.5), emission: Rgb::splat(emission), opacity };
        input.objects.push(Object { name: name.clone() });
        input.materials.push(Material { name, surface, two_sided: true, alpha, texture: None });
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| DVec3::new(x, y, z)).to_vec();
        input.faces.push(Face { object, material: object, corners, uv: None, surface: None });
    }

    fn ignored(scene: &Scene) -> Vec<(Severity, &str)> {
        let of = scene.issues.iter().filter(|issue| issue.kind == IssueKind::Ignored);
        of.map(|issue| (issue.severity, issue.object.as_str())).collect()
    }

    /// Catches faces that are not there at all kept as polygons (rays would stop at them, links be spent on them),
    /// taken for an error, or counted into the scene's diameter; and lamps dropped with them.
    #[test]
    fn faces_without_opacity_are_left_out_unless_they_emit() {
        let mask = |solid| AlphaMask { width: 2, height: 1, solid, cutoff: 0.5, wrap: [Wrap::Repeat; 2] };
        let mut input = SceneInput { metres_per_unit: 1.0, ..SceneInput::default() };
        input.masks = vec![mask(vec![false, false]), mask(vec![true, false])];
        add(&mut input, 0.0, 1.0, 0.0, Alpha::Opaque);
        add(&mut input, 1000.0, 0.0, 0.0, Alpha::Attenuate);
        add(&mut input, 2.0, 0.0, 3.0, Alpha::Attenuate);
        add(&mut input, 1000.0, 0.5, 0.0, Alpha::Mask(0));
        add(&mut input, 4.0, 0.5, 0.0, Alpha::Mask(1));
        let scene = Scene::build(input, &BuildOptions::default()).unwrap();
        scene.check().unwrap();
        assert_eq!(scene.fronts, 3);
        let none = Scene::NO_POLYGON;
        assert_eq!(scene.face_polygon, [0, 0, none, none, 1, 1, none, none, 2, 2]);
        assert_eq!(ignored(&scene), [(Severity::Note, "pane 1"), (Severity::Note, "pane 3")]);
        assert!(scene.diameter < 5.0, "{}", scene.diameter);
    }

    /// Catches a scene of nothing but invisible faces built, or a panic on it.
    #[test]
    fn a_scene_without_any_opacity_has_no_surfaces() {
        let mut input = SceneInput { metres_per_unit: 1.0, ..SceneInput::default() };
        add(&mut input, 0.0, 0.0, 0.0, Alpha::Attenuate);
        let error = Scene::build(input, &BuildOptions::default()).unwrap_err();
        assert_eq!(error, SceneError::Empty { dropped: 0, invisible: 1 });
    }
}
