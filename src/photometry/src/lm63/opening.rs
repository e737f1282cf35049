//! Luminous openings of LM-63: the signs of width, length and height encode a shape, differently in each edition.
//!
//! Sources: ANSI/IESNA LM-63-02 and ANSI/IES LM-63-19. The length is along "photometric horizontal" (C 0), so that the
//! width is along C 90. For earlier editions: IESNA LM-63-1995 and I. Ashdown, *Parsing the IESNA LM-63 photometric data
//! file* (1998). Radiance's `ies2rad` agrees: length along x, width along y, C 0 along x.

use super::Edition;
use crate::{HorizontalAxis, LuminousOpening};

/// Decodes width, length and height into the shape of an edition.
type Decoder = fn(f64, f64, f64) -> Option<LuminousOpening>;

/// The opening of three dimensions (metres, signed as in the file), and a remark on unusual ones.
pub(super) fn from_dimensions(
    edition: Edition,
    width_m: f64,
    length_m: f64,
    height_m: f64,
) -> (LuminousOpening, Option<String>) {
    let decoders: [Decoder; 2] = if edition <= Edition::Lm63_1995 {
        [decode_up_to_1995, decode_since_2002]
    } else {
        [decode_since_2002, decode_up_to_1995]
    };
    let [by_edition, by_other_edition] = decoders.map(|decode| decode(width_m, length_m, height_m));
    if let Some(opening) = by_edition {
        return (opening, describe_flattening(opening, width_m, length_m, height_m));
    }
    let dimensions = format!("the luminous opening {width_m} x {length_m} x {height_m} m (width, length, height)");
    match by_other_edition {
        Some(opening) => {
            let name = edition.name();
            let remark =
                format!("{dimensions} is written as in another edition than {name}; it was read as in that one");
            (opening, Some(remark))
        }
        None if width_m == 0.0 && length_m < 0.0 && height_m >= 0.0 => {
            let opening = LuminousOpening::Ellipse { x_m: -length_m, y_m: -length_m, height_m };
            (opening, Some(format!("{dimensions} gives its diameter as the length; it was read as round")))
        }
        None => {
            let (x_m, y_m, height_m) = (length_m.abs(), width_m.abs(), height_m.abs());
            let boxed = LuminousOpening::Box { x_m, y_m, height_m };
            (boxed, Some(format!("{dimensions} has signs that no edition defines; it was read as a box")))
        }
    }
}

/// Decodes LM-63-1986 to 1995: a negative width alone is round, a positive partner marks the axis of the length.
fn decode_up_to_1995(w: f64, l: f64, h: f64) -> Option<LuminousOpening> {
    let (wa, la, ha) = (w.abs(), l.abs(), h.abs());
    match (sign(w), sign(l), sign(h)) {
        (0, 0, 0) => Some(LuminousOpening::Point),
        (0.., 0.., 0..) => Some(LuminousOpening::Box { x_m: la, y_m: wa, height_m: ha }),
        (-1, 0, 0..) => Some(LuminousOpening::Ellipse { x_m: wa, y_m: wa, height_m: ha }),
        (-1, 0, -1) if wa == ha => Some(LuminousOpening::Ellipsoid { x_m: wa, y_m: wa, z_m: wa }),
        (0, 1, -1) => Some(lying(HorizontalAxis::X, la, ha, ha)),
        (1, 0, -1) => Some(lying(HorizontalAxis::Y, wa, ha, ha)),
        (-1, 1, 0..) | (1, -1, 0..) => Some(LuminousOpening::Ellipse { x_m: la, y_m: wa, height_m: ha }),
        (-1, 1, -1) | (1, -1, -1) => Some(LuminousOpening::Ellipsoid { x_m: la, y_m: wa, z_m: ha }),
        _ => None,
    }
}

/// Decodes LM-63-2002 and 2019: each negative dimension is a rounded one.
fn decode_since_2002(w: f64, l: f64, h: f64) -> Option<LuminousOpening> {
    let (wa, la, ha) = (w.abs(), l.abs(), h.abs());
    match (sign(w), sign(l), sign(h)) {
        (0, 0, 0) => Some(LuminousOpening::Point),
        (0.., 0.., 0..) => Some(LuminousOpening::Box { x_m: la, y_m: wa, height_m: ha }),
        (-1, -1, 0..) => Some(LuminousOpening::Ellipse { x_m: la, y_m: wa, height_m: ha }),
        (-1, -1, -1) => Some(LuminousOpening::Ellipsoid { x_m: la, y_m: wa, z_m: ha }),
        (-1, 1, -1) => Some(lying(HorizontalAxis::X, la, wa, ha)),
        (1, -1, -1) => Some(lying(HorizontalAxis::Y, wa, la, ha)),
        // A vertical circle or ellipse facing photometric horizontal: an ellipsoid without thickness along x.
        (-1, 0, -1) => Some(LuminousOpening::Ellipsoid { x_m: 0.0, y_m: wa, z_m: ha }),
        _ => None,
    }
}

/// Encodes an opening as width, length and height in metres; `None` where the edition lacks its shape.
pub(super) fn to_dimensions(edition: Edition, opening: &LuminousOpening) -> Option<[f64; 3]> {
    let (dimensions, decode): (_, Decoder) = if edition <= Edition::Lm63_1995 {
        (encode_up_to_1995(opening), decode_up_to_1995)
    } else {
        (encode_since_2002(opening), decode_since_2002)
    };
    // The file does not keep the sign of a minus zero.
    let dimensions = dimensions.map(|d| if d == 0.0 { 0.0 } else { d });
    let [w, l, h] = dimensions;
    (decode(w, l, h) == Some(*opening)).then_some(dimensions)
}

/// Encodes an opening for LM-63-1986 to 1995, as far as those editions have its shape.
fn encode_up_to_1995(opening: &LuminousOpening) -> [f64; 3] {
    match *opening {
        LuminousOpening::Point => [0.0; 3],
        LuminousOpening::Box { x_m, y_m, height_m } => [y_m, x_m, height_m],
        LuminousOpening::Ellipse { x_m, y_m, height_m } if x_m == y_m => [-y_m, 0.0, height_m],
        LuminousOpening::Ellipse { x_m, y_m, height_m } => [-y_m, x_m, height_m],
        LuminousOpening::Ellipsoid { x_m, y_m, z_m } if x_m == y_m && y_m == z_m => [-y_m, 0.0, -z_m],
        LuminousOpening::Ellipsoid { x_m, y_m, z_m } => [-y_m, x_m, -z_m],
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::X, length_m, diameter_m } => {
            [0.0, length_m, -diameter_m]
        }
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, length_m, diameter_m } => {
            [length_m, 0.0, -diameter_m]
        }
    }
}

/// Encodes an opening for LM-63-2002 and 2019, as far as those editions have its shape.
fn encode_since_2002(opening: &LuminousOpening) -> [f64; 3] {
    match *opening {
        LuminousOpening::Point => [0.0; 3],
        LuminousOpening::Box { x_m, y_m, height_m } => [y_m, x_m, height_m],
        LuminousOpening::Ellipse { x_m, y_m, height_m } => [-y_m, -x_m, height_m],
        LuminousOpening::Ellipsoid { x_m, y_m, z_m } => [-y_m, -x_m, -z_m],
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::X, length_m, diameter_m } => {
            [-diameter_m, length_m, -diameter_m]
        }
        LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, length_m, diameter_m } => {
            [length_m, -diameter_m, -diameter_m]
        }
    }
}

/// A lying cylinder. An elliptical one becomes round with the same cross-section.
fn lying(axis: HorizontalAxis, length_m: f64, across_m: f64, height_m: f64) -> LuminousOpening {
    let diameter_m = if across_m == height_m { height_m } else { (across_m * height_m).sqrt() };
    LuminousOpening::LyingCylinder { axis, length_m, diameter_m }
}

/// Describes the change of an elliptical lying cylinder to a round one.
fn describe_flattening(opening: LuminousOpening, w: f64, l: f64, h: f64) -> Option<String> {
    let LuminousOpening::LyingCylinder { axis, diameter_m, .. } = opening else { return None };
    let across = if axis == HorizontalAxis::X { w.abs() } else { l.abs() };
    let is_elliptical = across != 0.0 && across != h.abs();
    is_elliptical.then(|| {
        let h = h.abs();
        format!("an elliptical lying cylinder, {across} x {h} m, was read as a round one of diameter {diameter_m:.4} m")
    })
}

/// The sign of a dimension: -1, 0 or 1.
fn sign(x: f64) -> i8 {
    if x > 0.0 {
        1
    } else if x < 0.0 {
        -1
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn length_lies_along_c0_and_width_along_c90() {
        let (opening, odd) = from_dimensions(Edition::Lm63_2002, 0.3, 1.2, 0.1);
        assert_eq!(opening, LuminousOpening::Box { x_m: 1.2, y_m: 0.3, height_m: 0.1 });
        assert_eq!(odd, None);
    }

    #[test]
    fn the_1995_table_of_shapes_and_its_inverse() {
        use HorizontalAxis::{X, Y};
        use LuminousOpening::{Box, Ellipse, Ellipsoid, LyingCylinder, Point};
        let (d, l, h) = (0.12, 0.34, 0.56);
        for (dimensions, expected) in [
            ([0.0, 0.0, 0.0], Point),
            ([d, l, 0.0], Box { x_m: l, y_m: d, height_m: 0.0 }),
            ([d, l, h], Box { x_m: l, y_m: d, height_m: h }),
            ([-d, 0.0, 0.0], Ellipse { x_m: d, y_m: d, height_m: 0.0 }),
            ([-d, 0.0, h], Ellipse { x_m: d, y_m: d, height_m: h }),
            ([-d, 0.0, -d], Ellipsoid { x_m: d, y_m: d, z_m: d }),
            ([0.0, l, -d], LyingCylinder { axis: X, length_m: l, diameter_m: d }),
            ([d, 0.0, -l], LyingCylinder { axis: Y, length_m: d, diameter_m: l }),
            ([-d, l, h], Ellipse { x_m: l, y_m: d, height_m: h }),
            ([d, -l, h], Ellipse { x_m: l, y_m: d, height_m: h }),
            ([-d, l, -h], Ellipsoid { x_m: l, y_m: d, z_m: h }),
            ([d, -l, -h], Ellipsoid { x_m: l, y_m: d, z_m: h }),
        ] {
            let [w, l, h] = dimensions;
            assert_eq!(from_dimensions(Edition::Lm63_1995, w, l, h), (expected, None), "{dimensions:?}");
            // Two ways to write an ellipse and an ellipsoid mean the same.
            let written = to_dimensions(Edition::Lm63_1995, &expected).unwrap();
            assert_eq!(from_dimensions(Edition::Lm63_1995, written[0], written[1], written[2]), (expected, None));
        }
        assert_eq!(to_dimensions(Edition::Lm63_1995, &Ellipse { x_m: d, y_m: d, height_m: h }), Some([-d, 0.0, h]));
        assert_eq!(to_dimensions(Edition::Lm63_1995, &Ellipsoid { x_m: 0.0, y_m: d, z_m: h }), None);
    }

    #[test]
    fn the_2002_table_of_shapes_and_its_inverse() {
        use HorizontalAxis::{X, Y};
        use LuminousOpening::{Box, Ellipse, Ellipsoid, LyingCylinder, Point};
        let (d, l, h) = (0.12, 0.34, 0.56);
        for (dimensions, expected) in [
            ([0.0, 0.0, 0.0], Point),
            ([d, l, 0.0], Box { x_m: l, y_m: d, height_m: 0.0 }),
            ([d, l, h], Box { x_m: l, y_m: d, height_m: h }),
            ([-d, -d, 0.0], Ellipse { x_m: d, y_m: d, height_m: 0.0 }),
            ([-d, -l, 0.0], Ellipse { x_m: l, y_m: d, height_m: 0.0 }),
            ([-d, -d, h], Ellipse { x_m: d, y_m: d, height_m: h }),
            ([-d, -l, h], Ellipse { x_m: l, y_m: d, height_m: h }),
            ([-d, -d, -d], Ellipsoid { x_m: d, y_m: d, z_m: d }),
            ([-d, -l, -h], Ellipsoid { x_m: l, y_m: d, z_m: h }),
            ([-d, l, -d], LyingCylinder { axis: X, length_m: l, diameter_m: d }),
            ([l, -d, -d], LyingCylinder { axis: Y, length_m: l, diameter_m: d }),
            ([-d, 0.0, -h], Ellipsoid { x_m: 0.0, y_m: d, z_m: h }),
        ] {
            let [w, l, h] = dimensions;
            assert_eq!(from_dimensions(Edition::Lm63_2002, w, l, h), (expected, None), "{dimensions:?}");
            assert_eq!(to_dimensions(Edition::Lm63_2002, &expected), Some(dimensions), "{expected:?}");
        }
    }

    #[test]
    fn signs_of_another_edition_are_understood_and_remarked() {
        let (opening, odd) = from_dimensions(Edition::Lm63_1995, -0.5, -0.5, 0.0);
        assert_eq!(opening, LuminousOpening::Ellipse { x_m: 0.5, y_m: 0.5, height_m: 0.0 });
        assert!(odd.unwrap().contains("another edition"));
        let (opening, odd) = from_dimensions(Edition::Lm63_1991, 0.0, -0.32, 0.0);
        assert_eq!(opening, LuminousOpening::Ellipse { x_m: 0.32, y_m: 0.32, height_m: 0.0 });
        assert!(odd.unwrap().contains("round"));
        let (opening, odd) = from_dimensions(Edition::Lm63_1991, 0.1, 0.2, -0.3);
        assert_eq!(opening, LuminousOpening::Box { x_m: 0.2, y_m: 0.1, height_m: 0.3 });
        assert!(odd.unwrap().contains("no edition"));
    }
}
