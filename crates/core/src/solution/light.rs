//! Radiosity and irradiance of every element, and how they travel up and down the quadtrees.

use super::sums::tree_sum;
use super::values::{Values, pulled, settled};
use crate::scene::{Polygon, Scene};
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
    /// Share that nothing covers.
    open_share: Vec<f64>,
}

impl Light {
    /// Starts from emission: `B = E`, `H = 0`. `open_share`: the share of each element that nothing covers.
    #[must_use]
    pub fn emitted(scene: &Scene, elements: &Elements, open_share: Vec<f64>, update: Update) -> Light {
        let radiosity: Vec<Rgb> =
            elements.as_slice().iter().map(|element| scene.polygons[element.polygon as usize].emission).collect();
        let next = if update == Update::Jacobi { radiosity.clone() } else { Vec::new() };
        let irradiance = vec![Rgb::ZERO; radiosity.len()];
        Light { update, next, irradiance, radiosity, open_share }
    }

    /// From stored values, one per element.
    #[must_use]
    pub fn from_values(radiosity: Vec<Rgb>, irradiance: Vec<Rgb>, open_share: Vec<f64>) -> Light {
        Light { update: Update::InPlace, radiosity, next: Vec::new(), irradiance, open_share }
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

    /// Share of the element that nothing covers, in `[0, 1]`.
    #[must_use]
    pub fn open_share(&self, id: ElementId) -> f64 {
        self.open_share[id.index()]
    }

    /// All open shares, by element.
    #[must_use]
    pub fn open_shares(&self) -> &[f64] {
        &self.open_share
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

    /// Takes in the four children that were appended to the elements when `parent`, of a polygon with this emission, was
    /// split: they have open shares of their own, and what is open of them has the light of what was open of the parent.
    pub fn adopt(&mut self, parent: ElementId, emission: Rgb, open_share: [f64; 4]) {
        let (whole, irradiance) = (self.open_share[parent.index()], self.irradiance[parent.index()]);
        self.irradiance.extend(open_share.map(|share| match share {
            _ if share == whole => irradiance,
            _ if whole > 0.0 => irradiance * (share / whole),
            _ => Rgb::ZERO,
        }));
        self.open_share.extend(open_share);
        for values in [&mut self.radiosity, &mut self.next] {
            if let Some(&value) = values.get(parent.index()) {
                values.extend(open_share.map(|share| if share > 0.0 { value } else { emission }));
            }
        }
    }

    /// The open part of a leaf of `polygon` receives `open` on average, W/m² or lm/m²: `B = E + rho open`, and
    /// `H = s open` with the open share s. Where nothing is open, nothing arrives.
    pub fn settle(&mut self, id: ElementId, polygon: &Polygon, open: Rgb) {
        let values = settled(polygon.emission, polygon.reflectance, open, self.open_share[id.index()]);
        self.set(id, values);
    }

    fn set(&mut self, id: ElementId, values: Values) {
        self.open_share[id.index()] = values.open_share;
        self.irradiance[id.index()] = values.irradiance;
        self.fresh()[id.index()] = values.radiosity;
    }

    /// Pulls the means of the children up into their parent: irradiance and open share weighted by area (D17), radiosity by
    /// open area. Equal children give exactly their value.
    pub fn pull(&mut self, parent: ElementId, elements: &Elements) {
        let Some(first) = elements.get(parent).first_child.some() else { return };
        let children = [0, 1, 2, 3].map(|k| first.index() + k);
        let areas = children.map(|child| elements.as_slice()[child].area);
        let values = children.map(|child| Values {
            radiosity: self.fresh()[child],
            irradiance: self.irradiance[child],
            open_share: self.open_share[child],
        });
        self.set(parent, pulled(values, areas, elements.get(parent).area));
    }

    /// Ends an iteration: what was computed in it is now seen by all.
    pub fn publish(&mut self) {
        if self.update == Update::Jacobi {
            self.radiosity.clone_from(&self.next);
        }
    }

    /// Sum of open area times radiosity over the roots, W or lm: all that leaves; by [`tree_sum`] over the roots in
    /// order.
    #[must_use]
    pub fn total(&self, elements: &Elements) -> Rgb {
        let roots = (0..elements.roots() as u32).map(ElementId);
        let leaving = |root| self.radiosity(root) * (elements.get(root).area * self.open_share(root));
        tree_sum(&roots.map(leaving).collect::<Vec<Rgb>>(), Rgb::ZERO)
    }

    fn fresh(&mut self) -> &mut Vec<Rgb> {
        match self.update {
            Update::Jacobi => &mut self.next,
            Update::InPlace => &mut self.radiosity,
        }
    }

    /// Checks the invariants of a finished solution: one finite, not negative value per element; open shares in `[0, 1]`;
    /// leaves fulfil `B = E + rho H / s` with the open share s (and are dark where that is 0); parents have the means of their children,
    /// weighted by area or, their radiosities, by open area; all to rounding.
    ///
    /// # Errors
    /// The first violation.
    pub fn check(&self, scene: &Scene, elements: &Elements) -> Result<(), LightViolation> {
        let lengths = [self.radiosity.len(), self.irradiance.len(), self.open_share.len()];
        if lengths.iter().any(|&length| length != elements.len()) {
            return Err(LightViolation { element: ElementId::NONE, what: "one value per element" });
        }
        for id in (0..elements.len() as u32).map(ElementId) {
            let fail = |what| Err(LightViolation { element: id, what });
            let (radiosity, irradiance, open_share) = (self.radiosity(id), self.irradiance(id), self.open_share(id));
            if !(radiosity.is_finite() && irradiance.is_finite())
                || radiosity.min_component().min(irradiance.min_component()) < 0.0
            {
                return fail("values are finite and not negative");
            }
            // Means of four areas that add up to 1e-9, see `Elements::check`.
            if !(0.0..=1.0 + 1e-9).contains(&open_share) {
                return fail("open shares lie between 0 and 1");
            }
            let (expected, what) = if elements.is_leaf(id) {
                let polygon = &scene.polygons[elements.get(id).polygon as usize];
                if open_share == 0.0 && irradiance != Rgb::ZERO {
                    return fail("no light falls on a covered leaf");
                }
                let open = if open_share > 0.0 { irradiance / open_share } else { Rgb::ZERO };
                (polygon.emission + polygon.reflectance * open, "leaves fulfil B = E + rho H / s")
            } else {
                let weight = |child| elements.get(child).area * self.open_share(child);
                let weights: f64 = elements.children(id).map(weight).sum();
                let sum: Rgb = elements.children(id).map(|child| self.radiosity(child) * weight(child)).sum();
                let mean = if weights > 0.0 { sum / weights } else { radiosity };
                (mean, "parents are the mean of their children")
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
