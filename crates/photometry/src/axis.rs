//! One axis of a table: the angles of a file come in, the places of its rows over the whole range come out, with copies
//! where symmetry makes them; what the angles mean is the web's.

/// Angles closer than this are the same, degrees: files print 0.01 at best, and a direction's angle is known to 1e-14.
pub(crate) const SAME: f64 = 1e-9;

/// How far the last angle of a range may be from where it should end, degrees. Files print angles to 0.1 at worst.
const SNAP: f64 = 0.5;

/// Least range of horizontal angles that is mirrored until it fills the circle, degrees.
const LEAST_SPAN: f64 = 15.0;

/// Rows of a table by angle: between two neighbours values are linear, beyond the ends there is no light.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Axis {
    /// Angle in degrees and row, ascending; a row may come several times. At least two.
    knots: Vec<(f64, usize)>,
    /// Whether it goes round: the last knot lies 360 above the first.
    circle: bool,
}

/// An axis, and what was assumed in making it.
pub(crate) type Made = (Axis, Option<String>);

impl Axis {
    /// The full circle, of horizontal angles of type C or of C-planes: one angle stands for all, 180 degrees are
    /// mirrored in the plane through their ends, 90 in both planes, 360 stand for themselves.
    ///
    /// # Errors
    /// What was expected and what was found, where the angles cover no such range.
    pub(crate) fn around(angles: &[f64]) -> Result<Made, (String, String)> {
        let (Some(&first), Some(&last)) = (angles.first(), angles.last()) else {
            return Err(("an angle".into(), "none".into()));
        };
        if angles.len() == 1 {
            let note = (first != 0.0).then(|| format!("the only horizontal angle is {first}: it stands for all"));
            return Ok((Axis { knots: vec![(0.0, 0), (360.0, 0)], circle: true }, note));
        }
        let span = last - first;
        let near = |degrees: f64| (span - degrees).abs() <= SNAP;
        let widest = angles.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        let mut note = None;
        // Copies of the range, every other one mirrored, that fill the circle.
        let copies = if near(360.0) {
            1
        } else if span > 180.0 + SNAP && span < 360.0 && 360.0 - span <= widest + SNAP {
            let mut knots = pairs(angles);
            knots.push((first + 360.0, 0));
            let text = format!("horizontal angles end at {last}: the first one closes the circle");
            return Ok((Axis { knots, circle: true }, Some(text)));
        } else if near(180.0) {
            2
        } else if near(90.0) {
            4
        } else {
            let copies = 2.0 * (180.0 / span).round();
            if !(LEAST_SPAN..=90.0).contains(&span) || (360.0 / copies - span).abs() > SNAP / copies {
                return Err((
                    format!("horizontal angles up to {}, {} or {}", first + 90.0, first + 180.0, first + 360.0),
                    format!("{first} to {last}"),
                ));
            }
            note = Some(format!("horizontal angles {first} to {last} are mirrored until they fill the circle"));
            copies as usize
        };
        let share = 360.0 / copies as f64;
        if note.is_none() && copies > 1 && (first / 90.0).fract() != 0.0 {
            note = Some(format!("horizontal angles {first} to {last} are mirrored in planes off the axes"));
        } else if note.is_none() && (span - share).abs() > SAME {
            note = Some(format!("horizontal angles {first} to {last} are taken to end at {}", first + share));
        }
        let mut knots = vec![(first, 0)];
        for copy in 0..copies {
            let start = first + share * copy as f64;
            for step in 1..angles.len() {
                let is_end = step == angles.len() - 1;
                let (row, offset) = if copy % 2 == 0 {
                    (step, angles[step] - first)
                } else {
                    (angles.len() - 1 - step, last - angles[angles.len() - 1 - step])
                };
                let angle = if is_end { start + share } else { start + offset };
                if is_end {
                    // A last angle that was moved inwards may lie before its neighbours.
                    while knots.last().is_some_and(|&(before, _)| before >= angle) {
                        knots.pop();
                    }
                    knots.push((angle, row));
                } else if angle < start + share {
                    knots.push((angle, row));
                }
            }
        }
        Ok((Axis { knots, circle: true }, note))
    }

    /// Angles from the nadir, of type C and EULUMDAT: 0 to 90, 90 to 180 or 0 to 180. A gap at an end of at most the
    /// first or last step is filled with the nearest row; beyond other ends it is dark.
    pub(crate) fn from_nadir(angles: &[f64]) -> Made {
        let (first, last) = ends(angles);
        let low = if first < 90.0 { 0.0 } else { 90.0 };
        let high = if last <= 90.0 { 90.0 } else { 180.0 };
        Axis::filled(pairs(angles), low, high)
    }

    /// Angles from the axis of types A and B, up to `limit` on either side; a range that begins or ends at 0 is
    /// mirrored. One angle stands for all up to 90.
    pub(crate) fn from_axis(angles: &[f64], limit: f64, what: &str) -> Made {
        let (first, last) = ends(angles);
        if angles.len() == 1 {
            let note = format!("there is one {what} angle, {first}: it stands for all from -90 to 90");
            return (Axis { knots: vec![(-90.0, 0), (90.0, 0)], circle: false }, Some(note));
        }
        let mut knots = pairs(angles);
        let mut note = None;
        if first.abs() <= SAME {
            let mirrored = knots[1..].iter().rev().map(|&(angle, row)| (-angle, row)).collect::<Vec<_>>();
            knots.splice(0..0, mirrored);
            note = (what == "vertical").then(|| format!("{what} angles begin at 0: mirrored below the axis"));
        } else if last.abs() <= SAME {
            let mirrored = knots[..knots.len() - 1].iter().rev().map(|&(angle, row)| (-angle, row)).collect::<Vec<_>>();
            knots.extend(mirrored);
            note = Some(format!("{what} angles end at 0: mirrored beyond the axis"));
        }
        let (low, high) = (knots[0].0, knots[knots.len() - 1].0);
        let end = if low >= -90.0 - SAME && high <= 90.0 + SAME { 90.0 } else { limit };
        let (axis, filled) = Axis::filled(knots, -end, end);
        (axis, note.or(filled))
    }

    /// Knots that reach from `low` to `high`, if little is missing.
    fn filled(mut knots: Vec<(f64, usize)>, low: f64, high: f64) -> Made {
        let count = knots.len();
        let (start, end) = (knots[0], knots[count - 1]);
        let mut notes = Vec::new();
        let gap = start.0 - low;
        if gap > SAME {
            if gap <= knots[1].0 - start.0 + SAME {
                knots.insert(0, (low, start.1));
                notes.push(format!("angles begin at {}: the first row stands for {low}, too", start.0));
            } else {
                notes.push(format!("angles begin at {}: dark below", start.0));
            }
        }
        let gap = high - end.0;
        if gap > SAME {
            let step = end.0 - knots[knots.len() - 2].0;
            if gap <= step + SAME {
                knots.push((high, end.1));
                notes.push(format!("angles end at {}: the last row stands for {high}, too", end.0));
            } else {
                notes.push(format!("angles end at {}: dark beyond", end.0));
            }
        }
        (Axis { knots, circle: false }, (!notes.is_empty()).then(|| notes.join("; ")))
    }

    /// Angles and rows, ascending.
    pub(crate) fn knots(&self) -> &[(f64, usize)] {
        &self.knots
    }

    /// The two rows about an angle, and the share of the second; `None` where it is dark.
    pub(crate) fn locate(&self, angle: f64) -> Option<(usize, usize, f64)> {
        let (low, high) = (self.knots[0].0, self.knots[self.knots.len() - 1].0);
        let angle = if self.circle { low + (angle - low).rem_euclid(360.0) } else { angle };
        if !(low - SAME..=high + SAME).contains(&angle) {
            return None;
        }
        let above = self.knots.partition_point(|&(knot, _)| knot <= angle).clamp(1, self.knots.len() - 1);
        let ((from, row), (to, next)) = (self.knots[above - 1], self.knots[above]);
        Some((row, next, ((angle - from) / (to - from)).clamp(0.0, 1.0)))
    }

    /// For each of `rows` rows the integral of its share over `[low, high]` degrees, in radians; with `pole`, times the
    /// sine of the angle less `pole` degrees. Exact: shares are linear between knots.
    pub(crate) fn weights(&self, rows: usize, low: f64, high: f64, pole: Option<f64>) -> Vec<f64> {
        let mut weights = vec![0.0; rows];
        for pair in self.knots.windows(2) {
            let ((from, row), (to, next)) = (pair[0], pair[1]);
            let (begin, end) = (from.max(low), to.min(high));
            if end <= begin {
                continue;
            }
            let (at_begin, at_end) = match pole {
                None => {
                    let half = 0.5 * (end - begin).to_radians();
                    (half, half)
                }
                Some(pole) => sine_weights((begin - pole).to_radians(), (end - pole).to_radians()),
            };
            let share = |angle: f64| (angle - from) / (to - from);
            weights[row] += at_begin * (1.0 - share(begin)) + at_end * (1.0 - share(end));
            weights[next] += at_begin * share(begin) + at_end * share(end);
        }
        weights
    }
}

/// What the values at both ends of `[a, b]` (radians) count for in the integral of their linear interpolation times the
/// sine: with m the middle and h half the length, `sin m sin h -+ cos m (sin h - h cos h) / h`.
fn sine_weights(a: f64, b: f64) -> (f64, f64) {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    // Below 1e-3 the difference cancels; the next term of its series is h^4 / 840, 1e-15 there.
    let moment = if half < 1e-3 {
        half * half / 3.0 * (1.0 - half * half / 10.0)
    } else {
        (half.sin() - half * half.cos()) / half
    };
    let (even, odd) = (middle.sin() * half.sin(), middle.cos() * moment);
    (even - odd, even + odd)
}

fn ends(angles: &[f64]) -> (f64, f64) {
    (angles.first().copied().unwrap_or(0.0), angles.last().copied().unwrap_or(0.0))
}

fn pairs(angles: &[f64]) -> Vec<(f64, usize)> {
    angles.iter().enumerate().map(|(row, &angle)| (angle, row)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(axis: &Axis, angle: f64) -> f64 {
        axis.locate(angle).map_or(f64::NAN, |(row, next, share)| row as f64 * (1.0 - share) + next as f64 * share)
    }

    /// Catches a mirror plane in the wrong place: rows by angle for each range that files have.
    #[test]
    fn ranges_fill_the_circle() {
        let quadrant = Axis::around(&[0.0, 45.0, 90.0]).unwrap().0;
        for (angle, row) in
            [(0.0, 0.0), (45.0, 1.0), (90.0, 2.0), (135.0, 1.0), (180.0, 0.0), (270.0, 2.0), (-45.0, 1.0)]
        {
            assert_eq!(rows(&quadrant, angle), row, "{angle}");
        }
        let half = Axis::around(&[0.0, 90.0, 180.0]).unwrap().0;
        for (angle, row) in [(0.0, 0.0), (90.0, 1.0), (180.0, 2.0), (270.0, 1.0), (225.0, 1.5), (360.0, 0.0)] {
            assert_eq!(rows(&half, angle), row, "{angle}");
        }
        // 1995: symmetric about the plane 90-270.
        let across = Axis::around(&[90.0, 180.0, 270.0]).unwrap().0;
        for (angle, row) in [(90.0, 0.0), (180.0, 1.0), (270.0, 2.0), (0.0, 1.0), (315.0, 1.5), (45.0, 0.5)] {
            assert_eq!(rows(&across, angle), row, "{angle}");
        }
        let full = Axis::around(&[0.0, 90.0, 180.0, 270.0, 360.0]).unwrap().0;
        assert_eq!(rows(&full, 269.0), 3.0 - 1.0 / 90.0);
        assert!(Axis::around(&[0.0, 90.0, 200.0]).is_err());
        assert!(Axis::around(&[0.0, 90.0, 400.0]).is_err());
        let (open, note) = Axis::around(&[0.0, 90.0, 180.0, 270.0]).unwrap();
        assert_eq!(open.locate(315.0), Some((3, 0, 0.5)));
        assert!(note.is_some());
        let eighth = Axis::around(&[0.0, 22.5, 45.0]).unwrap().0;
        for (angle, row) in [(45.0, 2.0), (67.5, 1.0), (90.0, 0.0), (135.0, 2.0), (337.5, 1.0)] {
            assert_eq!(rows(&eighth, angle), row, "{angle}");
        }
    }

    /// Catches weights that lose what symmetry adds: the shares of all rows make the circle and the sphere.
    #[test]
    fn weights_add_up() {
        for angles in
            [vec![0.0, 90.0], vec![90.0, 110.0, 270.0], vec![0.0, 10.0, 360.0], vec![7.0], vec![0.0, 30.0, 45.0]]
        {
            let axis = Axis::around(&angles).unwrap().0;
            let sum: f64 = axis.weights(angles.len(), f64::NEG_INFINITY, f64::INFINITY, None).iter().sum();
            // Rounding of some ten additions.
            assert!((sum - std::f64::consts::TAU).abs() < 1e-13, "{angles:?}: {sum}");
        }
        let axis = Axis::from_nadir(&[0.0, 1e-6, 37.0, 90.0, 180.0]).0;
        let sum: f64 = axis.weights(5, 0.0, 180.0, Some(0.0)).iter().sum();
        assert!((sum - 2.0).abs() < 1e-13, "{sum}");
        let sum: f64 = axis.weights(5, 0.0, 60.0, Some(0.0)).iter().sum();
        assert!((sum - 0.5).abs() < 1e-13, "{sum}");
    }

    /// Catches a series that does not meet the formula that it stands for.
    #[test]
    fn series_meets_formula() {
        for half in [0.5e-3, 0.999e-3, 1.001e-3, 2e-3_f64] {
            let (left, right) = sine_weights(0.7 - half, 0.7 + half);
            let exact = 2.0 * 0.7_f64.cos() * (half.sin() - half * half.cos()) / half;
            // The formula itself cancels to 1e-16 / h here.
            assert!((right - left - exact).abs() < 1e-12, "{half}");
        }
    }

    /// Catches light beyond the range of the angles, and a half step at the pole that stays dark.
    #[test]
    fn gaps_are_filled_or_dark() {
        let (axis, note) = Axis::from_nadir(&[2.5, 7.5, 62.5]);
        assert_eq!(axis.locate(0.0), Some((0, 0, 0.0)));
        assert_eq!(axis.locate(90.0).map(|found| found.0), Some(2));
        assert_eq!(axis.locate(90.1), None);
        assert!(note.is_some());
        let (axis, note) = Axis::from_nadir(&[90.0, 95.0, 180.0]);
        assert_eq!(axis.locate(89.0), None);
        assert_eq!(axis.locate(90.0), Some((0, 1, 0.0)));
        assert_eq!(note, None);
        let (axis, note) = Axis::from_nadir(&[0.0, 5.0, 60.0, 65.0]);
        assert_eq!(axis.locate(66.0), None);
        assert!(note.unwrap().contains("dark beyond"));
    }
}
