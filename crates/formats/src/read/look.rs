//! What a material looks like, whichever format it comes from: factors and textures come in, the [`Surface`] of each
//! face goes out, averaged in linear space.
//!
//! With `c` the coverage (1, the mean alpha, or the solid share), `rho` the mean base colour of what is covered, `t`
//! the transmission, all over one face: what passes is `1 - c + c t m`, with `m` the mean of `rho` over the bands (a
//! tint passes as grey); what is reflected is `c (1 - t) rho`. So `opacity = c (1 - t m)`, and the reflectance of the
//! opaque part is `(1 - t) rho / (1 - t m)`; the rest, `c t (1 - m)` and more, is absorbed. Emission is multiplied by
//! `c`. Means of products are taken as products of means (vertex colour times texture, transmission times colour).

use super::texture::{Bank, Grid, Rule};
use glam::DVec2;
use isolux_core::scene::{Alpha, Surface, Wrap};
use isolux_core::units::Rgb;
use std::rc::Rc;

/// Use of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Map {
    /// Number of the image in the [`Bank`].
    pub(super) image: usize,
    /// Number of the set of texture coordinates.
    pub(super) set: u32,
    /// Applied to the coordinates before the lookup.
    pub(super) transform: UvTransform,
    /// Repetition along u and v.
    pub(super) wrap: [Wrap; 2],
}

/// An affine map of texture coordinates: `column_u * u + column_v * v + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct UvTransform {
    pub(super) column_u: DVec2,
    pub(super) column_v: DVec2,
    pub(super) offset: DVec2,
}

impl UvTransform {
    pub(super) const IDENTITY: UvTransform =
        UvTransform { column_u: DVec2::X, column_v: DVec2::Y, offset: DVec2::ZERO };

    pub(super) fn apply(&self, uv: DVec2) -> DVec2 {
        self.column_u * uv.x + self.column_v * uv.y + self.offset
    }
}

/// How much of a surface is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Coverage {
    /// All of it, whatever alpha says.
    Opaque,
    /// Where alpha is at least the cutoff.
    Mask(f64),
    /// As much as alpha says.
    Blend,
    /// As much as the factor on alpha says; a texture's alpha is not looked at.
    Factor,
}

/// A material before its textures are loaded.
#[derive(Clone, Debug)]
pub(super) struct Look {
    /// Linear base colour factor.
    pub(super) base: Rgb,
    /// Factor on alpha.
    pub(super) alpha: f64,
    pub(super) base_map: Option<Map>,
    pub(super) coverage: Coverage,
    /// Emitted radiosity, before the texture.
    pub(super) emission: Rgb,
    pub(super) emission_map: Option<Map>,
    pub(super) transmission: f64,
    pub(super) transmission_map: Option<Map>,
}

/// A material with its textures at hand.
pub(super) struct Loaded {
    pub(super) look: Look,
    pub(super) base: Option<(Map, Rc<Grid>)>,
    pub(super) emission: Option<(Map, Rc<Grid>)>,
    pub(super) transmission: Option<(Map, Rc<Grid>)>,
}

impl Look {
    /// How the base-colour texture is read.
    pub(super) fn base_rule(&self) -> Rule {
        match self.coverage {
            Coverage::Opaque | Coverage::Factor => Rule::Colour,
            Coverage::Blend => Rule::Blend,
            Coverage::Mask(cutoff) => {
                let solid = |alpha: &u16| f64::from(*alpha) / 255.0 * self.alpha >= cutoff;
                Rule::Mask { least: (0..=255).find(solid).unwrap_or(256) }
            }
        }
    }

    /// Least alpha of the base-colour texture that is there: the cutoff without the factor on alpha.
    pub(super) fn texture_cutoff(&self) -> f64 {
        match self.coverage {
            // A cutoff of 0 leaves everything, a factor of 0 nothing else.
            Coverage::Mask(cutoff) if cutoff > 0.0 => (cutoff / self.alpha.max(0.0)).min(f64::from(f32::MAX)),
            _ => 0.0,
        }
    }

    /// Loads the textures; `missing` is told of each that cannot be had, and the factor alone counts.
    pub(super) fn load(&self, bank: &mut Bank<'_>, mut missing: impl FnMut(&str, &str, String)) -> Loaded {
        let mut load = |map: Option<Map>, rule: Rule, what: &str| {
            let map = map?;
            match bank.grid(map.image, rule) {
                Ok(grid) => Some((map, grid)),
                Err(reason) => {
                    missing(what, bank.name(map.image), reason);
                    None
                }
            }
        };
        Loaded {
            base: load(self.base_map, self.base_rule(), "base-colour"),
            emission: load(self.emission_map, Rule::Colour, "emissive"),
            transmission: load(self.transmission_map, Rule::Linear, "transmission"),
            look: self.clone(),
        }
    }
}

impl Loaded {
    /// Do all faces look the same, vertex colours apart?
    pub(super) fn is_uniform(&self) -> bool {
        self.base.is_none() && self.emission.is_none() && self.transmission.is_none()
    }

    /// How rays treat it; `file_mask` is asked for the number of the base-colour texture's mask.
    pub(super) fn alpha(&self, file_mask: impl FnOnce(&Map, &Grid) -> u32) -> Alpha {
        match (self.look.coverage, &self.base) {
            (Coverage::Mask(_), Some((map, grid))) => Alpha::Mask(file_mask(map, grid)),
            // Without a texture a face is there or not: its opacity says so.
            (Coverage::Mask(cutoff), None) if self.look.alpha < cutoff => Alpha::Attenuate,
            (Coverage::Blend, _) => Alpha::Attenuate,
            (Coverage::Factor, _) if self.look.alpha < 1.0 => Alpha::Attenuate,
            _ if self.look.transmission > 0.0 => Alpha::Attenuate,
            _ => Alpha::Opaque,
        }
    }

    /// The surface of a face: `uv` gives its corners in a set of texture coordinates (`None`: it has none, and the
    /// mean of the whole texture stands in), `colour` is its mean vertex colour and alpha.
    pub(super) fn surface(&self, uv: impl Fn(u32) -> Option<[DVec2; 3]>, colour: Option<[f64; 4]>) -> Surface {
        let look = &self.look;
        let mean = |texture: &Option<(Map, Rc<Grid>)>| {
            texture.as_ref().map(|(map, grid)| match uv(map.set) {
                Some(corners) => grid.mean_over(corners.map(|corner| map.transform.apply(corner)), map.wrap),
                None => grid.mean(),
            })
        };
        let vertex = colour.unwrap_or([1.0; 4]);
        let mut base = look.base * Rgb([vertex[0], vertex[1], vertex[2]]);
        let mut weight = None;
        if let Some([r, g, b, w]) = mean(&self.base) {
            // Weighted colour over weight: what the covered part looks like.
            base = if w > 0.0 { base * (Rgb([r, g, b]) / w) } else { Rgb::ZERO };
            weight = Some(w);
        }
        let coverage = match look.coverage {
            Coverage::Opaque => 1.0,
            Coverage::Blend => weight.unwrap_or(1.0) * look.alpha * vertex[3],
            Coverage::Factor => look.alpha,
            Coverage::Mask(cutoff) => weight.unwrap_or(if look.alpha >= cutoff { 1.0 } else { 0.0 }),
        }
        .clamp(0.0, 1.0);
        let transmission = look.transmission * mean(&self.transmission).map_or(1.0, |[r, ..]| r);
        let passing = (transmission * base.mean()).clamp(0.0, 1.0);
        let opaque = 1.0 - passing;
        let reflectance = if opaque > 0.0 { base * ((1.0 - transmission) / opaque) } else { Rgb::ZERO };
        let emission = mean(&self.emission).map_or(look.emission, |[r, g, b, _]| look.emission * Rgb([r, g, b]));
        Surface { reflectance, emission: emission * coverage, opacity: coverage * opaque }
    }
}
