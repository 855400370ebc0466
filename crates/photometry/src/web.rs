//! The photometric web: angles and candela of a file come in, the intensity in any direction and integrals over the
//! sphere come out, with symmetry made good as it is asked for.

use crate::axis::{Axis, SAME};

/// Types of photometry: what the angles are measured about. The crate's page has their directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Poles at X: vertical angles are elevations, horizontal ones go round X.
    A,
    /// Poles at Y: horizontal angles are elevations, vertical ones go round Y.
    B,
    /// Poles at Z: vertical angles count from the nadir, horizontal ones go round Z. EULUMDAT, too.
    C,
}

/// What of the table stands for more than itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// Nothing.
    None,
    /// One plane stands for all around the axis.
    Rotational,
    /// Mirrored in the plane of H = 0 (C0-C180).
    Plane0,
    /// Mirrored in the plane of H = 90 (C90-C270).
    Plane90,
    /// Mirrored in both planes.
    Quadrants,
    /// Mirrored otherwise: about planes off the axes, or more than twice.
    Other,
}

impl Symmetry {
    /// Name in lower case, as the command shows it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Symmetry::None => "none",
            Symmetry::Rotational => "rotational",
            Symmetry::Plane0 => "plane-0",
            Symmetry::Plane90 => "plane-90",
            Symmetry::Quadrants => "quadrants",
            Symmetry::Other => "other",
        }
    }
}

/// The highest intensity and where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Intensity, candela.
    pub candela: f64,
    /// Vertical angle, degrees.
    pub vertical: f64,
    /// Horizontal angle, degrees.
    pub horizontal: f64,
    /// Unit vector in the luminaire's frame.
    pub direction: [f64; 3],
}

/// A table of intensities over directions: what the file has, and how it stands for the sphere.
#[derive(Clone, Debug, PartialEq)]
pub struct Web {
    kind: Kind,
    vertical: Vec<f64>,
    horizontal: Vec<f64>,
    /// By horizontal angle, then vertical angle.
    candela: Vec<f64>,
    by_vertical: Axis,
    by_horizontal: Axis,
}

/// A web with all that symmetry stands for written out: intensities by angles from a pole and about it, linear in
/// between. The pole depends on the type, and so does where angles about it begin and where they lead:
///
/// | type | pole | 0 | 90 |
/// |---|---|---|---|
/// | C | -Z | +X | -Y |
/// | B | -Y | -Z | +X |
/// | A | -X | -Z | -Y |
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Angles from the pole, degrees, ascending, within 0 and 180; it is dark beyond the first and the last.
    pub polar: Vec<f64>,
    /// Angles about the pole, degrees, ascending from 0 to 360, both included; 0 alone where it is the same all around.
    pub around: Vec<f64>,
    /// Intensities by angle about the pole and then polar angle, candela.
    pub candela: Vec<f64>,
}

/// Degrees beyond the edge of the light at which a [`Grid`] is dark: a millionth part of what is in the step before the
/// edge is lost or gained there, at steps of a degree.
const EDGE: f64 = 1e-6;

/// A table as a file has it: ascending angles, one finite candela value >= 0 for each pair of them.
pub(crate) struct Table {
    pub(crate) kind: Kind,
    pub(crate) vertical: Vec<f64>,
    pub(crate) horizontal: Vec<f64>,
    pub(crate) candela: Vec<f64>,
}

/// Notes about the vertical and the horizontal angles.
pub(crate) type Notes = [Option<String>; 2];

impl Web {
    /// Of a table whose angles the reader has looked at; what was assumed comes with it.
    ///
    /// # Errors
    /// What was expected of the horizontal angles, and what was found.
    pub(crate) fn new(table: Table) -> Result<(Web, Notes), (String, String)> {
        let Table { kind, vertical, horizontal, candela } = table;
        let ((by_vertical, above), (by_horizontal, around)) = match kind {
            Kind::A => {
                (Axis::from_axis(&vertical, 90.0, "vertical"), Axis::from_axis(&horizontal, 180.0, "horizontal"))
            }
            Kind::B => {
                (Axis::from_axis(&vertical, 180.0, "vertical"), Axis::from_axis(&horizontal, 90.0, "horizontal"))
            }
            Kind::C => (Axis::from_nadir(&vertical), Axis::around(&horizontal)?),
        };
        let above = above.map(|note| if note.starts_with("angles") { format!("vertical {note}") } else { note });
        let around = around.map(|note| if note.starts_with("angles") { format!("horizontal {note}") } else { note });
        Ok((Web { kind, vertical, horizontal, candela, by_vertical, by_horizontal }, [above, around]))
    }

    /// What the angles are measured about.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Vertical angles of the file, ascending, degrees.
    #[must_use]
    pub fn vertical(&self) -> &[f64] {
        &self.vertical
    }

    /// Horizontal angles of the file, ascending, degrees: only those that it has, symmetry is not written out.
    #[must_use]
    pub fn horizontal(&self) -> &[f64] {
        &self.horizontal
    }

    /// Intensities by horizontal angle and then vertical angle, candela, all factors of the file included.
    #[must_use]
    pub fn candela(&self) -> &[f64] {
        &self.candela
    }

    /// What of the table stands for more than itself.
    #[must_use]
    pub fn symmetry(&self) -> Symmetry {
        let rows = &self.horizontal;
        let (first, last) = (rows[0], rows[rows.len() - 1]);
        if self.kind != Kind::C {
            let sides = |angles: &[f64]| angles.len() == 1 || angles[0] == 0.0 || angles[angles.len() - 1] == 0.0;
            return match (sides(rows), sides(&self.vertical)) {
                (true, true) => Symmetry::Quadrants,
                (true, false) => Symmetry::Plane0,
                (false, true) => Symmetry::Plane90,
                (false, false) => Symmetry::None,
            };
        }
        let intervals = self.by_horizontal.knots().len() - 1;
        if rows.len() == 1 {
            Symmetry::Rotational
        } else if intervals < 2 * (rows.len() - 1) {
            Symmetry::None
        } else if (first / 90.0).fract() != 0.0 || last - first < 89.0 {
            Symmetry::Other
        } else if last - first < 91.0 {
            Symmetry::Quadrants
        } else if (first / 180.0).fract() == 0.0 {
            Symmetry::Plane0
        } else {
            Symmetry::Plane90
        }
    }

    /// Intensity in candela in a direction of the luminaire's frame, a vector of any length: linear between the rows of
    /// the table. Not a number where the vector has no direction.
    #[must_use]
    pub fn intensity(&self, direction: [f64; 3]) -> f64 {
        let largest = direction.iter().fold(0.0, |most: f64, part| most.max(part.abs()));
        if !(largest.is_finite() && largest > 0.0) || direction.iter().any(|part| part.is_nan()) {
            return f64::NAN;
        }
        let [x, y, z] = direction.map(|part| part / largest);
        let (vertical, horizontal) = match self.kind {
            Kind::A => (x.atan2(y.hypot(z)), (-y).atan2(-z)),
            Kind::B => (x.atan2(-z), (-y).atan2(x.hypot(z))),
            Kind::C => (x.hypot(y).atan2(-z), y.atan2(x)),
        };
        self.at(vertical.to_degrees(), horizontal.to_degrees())
    }

    /// Intensity in candela at a pair of angles, degrees; 0 where the file has none.
    #[must_use]
    pub fn at(&self, vertical: f64, horizontal: f64) -> f64 {
        let (Some((low, high, up)), Some((left, right, along))) =
            (self.by_vertical.locate(vertical), self.by_horizontal.locate(horizontal))
        else {
            return 0.0;
        };
        let count = self.vertical.len();
        let row = |horizontal: usize| {
            let row = &self.candela[horizontal * count..(horizontal + 1) * count];
            row[low] * (1.0 - up) + row[high] * up
        };
        row(left) * (1.0 - along) + row(right) * along
    }

    /// Unit vector of a pair of angles, degrees.
    #[must_use]
    pub fn direction(&self, vertical: f64, horizontal: f64) -> [f64; 3] {
        let ((sin_v, cos_v), (sin_h, cos_h)) = (vertical.to_radians().sin_cos(), horizontal.to_radians().sin_cos());
        match self.kind {
            Kind::A => [sin_v, -cos_v * sin_h, -cos_v * cos_h],
            Kind::B => [cos_h * sin_v, -sin_h, -cos_h * cos_v],
            Kind::C => [sin_v * cos_h, sin_v * sin_h, -cos_v],
        }
    }

    /// Flux in lumens: the integral of [`Web::intensity`] over the sphere, without error but rounding.
    #[must_use]
    pub fn flux(&self) -> f64 {
        self.flux_within(f64::NEG_INFINITY, f64::INFINITY)
    }

    /// Flux in lumens into the half space of -Z, to which the luminaire points: down for one that hangs from a ceiling.
    #[must_use]
    pub fn flux_down(&self) -> f64 {
        match self.kind {
            Kind::A | Kind::B => self.flux_within(-90.0, 90.0),
            Kind::C => self.flux_within(0.0, 90.0),
        }
    }

    /// Flux within bounds of the angle that tells below from above: that which goes round in types A and B, the
    /// vertical one in type C.
    fn flux_within(&self, low: f64, high: f64) -> f64 {
        let (rows, columns) = (self.horizontal.len(), self.vertical.len());
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        let (across, along) = match self.kind {
            Kind::A => (
                self.by_horizontal.weights(rows, low, high, None),
                self.by_vertical.weights(columns, all.0, all.1, Some(-90.0)),
            ),
            Kind::B => (
                self.by_horizontal.weights(rows, all.0, all.1, Some(-90.0)),
                self.by_vertical.weights(columns, low, high, None),
            ),
            Kind::C => (
                self.by_horizontal.weights(rows, all.0, all.1, None),
                self.by_vertical.weights(columns, low, high, Some(0.0)),
            ),
        };
        let row = |row: &[f64]| row.iter().zip(&along).map(|(value, weight)| value * weight).sum::<f64>();
        self.candela.chunks_exact(columns).zip(&across).map(|(values, weight)| row(values) * weight).sum()
    }

    /// The highest intensity; the first of several equal ones in the order of the file.
    #[must_use]
    pub fn peak(&self) -> Peak {
        let mut best = 0;
        for (place, &candela) in self.candela.iter().enumerate() {
            if candela > self.candela[best] {
                best = place;
            }
        }
        let vertical = self.vertical[best % self.vertical.len()];
        let horizontal = self.horizontal[best / self.vertical.len()];
        let direction = self.direction(vertical, horizontal);
        Peak { candela: self.candela[best], vertical, horizontal, direction }
    }

    /// The full angle, degrees, between the outermost directions of a plane through the axis in which the intensity is
    /// still `share` of that plane's highest: for the plane X/Z (H = 0) and the plane Y/Z (H = 90). With 0.5 the beam
    /// angle, with 0.1 the field angle; `None` where a plane is dark. Counted about -Z; about +Z where most of the flux
    /// of a type C goes up. Exact for the table.
    #[must_use]
    pub fn spread(&self, share: f64) -> [Option<f64>; 2] {
        [self.profile(false), self.profile(true)].map(|profile| width(&profile, share))
    }

    /// Signed angle from the axis and intensity, ascending, over a plane through the axis.
    fn profile(&self, is_across: bool) -> Vec<(f64, f64)> {
        let line = |axis: &Axis| axis.knots().iter().map(|&(angle, _)| angle).collect::<Vec<_>>();
        match (self.kind, is_across) {
            (Kind::A | Kind::B, false) => {
                line(&self.by_vertical).into_iter().map(|angle| (angle, self.at(angle, 0.0))).collect()
            }
            (Kind::A | Kind::B, true) => {
                line(&self.by_horizontal).into_iter().map(|angle| (angle, self.at(0.0, angle))).collect()
            }
            (Kind::C, _) => {
                let is_up = self.flux_down() < 0.5 * self.flux();
                let plane = if is_across { 90.0 } else { 0.0 };
                let side = |horizontal: f64, sign: f64| {
                    line(&self.by_vertical)
                        .into_iter()
                        .map(|angle| (sign * if is_up { 180.0 - angle } else { angle }, self.at(angle, horizontal)))
                        .collect::<Vec<_>>()
                };
                let mut both = side(plane + 180.0, -1.0);
                both.extend(side(plane, 1.0));
                both.sort_by(|a, b| a.0.total_cmp(&b.0));
                both
            }
        }
    }

    /// The whole sphere as one table: what [`Web::intensity`] tells, at an edge of the light to a millionth of
    /// a degree.
    #[must_use]
    pub fn grid(&self) -> Grid {
        let angles = |axis: &Axis| axis.knots().iter().map(|&(angle, _)| angle).collect::<Vec<_>>();
        // The file's angle by that of the grid: polar is `base + turn * angle`, about the pole `sense * angle`.
        let (polar, around, base, turn, sense) = match self.kind {
            Kind::C => (&self.by_vertical, &self.by_horizontal, 0.0, 1.0, -1.0),
            Kind::B => (&self.by_horizontal, &self.by_vertical, 90.0, -1.0, 1.0),
            Kind::A => (&self.by_vertical, &self.by_horizontal, 90.0, 1.0, 1.0),
        };
        let polar: Vec<f64> = angles(polar).into_iter().map(|angle| (base + turn * angle).clamp(0.0, 180.0)).collect();
        let polar = ascending(polar);
        let around = if self.kind == Kind::C && self.horizontal.len() == 1 {
            vec![0.0]
        } else {
            let knots = angles(around);
            let (first, last) = (knots[0], knots[knots.len() - 1]);
            let mut turned: Vec<f64> = knots.into_iter().map(|angle| (sense * angle).rem_euclid(360.0)).collect();
            if last - first < 360.0 - EDGE {
                turned.extend([first - EDGE, last + EDGE].map(|angle| (sense * angle).rem_euclid(360.0)));
            }
            turned.retain(|angle| (SAME..=360.0 - SAME).contains(angle));
            turned.extend([0.0, 360.0]);
            ascending(turned)
        };
        let candela = around.iter().flat_map(|&about| {
            // Types A and B count to both sides of 0; a circle takes any.
            let about = sense * if about > 180.0 { about - 360.0 } else { about };
            polar.iter().map(move |&from| {
                let from = turn * (from - base);
                if self.kind == Kind::B { self.at(about, from) } else { self.at(from, about) }
            })
        });
        let candela = candela.collect();
        Grid { polar, around, candela }
    }

    /// The same web with every intensity multiplied.
    pub(crate) fn scaled(&self, factor: f64) -> Web {
        Web { candela: self.candela.iter().map(|candela| candela * factor).collect(), ..self.clone() }
    }
}

/// Angles in order, those that are the same once.
fn ascending(mut angles: Vec<f64>) -> Vec<f64> {
    angles.sort_by(f64::total_cmp);
    angles.dedup_by(|next, before| *next - *before < SAME);
    angles
}

/// From the first to the last angle at which a profile has `share` of its highest value.
fn width(profile: &[(f64, f64)], share: f64) -> Option<f64> {
    let highest = profile.iter().fold(0.0, |most: f64, &(_, candela)| most.max(candela));
    if highest <= 0.0 {
        return None;
    }
    let least = share * highest;
    let first = profile.iter().position(|&(_, candela)| candela >= least)?;
    let last = profile.iter().rposition(|&(_, candela)| candela >= least)?;
    // Where the line from an inner knot to the one beyond it falls below.
    let edge = |inner: usize, outer: Option<&(f64, f64)>| match outer {
        Some(&(angle, candela)) => {
            let (from, value) = profile[inner];
            from + (angle - from) * (value - least) / (value - candela)
        }
        None => profile[inner].0,
    };
    let right = edge(last, profile.get(last + 1));
    let left = edge(first, first.checked_sub(1).and_then(|outer| profile.get(outer)));
    Some(right - left)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn web(kind: Kind, vertical: &[f64], horizontal: &[f64], candela: impl Fn(f64, f64) -> f64) -> Web {
        let candela =
            horizontal.iter().flat_map(|&h| vertical.iter().map(move |&v| (v, h))).map(|(v, h)| candela(v, h));
        let table =
            Table { kind, vertical: vertical.to_vec(), horizontal: horizontal.to_vec(), candela: candela.collect() };
        Web::new(table).unwrap().0
    }

    /// Catches angles that change sign or place between a direction and the table, in each type.
    #[test]
    fn directions_lead_back_to_their_angles() {
        let steps: Vec<f64> = (-6..=6).map(|step| 15.0 * f64::from(step)).collect();
        let around: Vec<f64> = (0..=24).map(|step| 15.0 * f64::from(step)).collect();
        for kind in [Kind::A, Kind::B, Kind::C] {
            let (vertical, horizontal) = match kind {
                Kind::C => (&around[..13], &around[..]),
                Kind::A | Kind::B => (&steps[..], &steps[..]),
            };
            // Linear in both angles, so that the table is exact between its rows.
            let table = web(kind, vertical, horizontal, |v, h| 1000.0 + 3.0 * v + h);
            for (v, h) in [(10.0, 20.0), (33.0, 77.0), (61.0, 3.0), (89.0, 50.0)] {
                let found = table.intensity(table.direction(v, h));
                // Angles are known to 1e-13 degrees after some trigonometry.
                assert!((found - (1000.0 + 3.0 * v + h)).abs() < 1e-9, "{kind:?} {v} {h}: {found}");
            }
        }
    }

    /// Catches a frame that differs from `EXT_lights_ies`: (0, 0) is -Z, V rises in X/Z, H is clockwise in A and B.
    #[test]
    fn frames_are_those_of_gltf() {
        let table = |kind| web(kind, &[0.0, 90.0], &[0.0, 90.0], |_, _| 1.0);
        let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-15);
        for kind in [Kind::A, Kind::B, Kind::C] {
            assert!(close(table(kind).direction(0.0, 0.0), [0.0, 0.0, -1.0]));
            assert!(close(table(kind).direction(90.0, 0.0), [1.0, 0.0, 0.0]));
        }
        assert!(close(table(Kind::A).direction(0.0, 90.0), [0.0, -1.0, 0.0]));
        assert!(close(table(Kind::B).direction(0.0, 90.0), [0.0, -1.0, 0.0]));
        assert!(close(table(Kind::B).direction(90.0, 90.0), [0.0, -1.0, 0.0]));
        assert!(close(table(Kind::A).direction(90.0, 90.0), [1.0, 0.0, 0.0]));
        assert!(close(table(Kind::C).direction(90.0, 90.0), [0.0, 1.0, 0.0]));
    }

    /// Catches an integration rule that is not exact for the table: against a sum over many directions.
    #[test]
    fn flux_is_the_integral_of_the_lookup() {
        let vertical = [0.0, 20.0, 50.0, 90.0, 130.0];
        let table = web(Kind::C, &vertical, &[0.0, 30.0, 90.0], |v, h| 100.0 + v + 2.0 * h);
        let b = web(Kind::B, &[-90.0, -20.0, 0.0, 60.0], &[0.0, 10.0, 90.0], |v, h| 200.0 + v - h);
        let a = web(Kind::A, &[-60.0, 0.0, 90.0], &[-90.0, 10.0, 120.0], |v, h| 300.0 + v - h);
        for table in [table, b, a] {
            let (mut sum, mut down) = (0.0, 0.0);
            // Equal areas: z and the azimuth in equal steps.
            let steps = 600_u32;
            for i in 0..steps {
                let z = -1.0 + (2.0 * f64::from(i) + 1.0) / f64::from(steps);
                for j in 0..steps {
                    let (sin, cos) = ((f64::from(j) + 0.5) / f64::from(steps) * std::f64::consts::TAU).sin_cos();
                    let side = (1.0 - z * z).sqrt();
                    let candela = table.intensity([side * cos, side * sin, z]);
                    sum += candela;
                    down += if z < 0.0 { candela } else { 0.0 };
                }
            }
            let area = 4.0 * std::f64::consts::PI / f64::from(steps * steps);
            // The midpoint rule at the edges of the light: one step of 600.
            assert!((table.flux() / (sum * area) - 1.0).abs() < 2e-3, "{:?}", table.kind());
            assert!((table.flux_down() / (down * area) - 1.0).abs() < 2e-3, "{:?}", table.kind());
        }
    }

    /// Catches a beam that is measured from the wrong place: triangles of known width, aside, upwards, and dark ones.
    #[test]
    fn beams_have_their_widths() {
        let cone = web(Kind::C, &[0.0, 40.0, 90.0], &[0.0], |v, _| if v == 0.0 { 100.0 } else { 0.0 });
        assert_eq!(cone.spread(0.5), [Some(40.0), Some(40.0)]);
        assert_eq!(cone.spread(0.1), [Some(72.0), Some(72.0)]);
        let up = web(Kind::C, &[90.0, 140.0, 180.0], &[0.0], |v, _| if v == 180.0 { 100.0 } else { 0.0 });
        assert_eq!(up.spread(0.5), [Some(40.0), Some(40.0)]);
        let all = web(Kind::C, &[0.0, 180.0], &[0.0], |_, _| 1.0);
        assert_eq!(all.spread(0.5), [Some(360.0), Some(360.0)]);
        let flood = web(Kind::B, &[-20.0, 0.0, 20.0], &[0.0, 10.0], |v, h| (20.0 - v.abs()) * (10.0 - h));
        assert_eq!(flood.spread(0.5), [Some(20.0), Some(10.0)]);
        let dark = web(Kind::C, &[0.0, 90.0], &[0.0], |_, _| 0.0);
        assert_eq!(dark.spread(0.5), [None, None]);
        // All light to one side of the axis.
        let aside = web(Kind::C, &[0.0, 30.0, 60.0, 90.0], &[0.0, 90.0, 180.0], |v, h| {
            if v == 60.0 && h == 0.0 { 100.0 } else { 0.0 }
        });
        assert_eq!(aside.spread(0.5), [Some(30.0), None]);
    }

    /// Catches vectors without a direction that become a number.
    #[test]
    fn no_direction_has_no_intensity() {
        let table = web(Kind::C, &[0.0, 180.0], &[0.0], |_, _| 1.0);
        for direction in [[0.0; 3], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0]] {
            assert!(table.intensity(direction).is_nan());
        }
        assert_eq!(table.intensity([0.0, 0.0, 1e-300]), 1.0);
        assert_eq!(table.intensity([1e300, 1e300, 1e300]), 1.0);
    }
}
