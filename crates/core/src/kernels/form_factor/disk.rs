//! The paper's kernel, four points to four disks: two patches go in, their exchange area comes out; which patch has the
//! points is left to `pair`.

use super::quadrature::Piece;
use crate::kernels::Patch;
use glam::DVec3;
use std::f64::consts::PI;

/// Points on a patch, and disks on the other, per form factor (the paper, section 2; its source, SPLASH-2, likewise).
const POINTS: usize = 4;

/// Exchange area by 4 points on `receiver` and 4 disks that cover `source`, m².
///
/// **Formula.** `A_i F_ij = A_i / 4 sum_k sum_l max(0, cos_kl cos'_kl) a_l / (pi r_kl^2 + a_l)`, both cosines positive.
///
/// **Symbols.** `k`: the middles of the four quarters of receiver i; `l`: the middles of the four quarters of source
/// j, each of area `a_l` in m²; `r_kl`: their distance in metres; `cos`, `cos'`: cosines of the angles between the line
/// from k to l and the normals of i and j; `A_i`: area of the receiver in m².
///
/// **Source.** J. R. Wallace, K. A. Elmquist, E. A. Haines, *A ray tracing algorithm for progressive radiosity*
/// (SIGGRAPH 1989): exact for a disk seen from a point on its axis.
///
/// **Preconditions.** Both patches planar and convex.
///
/// **Error bound.** None that holds everywhere. At present (test `disk_errors_keep_their_size`), unit squares: parallel
/// +3.6 % at distance 0.25, +1.6 % at 1, +0.8 % at 3, +0.09 % at 10; perpendicular with a shared edge -4.4 %.
pub(super) fn exchange_area(receiver: &Patch, source: &Patch) -> f64 {
    let receivers = Piece::new(receiver.corners).quarters();
    let sources = Piece::new(source.corners).quarters();
    let mut sum = 0.0;
    for &(p, _) in &receivers {
        for &(q, area) in &sources {
            sum += point_to_disk(p, receiver.plane.normal, q, source.plane.normal, area);
        }
    }
    receiver.area * (sum / POINTS as f64)
}

/// `cos cos' a / (pi r^2 + a)`, 0 unless both cosines are positive.
#[inline]
fn point_to_disk(p: DVec3, p_normal: DVec3, q: DVec3, q_normal: DVec3, area: f64) -> f64 {
    let ray = q - p;
    let square = ray.length_squared();
    let near = ray.dot(p_normal);
    let far = -ray.dot(q_normal);
    // The product of cosines is near * far / r^2; two positive factors make r positive.
    if near > 0.0 && far > 0.0 { near * far * area / (square * (PI * square + area)) } else { 0.0 }
}
