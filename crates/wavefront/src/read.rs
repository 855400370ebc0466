//! Values at points: a field and a place go in, the light there comes out.

use crate::field::INNER;
use crate::geometry::{Element, Geometry, NONE};
use crate::light::{Bands, Field, Light};
use crate::link::MIDDLE;
use glam::{DVec3, Vec3};
use isolux_core::solution::bilinear_coordinates;
use isolux_core::tree::Cut;
use rayon::prelude::*;

/// Finds the leaves that hold points, for many points: all that it looks at on the way down lies close together.
pub(crate) struct Reader {
    /// Of each element the first quarter, or [`NONE`].
    first_child: Vec<u32>,
    cuts: Vec<Cut>,
    /// Corners by polygon: three or four.
    counts: Vec<u8>,
    maps: Vec<Map>,
}

/// Takes points of a polygon to coordinates along two of its sides.
enum Map {
    /// Of a triangle or a parallelogram: from a corner, along both sides from there.
    Affine { corner: Vec3, along: [Vec3; 2] },
    /// Of another quadrilateral: its corners and its normal.
    Bilinear([Vec3; 4], Vec3),
}

impl Reader {
    pub(crate) fn new(geometry: &Geometry, elements: &[Element]) -> Reader {
        let first_child = elements.iter().map(|element| element.first_child).collect();
        let roots = &elements[..geometry.surfaces.len()];
        let map = |root: &Element| -> Map {
            if root.lean() != [0.0; 2] {
                return Map::Bilinear(root.corners, geometry.surfaces[root.polygon as usize].normal);
            }
            let [a, b, c, d] = root.corners.map(|corner| corner.as_dvec3());
            let sides = [b - a, if root.count == 4 { d - a } else { c - a }];
            let normal = sides[0].cross(sides[1]);
            // What is 1 along one side and 0 along the other.
            let along = [sides[1].cross(normal), normal.cross(sides[0])].map(|side| side / normal.length_squared());
            Map::Affine { corner: root.corners[0], along: along.map(|along| along.as_vec3()) }
        };
        Reader {
            first_child,
            cuts: elements.iter().map(|element| element.cut).collect(),
            counts: roots.iter().map(|root| root.count).collect(),
            maps: roots.par_iter().with_min_len(1024).map(map).collect(),
        }
    }

    /// Irradiance at a point of a polygon, in the middle's coordinates.
    pub(crate) fn field_at(&self, light: &Light, polygon: u32, point: Vec3) -> Bands {
        let (leaf, shares) = self.shares_at(polygon, point);
        let field = &light.field[leaf];
        std::array::from_fn(|band| (0..5).map(|k| shares[k] * field[k][band]).sum::<f32>().max(0.0))
    }

    /// The leaf that holds a point of a polygon, and what the irradiance there has of each value of the leaf's field, as long
    /// as it is above nothing.
    pub(crate) fn shares_at(&self, polygon: u32, point: Vec3) -> (usize, [f32; 5]) {
        let mut index = polygon as usize;
        let mut place = self.place(index, point);
        while self.first_child[index] != NONE {
            index = self.first_child[index] as usize + place.descend(self.cuts[index]);
        }
        (index, place.shares())
    }

    fn place(&self, polygon: usize, point: Vec3) -> Place {
        let [s, t] = match &self.maps[polygon] {
            Map::Affine { corner, along } => along.map(|along| f64::from(along.dot(point - *corner)).clamp(0.0, 1.0)),
            Map::Bilinear(corners, normal) => {
                return Place::new(&corners.map(|corner| corner.as_dvec3()), normal.as_dvec3(), point.as_dvec3());
            }
        };
        if self.counts[polygon] == 4 {
            return Place::Quadrilateral([s, t]);
        }
        let first = (1.0 - s - t).max(0.0);
        Place::Triangle([first, s, (1.0 - first - s).max(0.0)])
    }
}

/// Irradiance of a node at its samples, by the leaves below it, without what lamps throw there.
pub(crate) fn samples(elements: &[Element], light: &Light, node: usize) -> Field {
    let count = elements[node].count as usize;
    let inner = f64::from(INNER);
    std::array::from_fn(|k| {
        let mut place = if count == 4 {
            let corner = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]][k];
            Place::Quadrilateral(corner.map(|along: f64| 0.5 + inner * (along - 0.5)))
        } else {
            let corner = if k == MIDDLE { usize::MAX } else { k.min(2) };
            let share = if k == MIDDLE { 0.0 } else { inner };
            Place::Triangle(std::array::from_fn(|l| (1.0 - share) / 3.0 + if l == corner { share } else { 0.0 }))
        };
        let mut index = node;
        while elements[index].first_child != NONE {
            index = elements[index].first_child as usize + place.descend(elements[index].cut);
        }
        place.value(&light.without_lamps(index))
    })
}

/// A leaf's field at one of its points: linear along the sides, and the bulge in between. A point that rounding puts
/// outside takes the value on the border.
pub(crate) fn within(corners: &[DVec3], normal: DVec3, point: DVec3, field: &Field) -> Bands {
    Place::new(corners, normal, point).value(field)
}

/// The same before it is cut off at nothing: linear in the field.
pub(crate) fn signed_within(corners: &[DVec3], normal: DVec3, point: DVec3, field: &Field) -> [f64; 3] {
    Place::new(corners, normal, point).signed(field)
}

/// Where a point is in an element.
#[derive(Clone, Copy, Debug)]
enum Place {
    /// Coordinates of the bilinear map.
    Quadrilateral([f64; 2]),
    /// Barycentric coordinates.
    Triangle([f64; 3]),
}

impl Place {
    fn new(corners: &[DVec3], normal: DVec3, point: DVec3) -> Place {
        if let &[a, b, c, d] = corners {
            let (s, t) = bilinear_coordinates([a, b, c, d], normal, point);
            return Place::Quadrilateral([s, t]);
        }
        let (a, b, c) = (corners[0], corners[1], corners[2]);
        let whole = normal.dot((b - a).cross(c - a));
        let first = (normal.dot((b - point).cross(c - point)) / whole).clamp(0.0, 1.0);
        let second = (normal.dot((c - point).cross(a - point)) / whole).clamp(0.0, 1.0);
        Place::Triangle([first, second, (1.0 - first - second).max(0.0)])
    }

    /// Goes on to the part that holds the point, and says which it is: parts of a bilinear map are bilinear maps.
    fn descend(&mut self, cut: Cut) -> usize {
        match self {
            Place::Quadrilateral(place) if cut != Cut::Quarters => {
                let along = &mut place[usize::from(cut == Cut::Across)];
                let strip = (4.0 * *along).floor().min(3.0);
                *along = 4.0 * *along - strip;
                strip as usize
            }
            Place::Quadrilateral(place) => {
                let upper = place.map(|along| along >= 0.5);
                for (along, upper) in place.iter_mut().zip(upper) {
                    *along = 2.0 * *along - if upper { 1.0 } else { 0.0 };
                }
                match upper {
                    [false, false] => 0,
                    [true, false] => 1,
                    [true, true] => 2,
                    [false, true] => 3,
                }
            }
            Place::Triangle(place) => {
                let corner = place.iter().position(|&weight| weight > 0.5);
                *place = match corner {
                    Some(corner) => std::array::from_fn(|k| 2.0 * place[k] - if k == corner { 1.0 } else { 0.0 }),
                    None => place.map(|weight| 1.0 - 2.0 * weight),
                };
                corner.unwrap_or(3)
            }
        }
    }

    /// What corners count along the sides, what the bulge counts, and how many corners there are.
    fn weights(&self) -> ([f64; 4], f64, usize) {
        match *self {
            Place::Quadrilateral([s, t]) => {
                let (u, v) = (2.0 * s - 1.0, 2.0 * t - 1.0);
                let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
                (weights, 1.0 - 0.5 * (u * u + v * v), 4)
            }
            Place::Triangle([a, b, c]) => ([a, b, c, 0.0], 3.0 * (a * b + b * c + c * a), 3),
        }
    }

    /// What the field has here of each of its values.
    fn shares(&self) -> [f32; 5] {
        let (weights, bulge, count) = self.weights();
        let corner = |k: usize| if k < count { weights[k] - bulge / count as f64 } else { 0.0 };
        std::array::from_fn(|k| if k == MIDDLE { bulge as f32 } else { corner(k) as f32 })
    }

    fn value(&self, field: &Field) -> Bands {
        self.signed(field).map(|band| band.max(0.0) as f32)
    }

    fn signed(&self, field: &Field) -> [f64; 3] {
        let (weights, bulge, count) = self.weights();
        std::array::from_fn(|band| {
            let at = |k: usize| f64::from(field[k][band]);
            let plain: f64 = (0..count).map(|k| weights[k] * at(k)).sum();
            let mean = (0..count).map(at).sum::<f64>() / count as f64;
            plain + bulge * (at(MIDDLE) - mean)
        })
    }
}

/// Which part of an element holds a point: [`Cut::part_at`] in single precision.
pub(crate) fn part_at(element: &Element, normal: Vec3, point: Vec3) -> usize {
    if element.cut == Cut::Quarters {
        return quadrant(element, normal, point);
    }
    let [a, b, c, d] = element.corners;
    let along = element.cut == Cut::Along;
    let (from, to) = if along { ([a, d], [b, c]) } else { ([b, a], [c, d]) };
    let is_beyond = |k: &usize| {
        let [near, far] = [0, 1].map(|side| from[side] + (to[side] - from[side]) * (0.25 * *k as f32));
        normal.dot((far - near).cross(point - near)) <= 0.0
    };
    (1..4).take_while(is_beyond).count()
}

/// Which quarter holds a point: [`isolux_core::tree::quadrant_of`] in single precision.
pub(crate) fn quadrant(element: &Element, normal: Vec3, point: Vec3) -> usize {
    let left = |from: Vec3, to: Vec3| normal.dot((to - from).cross(point - from)) > 0.0;
    let middle = |a: Vec3, b: Vec3| (a + b) * 0.5;
    let [a, b, c, d] = element.corners;
    let (ab, bc) = (middle(a, b), middle(b, c));
    if element.count == 4 {
        let (cd, da) = (middle(c, d), middle(d, a));
        match (left(ab, cd), left(da, bc)) {
            (true, false) => 0,
            (false, false) => 1,
            (false, true) => 2,
            (true, true) => 3,
        }
    } else {
        let ca = middle(c, a);
        if left(ab, ca) {
            0
        } else if left(bc, ab) {
            1
        } else if left(ca, bc) {
            2
        } else {
            3
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::rays::even_point_of;
    use crate::samples::painted;
    use isolux_core::sampling::Stream;

    /// Catches leaves and places that a reader finds elsewhere than where a point was taken from: on triangles, parallelograms
    /// and other quadrilaterals, above leaves of different sizes, in quarters and in strips.
    #[test]
    fn a_reader_finds_the_leaf_that_holds_a_point() {
        let shapes: [&[[f64; 3]]; 5] = [
            &[[0.0, 0.0, 0.0], [3.0, 0.5, 0.0], [0.5, 2.0, 0.0]],
            &[[0.0, 0.0, 1.0], [3.0, 0.0, 1.0], [3.5, 1.0, 2.0], [0.5, 1.0, 2.0]],
            &[[0.0, 0.0, 4.0], [2.0, 0.0, 4.0], [2.5, 1.5, 4.0], [0.0, 1.0, 4.0]],
            &[[0.0, 0.0, 5.0], [4.0, 0.0, 5.0], [4.0, 0.1, 5.0], [0.0, 0.1, 5.0]],
            &[[0.0, 0.0, 6.0], [0.1, 0.0, 6.0], [0.2, 3.0, 6.0], [0.0, 3.0, 6.0]],
        ];
        let geometry = Geometry::new(painted(&shapes, 0.5, 0.0));
        let mut elements = geometry.bare_roots();
        elements.iter_mut().for_each(|root| root.cut = root.compact_cut());
        assert_eq!(elements.iter().filter(|root| root.cut != Cut::Quarters).count(), 2);
        let mut stream = Stream::new(7);
        for _ in 0..200 {
            let parent = (stream.next_unit() * elements.len() as f64) as usize;
            if elements[parent].first_child == NONE {
                elements[parent].first_child = elements.len() as u32;
                let quarters = elements[parent].parts(parent as u32);
                elements.extend(quarters);
            }
        }
        let reader = Reader::new(&geometry, &elements);
        for leaf in (0..elements.len()).filter(|&index| elements[index].first_child == NONE) {
            let element = &elements[leaf];
            for _ in 0..8 {
                // Well within: on a border rounding decides.
                let place = even_point_of(element, [stream.next_unit() as f32, stream.next_unit() as f32]);
                let place = place + (element.centre() - place) * 1e-3;
                let (found, shares) = reader.shares_at(element.polygon, place);
                assert_eq!(found, leaf, "{place}");
                let mut node = element.polygon as usize;
                while elements[node].first_child != NONE {
                    let normal = geometry.surfaces[element.polygon as usize].normal;
                    node = elements[node].first_child as usize + part_at(&elements[node], normal, place);
                }
                assert_eq!(node, leaf, "{place}");
                let corners = element.corners.map(|corner| corner.as_dvec3());
                let normal = geometry.surfaces[element.polygon as usize].normal.as_dvec3();
                let own = Place::new(&corners[..element.count as usize], normal, place.as_dvec3()).shares();
                // Coordinates are as good as single precision is over the whole, in quarters of quarters.
                let coarse = 1e-6 * (1_u32 << element.path.depth()) as f32;
                assert!((0..5).all(|k| (shares[k] - own[k]).abs() < coarse), "{shares:?} {own:?}");
            }
        }
    }

    /// Catches shares that are not what a value is made of, on quadrilaterals and triangles.
    #[test]
    fn shares_make_the_value() {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.5, 1.5], [0.0, 1.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let field: Field = std::array::from_fn(|k| std::array::from_fn(|band| 1.0 + ((3 * k + band) * 7 % 11) as f32));
        for count in [3, 4] {
            for point in [[0.1, 0.1], [0.9, 0.2], [0.4, 0.5]].map(|[x, y]| DVec3::new(x, y, 0.0)) {
                let place = Place::new(&corners[..count], DVec3::Z, point);
                let (value, shares) = (place.value(&field), place.shares());
                for band in 0..3 {
                    let sum: f32 = (0..5).map(|k| shares[k] * field[k][band]).sum();
                    // Five terms of single precision, of 11 at most.
                    assert!((sum - value[band]).abs() < 1e-5, "{count} {point}: {sum} {}", value[band]);
                }
            }
        }
    }
}
