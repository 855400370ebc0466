//! Luminaires as lamps: a photometric file that was read comes in, the distribution of a lamp without a surface goes
//! out, and what is to be said of it; where it hangs is left to others.

use super::issue;
use isolux_core::scene::{Issue, IssueKind, Pole, Severity, Web};
use isolux_core::units::Unit;
use isolux_photometry::{Grid, Kind, Photometry};

/// The distribution of a luminaire, in the frame of a lamp whose `forward` is the luminaire's -Z and whose `side` is
/// its +X. Its +Y is `side × forward`, or the opposite of that where it is `mirrored`, as by a node whose transform has
/// a negative determinant. The table is the file's with its symmetry written out, for each type of photometry about its
/// own poles, so that intensities and flux are those of [`Photometry::intensity`] and [`Photometry::flux`].
#[must_use]
pub fn web(luminaire: &Photometry, mirrored: bool) -> Web {
    let Grid { mut polar, mut around, candela: mut intensity } = luminaire.web.grid();
    let kind = luminaire.web.kind();
    let rows = polar.len();
    if mirrored && kind == Kind::B {
        // The mirror changes the poles.
        polar = polar.into_iter().rev().map(|angle| 180.0 - angle).collect();
        intensity.chunks_exact_mut(rows).for_each(<[f64]>::reverse);
    } else if mirrored && around.len() > 1 {
        around = around.into_iter().rev().map(|angle| 360.0 - angle).collect();
        intensity = intensity.chunks_exact(rows).rev().flatten().copied().collect();
    }
    let pole = match kind {
        Kind::A => Pole::Aside,
        Kind::B => Pole::Across,
        Kind::C => Pole::Forward,
    };
    Web { polar, around, intensity, pole }
}

/// What is to be said of a lamp made of a luminaire: what was mended in its file, and that candela are no watts.
#[must_use]
pub fn issues(luminaire: &Photometry, lamp: &str, unit: Unit) -> Vec<Issue> {
    let warning = |message: String| issue(Severity::Warning, IssueKind::Assumed, lamp, message);
    let mut issues: Vec<Issue> = luminaire.warnings.iter().map(|mended| warning(mended.to_string())).collect();
    if unit == Unit::Radiometric {
        let message = format!("{}: candela count as W/sr where power is in W: nothing is converted", luminaire.file);
        issues.push(warning(message));
    }
    issues
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use isolux_core::scene::{Lamp, LampShape};
    use isolux_core::units::Rgb;
    use isolux_photometry::read;
    use std::path::{Path, PathBuf};

    fn files() -> Vec<PathBuf> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../photometry/tests/files");
        let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    }

    /// Catches poles, signs, edges or mirror images that differ between a file and the lamp made of it, in direction or
    /// flux, for every sound file there is: all types, symmetries and ranges.
    #[test]
    fn lamps_throw_what_files_say() {
        let (mut seen, mut kinds) = (0, [0; 3]);
        for luminaire in files().iter().filter_map(|path| read(path).ok()) {
            seen += 1;
            kinds[match luminaire.web.kind() {
                Kind::A => 0,
                Kind::B => 1,
                Kind::C => 2,
            }] += 1;
            for mirrored in [false, true] {
                let shape = LampShape::Web(web(&luminaire, mirrored));
                let (forward, side) = (DVec3::NEG_Z, DVec3::X);
                let (name, position, intensity) = ("lamp".into(), DVec3::ZERO, Rgb::splat(1.0));
                let lamp = Lamp { name, position, forward, side, intensity, shape };
                let (power, flux) = (lamp.power().unwrap()[0], luminaire.flux());
                // A millionth of a degree of light is lost or gained at each edge.
                assert!((power - flux).abs() <= 1e-6 * flux, "{}: {power} {flux}", luminaire.file);
                let most = luminaire.web.peak().candela;
                let mut lit = 0;
                for step in 0..2000_u32 {
                    // A spiral over the sphere, off all the edges that files have.
                    let z = 1.0 - (f64::from(step) + 0.37) / 1000.0;
                    let (sin, cos) = (f64::from(step) * 2.399_963 + 0.1).sin_cos();
                    let across = (1.0 - z * z).sqrt();
                    let direction = DVec3::new(across * cos, across * sin, z);
                    let own = if mirrored { direction * DVec3::new(1.0, -1.0, 1.0) } else { direction };
                    let wanted = luminaire.intensity(own.to_array());
                    let found = lamp.share(direction);
                    lit += u32::from(wanted > 0.0);
                    // Arcs of cosines are known to 1e-8 next to a pole, where intensity may change by its peak in a
                    // degree.
                    assert!((found - wanted).abs() <= 1e-6 * most, "{} {direction}: {found} {wanted}", luminaire.file);
                }
                assert!(lit > 20, "{}: {lit}", luminaire.file);
            }
        }
        assert!(seen > 25 && kinds.iter().all(|&count| count > 0), "{seen} {kinds:?}");
    }

    /// Catches what was mended in a file being lost on the way, and candela that become watts in silence.
    #[test]
    fn findings_come_along() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../photometry/tests/files/tilt-file.ies");
        let luminaire = read(&path).unwrap();
        assert!(!luminaire.warnings.is_empty());
        let said = issues(&luminaire, "lamp", Unit::Photometric);
        assert_eq!(said.len(), luminaire.warnings.len());
        assert!(said.iter().all(|found| found.object == "lamp" && found.severity == Severity::Warning));
        assert!(said[0].message.contains("tilt-file.ies: line "));
        let watts = issues(&luminaire, "lamp", Unit::Radiometric);
        assert!(watts.len() == said.len() + 1 && watts[said.len()].message.contains("W/sr"));
    }
}
