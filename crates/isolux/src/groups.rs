//! Light groups: a scene comes in, what emits in it, polygons, lamps and the sky, comes out as named sets, as lighting people dim
//! them.

use isolux_core::scene::{Lamp, Scene, Sky};
use isolux_core::units::Rgb;
use isolux_wavefront::NO_GROUP;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Most groups that are kept apart. Each costs a column of fields, 60 bytes a leaf: 32 of them take as much as a few
/// million links.
pub const MOST_GROUPS: usize = 32;

/// Name of the group that holds all emitters where there are too many to be kept apart.
pub const ALL: &str = "all lights";

/// What groups are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GroupedBy {
    /// One group for each name of an emitting object or a lamp.
    Object,
    /// One for each emitting material, and each name of a lamp: more than [`MOST_GROUPS`] objects and lamps emit.
    Material,
    /// One for everything: there are more than that many materials and lamps, too.
    All,
}

/// A set of emitting polygons and lamps, and the sky.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightGroup {
    /// Its name, unique within a scene.
    pub name: String,
    /// One-sided polygons that emit.
    pub polygons: u64,
    /// Their area, m².
    pub area: f64,
    /// Emitted power per band, W or lm; of parallel light, which has no end, nothing is counted.
    pub power: Rgb,
    /// Lamps without a surface.
    #[serde(default)]
    pub lamps: u64,
    /// Is the sky in it? Of its light, which has no end, no power is counted.
    #[serde(default)]
    pub sky: bool,
}

/// The light groups of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LightGroups {
    /// What they are made of.
    pub by: GroupedBy,
    /// The groups, in the order in which their first polygons come, then their first lamps, then the sky.
    pub groups: Vec<LightGroup>,
    /// By polygon, then by lamp, then the sky's if there is one: its row of `groups`, or [`NO_GROUP`] where it emits nothing.
    pub of: Vec<u32>,
}

/// Groups what emits in `scene`: by the names of objects and lamps (a lamp and an object of one name are dimmed together),
/// where these are too many by materials and names of lamps, where these are too many, too, all in one.
#[must_use]
pub fn light_groups(scene: &Scene) -> LightGroups {
    let by_object = grouped(scene, |polygon| scene.object_name(polygon), |lamp| &lamp.name, |sky| &sky.name);
    if by_object.groups.len() <= MOST_GROUPS {
        return LightGroups { by: GroupedBy::Object, ..by_object };
    }
    let material = |polygon: u32| scene.materials[scene.polygons[polygon as usize].material as usize].name.as_str();
    let by_material = grouped(scene, material, |lamp| &lamp.name, |sky| &sky.name);
    if by_material.groups.len() <= MOST_GROUPS {
        return LightGroups { by: GroupedBy::Material, ..by_material };
    }
    grouped(scene, |_| ALL, |_| ALL, |_| ALL)
}

/// Groups by names of polygons, of lamps and of the sky.
fn grouped<'a>(
    scene: &'a Scene,
    name_of: impl Fn(u32) -> &'a str,
    name_of_lamp: impl Fn(&'a Lamp) -> &'a str,
    name_of_sky: impl Fn(&'a Sky) -> &'a str,
) -> LightGroups {
    let mut rows: HashMap<&'a str, u32> = HashMap::new();
    let of = vec![NO_GROUP; scene.emitters()];
    let mut found = LightGroups { by: GroupedBy::All, groups: Vec::new(), of };
    let mut row_of = |name: &'a str, groups: &mut Vec<LightGroup>| {
        let row = *rows.entry(name).or_insert(groups.len() as u32);
        if row as usize == groups.len() {
            groups.push(LightGroup {
                name: name.to_owned(),
                polygons: 0,
                area: 0.0,
                power: Rgb::ZERO,
                lamps: 0,
                sky: false,
            });
        }
        row
    };
    for (index, polygon) in scene.polygons.iter().enumerate().filter(|(_, polygon)| polygon.emission != Rgb::ZERO) {
        let row = row_of(name_of(index as u32), &mut found.groups);
        let group = &mut found.groups[row as usize];
        group.polygons += 1;
        group.area += polygon.area;
        group.power += polygon.emission * polygon.area;
        found.of[index] = row;
    }
    for (index, lamp) in scene.lamps.iter().enumerate() {
        let row = row_of(name_of_lamp(lamp), &mut found.groups);
        let group = &mut found.groups[row as usize];
        group.lamps += 1;
        group.power += lamp.power().unwrap_or(Rgb::ZERO);
        found.of[scene.polygons.len() + index] = row;
    }
    if let Some(sky) = &scene.sky {
        let row = row_of(name_of_sky(sky), &mut found.groups);
        found.groups[row as usize].sky = true;
        found.of[scene.polygons.len() + scene.lamps.len()] = row;
    }
    found
}
