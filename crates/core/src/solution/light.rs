//! Radiosity and irradiance of every element, and how they travel up and down the quadtrees.

use crate::scene::Scene;
use crate::tree::{ElementId, Elements};
use crate::units::Rgb;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// When a new radiosity is seen by others (D16).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Update {
    /// At the end of the iteration.
    Jacobi,
    /// At once (as in Gauss-Seidel).
    #[default]
    InPlace,
}

/// Light by element. What others read is the radiosity; in Jacobi's update new values wait until the iteration ends.
#[derive(Clone, Debug)]
pub struct Light {
    update: Update,
    radiosity: Vec<Rgb>,
    /// Values of this iteration; empty when updated in place.
    next: Vec<Rgb>,
    irradiance: Vec<Rgb>,
}

impl Light {
    /// Starts from emission: `B = E`, `H = 0`.
    #[must_use]
    pub fn emitted(scene: &Scene, elements: &Elements, update: Update) -> Light {
        let radiosity: Vec<Rgb> =
            elements.as_slice().iter().map(|element| scene.polygons[element.polygon as usize].emission).collect();
        let next = if update == Update::Jacobi { radiosity.clone() } else { Vec::new() };
        Light { update, next, irradiance: vec![Rgb::ZERO; radiosity.len()], radiosity }
    }

    /// From stored values, one per element.
    #[must_use]
    pub fn from_values(radiosity: Vec<Rgb>, irradiance: Vec<Rgb>) -> Light {
        Light { update: Update::InPlace, radiosity, next: Vec::new(), irradiance }
    }

    /// Radiosity that others see, W/m² or lm/m².
    #[must_use]
    pub fn radiosity(&self, id: ElementId) -> Rgb {
        self.radiosity[id.index()]
    }

    /// Irradiance of the last visit, W/m² or lm/m²; of an inner element the area-weighted mean of its children's.
    #[must_use]
    pub fn irradiance(&self, id: ElementId) -> Rgb {
        self.irradiance[id.index()]
    }

    /// All radiosities, by element.
    #[must_use]
    pub fn radiosities(&self) -> &[Rgb] {
        &self.radiosity
    }

    /// All irradiances, by element.
    #[must_use]
    pub fn irradiances(&self) -> &[Rgb] {
        &self.irradiance
    }

    /// Takes in the four children that were appended to the elements when `parent` was split: they have its values.
    pub fn adopt(&mut self, parent: ElementId) {
        for values in [&mut self.radiosity, &mut self.irradiance, &mut self.next] {
            if let Some(&value) = values.get(parent.index()) {
                values.extend([value; 4]);
            }
        }
    }

    /// A leaf has gathered `irradiance`.
    pub fn set(&mut self, id: ElementId, irradiance: Rgb, radiosity: Rgb) {
        self.irradiance[id.index()] = irradiance;
        self.fresh()[id.index()] = radiosity;
    }

    /// Pulls the area-weighted means (D17) of the children up into their parent. Equal children give exactly their value.
    pub fn pull(&mut self, parent: ElementId, elements: &Elements) {
        let area = elements.get(parent).area;
        let Some(first) = elements.get(parent).first_child.some() else { return };
        let mean = |values: &[Rgb]| {
            let base = values[first.index()];
            elements
                .children(parent)
                .fold(base, |sum, child| sum + (values[child.index()] - base) * (elements.get(child).area / area))
        };
        let irradiance = mean(&self.irradiance);
        let radiosity = mean(self.fresh());
        self.irradiance[parent.index()] = irradiance;
        self.fresh()[parent.index()] = radiosity;
    }

    /// Ends an iteration: what was computed in it is now seen by all.
    pub fn publish(&mut self) {
        if self.update == Update::Jacobi {
            self.radiosity.clone_from(&self.next);
        }
    }

    /// Sum of area times radiosity over the roots, W or lm.
    #[must_use]
    pub fn total(&self, elements: &Elements) -> Rgb {
        (0..elements.roots() as u32).map(ElementId).map(|root| self.radiosity(root) * elements.get(root).area).sum()
    }

    fn fresh(&mut self) -> &mut Vec<Rgb> {
        match self.update {
            Update::Jacobi => &mut self.next,
            Update::InPlace => &mut self.radiosity,
        }
    }

    /// Checks the invariants of a finished solution: one finite, not negative value per element; leaves fulfil
    /// `B = E + rho H` and parents are the area-weighted means of their children, to rounding.
    ///
    /// # Errors
    /// The first violation.
    pub fn check(&self, scene: &Scene, elements: &Elements) -> Result<(), LightViolation> {
        if self.radiosity.len() != elements.len() || self.irradiance.len() != elements.len() {
            return Err(LightViolation { element: ElementId::NONE, what: "one value per element" });
        }
        for id in (0..elements.len() as u32).map(ElementId) {
            let fail = |what| Err(LightViolation { element: id, what });
            let (radiosity, irradiance) = (self.radiosity(id), self.irradiance(id));
            if !(radiosity.is_finite() && irradiance.is_finite())
                || radiosity.min_component().min(irradiance.min_component()) < 0.0
            {
                return fail("values are finite and not negative");
            }
            let (expected, what) = if elements.is_leaf(id) {
                let polygon = &scene.polygons[elements.get(id).polygon as usize];
                (polygon.emission + polygon.reflectance * irradiance, "leaves fulfil B = E + rho H")
            } else {
                let area = elements.get(id).area;
                let sum: Rgb =
                    elements.children(id).map(|child| self.radiosity(child) * elements.get(child).area).sum();
                (sum / area, "parents are the mean of their children")
            };
            // Sums of five terms and areas that add up to 1e-9, see `Elements::check`.
            if (0..3).any(|band| (expected[band] - radiosity[band]).abs() > 2e-9 * radiosity[band].abs()) {
                return fail(what);
            }
        }
        Ok(())
    }
}

/// A broken invariant of a solution.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("element {}: violated: {what}", element.0)]
pub struct LightViolation {
    /// Where.
    pub element: ElementId,
    /// Which invariant.
    pub what: &'static str,
}
