//! Irradiance at a point from the links above it: a site and a hierarchy go in, a sum over point-to-polygon factors
//! comes out. Links decide which sources stand for the surroundings; how the receiver sees each is evaluated anew.

use super::interpolate::Site;
use crate::kernels::form_factor::point_factor;
use crate::kernels::visibility::{Sight, point_visibility};
use crate::kernels::{Patch, Probe};
use crate::links::{Evaluator, Hierarchy};
use crate::sampling::mix;
use crate::tree::ElementId;
use crate::units::Rgb;
use glam::DVec3;
use std::f64::consts::PI;

/// How partially visible sources are seen from a site.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shadows {
    /// As the link says: the mean over its receiver.
    OfLinks,
    /// By 16 rays from the site to the source, where the source would throw more than this on it, W/m² or lm/m²: links
    /// to lights, and links that were too small to be refined further. Others have been refined until they carry less.
    OfSites(f64),
}

/// What a site receives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gathered {
    /// Irradiance, W/m² or lm/m².
    pub irradiance: Rgb,
    /// Sum of `F V`: the share of its hemisphere in which it sees linked surfaces.
    pub openness: f64,
}

/// `H = sum_j F(x, j) V_j B_j` over the links of the site's leaf and all its ancestors.
///
/// - F(x, j): closed-form factor from the point to the source, which the horizon clips; its sum over sources that close
///   the surroundings is exactly 1, whatever their sizes
/// - V_j: the link's visibility where that is proven, per open share of its receiver; else as `shadows` says
/// - B_j: radiosity of the source, W/m² or lm/m²
///
/// Source: Lischinski, Tampieri, Greenberg 1993, "Combining hierarchical radiosity and discontinuity meshing" (the
/// local pass: links of the global pass, factors of the point).
pub fn irradiance_at_site<P: Probe>(
    site: &Site,
    evaluator: &Evaluator<'_>,
    hierarchy: &Hierarchy,
    shadows: Shadows,
    probe: &mut P,
) -> Gathered {
    let Hierarchy { elements, links, light } = hierarchy;
    let receiver = elements.patch(site.leaf);
    let (mut sum, mut openness) = (Rgb::ZERO, 0.0);
    let mut at = site.leaf;
    while at != ElementId::NONE {
        let open_share = light.open_share(at);
        for link in links.of(at) {
            let Some(sight) = link.sight() else { continue };
            let radiosity = light.radiosity(link.source);
            if sight == Sight::BLOCKED {
                continue;
            }
            let source = elements.patch(link.source);
            probe.form_factor(1);
            let factor = seen_factor(site.position, receiver.plane.normal, &source);
            if factor <= 0.0 {
                continue;
            }
            let thrown = factor * radiosity.mean() * doubt(sight);
            let visible = if matches!(shadows, Shadows::OfSites(above) if thrown > above) {
                let names = [elements.get(site.leaf).path, elements.get(link.source).path];
                let seed = names.into_iter().fold(evaluator.seed, |seed, name| mix(seed ^ name.to_bits()));
                let seed = site.position.to_array().into_iter().fold(seed, |seed, x| mix(seed ^ x.to_bits()));
                point_visibility(evaluator.bsp, evaluator.scene, site.position, receiver.plane, &source, seed, probe)
            } else if open_share > 0.0 {
                (sight.share / open_share).min(1.0)
            } else {
                sight.share
            };
            openness += factor * visible;
            sum += radiosity * (factor * visible);
        }
        at = elements.get(at).parent;
    }
    Gathered { irradiance: sum, openness }
}

/// How far the visibility from a point may be from its link's: not at all where that is proven, all the way where some rays passed and some did not; where 16 of 16 agreed, four times the `1/18` of the rule of succession
/// (as refinement weighs it).
fn doubt(sight: Sight) -> f64 {
    match sight {
        Sight { proven: true, .. } => 0.0,
        Sight { share, .. } if share <= 0.0 || share >= 1.0 => 4.0 / 18.0,
        _ => 1.0,
    }
}

/// Squared distance in source areas beyond which a source counts as a point: the kernel `cos cos' A/(pi r²)` at the
/// middle is then off by at most about `A/r²`, 0.4 %, either way over a turned or shifted source.
const FAR: f64 = 256.0;

/// Closed-form factor of a source from a point with a unit normal, or the kernel at its middle where it is far and wholly
/// above the horizon.
#[must_use]
pub fn seen_factor(point: DVec3, normal: DVec3, source: &Patch<'_>) -> f64 {
    let towards = source.corners.mean() - point;
    let square = towards.length_squared();
    let (height, drop) = (normal.dot(towards), -source.plane.normal.dot(towards));
    // Half an edge of a patch of moderate shape is below the root of its area.
    let is_clear = height > 0.0 && drop > 0.0 && height * height > source.area && drop * drop > source.area;
    if square > FAR * source.area && is_clear {
        height * drop * source.area / (PI * square * square)
    } else {
        point_factor(point, normal, source)
    }
}

impl Hierarchy {
    /// Gives leaves new irradiances of their open parts, with the radiosities that follow, and pulls both up.
    pub fn relight_leaves(&mut self, scene: &crate::scene::Scene, means: &[(ElementId, Rgb)]) {
        for &(leaf, irradiance) in means {
            let polygon = &scene.polygons[self.elements.get(leaf).polygon as usize];
            self.light.settle(leaf, polygon, irradiance);
        }
        self.light.publish();
        // Children come after their parents.
        for id in (0..self.elements.len() as u32).rev().map(ElementId) {
            self.light.pull(id, &self.elements);
        }
        self.light.publish();
    }
}
