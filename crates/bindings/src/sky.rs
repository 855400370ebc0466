//! Skies: what Python describes in, the core's sky out, and what patterns come to.

use isolux::core::DVec3;
use isolux::core::scene::{Sky, SkyPattern};
use isolux::core::units::Rgb;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Three numbers as Python's tuple.
type Triple = (f64, f64, f64);

/// Base, c, d and e.
type Indicatrix = (f64, f64, f64, f64);

/// Name, direction towards the sun, gradation, indicatrix, radiance and ground's reflectance per band.
pub(crate) type SkyTuple = (String, Triple, Triple, Indicatrix, Triple, Triple);

fn pattern((a, b, slope): Triple, (base, c, d, e): Indicatrix) -> SkyPattern {
    SkyPattern { gradation: [a, b, slope], indicatrix: [base, c, d, e] }
}

/// A sky as Python describes it.
pub(crate) fn sky_of((name, sun, gradation, indicatrix, radiance, ground): SkyTuple) -> Sky {
    Sky {
        name,
        up: DVec3::Y,
        sun: sun.into(),
        pattern: pattern(gradation, indicatrix),
        radiance: Rgb(radiance.into()),
        ground: Rgb(ground.into()),
    }
}

/// The same the other way.
pub(crate) fn sky_tuple(sky: &Sky) -> SkyTuple {
    let SkyPattern { gradation, indicatrix } = sky.pattern;
    let (sun, radiance, ground) = (sky.sun.into(), sky.radiance.0.into(), sky.ground.0.into());
    (sky.name.clone(), sun, gradation.into(), indicatrix.into(), radiance, ground)
}

/// Gradation and indicatrix of a type of the CIE standard general sky, 1 to 16.
#[pyfunction]
pub(crate) fn cie_sky(number: i64) -> PyResult<(Triple, Indicatrix)> {
    let found = usize::try_from(number).ok().and_then(SkyPattern::cie);
    let SkyPattern { gradation, indicatrix } =
        found.ok_or_else(|| PyValueError::new_err(format!("there is no CIE sky {number}: expected 1 to 16")))?;
    Ok((gradation.into(), indicatrix.into()))
}

/// What a pattern throws on a level surface, sr; `sun`: sine of its height.
#[pyfunction]
pub(crate) fn sky_horizontal(gradation: Triple, indicatrix: Indicatrix, sun: f64) -> f64 {
    pattern(gradation, indicatrix).horizontal(sun)
}

/// A pattern by the cosines of the angles from the zenith and from the sun.
#[pyfunction]
pub(crate) fn sky_pattern(gradation: Triple, indicatrix: Indicatrix, from_zenith: f64, from_sun: f64) -> f64 {
    pattern(gradation, indicatrix).at(from_zenith, from_sun)
}
