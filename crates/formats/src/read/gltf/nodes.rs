//! The node hierarchy: transforms are multiplied out, and instances of meshes, cameras and lights come out in
//! depth-first document order.

use super::container::Document;
use super::profiles::{self, Profiles};
use crate::read::error::{ReadError, brief, clean};
use crate::read::names::Names;
use crate::read::{LightUnits, ReadOptions, issue};
use glam::{DMat3, DMat4, DQuat, DVec3};
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};
use gltf::json::validation::Checked;
use gltf::json::{self, Index, Node, Root, Value};
use isolux_core::scene::{Camera, Issue, IssueKind, Lamp, LampShape, Projection, Severity};
use isolux_core::units::{Rgb, Unit};

/// A mesh as a node shows it.
pub(super) struct Instance {
    /// Name of the object, unique.
    pub(super) object: String,
    /// Number of the mesh.
    pub(super) mesh: usize,
    /// From mesh to world.
    pub(super) world: DMat4,
}

/// Where a lamp is, and which way it is turned.
pub(super) struct Place {
    pub(super) position: DVec3,
    /// Unit vector along -z of the node.
    pub(super) forward: DVec3,
    /// Along x of the node.
    pub(super) side: DVec3,
    /// Whether the node turns what it holds into its mirror image.
    pub(super) mirrored: bool,
}

impl Place {
    /// Of a node; `None` where it has no direction. Scale has no meaning for a lamp.
    fn of(world: &DMat4) -> Option<Place> {
        Some(Place {
            position: world.w_axis.truncate(),
            forward: (-world.z_axis.truncate()).try_normalize()?,
            side: world.x_axis.truncate(),
            mirrored: is_mirrored(world),
        })
    }
}

/// What the nodes of a scene amount to.
#[derive(Default)]
pub(super) struct Walk {
    pub(super) instances: Vec<Instance>,
    pub(super) cameras: Vec<Camera>,
    pub(super) lamps: Vec<Lamp>,
    pub(super) issues: Vec<Issue>,
    profiles: Profiles,
}

/// Walks the default scene (else the first; else all nodes that are nobody's child).
pub(super) fn walk(document: &Document<'_>, options: &ReadOptions) -> Result<Walk, ReadError> {
    let root = document.root();
    let mut walk = Walk::default();
    let roots: Vec<Index<Node>> = match (root.scene, root.scenes.first()) {
        (Some(index), _) => entry(document, || "the file".to_owned(), "scene", index)?.nodes.clone(),
        (None, Some(first)) => first.nodes.clone(),
        (None, None) => {
            let mut is_child = vec![false; root.nodes.len()];
            for child in root.nodes.iter().filter_map(|node| node.children.as_ref()).flatten() {
                if let Some(flag) = is_child.get_mut(child.value()) {
                    *flag = true;
                }
            }
            (0..root.nodes.len()).filter(|&index| !is_child[index]).map(|index| Index::new(index as u32)).collect()
        }
    };
    if root.scenes.len() > 1 {
        let others = root.scenes.len() - 1;
        let message = format!("{others} of {} scenes in the file are not read, only the default one", others + 1);
        walk.issues.push(issue(Severity::Note, IssueKind::Ignored, &document.file, message));
    }

    let (mut objects, mut cameras, mut lamps) = (Names::default(), Names::default(), Names::default());
    let mut visited = vec![false; root.nodes.len()];
    let mut repeated: Vec<usize> = Vec::new();
    // Depth-first with a stack of its own: a chain of a million nodes must not end the program's.
    let mut stack: Vec<(Index<Node>, DMat4)> = roots.iter().rev().map(|&index| (index, DMat4::IDENTITY)).collect();
    while let Some((index, parent)) = stack.pop() {
        let node = entry(document, || "the node hierarchy".to_owned(), "node", index)?;
        let index = index.value();
        if std::mem::replace(&mut visited[index], true) {
            repeated.push(index);
            continue;
        }
        let world = parent * local(node);
        stack.extend(node.children.iter().flatten().rev().map(|&child| (child, world)));
        if let Some(mesh) = node.mesh {
            walk.mesh(document, index, mesh, world, &mut objects)?;
        }
        if let Some(camera) = node.camera {
            walk.camera(document, index, camera, world, &mut cameras)?;
        }
        let extensions = node.extensions.as_ref();
        let profile = extensions.and_then(|extensions| extensions.others.get(profiles::NAME));
        let light = extensions.and_then(|extensions| extensions.khr_lights_punctual.as_ref());
        match (profile, light) {
            (Some(profile), light) => {
                walk.luminaire(document, index, profile, light.is_some(), &world, options.unit, &mut lamps)?;
            }
            (None, Some(light)) => walk.lamp(document, index, light.light, &world, options.light_units, &mut lamps)?,
            (None, None) => {}
        }
    }
    if let Some(&first) = repeated.first() {
        let message = format!(
            "nodes are reached on more than one way (a cycle, or two parents) {} times, first {}: each counts once",
            repeated.len(),
            node_name(root, first)
        );
        walk.issues.push(issue(Severity::Warning, IssueKind::Ignored, &document.file, message));
    }
    Ok(walk)
}

impl Walk {
    fn mesh(
        &mut self,
        document: &Document<'_>,
        index: usize,
        mesh: Index<json::Mesh>,
        world: DMat4,
        names: &mut Names,
    ) -> Result<(), ReadError> {
        let root = document.root();
        let node = &root.nodes[index];
        let data = entry(document, || node_name(root, index), "mesh", mesh)?;
        let label = [&node.name, &data.name].into_iter().flatten().find(|name| !clean(name).is_empty());
        let object = names.unique(label.map(String::as_str), || format!("node {index}"));
        let mut ignored = |severity, what: &str| {
            self.issues.push(issue(severity, IssueKind::Ignored, &object, what));
        };
        if node.skin.is_some() {
            ignored(Severity::Note, "the skin is ignored: the mesh stands as it was modelled");
        }
        if data.primitives.iter().any(|primitive| primitive.targets.is_some()) {
            ignored(Severity::Note, "morph targets are ignored: the mesh stands as it was modelled");
        }
        let extensions = node.extensions.as_ref().map(|extensions| &extensions.others);
        if extensions.is_some_and(|others| others.contains_key("EXT_mesh_gpu_instancing")) {
            ignored(Severity::Warning, "EXT_mesh_gpu_instancing is ignored: one instance stands for all");
        }
        self.instances.push(Instance { object, mesh: mesh.value(), world });
        Ok(())
    }

    fn camera(
        &mut self,
        document: &Document<'_>,
        index: usize,
        camera: Index<json::Camera>,
        world: DMat4,
        names: &mut Names,
    ) -> Result<(), ReadError> {
        let root = document.root();
        let data = entry(document, || node_name(root, index), "camera", camera)?;
        let label = [&root.nodes[index].name, &data.name].into_iter().flatten().find(|name| !clean(name).is_empty());
        let name = names.unique(label.map(String::as_str), || format!("camera {camera}"));
        let projection = match (&data.perspective, &data.orthographic) {
            (Some(perspective), _) => Some(Projection::Perspective { vertical_angle: perspective.yfov.into() }),
            (None, Some(orthographic)) => Some(Projection::Orthographic { height: 2.0 * f64::from(orthographic.ymag) }),
            (None, None) => None,
        };
        // A camera looks along -z, y up; scale has no meaning for it.
        let forward = (-world.z_axis.truncate()).try_normalize();
        let up = forward.and_then(|forward| world.y_axis.truncate().reject_from_normalized(forward).try_normalize());
        match (projection, forward, up) {
            (Some(projection), Some(forward), Some(up)) => {
                self.cameras.push(Camera { name, eye: world.w_axis.truncate(), forward, up, projection });
            }
            _ => {
                let message = "the camera is ignored: it has no projection, or no direction";
                self.issues.push(issue(Severity::Warning, IssueKind::Ignored, &name, message));
            }
        }
        Ok(())
    }

    fn lamp(
        &mut self,
        document: &Document<'_>,
        index: usize,
        light: Index<Light>,
        world: &DMat4,
        units: LightUnits,
        names: &mut Names,
    ) -> Result<(), ReadError> {
        let root = document.root();
        let data = entry(document, || node_name(root, index), "light", light)?;
        let label = [&root.nodes[index].name, &data.name].into_iter().flatten().find(|name| !clean(name).is_empty());
        let name = names.unique(label.map(String::as_str), || format!("light {light}"));
        let shape = match (&data.type_, &data.spot) {
            (Checked::Valid(Type::Directional), _) => Some(LampShape::Parallel),
            (Checked::Valid(Type::Point), _) => Some(LampShape::Point),
            (Checked::Valid(Type::Spot), spot) => {
                let (inner, outer) = spot.as_ref().map_or((0.0, SPOT_ANGLE), |spot| {
                    (f64::from(spot.inner_cone_angle), f64::from(spot.outer_cone_angle))
                });
                // A cone without a rim, as files have it, is one with the least.
                let inner = if inner == outer { inner * (1.0 - LEAST_RIM) } else { inner };
                Some(LampShape::Spot { inner, outer })
            }
            (Checked::Invalid, _) => None,
        };
        let (Some(shape), Some(Place { position, forward, side, .. })) = (shape, Place::of(world)) else {
            let message =
                "the light is ignored: its type is none of directional, point and spot, or it has no direction";
            self.issues.push(issue(Severity::Warning, IssueKind::Ignored, &name, message));
            return Ok(());
        };
        if data.range.is_some() {
            let message = "the light's range is ignored: light falls off with the square of the distance, without end";
            self.issues.push(issue(Severity::Note, IssueKind::Ignored, &name, message));
        }
        let factor = f64::from(data.intensity) * units.factor(shape == LampShape::Parallel);
        let intensity = Rgb(data.color.map(f64::from)) * factor;
        self.lamps.push(Lamp { name, position, forward, side, intensity, shape });
        Ok(())
    }

    /// A lamp with a light profile; `has_other` tells whether its node has a light of `KHR_lights_punctual`, too.
    #[expect(clippy::too_many_arguments, reason = "what a node's entry needs of the walk")]
    fn luminaire(
        &mut self,
        document: &Document<'_>,
        index: usize,
        extension: &Value,
        has_other: bool,
        world: &DMat4,
        unit: Unit,
        names: &mut Names,
    ) -> Result<(), ReadError> {
        let root = document.root();
        let label = [root.nodes[index].name.as_deref(), Profiles::label(document, extension)];
        let label = label.into_iter().flatten().find(|name| !clean(name).is_empty());
        let name = names.unique(label, || format!("light of node {index}"));
        if has_other {
            let message =
                "its light of KHR_lights_punctual is left out: it stands in for the light profile where none is read";
            self.issues.push(issue(Severity::Warning, IssueKind::Ignored, &name, message));
        }
        let Some(place) = Place::of(world) else {
            let message = "the light profile is ignored: its node has no direction";
            self.issues.push(issue(Severity::Warning, IssueKind::Ignored, &name, message));
            return Ok(());
        };
        let owner = || node_name(root, index);
        let (lamp, found) = self.profiles.lamp(document, extension, owner, (name, place), unit)?;
        self.lamps.push(lamp);
        self.issues.extend(found);
        Ok(())
    }
}

/// Angle of a cone of which a file says nothing, radians.
const SPOT_ANGLE: f64 = std::f64::consts::FRAC_PI_4;

/// Least share of a cone's angle that its rim takes.
const LEAST_RIM: f64 = 1e-3;

/// Transform of a node to its parent.
fn local(node: &Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |q| {
        let quaternion = DQuat::from_array(q.0.map(f64::from));
        // Rounded to f32, or zero in a hostile file.
        let length = quaternion.length();
        if length > 0.0 && length.is_finite() { quaternion / length } else { DQuat::IDENTITY }
    });
    let vector =
        |value: Option<[f32; 3]>, default: f32| DVec3::from_array(value.unwrap_or([default; 3]).map(f64::from));
    DMat4::from_scale_rotation_translation(vector(node.scale, 1.0), rotation, vector(node.translation, 0.0))
}

/// Does a transform turn triangles inside out?
pub(super) fn is_mirrored(world: &DMat4) -> bool {
    DMat3::from_mat4(*world).determinant() < 0.0
}

fn node_name(root: &Root, index: usize) -> String {
    match &root.nodes[index].name {
        Some(name) => format!("node '{}'", brief(name)),
        None => format!("node {index}"),
    }
}

/// An entry of one of the file's tables; `owner` names it.
pub(super) fn entry<'a, T>(
    document: &'a Document<'_>,
    owner: impl FnOnce() -> String,
    what: &'static str,
    index: Index<T>,
) -> Result<&'a T, ReadError>
where
    Root: AsRef<[T]>,
{
    let table: &[T] = document.root().as_ref();
    table.get(index.value()).ok_or_else(|| reference(document, owner(), what, index.value(), table.len()))
}

/// The error for an index past a table's end.
pub(super) fn reference(
    document: &Document<'_>,
    owner: String,
    what: &'static str,
    index: usize,
    count: usize,
) -> ReadError {
    ReadError::Reference { file: document.file.clone(), owner, what, index, count }
}
