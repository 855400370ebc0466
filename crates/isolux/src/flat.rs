//! Points and colours as rows of plain numbers, the way arrays hold them.

use isolux_core::DVec3;
use isolux_core::units::Rgb;

/// Three coordinates per point.
pub fn points(points: impl IntoIterator<Item = DVec3>) -> Vec<f64> {
    points.into_iter().flat_map(|point| point.to_array()).collect()
}

/// Three bands per value.
pub fn bands(values: impl IntoIterator<Item = Rgb>) -> Vec<f64> {
    values.into_iter().flat_map(|value| value.0).collect()
}
