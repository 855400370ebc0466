//! The sky, as data: light from all directions above the horizon by a few coefficients, and ground below it that throws back
//! what falls on it.

use super::{Lamp, Scene};
use crate::units::Rgb;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_1_PI, PI};

/// How the radiance of a sky goes with direction, up to a factor: `p(Z, x) = (1 + a exp(b / cos Z) + g cos Z) f(x)` and
/// `f(x) = base + c exp(d x) + e cos² x`, with the angle Z from the zenith and x from the sun, radians; not below 0.
///
/// That is the CIE standard general sky (ISO 15469:2004, CIE S 011/E:2003) with `base = 1 - c exp(d pi / 2)`, and the all-weather
/// model of R. Perez, R. Seals and J. Michalsky (1993) with `base = 1`, both with g = 0. g = 2 and nothing else is the traditional
/// overcast sky of P. Moon and D. Spencer (1942), the sixteenth of the standard.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SkyPattern {
    /// Gradation from horizon to zenith: a, b and g. b is not above 0, so that the horizon has an end.
    pub gradation: [f64; 3],
    /// Indicatrix about the sun: base, c, d and e.
    pub indicatrix: [f64; 4],
}

/// Light from the sky, and the ground below it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sky {
    /// Its name, and that of its light group.
    pub name: String,
    /// Unit vector towards the zenith.
    pub up: DVec3,
    /// Unit vector towards the sun, whose own light is a lamp's ([`super::LampShape::Parallel`]).
    pub sun: DVec3,
    /// How its radiance goes with direction.
    pub pattern: SkyPattern,
    /// Per band: factor on the pattern, W/(m² sr) or cd/m².
    pub radiance: Rgb,
    /// Reflectance of the ground, a diffuse plane far below that sky and sun light and nothing shades. 0: no light from below.
    pub ground: Rgb,
}

/// The coefficients a to e of the fifteen types of ISO 15469:2004, table 1.
const TYPES: [[f64; 5]; 15] = [
    [4.0, -0.70, 0.0, -1.0, 0.0],
    [4.0, -0.70, 2.0, -1.5, 0.15],
    [1.1, -0.8, 0.0, -1.0, 0.0],
    [1.1, -0.8, 2.0, -1.5, 0.15],
    [0.0, -1.0, 0.0, -1.0, 0.0],
    [0.0, -1.0, 2.0, -1.5, 0.15],
    [0.0, -1.0, 5.0, -2.5, 0.30],
    [0.0, -1.0, 10.0, -3.0, 0.45],
    [-1.0, -0.55, 2.0, -1.5, 0.15],
    [-1.0, -0.55, 5.0, -2.5, 0.30],
    [-1.0, -0.55, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 24.0, -2.8, 0.15],
];

/// Rings and turns of [`SkyPattern::horizontal`]: halving both changes the fifteen types and Perez's clear sky by less than 2e-5
/// (`the_integral_has_converged`).
const RINGS: u32 = 256;
const TURNS: u32 = 256;

impl SkyPattern {
    /// The same from everywhere.
    pub const UNIFORM: SkyPattern = SkyPattern { gradation: [0.0, -1.0, 0.0], indicatrix: [1.0, 0.0, -1.0, 0.0] };

    /// That of a general sky by its coefficients a to e.
    #[must_use]
    pub fn general([a, b, c, d, e]: [f64; 5]) -> SkyPattern {
        SkyPattern { gradation: [a, b, 0.0], indicatrix: [1.0 - c * libm::exp(0.5 * PI * d), c, d, e] }
    }

    /// Type 1 (overcast, steep gradation) to 15 (white-blue turbid, broad corona) of the CIE standard general sky, and 16, the
    /// traditional overcast sky; `None` of other numbers. Type 5 is uniform, 12 clear.
    #[must_use]
    pub fn cie(number: usize) -> Option<SkyPattern> {
        if number == 16 {
            return Some(SkyPattern { gradation: [0.0, -1.0, 2.0], ..SkyPattern::UNIFORM });
        }
        TYPES.get(number.checked_sub(1)?).map(|&coefficients| SkyPattern::general(coefficients))
    }

    /// By the cosine of the angle from the zenith, above 0 up to 1, and of that from the sun.
    #[must_use]
    pub fn at(&self, from_zenith: f64, from_sun: f64) -> f64 {
        self.gradation(from_zenith) * self.indicatrix(libm::acos(from_sun.clamp(-1.0, 1.0)))
    }

    /// The part that goes with the cosine of the angle from the zenith, not below 0. At the horizon it is what it comes to there.
    #[must_use]
    pub fn gradation(&self, from_zenith: f64) -> f64 {
        let [a, b, slope] = self.gradation;
        // Without a slope there is nothing to divide by.
        let power = if b == 0.0 { 0.0 } else { b / from_zenith.max(f64::MIN_POSITIVE) };
        (1.0 + a * libm::exp(power) + slope * from_zenith).max(0.0)
    }

    /// The part that goes with the angle from the sun, radians; not below 0.
    #[must_use]
    pub fn indicatrix(&self, angle: f64) -> f64 {
        let [base, c, d, e] = self.indicatrix;
        let cosine = libm::cos(angle);
        (base + c * libm::exp(d * angle) + e * cosine * cosine).max(0.0)
    }

    /// What it throws on a level surface below the whole of it: its integral over the upper half space times the cosine from the
    /// zenith, sr. `sun`: sine of the sun's height.
    #[must_use]
    pub fn horizontal(&self, sun: f64) -> f64 {
        self.integral(sun, RINGS, TURNS)
    }

    fn integral(&self, sun: f64, rings: u32, turns: u32) -> f64 {
        let (low, high) = (libm::sqrt((1.0 - sun * sun).max(0.0)), sun);
        let mut sum = 0.0;
        for ring in 0..rings {
            // The square of the sine, in which light on a level surface is even. Finer towards the horizon, where the
            // gradation bends, and to the zenith: smoothstep.
            let along = |at: f64| at * at * (3.0 - 2.0 * at);
            let ends = [ring, ring + 1].map(|at| along(f64::from(at) / f64::from(rings)));
            let square = along((f64::from(ring) + 0.5) / f64::from(rings));
            let (sine, cosine) = (libm::sqrt(square), libm::sqrt(1.0 - square));
            let mut around = 0.0;
            for turn in 0..turns {
                // Both sides of the sun are alike.
                let angle = PI * (f64::from(turn) + 0.5) / f64::from(turns);
                let to_sun = sine * low * libm::cos(angle) + cosine * high;
                around += self.indicatrix(libm::acos(to_sun.clamp(-1.0, 1.0)));
            }
            sum += (ends[1] - ends[0]) * self.gradation(cosine) * around / f64::from(turns);
        }
        PI * sum
    }
}

impl Sky {
    /// A sky over +Y by the illuminance or irradiance of a level surface that sees all of it, lm/m² or W/m². `sun`: towards the
    /// sun, of unit length.
    #[must_use]
    pub fn by_horizontal(pattern: SkyPattern, sun: DVec3, horizontal: Rgb, ground: Rgb) -> Sky {
        let up = DVec3::Y;
        Sky { name: "sky".into(), up, sun, pattern, radiance: horizontal / pattern.horizontal(sun.dot(up)), ground }
    }

    /// Radiance from a direction (a unit vector away from whoever looks) above the horizon, W/(m² sr) or cd/m²; nothing below.
    #[must_use]
    pub fn radiance_from(&self, direction: DVec3) -> Rgb {
        let height = self.up.dot(direction);
        if height > 0.0 { self.radiance * self.pattern.at(height, self.sun.dot(direction)) } else { Rgb::ZERO }
    }

    /// What it throws on a level surface that sees all of it, lm/m² or W/m².
    #[must_use]
    pub fn horizontal(&self) -> Rgb {
        self.radiance * self.pattern.horizontal(self.sun.dot(self.up))
    }

    /// Radiance of the ground by the sky's light, W/(m² sr) or cd/m².
    #[must_use]
    pub fn ground_by_sky(&self) -> Rgb {
        self.ground * self.horizontal() * FRAC_1_PI
    }

    /// Radiance of the ground by a lamp: parallel light from above alone gets there from afar.
    #[must_use]
    pub fn ground_by_lamp(&self, lamp: &Lamp) -> Rgb {
        let height = if lamp.is_parallel() { -lamp.forward.dot(self.up) } else { 0.0 };
        self.ground * lamp.intensity * (height.max(0.0) * FRAC_1_PI)
    }
}

impl Scene {
    /// Radiance of the ground by all that lights it, W/(m² sr) or cd/m²; nothing without a sky.
    #[must_use]
    pub fn ground_radiance(&self) -> Rgb {
        let Some(sky) = &self.sky else { return Rgb::ZERO };
        sky.ground_by_sky() + self.lamps.iter().map(|lamp| sky.ground_by_lamp(lamp)).sum()
    }

    /// How many things emit that are named by number: polygons first, then lamps, then the sky if there is one.
    #[must_use]
    pub fn emitters(&self) -> usize {
        self.polygons.len() + self.lamps.len() + usize::from(self.sky.is_some())
    }

    /// Does light come from what no ray can meet: a lamp, or the sky?
    #[must_use]
    pub fn has_remote_light(&self) -> bool {
        !self.lamps.is_empty() || self.sky.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches a wrong measure.
    #[test]
    fn a_uniform_sky_throws_pi() {
        assert!((SkyPattern::UNIFORM.horizontal(0.3) / PI - 1.0).abs() < 1e-12);
        // (1 + 2 cos Z) / 3: 7 pi / 9, horizon 1.
        assert!((SkyPattern::cie(16).unwrap().horizontal(0.5) / (7.0 / 3.0 * PI) - 1.0).abs() < 1e-5);
        assert!((SkyPattern::cie(5).unwrap().horizontal(1.0) / PI - 1.0).abs() < 1e-12);
    }

    /// Perez's clear sky, the steepest about its sun: see `python/isolux/sky.py`.
    fn clear() -> SkyPattern {
        SkyPattern { gradation: [-1.0, -0.21, 0.0], indicatrix: [1.0, 18.0, -4.5, 0.6] }
    }

    /// Catches too few terms.
    #[test]
    fn the_integral_has_converged() {
        for pattern in (1..=16).filter_map(SkyPattern::cie).chain([clear()]) {
            for sun in [0.05, 0.5, 0.9, 1.0] {
                let (coarse, fine) = (pattern.integral(sun, RINGS, TURNS), pattern.integral(sun, 4 * RINGS, 4 * TURNS));
                assert!((coarse / fine - 1.0).abs() < 2e-5, "{pattern:?} {sun}: {coarse} {fine}");
            }
        }
    }

    /// Catches a table that is off by one and a mistyped base: type 1 has a horizon of a third of its zenith, all types an
    /// indicatrix of 1 at 90 degrees from the sun but for its cosine, which is 0 there.
    #[test]
    fn types_are_those_of_the_standard() {
        let overcast = SkyPattern::cie(1).unwrap();
        let horizon = overcast.at(1e-9, 0.0) / overcast.at(1.0, 0.0);
        assert!((horizon - 1.0 / (1.0 + 4.0 * (-0.7_f64).exp())).abs() < 1e-12, "{horizon}");
        for number in 1..=15 {
            let pattern = SkyPattern::cie(number).unwrap();
            assert!((pattern.indicatrix(0.5 * PI) - 1.0).abs() < 1e-12, "{number}");
            assert!((pattern.gradation(0.0) - 1.0).abs() < 1e-12, "{number}");
        }
        assert_eq!((SkyPattern::cie(0), SkyPattern::cie(17)), (None, None));
        assert_eq!(SkyPattern::cie(5).map(|five| five.at(0.3, 0.7)), Some(1.0));
    }
}
