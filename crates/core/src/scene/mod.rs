//! Scenes: what readers hand over ([`SceneInput`]) goes in through one door ([`Scene::build`]), which validates it,
//! joins triangle pairs and splits two-sided surfaces; a [`Scene`] of one-sided polygons comes out, with every
//! [`Issue`] naming its object.

mod build;
mod camera;
mod check;
mod corners;
mod hash;
mod input;
mod issue;
mod lamp;
mod mask;
mod polygon;
mod sky;

pub use build::BuildOptions;
pub use camera::{Camera, Projection};
pub use check::SceneViolation;
pub use corners::Corners;
pub use input::{Alpha, Face, Image, Material, Object, SceneInput, Surface, Texture, Wrap};
pub use issue::{Issue, IssueKind, SceneError, Severity};
pub use lamp::{Lamp, LampShape, Pole, Thrown, Web};
pub use mask::AlphaMask;
pub use polygon::{Plane, Polygon, Side};
pub use sky::{Sky, SkyPattern};

use crate::units::{Rgb, Unit};
use glam::{DVec2, DVec3};

/// A validated scene of one-sided polygons. Lengths are in metres (the input's unit scale applied).
///
/// Built only by [`Scene::build`]; [`Scene::check`] lists its invariants.
#[derive(Clone, Debug)]
pub struct Scene {
    /// One-sided polygons. Every front comes before every back: `polygons[..fronts]` are the surfaces in file order,
    /// the rest are the backs of two-sided ones, each the `twin` of its front.
    pub polygons: Vec<Polygon>,
    /// Number of fronts: surfaces that exist as geometry (what a ray can hit).
    pub fronts: usize,
    /// Fronts that were joined from two triangles each; the other quadrilaterals were given as such.
    pub joined: usize,
    /// Named objects, in file order.
    pub objects: Vec<Object>,
    /// Named materials, in file order.
    pub materials: Vec<Material>,
    /// Images that outputs carry along (encoded bytes, untouched).
    pub images: Vec<Image>,
    /// Cut-out masks that rays look up.
    pub masks: Vec<AlphaMask>,
    /// Cameras of the file, in world coordinates.
    pub cameras: Vec<Camera>,
    /// Lamps without a surface, in file order, metres.
    pub lamps: Vec<Lamp>,
    /// The sky, and the ground below it.
    pub sky: Option<Sky>,
    /// Corners of every input triangle in file order, metres; the row is the face index. A quadrilateral face counts
    /// as two triangles (0,1,2) and (0,2,3).
    pub triangles: Vec<[DVec3; 3]>,
    /// For each row of `triangles`: the front polygon that holds it, or [`Scene::NO_POLYGON`] for dropped
    /// (degenerate) faces.
    pub face_polygon: Vec<u32>,
    /// What was found and done while building, worst first.
    pub issues: Vec<Issue>,
    /// Diagonal of the bounding box of all polygons, metres: the length that every tolerance is relative to.
    pub diameter: f64,
    /// Total area of all fronts, m², see [`Scene::area_of`]: asked for at every element, so it is summed once.
    pub front_area: f64,
    /// What the power of its lights is counted in.
    pub unit: Unit,
    /// SHA-256 over everything that a result depends on or is read by, see [`Scene::compute_hash`]: equal hashes mean
    /// equal results that mean the same.
    pub hash: [u8; 32],
    /// Name of the scene (file stem, or what the caller gave).
    pub name: String,
}

impl Scene {
    /// Marks a face that no polygon holds.
    pub const NO_POLYGON: u32 = u32::MAX;

    /// The one door in: validates `input`, converts it to metres, drops degenerate faces, joins coplanar triangle
    /// pairs to convex quadrilaterals where asked, clamps reflectances, adds backs of two-sided surfaces.
    ///
    /// # Errors
    /// [`SceneError`] where no scene can be made: indices out of range, coordinates not finite, nothing left.
    pub fn build(input: SceneInput, options: &BuildOptions) -> Result<Scene, SceneError> {
        build::build(input, options)
    }

    /// Total power that surfaces emit (all bands), W or lm.
    #[must_use]
    pub fn emitted_power(&self) -> Rgb {
        self.polygons.iter().map(|polygon| polygon.emission * polygon.area).sum()
    }

    /// Total power of the lamps that have no surface, W or lm. Of parallel light, which has no end, nothing is counted.
    #[must_use]
    pub fn lamp_power(&self) -> Rgb {
        self.lamps.iter().filter_map(Lamp::power).sum()
    }

    /// Total area of all fronts, m².
    #[must_use]
    pub fn area(&self) -> f64 {
        self.front_area
    }

    /// The sum of the areas of polygons, m².
    #[must_use]
    pub fn area_of(polygons: &[Polygon]) -> f64 {
        polygons.iter().map(|polygon| polygon.area).sum()
    }

    /// The scale-aware distance below which two points count as touching, metres: rays neither start nor hit closer
    /// than this to either end's plane.
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        self.diameter * RELATIVE_TOLERANCE
    }

    /// Name of the object that holds a polygon.
    #[must_use]
    pub fn object_name(&self, polygon: u32) -> &str {
        &self.objects[self.polygons[polygon as usize].object as usize].name
    }

    /// SHA-256 over the scene as it is now; equals `hash` unless someone changed it.
    ///
    /// It covers what a result depends on: polygons (corners, plane, area, surface values, sides, twins, masks with
    /// their texture coordinates), masks, lamps, the sky, the diameter that tolerances refer to, and the unit of power. And it covers
    /// what a result is read by: input triangles, which polygon holds which of them, objects and materials by name
    /// and value (reports and outputs speak of them), texture coordinates. It does not cover the name of the scene,
    /// which a copied file may change, its cameras, images and findings: they change no value on a surface.
    #[must_use]
    pub fn compute_hash(&self) -> [u8; 32] {
        hash::hash(self)
    }

    /// The hash as 64 lower-case hexadecimal digits.
    #[must_use]
    pub fn hash_text(&self) -> String {
        self.hash.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Position of a point given by face index and barycentric coordinates, metres.
    #[must_use]
    pub fn position(&self, face: u32, barycentric: [f64; 3]) -> DVec3 {
        let [a, b, c] = self.triangles[face as usize];
        a * barycentric[0] + b * barycentric[1] + c * barycentric[2]
    }

    /// Texture coordinates of a point of a polygon, where its object has any.
    #[must_use]
    pub fn texture_coordinates(&self, polygon: u32, position: DVec3) -> Option<DVec2> {
        self.polygons[polygon as usize].texture_coordinates(position)
    }
}

/// Share of the scene's diameter that counts as "the same place": 10 micrometres in a room of 10 m, a hundredth of
/// the 1 mm gap that must be resolved there, and 10^9 times the rounding of f64 coordinates.
pub const RELATIVE_TOLERANCE: f64 = 1e-6;
