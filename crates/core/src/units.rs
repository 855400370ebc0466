//! The quantities that the whole system shares: colour triples of linear RGB, and what their numbers mean.
//!
//! Radiosity `B`, irradiance `H` and emission `E` are powers per area per band, in lm/m² or W/m² as the scene's [`Unit`]
//! says; reflectance `rho` is a share in `[0, 1)`. Areas are in the square of the scene's length unit.

use serde::{Deserialize, Serialize};
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Index, IndexMut, Mul, Sub};

/// What the power in a scene is counted in. Nothing is ever converted: it says how numbers are to be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Unit {
    /// Light, in lumens: lm/m² on surfaces, cd/m² towards the eye. What glTF means.
    #[default]
    #[serde(rename = "lm")]
    Photometric,
    /// Radiant power, in watts: W/m² on surfaces, W/(m² sr) towards the eye.
    #[serde(rename = "W")]
    Radiometric,
}

impl Unit {
    /// Unit of power.
    #[must_use]
    pub fn power(self) -> &'static str {
        match self {
            Unit::Photometric => "lm",
            Unit::Radiometric => "W",
        }
    }

    /// The unit of power of that name (`lm`, `W`).
    #[must_use]
    pub fn from_power(name: &str) -> Option<Unit> {
        [Unit::Photometric, Unit::Radiometric].into_iter().find(|unit| unit.power() == name)
    }

    /// Unit of irradiance and radiosity, in ASCII.
    #[must_use]
    pub fn per_area(self) -> &'static str {
        match self {
            Unit::Photometric => "lm/m2",
            Unit::Radiometric => "W/m2",
        }
    }

    /// Unit of radiance (what pictures hold), in ASCII.
    #[must_use]
    pub fn radiance(self) -> &'static str {
        match self {
            Unit::Photometric => "cd/m2",
            Unit::Radiometric => "W/(m2 sr)",
        }
    }
}

/// One value per band: linear red, green, blue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
#[repr(transparent)]
pub struct Rgb(pub [f64; 3]);

impl Rgb {
    /// No light.
    pub const ZERO: Rgb = Rgb([0.0; 3]);
    /// One in every band.
    pub const ONE: Rgb = Rgb([1.0; 3]);

    /// The same value in every band.
    #[must_use]
    pub const fn splat(value: f64) -> Rgb {
        Rgb([value; 3])
    }

    /// Mean over the three bands: the scalar that oracle and convergence test look at.
    #[must_use]
    pub fn mean(self) -> f64 {
        (self.0[0] + self.0[1] + self.0[2]) / 3.0
    }

    /// Largest of the three bands.
    #[must_use]
    pub fn max_component(self) -> f64 {
        self.0[0].max(self.0[1]).max(self.0[2])
    }

    /// Smallest of the three bands.
    #[must_use]
    pub fn min_component(self) -> f64 {
        self.0[0].min(self.0[1]).min(self.0[2])
    }

    /// True when no band is NaN or infinite.
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.0.iter().all(|value| value.is_finite())
    }

    /// Applies `f` to each band.
    #[must_use]
    pub fn map(self, f: impl FnMut(f64) -> f64) -> Rgb {
        Rgb(self.0.map(f))
    }
}

impl From<[f64; 3]> for Rgb {
    fn from(value: [f64; 3]) -> Rgb {
        Rgb(value)
    }
}

impl Add for Rgb {
    type Output = Rgb;
    fn add(self, other: Rgb) -> Rgb {
        Rgb([self.0[0] + other.0[0], self.0[1] + other.0[1], self.0[2] + other.0[2]])
    }
}

impl AddAssign for Rgb {
    fn add_assign(&mut self, other: Rgb) {
        *self = *self + other;
    }
}

impl Sub for Rgb {
    type Output = Rgb;
    fn sub(self, other: Rgb) -> Rgb {
        Rgb([self.0[0] - other.0[0], self.0[1] - other.0[1], self.0[2] - other.0[2]])
    }
}

/// Band by band.
impl Mul for Rgb {
    type Output = Rgb;
    fn mul(self, other: Rgb) -> Rgb {
        Rgb([self.0[0] * other.0[0], self.0[1] * other.0[1], self.0[2] * other.0[2]])
    }
}

impl Mul<f64> for Rgb {
    type Output = Rgb;
    fn mul(self, factor: f64) -> Rgb {
        Rgb([self.0[0] * factor, self.0[1] * factor, self.0[2] * factor])
    }
}

impl Div<f64> for Rgb {
    type Output = Rgb;
    fn div(self, divisor: f64) -> Rgb {
        Rgb([self.0[0] / divisor, self.0[1] / divisor, self.0[2] / divisor])
    }
}

impl Sum for Rgb {
    fn sum<I: Iterator<Item = Rgb>>(iter: I) -> Rgb {
        iter.fold(Rgb::ZERO, Add::add)
    }
}

impl Index<usize> for Rgb {
    type Output = f64;
    fn index(&self, band: usize) -> &f64 {
        &self.0[band]
    }
}

impl IndexMut<usize> for Rgb {
    fn index_mut(&mut self, band: usize) -> &mut f64 {
        &mut self.0[band]
    }
}
