//! What every result file says about its origin: version, scene, settings, units; formats only differ in how they
//! store the same list of entries.

use isolux_core::scene::Scene;
use isolux_core::units::Unit;

/// Where a result comes from. All of it lands in every file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance {
    /// Version of isolux.
    pub version: String,
    /// Name of the scene.
    pub scene: String,
    /// SHA-256 of the scene, 64 hexadecimal digits.
    pub scene_hash: String,
    /// Settings of the solution, as JSON text.
    pub settings: String,
    /// Seed of all random choices.
    pub seed: u64,
    /// Schedule that ordered the work.
    pub schedule: String,
    /// Machine that did the work.
    pub machine: String,
    /// What the numbers mean.
    pub unit: Unit,
}

impl Provenance {
    /// A provenance of this version and that scene, its unit included; settings `{}`, no schedule or machine yet.
    #[must_use]
    pub fn of(scene: &Scene) -> Provenance {
        Provenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene.name.clone(),
            scene_hash: scene.hash_text(),
            settings: "{}".to_owned(),
            unit: scene.unit,
            ..Provenance::default()
        }
    }

    /// Program and version, as generator fields want it.
    pub(super) fn generator(&self) -> String {
        format!("isolux {}", self.version)
    }

    /// Keys (the same in every format) and values, in a fixed order. `exposure` is that of the file, where it has one.
    pub(super) fn entries(&self, exposure: Option<f64>) -> Vec<(&'static str, String)> {
        let mut entries = vec![
            ("version", self.version.clone()),
            ("scene", self.scene.clone()),
            ("sceneHash", self.scene_hash.clone()),
            ("unit", self.unit.per_area().to_owned()),
            ("radianceUnit", self.unit.radiance().to_owned()),
            ("settings", self.settings.clone()),
            ("seed", self.seed.to_string()),
            ("schedule", self.schedule.clone()),
            ("machine", self.machine.clone()),
        ];
        if let Some(exposure) = exposure {
            entries.push(("exposure", exposure.to_string()));
        }
        entries
    }

    /// The entries as a JSON object: exposure and seed as numbers, the rest as text.
    pub(super) fn json(&self, exposure: Option<f64>) -> serde_json::Map<String, serde_json::Value> {
        self.entries(exposure)
            .into_iter()
            .map(|(key, text)| {
                let value = match key {
                    "exposure" => exposure.into(),
                    "seed" => self.seed.into(),
                    _ => text.into(),
                };
                (key.to_owned(), value)
            })
            .collect()
    }
}
