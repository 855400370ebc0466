//! What a user may ask of a solve; serialised into every result.

use crate::SettingsError;
use isolux_core::solution::{Interpolation, Roots, Update};
use serde::{Deserialize, Serialize};

/// Named errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quality {
    /// 0.2
    Draft,
    /// 0.1
    Preview,
    /// 0.05
    Production,
    /// 0.02
    Final,
}

impl Quality {
    /// The error that the name stands for.
    #[must_use]
    pub fn error(self) -> f64 {
        match self {
            Quality::Draft => 0.2,
            Quality::Preview => 0.1,
            Quality::Production => 0.05,
            Quality::Final => 0.02,
        }
    }
}

/// What a user may ask of a solve. Every epsilon is relative, so that a scene may be scaled or dimmed at will.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Asked relative error of irradiance (RMS over surfaces, relative to the mean); sets the epsilons not given.
    pub error: f64,
    /// Links carry at most this share of the scene's mean irradiance (the paper's `BF_eps`).
    pub bf_epsilon: Option<f64>,
    /// What counts for a visibility that is only sampled, and below 1; 0, the paper's rule, stands for the sample.
    pub partial_visibility: f64,
    /// Links that see each other partly are refined down to this form factor, however dim; 1 is the paper's rule.
    pub partial_form_factor: f64,
    /// A source's emission counts this many times what it reflects, where all of it is visible; 1 is the paper's rule.
    pub emission_weight: f64,
    /// Elements below this share of the scene's area are not split (the paper's `A_eps`).
    pub area_epsilon: Option<f64>,
    /// Stop when the total radiosity changes by less than this share in an iteration (the paper's `epsilon`).
    pub energy_epsilon: Option<f64>,
    /// When a new radiosity is seen by others.
    pub update: Update,
    /// Form factor kernel.
    pub form_factor: crate::core::kernels::form_factor::FormFactor,
    /// Rays per visibility: 16 or 256.
    pub rays: crate::core::kernels::visibility::Rays,
    /// What each ray counts for.
    pub weighting: crate::core::kernels::visibility::Weighting,
    /// What becomes of parts of elements that something covers.
    pub covered: crate::core::kernels::visibility::Covered,
    /// Order of insertion in the BSP tree.
    pub order: crate::core::tree::InsertionOrder,
    /// What the roots of the quadtrees are.
    pub roots: Roots,
    /// How vertices get their values.
    pub interpolation: Interpolation,
    /// Seed of every pseudo-random choice.
    pub seed: u64,
    /// Iterations after which the solve gives up (status `iteration-limit`).
    pub max_iterations: u32,
    /// Threads of the interpolation; 0: all cores. Never changes a result.
    pub threads: usize,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            error: Quality::Production.error(),
            bf_epsilon: None,
            partial_visibility: 0.5,
            partial_form_factor: 0.02,
            emission_weight: 0.1,
            area_epsilon: None,
            energy_epsilon: None,
            update: Update::default(),
            form_factor: Default::default(),
            rays: Default::default(),
            weighting: Default::default(),
            covered: Default::default(),
            order: Default::default(),
            roots: Roots::default(),
            interpolation: Interpolation::default(),
            seed: 0,
            max_iterations: 100,
            threads: 0,
        }
    }
}

impl Settings {
    /// Checks every value.
    ///
    /// # Errors
    /// [`SettingsError`] naming the first setting that makes no sense.
    pub fn validate(&self) -> Result<(), SettingsError> {
        let share = |name, value: f64| {
            if value.is_finite() && value > 0.0 && value <= 1.0 {
                Ok(())
            } else {
                Err(SettingsError { name, value: value.to_string(), expected: "a number above 0 and at most 1" })
            }
        };
        share("error", self.error)?;
        if !(0.0..=1.0).contains(&self.partial_visibility) {
            let value = self.partial_visibility.to_string();
            return Err(SettingsError { name: "partial_visibility", value, expected: "a number from 0 to 1" });
        }
        for (name, value) in [("area_epsilon", self.area_epsilon), ("energy_epsilon", self.energy_epsilon)] {
            value.map_or(Ok(()), |value| share(name, value))?;
        }
        for (name, value) in [
            ("bf_epsilon", self.bf_epsilon),
            ("partial_form_factor", Some(self.partial_form_factor)),
            ("emission_weight", Some(self.emission_weight)),
        ] {
            if let Some(value) = value
                && !(value.is_finite() && value > 0.0)
            {
                return Err(SettingsError { name, value: value.to_string(), expected: "a number above 0" });
            }
        }
        if self.max_iterations == 0 {
            return Err(SettingsError { name: "max_iterations", value: "0".into(), expected: "at least 1" });
        }
        Ok(())
    }
}
