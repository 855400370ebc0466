//! A solved scene, and what it answers; how it came about is left to the schedules.

use crate::wavefront::Transported;
use crate::{Array, Record, RecordError, RenderError, Report, smooth};
use isolux_core::DVec3;
use isolux_core::links::Hierarchy;
use isolux_core::scene::Scene;
use isolux_core::solution::{Observer, SmoothSurfaces, SurfaceMesh, Unobserved};
use isolux_core::tree::Bsp;
use isolux_core::units::Rgb;
use isolux_wavefront::{Control, Tracer};
use std::sync::{Arc, OnceLock};

/// A solved scene.
#[derive(Debug)]
pub struct Solution {
    pub(crate) scene: Arc<Scene>,
    /// Made when it is first asked for, where the solve did without.
    pub(crate) bsp: OnceLock<Bsp>,
    /// What finds what a ray meets; made when it is first asked for.
    pub(crate) tracer: OnceLock<Tracer>,
    pub(crate) hierarchy: Hierarchy,
    pub(crate) active: Vec<bool>,
    /// Made when first asked for, likewise.
    pub(crate) surfaces: OnceLock<SmoothSurfaces>,
    /// Irradiance by vertex of the restricted mesh: what `surfaces` is made from. Empty in a solve that was cancelled
    /// before it had any: means of the leaves around stand in. Empty with `wavefront`, whose fields stand in.
    pub(crate) vertex_irradiance: Vec<Rgb>,
    /// What `wavefront` leaves behind beyond elements and light.
    pub(crate) transport: Option<Transported>,
    pub(crate) report: Report,
}

impl Solution {
    /// The scene that was solved.
    #[must_use]
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// What the solve told of itself.
    #[must_use]
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Elements, links and light.
    #[must_use]
    pub fn hierarchy(&self) -> &Hierarchy {
        &self.hierarchy
    }

    /// Fields, links and clusters of a `wavefront` solve. The hierarchy's own links are those of `sequential`.
    #[must_use]
    pub fn transport(&self) -> Option<&Transported> {
        self.transport.as_ref()
    }

    /// The BSP tree of its polygons: what the rays of a `sequential` solve walked. After a `wavefront` solve nothing but this
    /// call makes one, which takes long for large scenes.
    #[must_use]
    pub fn bsp(&self) -> &Bsp {
        self.bsp.get_or_init(|| Bsp::build(&self.scene, self.report.settings.order))
    }

    /// Was the BSP tree made? Not by a `wavefront` solve, nor by what is asked of its solution.
    #[must_use]
    pub fn has_bsp(&self) -> bool {
        self.bsp.get().is_some()
    }

    /// What finds what rays meet: what pictures look through.
    #[must_use]
    pub fn tracer(&self) -> &Tracer {
        self.tracer.get_or_init(|| Tracer::new(self.scene.clone()))
    }

    /// Smooth values at the vertices of a restricted mesh.
    #[must_use]
    pub fn mesh(&self) -> &SurfaceMesh {
        self.surfaces().mesh()
    }

    /// Smooth values at any point.
    pub(crate) fn surfaces(&self) -> &SmoothSurfaces {
        self.surfaces.get_or_init(|| {
            let scene = &*self.scene;
            // An observer that never says stop lets everything through.
            let made = match &self.transport {
                Some(transport) => {
                    let Hierarchy { elements, light, .. } = &self.hierarchy;
                    smooth::blend(scene, self.tracer(), elements, light, &transport.fields)
                }
                None => smooth::average(scene, self.bsp(), &self.hierarchy, &mut Unobserved).map(|(_, made)| made),
            };
            made.unwrap_or_default()
        })
    }

    /// Makes what pictures need, where it is not there yet: with a final gather, values at points alone.
    pub(crate) fn prepare(&self, gather: bool) {
        let _ = self.tracer();
        if !gather || self.transport.is_none() {
            let _ = self.surfaces();
        }
    }

    /// Irradiance at a point of a polygon, front or back, W/m² or lm/m²: of fields where there are some.
    pub(crate) fn solved(&self, polygon: u32, point: DVec3) -> Rgb {
        match &self.transport {
            Some(Transported { fields, .. }) => {
                let normal = self.scene.polygons[polygon as usize].plane.normal;
                isolux_wavefront::irradiance_at(&self.hierarchy.elements, fields, polygon, normal, point)
            }
            None => self.surfaces().irradiance(&self.scene, polygon, point),
        }
    }

    /// [`Solution::mesh`] with irradiances that rays find at its vertices, in place of what was solved there: `rays` around
    /// each, half as many to emitters. Not kept. `threads`: 0 stands for all cores; never changes a result.
    ///
    /// # Errors
    /// [`RenderError`] for no rays or more than make sense, and when the observer stops it.
    pub fn gathered_mesh(
        &self,
        rays: u32,
        threads: usize,
        observer: &mut dyn Observer,
    ) -> Result<SurfaceMesh, RenderError> {
        crate::render::check_rays(Some(rays))?;
        self.prepare(true);
        let Hierarchy { elements, light, .. } = &self.hierarchy;
        let gathering = smooth::Gathering {
            scene: &self.scene,
            tracer: self.tracer(),
            elements,
            light,
            active: &self.active,
            rays,
            seed: self.report.settings.seed,
            threads,
        };
        let made = gathering.surfaces(&|polygon, point| self.solved(polygon, point), observer)?;
        Ok(made.into_mesh())
    }

    /// Irradiance of the front at a point of an input face, W/m² or lm/m²; `None` where no such face exists or where
    /// it was dropped for want of area.
    #[must_use]
    pub fn irradiance_at(&self, face: u32, barycentric: [f64; 3]) -> Option<Rgb> {
        let &polygon = self.scene.face_polygon.get(face as usize)?;
        let point = self.scene.position(face, barycentric);
        (polygon != Scene::NO_POLYGON).then(|| self.solved(polygon, point))
    }

    /// Radiosity `E + rho H` of the front at a point of an input face, W/m² or lm/m²; `None` as above.
    #[must_use]
    pub fn radiosity_at(&self, face: u32, barycentric: [f64; 3]) -> Option<Rgb> {
        let irradiance = self.irradiance_at(face, barycentric)?;
        let polygon = &self.scene.polygons[self.scene.face_polygon[face as usize] as usize];
        Some(polygon.emission + polygon.reflectance * irradiance)
    }

    /// Checks every invariant of scene, elements, links and light, and of the BSP tree where the solve needed one.
    ///
    /// # Errors
    /// One line that names the first violation.
    pub fn check(&self) -> Result<(), String> {
        self.scene.check().map_err(|violation| violation.to_string())?;
        let Hierarchy { elements, links, light } = &self.hierarchy;
        elements.check().map_err(|violation| violation.to_string())?;
        if let Some(transport) = &self.transport {
            return transport.check(&self.scene, elements, light).map_err(|violation| violation.to_string());
        }
        self.bsp().check(&self.scene).map_err(|violation| violation.to_string())?;
        links.check(elements, &self.scene).map_err(|violation| violation.to_string())?;
        light.check(&self.scene, elements).map_err(|violation| violation.to_string())
    }

    /// Everything as named arrays, light by groups included. `elements/*`, `links/*` and, with `wavefront`, `clusters/*` are
    /// what Python shows as views; `scene/*` is the scene after validation.
    #[must_use]
    pub fn to_record(&self) -> Record {
        self.to_record_until(&Control::default()).unwrap_or_else(|| unreachable!("nobody says stop"))
    }

    /// The same until `control` says stop, for the light by groups may have to be made first; none then.
    #[must_use]
    pub fn to_record_until(&self, control: &Control) -> Option<Record> {
        let columns = self.kept_columns(control).ok()?;
        Some(crate::record::write(self, columns.as_deref()))
    }

    /// The same without the light by groups, which may have to be made first: what can be looked at right away.
    #[must_use]
    pub fn arrays(&self) -> Vec<Array> {
        crate::record::write(self, None).arrays
    }

    /// The scene's part of [`Solution::to_record`]'s arrays (`scene/*`): polygons, input faces, images, masks.
    #[must_use]
    pub fn scene_arrays(&self) -> Vec<Array> {
        crate::record::scene_arrays(self)
    }

    /// A solution back from its arrays.
    ///
    /// # Errors
    /// [`RecordError`] naming the array that is missing or wrong.
    pub fn from_record(record: Record) -> Result<Solution, RecordError> {
        crate::record::read(record)
    }
}
