//! What a user may ask of a solve; serialised into every result.

use crate::SettingsError;
use isolux_core::scene::Scene;
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

/// How a solve is organised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Schedule {
    /// Flat rounds on all cores over clusters and elements, until the estimated error is the one asked for.
    #[default]
    Wavefront,
    /// The paper's method, one pair of elements after the other.
    Sequential,
}

impl Schedule {
    /// Its name in settings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Schedule::Wavefront => "wavefront",
            Schedule::Sequential => "sequential",
        }
    }

    /// Settings that mean something to this schedule alone.
    fn own_settings(self) -> &'static [&'static str] {
        match self {
            Schedule::Wavefront => &["dark", "max_elements", "min_area", "memory", "time"],
            Schedule::Sequential => &[
                "bf_epsilon",
                "partial_visibility",
                "partial_form_factor",
                "emission_weight",
                "area_epsilon",
                "energy_epsilon",
                "update",
                "form_factor",
                "rays",
                "weighting",
                "covered",
                "order",
                "roots",
                "interpolation",
                "max_iterations",
            ],
        }
    }
}

/// Share of the scene's area below which `wavefront` splits no element: of a room of 100 m² a square of 1 mm.
const MIN_AREA: f64 = 1e-8;

/// The same in scenes with lamps that have no surface, whose shadows have no penumbra: at an edge of sun that is forty times as
/// bright as a room of 100 m², an error of 0.05 asks for squares of 0.3 mm.
const MIN_AREA_OF_LAMPS: f64 = 1e-9;

/// What a user may ask of a solve. Every epsilon is relative, so that a scene may be scaled or dimmed at will.
///
/// Settings that only one schedule has are refused with the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// How the solve is organised.
    pub schedule: Schedule,
    /// Asked relative error of irradiance (RMS over surfaces, relative to the mean); sets the epsilons not given.
    pub error: f64,
    /// `wavefront`: asked error of the darker half of the surfaces, relative to that half's mean.
    pub dark: Option<f64>,
    /// `wavefront`: stop before there are more elements than this.
    pub max_elements: Option<u64>,
    /// `wavefront`: elements below this share of the scene's area are not split; unless given, 1e-8, and 1e-9 in scenes
    /// with lamps that have no surface.
    pub min_area: Option<f64>,
    /// `wavefront`: stop before the solve takes more memory than this, bytes; 4 GiB unless given.
    pub memory: Option<u64>,
    /// `wavefront`: stop after this time, seconds.
    pub time: Option<f64>,
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
    /// Threads (`sequential`: of the interpolation); 0: all cores. Never changes a result.
    pub threads: usize,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            schedule: Schedule::default(),
            error: Quality::Production.error(),
            dark: None,
            max_elements: None,
            min_area: None,
            memory: None,
            time: None,
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
                Err(SettingsError::Value { name, value: value.to_string(), expected: "a number above 0 and at most 1" })
            }
        };
        share("error", self.error)?;
        if !(0.0..=1.0).contains(&self.partial_visibility) {
            let value = self.partial_visibility.to_string();
            return Err(SettingsError::Value { name: "partial_visibility", value, expected: "a number from 0 to 1" });
        }
        for (name, value) in [
            ("dark", self.dark),
            ("min_area", self.min_area),
            ("area_epsilon", self.area_epsilon),
            ("energy_epsilon", self.energy_epsilon),
        ] {
            value.map_or(Ok(()), |value| share(name, value))?;
        }
        for (name, value) in [
            ("bf_epsilon", self.bf_epsilon),
            ("partial_form_factor", Some(self.partial_form_factor)),
            ("emission_weight", Some(self.emission_weight)),
            ("time", self.time),
        ] {
            if let Some(value) = value
                && !(value.is_finite() && value > 0.0)
            {
                return Err(SettingsError::Value { name, value: value.to_string(), expected: "a number above 0" });
            }
        }
        for (name, value) in [
            ("max_iterations", Some(u64::from(self.max_iterations))),
            ("max_elements", self.max_elements),
            ("memory", self.memory),
        ] {
            if value == Some(0) {
                return Err(SettingsError::Value { name, value: "0".into(), expected: "at least 1" });
            }
        }
        self.check_schedule()
    }

    /// What only the other schedule has keeps its default.
    fn check_schedule(&self) -> Result<(), SettingsError> {
        let other = match self.schedule {
            Schedule::Wavefront => Schedule::Sequential,
            Schedule::Sequential => Schedule::Wavefront,
        };
        // Plain data: it always has a JSON form.
        let [given, default] = [self, &Settings::default()].map(|settings| serde_json::json!(settings));
        match other.own_settings().iter().find(|&&name| given[name] != default[name]) {
            Some(&name) => {
                Err(SettingsError::Schedule { name, value: given[name].to_string(), schedule: other.name() })
            }
            None => Ok(()),
        }
    }

    /// Least area of elements that `wavefront` splits in `scene`, share of the scene's.
    #[must_use]
    pub fn least_area(&self, scene: &Scene) -> f64 {
        self.min_area.unwrap_or(if scene.lamps.is_empty() { MIN_AREA } else { MIN_AREA_OF_LAMPS })
    }
}
