//! Faces whose emission varies: triangles with an emissive texture come in, how finely they are cut goes out, and the
//! parts with what their texture averages to; each part becomes a face of its own, so that a screen lights the room as
//! its picture says, not as its mean.
//!
//! A triangle is cut by lines parallel to its sides at equal steps. All triangles of a primitive are cut alike, so that
//! corners of parts meet along the sides that they share. Two parts that make a parallelogram are a cell, and become
//! one polygon.

use super::mesh::Piece;
use crate::read::look::Loaded;
use glam::{DVec2, DVec3};
use isolux_core::scene::Surface;
use isolux_core::units::Rgb;

/// Emission that varies by at most this within the parts of a primitive, on average and relative to its mean, is left
/// as it is: the mean over bands of the difference between what a cell emits and what quarters of its parts do. 5 % is
/// what `isolux solve` asks for where nothing else is said.
const EVEN: f64 = 0.05;

/// Most steps along a side: 16, 512 parts of a square of two triangles.
const MOST_STEPS: usize = 16;

/// Most faces that cutting may make in one file, all instances counted.
pub(super) const MOST_PARTS: usize = 1 << 12;

/// The parts of a triangle that is cut into `steps` along each side, by the barycentric coordinates of their corners;
/// in cells of two that make a parallelogram, with the side between them parallel to that from the second to the third
/// corner, and of one along that side. `Scene::build` joins those of two.
fn cells(steps: usize) -> Vec<Vec<[DVec3; 3]>> {
    let at = |i: usize, j: usize| DVec3::new((steps - i - j) as f64, i as f64, j as f64) / steps as f64;
    let mut cells = Vec::new();
    for j in 0..steps {
        for i in 0..steps - j {
            let mut cell = vec![[at(i, j), at(i + 1, j), at(i, j + 1)]];
            if i + j + 1 < steps {
                cell.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
            cells.push(cell);
        }
    }
    cells
}

/// How a triangle's corners are counted so that its longest side is from the second to the third: the number of the
/// first. Cells of a right triangle are then rectangles, as the texels of most pictures that are shown.
fn first_corner(piece: &Piece<'_>, triangle: [u32; 3]) -> usize {
    let corners = triangle.map(|corner| piece.position(corner));
    let opposite = |corner: usize| (corners[(corner + 1) % 3] - corners[(corner + 2) % 3]).length_squared();
    (1..3).fold(0, |best, corner| if opposite(corner) > opposite(best) { corner } else { best })
}

/// A part by the corners as the file counts them.
fn counted_from(part: &[DVec3; 3], first: usize) -> [DVec3; 3] {
    part.map(|at| match first {
        0 => at,
        1 => DVec3::new(at.z, at.x, at.y),
        _ => DVec3::new(at.y, at.z, at.x),
    })
}

/// The parts of a triangle of a piece, by the barycentric coordinates of their corners; none where it is whole.
pub(super) fn parts(piece: &Piece<'_>, triangle: [u32; 3]) -> Vec<[DVec3; 3]> {
    if piece.steps <= 1 {
        return Vec::new();
    }
    let first = first_corner(piece, triangle);
    cells(piece.steps).iter().flatten().map(|part| counted_from(part, first)).collect()
}

/// Into how many steps along a side the triangles of a piece are cut, with `budget` faces to spend on them.
pub(super) fn steps(piece: &Piece<'_>, loaded: &Loaded, budget: usize) -> usize {
    let Some((map, _)) = &loaded.emission else { return 1 };
    if !piece.has_coordinates(map.set) {
        return 1;
    }
    let fits =
        |steps: usize| piece.triangles.len().saturating_mul(piece.shown.max(1)).saturating_mul(steps * steps) <= budget;
    let mut steps = 1;
    while steps < MOST_STEPS && fits(2 * steps) {
        if variation(piece, loaded, steps) <= EVEN {
            return steps;
        }
        steps *= 2;
    }
    steps
}

/// By how much the emission within cells differs from what they emit together, on average and relative to the mean.
fn variation(piece: &Piece<'_>, loaded: &Loaded, steps: usize) -> f64 {
    let cells = cells(steps);
    let (mut off, mut sum) = (0.0, 0.0);
    for &triangle in &piece.triangles {
        let [a, b, c] = triangle.map(|corner| piece.position(corner));
        let (area, first) = ((b - a).cross(c - a).length(), first_corner(piece, triangle));
        let emission = |part: &[DVec3; 3]| surface(piece, loaded, triangle, Some(&counted_from(part, first))).emission;
        for cell in &cells {
            let whole = cell.iter().map(emission).sum::<Rgb>() / cell.len() as f64;
            sum += area * cell.len() as f64 * whole.mean();
            for quarter in cell.iter().flat_map(quarters) {
                let quarter = emission(&quarter);
                off += 0.25 * area * (0..3).map(|band| (quarter[band] - whole[band]).abs()).sum::<f64>() / 3.0;
            }
        }
    }
    if sum > 0.0 { off / sum } else { 0.0 }
}

/// The quarters of a part.
fn quarters(&[a, b, c]: &[DVec3; 3]) -> [[DVec3; 3]; 4] {
    let (ab, bc, ca) = ((a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5);
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
}

/// What a triangle looks like on average, or a part of it.
pub(super) fn surface(piece: &Piece<'_>, loaded: &Loaded, triangle: [u32; 3], part: Option<&[DVec3; 3]>) -> Surface {
    let corners = |set: u32| {
        let whole = piece.coordinates(set, triangle)?;
        Some(part.map_or(whole, |part| coordinates(whole, part)))
    };
    loaded.surface(corners, piece.colour(triangle, part))
}

/// Texture coordinates of a part's corners.
pub(super) fn coordinates(whole: [DVec2; 3], part: &[DVec3; 3]) -> [DVec2; 3] {
    part.map(|at| whole[0] * at.x + whole[1] * at.y + whole[2] * at.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches parts that overlap, leave a gap, turn over or do not pair up, whichever corner they are counted from.
    #[test]
    fn parts_make_up_the_triangle() {
        for (steps, first) in [(1, 0), (2, 1), (4, 2), (16, 0)] {
            let cells = cells(steps);
            assert_eq!(cells.iter().filter(|cell| cell.len() == 2).count(), steps * (steps - 1) / 2);
            for cell in cells.iter().filter(|cell| cell.len() == 2) {
                assert_eq!((cell[0][1], cell[0][2]), (cell[1][0], cell[1][2]));
                // Opposite sides are the same vector.
                assert!((cell[0][1] - cell[0][0] - (cell[1][1] - cell[1][2])).length() < 1e-15);
            }
            let parts: Vec<[DVec3; 3]> = cells.iter().flatten().map(|part| counted_from(part, first)).collect();
            assert_eq!(parts.len(), steps * steps);
            let doubled = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).dot(DVec3::ONE) / 3.0;
            let whole = doubled([DVec3::X, DVec3::Y, DVec3::Z]);
            for part in &parts {
                assert!((doubled(*part) * (steps * steps) as f64 / whole - 1.0).abs() < 1e-12);
                assert!(part.iter().all(|at| (at.element_sum() - 1.0).abs() < 1e-15 && at.min_element() >= 0.0));
                let by_quarters: f64 = quarters(part).into_iter().map(doubled).sum();
                assert!((by_quarters / doubled(*part) - 1.0).abs() < 1e-12);
            }
            // The first part lies at the corner that is counted first.
            assert_eq!(parts[0][0][first], 1.0);
            let centre = |part: &[DVec3; 3]| (part[0] + part[1] + part[2]) / 3.0;
            let mean = parts.iter().map(centre).sum::<DVec3>() / parts.len() as f64;
            assert!((mean - DVec3::splat(1.0 / 3.0)).length() < 1e-12);
        }
    }
}
