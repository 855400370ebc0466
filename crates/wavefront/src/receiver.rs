//! What takes light in at a point: a direction goes in, what light from there counts for comes out; and directions as often as
//! they count.

use glam::DVec3;
use std::f64::consts::PI;

/// A small thing that takes light in; the irradiance of its surface is what it measures. All unit vectors.
///
/// Where all directions send the same radiance L each has pi L.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Receiver {
    /// A flat piece that looks along this normal: irradiance, or illuminance.
    Plane(DVec3),
    /// The side of an upright cylinder about this axis: the mean over all planes through the axis, both sides of each.
    Cylinder(DVec3),
    /// The curved side of half a cylinder about `axis`, which looks along `facing`, orthogonal to it.
    SemiCylinder {
        /// Along the cylinder.
        axis: DVec3,
        /// The middle of the curved side looks there.
        facing: DVec3,
    },
}

impl Receiver {
    /// What the radiance from a direction counts for: irradiance is its integral over all directions, `H = int w L dw`.
    ///
    /// With the angle t from the axis and the angle p about it from `facing`: `cos` of the angle to a plane's normal, `sin t / pi`
    /// of a cylinder, `sin t (1 + cos p) / pi` of half a one (EN 13201-3:2015 for street lighting). A cylinder's and half a one's are the means
    /// of what flat pieces of them see.
    #[must_use]
    pub fn weight(&self, direction: DVec3) -> f64 {
        let sine = |axis: DVec3| axis.cross(direction).length();
        match *self {
            Receiver::Plane(normal) => normal.dot(direction).max(0.0),
            Receiver::Cylinder(axis) => sine(axis) / PI,
            Receiver::SemiCylinder { axis, facing } => (sine(axis) + facing.dot(direction)).max(0.0) / PI,
        }
    }

    /// Directions with a density of [`Receiver::weight`] over pi, for places in the unit square.
    pub(crate) fn directions(&self) -> Directions {
        let (pole, turned) = match *self {
            Receiver::Plane(normal) => (normal, normal.any_orthonormal_pair()),
            Receiver::Cylinder(axis) => (axis, axis.any_orthonormal_pair()),
            Receiver::SemiCylinder { axis, facing } => (axis, (facing, axis.cross(facing))),
        };
        Directions { receiver: *self, pole, tangent: turned.0, bitangent: turned.1 }
    }
}

/// A receiver with axes beside its own.
pub(crate) struct Directions {
    receiver: Receiver,
    pole: DVec3,
    tangent: DVec3,
    bitangent: DVec3,
}

impl Directions {
    /// The direction of a place in the unit square.
    pub(crate) fn at(&self, u: f64, v: f64) -> DVec3 {
        let (run, rise, around) = match self.receiver {
            Receiver::Plane(_) => (u.sqrt(), (1.0 - u).max(0.0).sqrt(), 2.0 * PI * v),
            Receiver::Cylinder(_) | Receiver::SemiCylinder { .. } => {
                // Angles from the axis by their squared sine: 2t - sin 2t = 2 pi u.
                let (run, rise) = libm::sincos(0.5 * swept(u));
                let is_half = matches!(self.receiver, Receiver::SemiCylinder { .. });
                // And about it by 1 + cos p, for which pi - p has the same law.
                (run, rise, if is_half { PI - swept(v) } else { 2.0 * PI * v })
            }
        };
        let (sine, cosine) = libm::sincos(around);
        (self.tangent * cosine + self.bitangent * sine) * run + self.pole * rise
    }
}

/// Steps of Newton's method in [`swept`]: one less leaves 3e-13 at the worst (`all_of_a_turn_is_swept`).
const STEPS: u32 = 6;

/// The angle a in [0, 2 pi] with `a - sin a = 2 pi u`: a segment of a circle that is cut off by a chord has the share u of its area.
fn swept(u: f64) -> f64 {
    let half = u.min(1.0 - u).max(0.0);
    let area = 2.0 * PI * half;
    // From below, as a - sin a <= a^3/6: the function bends upwards, so that all steps but the first go down to the root.
    let mut angle = libm::cbrt(6.0 * area);
    if angle > 0.0 {
        for _ in 0..STEPS {
            let (sine, cosine) = libm::sincos(angle);
            let slope = 1.0 - cosine;
            angle -= if slope > 0.0 { (angle - sine - area) / slope } else { 0.0 };
        }
    }
    if u > 0.5 { 2.0 * PI - angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isolux_core::sampling::Stream;

    /// Catches an iteration that ends too early, or runs off at an end of the range.
    #[test]
    fn all_of_a_turn_is_swept() {
        for step in 0..=1_000_000_u32 {
            let u = f64::from(step) / 1e6;
            let angle = swept(u);
            assert!((0.0..=2.0 * PI).contains(&angle), "{u}: {angle}");
            // In units of u: some roundings of angles below 7.
            assert!(((angle - angle.sin()) / (2.0 * PI) - u).abs() < 1e-15 * 8.0, "{u}: {angle}");
        }
    }

    /// Catches weights and directions that do not belong together, and a receiver that has not pi L in even light: the mean
    /// over directions of any function is its integral with the weight, over pi.
    #[test]
    fn directions_are_as_frequent_as_they_count() {
        let axis = DVec3::new(0.2, 0.9, -0.3).normalize();
        let facing = axis.any_orthonormal_vector();
        let receivers = [Receiver::Plane(axis), Receiver::Cylinder(axis), Receiver::SemiCylinder { axis, facing }];
        // A function without symmetry, between 0 and 1.
        let function = |direction: DVec3| {
            let [x, y, z] = direction.to_array();
            0.25 * (1.0 + 0.5 * x + 0.8 * y * z + z * z * z + 0.6 * (axis.dot(direction)).powi(2))
        };
        let side = 1000;
        for receiver in receivers {
            let directions = receiver.directions();
            let (mut by_directions, mut by_weight, mut whole) = (0.0, 0.0, 0.0);
            let mut stream = Stream::new(7);
            for row in 0..side {
                for column in 0..side {
                    let (u, v) = (
                        (f64::from(row) + stream.next_unit()) / f64::from(side),
                        (f64::from(column) + stream.next_unit()) / f64::from(side),
                    );
                    by_directions += function(directions.at(u, v));
                    let (rise, around) = (1.0 - 2.0 * u, 2.0 * PI * v);
                    let run = (1.0 - rise * rise).sqrt();
                    let even = DVec3::new(run * around.cos(), rise, run * around.sin());
                    by_weight += 4.0 * function(even) * receiver.weight(even);
                    whole += 4.0 * receiver.weight(even);
                }
            }
            let count = f64::from(side * side);
            // Strata of 1/1000: off by some 1e-3/1e3 as a random walk over strata of width 1e-3.
            assert!((by_directions / count - by_weight / count).abs() < 2e-5, "{receiver:?}");
            assert!((whole / count - 1.0).abs() < 2e-5, "{receiver:?}: {}", whole / count);
        }
    }
}
