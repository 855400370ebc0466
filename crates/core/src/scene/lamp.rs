//! Lamps without a surface: points, spots, parallel light and luminaires with a measured distribution, as data, and what
//! each throws on a point of a surface that nothing stands before.

use crate::units::Rgb;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A lamp that no ray can meet. It throws light in directions about its place, or along one direction everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lamp {
    /// Name, unique among lamps; it is that of its light group, too.
    pub name: String,
    /// Where it is, metres. Parallel light comes from no place.
    pub position: DVec3,
    /// Unit vector along which it shines: the axis of a cone, the way of parallel light, where a luminaire points.
    pub forward: DVec3,
    /// Unit vector orthogonal to `forward`: how a luminaire is turned about it, see [`Pole`].
    pub side: DVec3,
    /// Per band: luminous or radiant intensity, cd or W/sr; of parallel light irradiance on a surface that faces it, lm/m² or
    /// W/m²; of a luminaire a factor on its distribution.
    pub intensity: Rgb,
    /// How it throws light.
    pub shape: LampShape,
}

/// How a lamp throws its light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LampShape {
    /// The same in all directions.
    Point,
    /// In a cone, as glTF's `KHR_lights_punctual` has it: all of it within `inner`, nothing beyond `outer`, in between by the
    /// square of a function that is linear in the cosine.
    Spot {
        /// Angle from the axis, radians.
        inner: f64,
        /// Angle from the axis, radians; above `inner`, at most π/2.
        outer: f64,
    },
    /// Parallel light from far away: the sun.
    Parallel,
    /// As measured.
    Web(Web),
}

/// A measured distribution of intensity: a table over directions about an axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Web {
    /// Angles from the pole, degrees, ascending, within 0 and 180; beyond them nothing is thrown.
    pub polar: Vec<f64>,
    /// Angles about the pole, degrees, ascending from 0 to 360, first and last included. A single one: the same all
    /// around.
    pub around: Vec<f64>,
    /// Candela or W/sr: for each angle about the pole one row of values by polar angle.
    pub intensity: Vec<f64>,
    /// What the angles are measured from.
    #[serde(default)]
    pub pole: Pole,
}

/// What the angles of a table are measured from, in the frame of its lamp: `forward`, `side`, and `forward × side`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pole {
    /// Polar angles from `forward`, angles about it from `side` towards `forward × side`. Type C of photometric files.
    #[default]
    Forward,
    /// Polar angles from `forward × side`, angles about it from `forward` towards `side`. Type B.
    Across,
    /// Polar angles from `-side`, angles about it from `forward` towards `forward × side`. Type A.
    Aside,
}

/// What a lamp throws on a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thrown {
    /// Unit vector from the point towards the lamp.
    pub towards: DVec3,
    /// Distance of the lamp, metres; infinite for parallel light.
    pub distance: f64,
    /// Irradiance of a surface that faces it, W/m² or lm/m².
    pub facing: Rgb,
}

impl Lamp {
    /// What it throws on a point where nothing stands between; `None` where that is nothing.
    #[must_use]
    pub fn thrown_on(&self, point: DVec3) -> Option<Thrown> {
        if let LampShape::Parallel = self.shape {
            let thrown = Thrown { towards: -self.forward, distance: f64::INFINITY, facing: self.intensity };
            return (self.intensity != Rgb::ZERO).then_some(thrown);
        }
        let from = point - self.position;
        let square = from.length_squared();
        let distance = square.sqrt();
        if distance == 0.0 {
            return None;
        }
        let direction = from / distance;
        let share = self.share(direction);
        let facing = self.intensity * (share / square);
        (facing != Rgb::ZERO).then_some(Thrown { towards: -direction, distance, facing })
    }

    /// Intensity along a unit vector that leads away from it, as a factor on [`Lamp::intensity`].
    #[must_use]
    pub fn share(&self, direction: DVec3) -> f64 {
        let cosine = self.forward.dot(direction).clamp(-1.0, 1.0);
        match &self.shape {
            LampShape::Point | LampShape::Parallel => 1.0,
            LampShape::Spot { inner, outer } => {
                let (inner, outer) = (inner.cos(), outer.cos());
                let within = ((cosine - outer) / (inner - outer).max(LEAST_PENUMBRA)).clamp(0.0, 1.0);
                within * within
            }
            LampShape::Web(web) => {
                let other = self.forward.cross(self.side);
                let (pole, zero, next) = match web.pole {
                    Pole::Forward => (self.forward, self.side, other),
                    Pole::Across => (other, self.forward, self.side),
                    Pole::Aside => (-self.side, self.forward, other),
                };
                let around = direction.dot(next).atan2(direction.dot(zero)).to_degrees().rem_euclid(360.0);
                web.at(direction.dot(pole).clamp(-1.0, 1.0).acos().to_degrees(), around)
            }
        }
    }

    /// All that it throws, W or lm; `None` for parallel light, which has no end.
    #[must_use]
    pub fn power(&self) -> Option<Rgb> {
        let factor = match &self.shape {
            LampShape::Point => 4.0 * PI,
            LampShape::Spot { inner, outer } => {
                // In cosines c the square of a linear function from 0 to 1, and 1 beyond.
                let (inner, outer) = (inner.cos(), outer.cos());
                2.0 * PI * ((inner - outer).max(0.0) / 3.0 + 1.0 - inner)
            }
            LampShape::Parallel => return None,
            LampShape::Web(web) => web.power(),
        };
        Some(self.intensity * factor)
    }

    /// Does it come from everywhere along one direction?
    #[must_use]
    pub fn is_parallel(&self) -> bool {
        matches!(self.shape, LampShape::Parallel)
    }
}

/// Least difference between the cosines of both angles of a cone, as `KHR_lights_punctual` has it.
const LEAST_PENUMBRA: f64 = 1e-3;

impl Web {
    /// Intensity at a polar angle and an angle about the axis, degrees; linear between the table's angles.
    #[must_use]
    pub fn at(&self, polar: f64, around: f64) -> f64 {
        let Some((low, share)) = bracket(&self.polar, polar) else { return 0.0 };
        let rows = self.polar.len();
        let row = |column: usize| {
            let values = &self.intensity[column * rows..(column + 1) * rows];
            values[low] + share * (values[(low + 1).min(rows - 1)] - values[low])
        };
        match bracket(&self.around, around) {
            Some((column, turn)) if self.around.len() > 1 => {
                let (one, other) = (row(column), row((column + 1).min(self.around.len() - 1)));
                one + turn * (other - one)
            }
            _ => row(0),
        }
    }

    /// All that it throws, W or lm: the exact integral of what [`Web::at`] interpolates.
    #[must_use]
    pub fn power(&self) -> f64 {
        let columns: Vec<f64> = self.intensity.chunks(self.polar.len().max(1)).map(|row| self.row_power(row)).collect();
        if columns.len() == 1 {
            return 2.0 * PI * columns[0];
        }
        let turns = self.around.windows(2).map(|pair| (pair[1] - pair[0]).to_radians());
        turns.zip(columns.windows(2)).map(|(turn, pair)| 0.5 * turn * (pair[0] + pair[1])).sum()
    }

    /// Integral of one row's intensity times the sine, over the polar angle.
    fn row_power(&self, row: &[f64]) -> f64 {
        let pieces = self.polar.windows(2).zip(row.windows(2));
        let piece = |(angles, values): (&[f64], &[f64])| {
            let (from, to) = (angles[0].to_radians(), angles[1].to_radians());
            if to <= from {
                return 0.0;
            }
            // Of v + s (x - from) with sin x: [-(v + s (x - from)) cos x + s sin x].
            let slope = (values[1] - values[0]) / (to - from);
            values[0] * from.cos() - values[1] * to.cos() + slope * (to.sin() - from.sin())
        };
        pieces.map(piece).sum()
    }
}

/// The entry of an ascending list below a value, and how far the value is on the way to the next; `None` outside.
fn bracket(list: &[f64], value: f64) -> Option<(usize, f64)> {
    let (first, last) = (*list.first()?, *list.last()?);
    if value < first - EDGE || value > last + EDGE {
        return None;
    }
    let low = list.partition_point(|&entry| entry <= value).clamp(1, list.len().max(2) - 1) - 1;
    let (from, to) = (list[low], *list.get(low + 1).unwrap_or(&list[low]));
    Some((low, if to > from { ((value - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 }))
}

/// Degrees that rounding may take a direction beyond a table.
const EDGE: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;

    fn lamp(shape: LampShape) -> Lamp {
        Lamp {
            name: "lamp".into(),
            position: DVec3::new(1.0, 2.0, 3.0),
            forward: DVec3::NEG_Y,
            side: DVec3::X,
            intensity: Rgb([100.0, 50.0, 0.0]),
            shape,
        }
    }

    /// Power by a sum over directions: strata of equal solid angle about the axis.
    fn summed(lamp: &Lamp) -> f64 {
        // No direction lies in the planes that bound half spaces.
        let (rings, turns) = (2000, 96);
        let other = lamp.forward.cross(lamp.side);
        let mut sum = 0.0;
        for ring in 0..rings {
            let cosine = 1.0 - 2.0 * (f64::from(ring) + 0.5) / f64::from(rings);
            let sine = (1.0 - cosine * cosine).sqrt();
            for turn in 0..turns {
                let angle = 2.0 * PI * (f64::from(turn) + 0.5) / f64::from(turns);
                let across = lamp.side * angle.cos() + other * angle.sin();
                sum += lamp.share(lamp.forward * cosine + across * sine);
            }
        }
        4.0 * PI * sum / f64::from(rings * turns)
    }

    /// Catches wrong solid angles: closed forms against sums over directions.
    #[test]
    fn power_is_the_integral_of_intensity() {
        let cone = LampShape::Spot { inner: 0.3, outer: 0.9 };
        let cosine_lobe: Vec<f64> = (0..=90).map(|angle| 100.0 * f64::from(angle).to_radians().cos()).collect();
        let web = Web {
            polar: (0..=90).map(f64::from).collect(),
            around: vec![0.0],
            intensity: cosine_lobe,
            pole: Pole::Forward,
        };
        let two: Vec<f64> = [0.0, 45.0, 90.0].map(|angle: f64| angle + 10.0).into();
        let turned: Vec<f64> = [0.0, 1.0, 0.5, 0.0].iter().flat_map(|&s| two.iter().map(move |v| s * v)).collect();
        let lobed = |pole| {
            let (polar, around) = (vec![0.0, 45.0, 90.0], vec![0.0, 90.0, 180.0, 360.0]);
            LampShape::Web(Web { polar, around, intensity: turned.clone(), pole })
        };
        let lobed = [Pole::Forward, Pole::Across, Pole::Aside].map(lobed);
        for shape in [LampShape::Point, cone, LampShape::Web(web)].into_iter().chain(lobed) {
            let lamp = lamp(shape);
            let (power, wanted) = (lamp.power().unwrap(), summed(&lamp));
            // 2,000 rings: a fraction of a ring of error at each edge.
            assert!((power[0] / 100.0 / wanted - 1.0).abs() < 2e-3, "{:?}: {power:?} {wanted}", lamp.shape);
        }
    }

    /// Catches a wrong square of the distance, a direction from lamp to point instead of back, light behind a cone.
    #[test]
    fn what_is_thrown_falls_by_the_square_and_stays_in_the_cone() {
        let point = lamp(LampShape::Point).thrown_on(DVec3::new(1.0, 0.0, 3.0)).unwrap();
        assert_eq!((point.towards, point.distance, point.facing), (DVec3::Y, 2.0, Rgb([25.0, 12.5, 0.0])));
        let spot = lamp(LampShape::Spot { inner: 0.2, outer: 0.5 });
        assert!(spot.thrown_on(DVec3::new(1.0, 5.0, 3.0)).is_none());
        assert!(spot.thrown_on(DVec3::new(1.0 + 2.0 * 0.51_f64.tan(), 0.0, 3.0)).is_none());
        assert_eq!(spot.thrown_on(DVec3::new(1.0, 0.0, 3.0)).unwrap().facing, point.facing);
        let sun = lamp(LampShape::Parallel).thrown_on(DVec3::ZERO).unwrap();
        assert_eq!((sun.towards, sun.distance, sun.facing), (DVec3::Y, f64::INFINITY, Rgb([100.0, 50.0, 0.0])));
        assert_eq!(lamp(LampShape::Parallel).power(), None);
    }

    /// Catches angles about the axis that are counted from the wrong side, or the wrong way round.
    #[test]
    fn a_table_is_read_about_its_axis() {
        let columns = [0.0, 90.0, 180.0, 270.0, 360.0];
        let intensity: Vec<f64> = [1.0, 2.0, 3.0, 4.0, 1.0].iter().flat_map(|&value| [value, value]).collect();
        let web =
            |pole| Web { polar: vec![0.0, 180.0], around: columns.into(), intensity: Vec::clone(&intensity), pole };
        // forward = -y, side = x, forward × side = -y × x = z: where angles begin, and where they lead at 90 degrees.
        for (pole, zero, next) in [
            (Pole::Forward, DVec3::X, DVec3::Z),
            (Pole::Across, -DVec3::Y, DVec3::X),
            (Pole::Aside, -DVec3::Y, DVec3::Z),
        ] {
            let lamp = lamp(LampShape::Web(web(pole)));
            for (direction, wanted) in [(zero, 1.0), (next, 2.0), (-zero, 3.0), (-next, 4.0), (zero + next, 1.5)] {
                assert!((lamp.share(direction.normalize()) - wanted).abs() < 1e-12, "{pole:?} {direction}");
            }
        }
    }

    /// Catches polar angles that are counted from the wrong end of an axis.
    #[test]
    fn a_table_is_read_from_its_pole() {
        for (pole, at) in [(Pole::Forward, -DVec3::Y), (Pole::Across, DVec3::Z), (Pole::Aside, -DVec3::X)] {
            let web = Web { polar: vec![0.0, 180.0], around: vec![0.0], intensity: vec![1.0, 3.0], pole };
            let lamp = lamp(LampShape::Web(web));
            let found = [at, at.any_orthonormal_vector(), -at].map(|direction| lamp.share(direction));
            assert!(found.iter().zip([1.0, 2.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{pole:?} {found:?}");
        }
    }
}
