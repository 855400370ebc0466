//! The luminous opening: the three dimensions of a file come in, with their signs, a shape in metres comes out.

/// What light comes out of, seen from the side it shines to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OpeningShape {
    /// No extent, or none given.
    Point,
    /// A flat rectangle that faces -Z.
    Rectangle,
    /// A rectangle with luminous sides.
    Box,
    /// A flat disc that faces -Z; an ellipse where width and length differ.
    Disc,
    /// A cylinder along Z; elliptic where width and length differ.
    VerticalCylinder,
    /// A cylinder along X.
    CylinderX,
    /// A cylinder along Y.
    CylinderY,
    /// A sphere; an ellipsoid where the dimensions differ.
    Ellipsoid,
    /// A disc that faces X, the photometric horizontal; an ellipse where width and height differ.
    UprightDisc,
    /// A rectangle that stands upright: width or length is zero.
    UprightRectangle,
}

impl OpeningShape {
    /// Name in lower case, as the command shows it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            OpeningShape::Point => "point",
            OpeningShape::Rectangle => "rectangle",
            OpeningShape::Box => "box",
            OpeningShape::Disc => "disc",
            OpeningShape::VerticalCylinder => "vertical-cylinder",
            OpeningShape::CylinderX => "cylinder-x",
            OpeningShape::CylinderY => "cylinder-y",
            OpeningShape::Ellipsoid => "ellipsoid",
            OpeningShape::UprightDisc => "upright-disc",
            OpeningShape::UprightRectangle => "upright-rectangle",
        }
    }
}

/// Shape and size of the luminous opening, metres, along the axes of the luminaire's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opening {
    /// What it is.
    pub shape: OpeningShape,
    /// Extents along X, Y and Z, none negative. X is the plane H = 0: the length of an IES file, the width of an
    /// EULUMDAT file.
    pub size: [f64; 3],
}

impl Opening {
    /// An opening without extent.
    pub const POINT: Opening = Opening { shape: OpeningShape::Point, size: [0.0; 3] };

    /// Of an IES file: width (along Y), length (along X) and height (along Z) in metres; a negative one says that the
    /// opening is round there. `old` are the versions up to 1995, which give the diameter of a circle once (-D 0 0).
    ///
    /// Source of the signs: IES LM-63-2019, table 1; LM-63-1995 for the older ones.
    pub(crate) fn of_ies(width: f64, length: f64, height: f64, old: bool) -> Opening {
        let sign = |value: f64| if value == 0.0 { 0 } else { value.signum() as i8 };
        let (w, l, h) = (width.abs(), length.abs(), height.abs());
        let (shape, size) = match (sign(width), sign(length), sign(height)) {
            (0, 0, 0) => (OpeningShape::Point, [0.0; 3]),
            (1, 1, 0) => (OpeningShape::Rectangle, [l, w, 0.0]),
            (1, 1, 1) => (OpeningShape::Box, [l, w, h]),
            (1, 0, _) | (0, 1, _) | (0, 0, 1) => match (old, sign(height)) {
                // Along the one positive dimension; the height is the diameter.
                (true, -1) if w > 0.0 => (OpeningShape::CylinderY, [h, w, h]),
                (true, -1) => (OpeningShape::CylinderX, [l, h, h]),
                _ => (OpeningShape::UprightRectangle, [l, w, h]),
            },
            // The older way: the other dimension of the circle is left out.
            (-1, 0, 0) => (OpeningShape::Disc, [w, w, 0.0]),
            (0, -1, 0) => (OpeningShape::Disc, [l, l, 0.0]),
            (-1, 0, 1) => (OpeningShape::VerticalCylinder, [w, w, h]),
            (0, -1, 1) => (OpeningShape::VerticalCylinder, [l, l, h]),
            (-1, 0, -1) if old => (OpeningShape::Ellipsoid, [w, w, h]),
            (0, -1, -1) if old => (OpeningShape::Ellipsoid, [l, l, h]),
            (-1, 0, -1) => (OpeningShape::UprightDisc, [0.0, w, h]),
            (0, -1, -1) => (OpeningShape::UprightDisc, [l, 0.0, h]),
            (0, 0, -1) => (OpeningShape::Ellipsoid, [h, h, h]),
            // Ellipses of the older versions have one negative sign; no other version has such a row.
            (-1, -1, 0) | (-1, 1, 0) | (1, -1, 0) => (OpeningShape::Disc, [l, w, 0.0]),
            (-1, -1, 1) | (-1, 1, 1) | (1, -1, 1) => (OpeningShape::VerticalCylinder, [l, w, h]),
            (-1, -1, -1) => (OpeningShape::Ellipsoid, [l, w, h]),
            (-1, 1, -1) if old => (OpeningShape::Ellipsoid, [l, w, h]),
            (1, -1, -1) if old => (OpeningShape::Ellipsoid, [l, w, h]),
            (-1, 1, -1) => (OpeningShape::CylinderX, [l, w, h]),
            (1, -1, -1) => (OpeningShape::CylinderY, [l, w, h]),
            // A positive rectangle of negative height: the sides are round about no axis that a table has.
            _ => (OpeningShape::Box, [l, w, h]),
        };
        Opening { shape, size }
    }

    /// Of an EULUMDAT file: length (along Y) and width (along X) of the luminous area and its height, metres; width 0
    /// is a circle of diameter `length`.
    pub(crate) fn of_ldt(length: f64, width: f64, height: f64) -> Opening {
        if length <= 0.0 {
            return Opening::POINT;
        }
        let is_round = width <= 0.0;
        let shape = match (is_round, height > 0.0) {
            (true, false) => OpeningShape::Disc,
            (true, true) => OpeningShape::VerticalCylinder,
            (false, false) => OpeningShape::Rectangle,
            (false, true) => OpeningShape::Box,
        };
        Opening { shape, size: [if is_round { length } else { width }, length, height.max(0.0)] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use OpeningShape::{
        Box, CylinderX, CylinderY, Disc, Ellipsoid, Point, Rectangle, UprightDisc, UprightRectangle, VerticalCylinder,
    };

    /// Catches a row of the table of signs that goes to another shape, and width and length that change places.
    #[test]
    fn signs_make_shapes() {
        let new = [
            ((0.0, 0.0, 0.0), Point, [0.0, 0.0, 0.0]),
            ((2.0, 3.0, 0.0), Rectangle, [3.0, 2.0, 0.0]),
            ((2.0, 3.0, 1.0), Box, [3.0, 2.0, 1.0]),
            ((-2.0, -2.0, 0.0), Disc, [2.0, 2.0, 0.0]),
            ((-2.0, -3.0, 0.0), Disc, [3.0, 2.0, 0.0]),
            ((-2.0, -3.0, 1.0), VerticalCylinder, [3.0, 2.0, 1.0]),
            ((-2.0, -2.0, -2.0), Ellipsoid, [2.0, 2.0, 2.0]),
            ((-1.0, 3.0, -1.0), CylinderX, [3.0, 1.0, 1.0]),
            ((3.0, -1.0, -1.0), CylinderY, [1.0, 3.0, 1.0]),
            ((-1.0, 0.0, -1.0), UprightDisc, [0.0, 1.0, 1.0]),
            ((-2.0, 0.0, 0.0), Disc, [2.0, 2.0, 0.0]),
            ((2.0, 0.0, 1.0), UprightRectangle, [0.0, 2.0, 1.0]),
        ];
        for ((width, length, height), shape, size) in new {
            assert_eq!(Opening::of_ies(width, length, height, false), Opening { shape, size });
        }
        let old = [
            ((-2.0, 0.0, 0.0), Disc, [2.0, 2.0, 0.0]),
            ((-2.0, 0.0, 1.0), VerticalCylinder, [2.0, 2.0, 1.0]),
            ((-2.0, 0.0, -2.0), Ellipsoid, [2.0, 2.0, 2.0]),
            ((0.0, 3.0, -1.0), CylinderX, [3.0, 1.0, 1.0]),
            ((3.0, 0.0, -1.0), CylinderY, [1.0, 3.0, 1.0]),
            ((-1.0, 2.0, 0.0), Disc, [2.0, 1.0, 0.0]),
        ];
        for ((width, length, height), shape, size) in old {
            assert_eq!(Opening::of_ies(width, length, height, true), Opening { shape, size });
        }
    }

    /// Catches a circle of EULUMDAT that becomes a line, and sides that are lost.
    #[test]
    fn widths_of_zero_are_circles() {
        assert_eq!(Opening::of_ldt(0.5, 0.0, 0.0), Opening { shape: Disc, size: [0.5, 0.5, 0.0] });
        assert_eq!(Opening::of_ldt(0.5, 0.0, 0.2), Opening { shape: VerticalCylinder, size: [0.5, 0.5, 0.2] });
        assert_eq!(Opening::of_ldt(1.2, 0.3, 0.0), Opening { shape: Rectangle, size: [0.3, 1.2, 0.0] });
        assert_eq!(Opening::of_ldt(1.2, 0.3, 0.1), Opening { shape: Box, size: [0.3, 1.2, 0.1] });
        assert_eq!(Opening::of_ldt(0.0, 0.3, 0.1), Opening::POINT);
    }
}
