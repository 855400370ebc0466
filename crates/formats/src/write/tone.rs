//! From radiance to what a screen shows: exposure (one factor for a whole scene), tone map (compresses highlights),
//! transfer function (linear to sRGB codes).

use isolux_core::scene::Scene;
use isolux_core::solution::SurfaceMesh;
use isolux_core::units::Rgb;
use std::f64::consts::PI;

/// The value that the average surface is shown with: the "key" of a normal scene in E. Reinhard, M. Stark, P. Shirley,
/// J. Ferwerda, *Photographic tone reproduction for digital images* (2002), section 3.1; 18 % is a grey card.
pub const MIDDLE_GREY: f64 = 0.18;

/// Share of the non-emitting area that [`auto_exposure`] keeps from clipping at 1. Our choice: with 0.98, of a floor
/// with a sunlit patch only the patch clips, while one bright lamp shade does not darken a whole room.
const UNCLIPPED_SHARE: f64 = 0.98;

/// Surfaces darker than this share of the mean radiance do not count as lit, so that unlit backs and closed boxes do
/// not drag the logarithmic average to nothing: 2^-20, more than the 1:10^6 between sunlight and moonlight shadows
/// within one picture, and far above the rounding of a solution.
const LIT_SHARE: f64 = 1.0 / 1_048_576.0;

/// Relative luminance of linear Rec. 709 / sRGB colour: the weights of ITU-R BT.709-6, item 3.2.
#[must_use]
pub fn luminance(colour: Rgb) -> f64 {
    0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]
}

/// The exposure that shows a scene at middle brightness.
///
/// Formula: `min(0.18 / L_log, 1 / L_98)`, where `L = luminance(B) / pi` is the radiance of a triangle (mean of its
/// corners), `L_log = exp(sum(A ln L) / sum(A))` its area-weighted logarithmic mean over lit triangles, and `L_98`
/// the value that 98 % of the lit area stays below.
///
/// Source: the logarithmic mean and the key 0.18 are Reinhard et al. 2002, equations 1 and 2, taken over surfaces
/// instead of pixels so that the answer does not depend on a camera. The second bound is ours.
///
/// Only non-emitting polygons count; where none of them is lit the emitting ones do; where nothing is lit at all the
/// answer is 1. Values that are not finite are left out. Twice the light gives half the exposure; a larger scene
/// gives the same one.
#[must_use]
pub fn auto_exposure(mesh: &SurfaceMesh, scene: &Scene) -> f64 {
    let is_emitter = |polygon: usize| scene.polygons[polygon].emission != Rgb::ZERO;
    exposure_of(&mut samples(mesh, scene, |polygon| !is_emitter(polygon)))
        .or_else(|| exposure_of(&mut samples(mesh, scene, is_emitter)))
        .unwrap_or(1.0)
}

/// Radiance and area of every triangle of the polygons that `takes` takes; those that do not fit the scene are left.
fn samples(mesh: &SurfaceMesh, scene: &Scene, takes: impl Fn(usize) -> bool) -> Vec<(f64, f64)> {
    let mut samples = Vec::new();
    for (polygon, range) in mesh.triangle_start.windows(2).enumerate().take(scene.polygons.len()) {
        if !takes(polygon) {
            continue;
        }
        for triangle in mesh.triangles.get(range[0] as usize..range[1] as usize).unwrap_or_default() {
            let corner = |k: usize| {
                let vertex = triangle[k] as usize;
                Some((*mesh.positions.get(vertex)?, *mesh.radiosity.get(vertex)?))
            };
            if let (Some((a, at_a)), Some((b, at_b)), Some((c, at_c))) = (corner(0), corner(1), corner(2)) {
                let radiance = luminance(at_a + at_b + at_c) / (3.0 * PI);
                let area = 0.5 * (b - a).cross(c - a).length();
                if radiance.is_finite() && radiance > 0.0 && area.is_finite() && area > 0.0 {
                    samples.push((radiance, area));
                }
            }
        }
    }
    samples
}

/// The rule of [`auto_exposure`] on (radiance, area) pairs; `None` where there are none.
fn exposure_of(samples: &mut Vec<(f64, f64)>) -> Option<f64> {
    let total: f64 = samples.iter().map(|(_, area)| area).sum();
    let mean = samples.iter().map(|(radiance, area)| radiance * (area / total)).sum::<f64>();
    samples.retain(|&(radiance, _)| radiance >= LIT_SHARE * mean);
    let lit: f64 = samples.iter().map(|(_, area)| area).sum();
    if samples.is_empty() || mean <= 0.0 || lit <= 0.0 {
        return None;
    }
    // Logarithms relative to the mean: doubling the light then doubles the result without rounding.
    let log_mean = mean * (samples.iter().map(|(l, area)| (l / mean).ln() * area).sum::<f64>() / lit).exp();
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut below = 0.0;
    let bright = samples
        .iter()
        .find(|(_, area)| {
            below += area;
            below >= UNCLIPPED_SHARE * lit
        })
        .or(samples.last())?
        .0;
    let exposure = (MIDDLE_GREY / log_mean).min(1.0 / bright);
    (exposure.is_finite() && exposure > 0.0).then_some(exposure)
}

/// How exposed radiance (1 is white on a plain screen) becomes display light in `[0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToneMap {
    /// Cut off at 1: exact below.
    Clip,
    /// The extended curve of Reinhard et al. 2002, equation 4, on luminance: `L (1 + L / white²) / (1 + L)`; `white` is
    /// the smallest luminance that is shown as white. Hue is kept; bands that end above 1 are cut.
    Reinhard {
        /// The smallest exposed luminance shown as white.
        white: f64,
    },
}

impl Default for ToneMap {
    /// Reinhard with white at 4: two stops of highlights above plain white.
    fn default() -> ToneMap {
        ToneMap::Reinhard { white: 4.0 }
    }
}

impl ToneMap {
    /// Display light in `[0, 1]` of an exposed radiance. Negative and NaN bands come out as 0.
    #[must_use]
    pub fn apply(self, exposed: Rgb) -> Rgb {
        // f64::max takes the number of (NaN, 0).
        let exposed = exposed.map(|band| band.max(0.0));
        let scale = match self {
            ToneMap::Clip => 1.0,
            ToneMap::Reinhard { white } => {
                let l = luminance(exposed);
                (1.0 + l / (white * white)) / (1.0 + l)
            }
        };
        exposed.map(|band| unit(band * scale))
    }
}

/// `value` cut to `[0, 1]`; NaN is 0.
pub(super) fn unit(value: f64) -> f64 {
    if value > 0.0 { value.min(1.0) } else { 0.0 }
}

/// The sRGB transfer function (IEC 61966-2-1:1999): linear light in `[0, 1]` to an encoded value in
/// `[0, 1]`; what lies outside is cut, NaN is 0.
#[must_use]
pub fn srgb_encode(linear: f64) -> f64 {
    let linear = unit(linear);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The nearest 8-bit sRGB code of linear light.
#[must_use]
pub fn srgb8(linear: f64) -> u8 {
    (255.0 * srgb_encode(linear)).round() as u8
}
