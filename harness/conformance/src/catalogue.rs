//! The files of the pack.

use luxproof_photometry::Goniometer;

use crate::closed_form::ClosedForm;
use crate::document::{Document, Edition, Eulumdat, LampSet, Layout, Lm63, Tilt, Tm33};
use crate::mistake::Variant;
use crate::pack_file::{AskedDirection, PackFile};
use crate::table::Table;

/// The version of the pack: the first number changes where an answer changes, the second where files are added.
pub const PACK_VERSION: &str = "1.0.0";

const WHOLE_CIRCLE: [f64; 9] = [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0, 360.0];
const HALF_FROM_C0: [f64; 5] = [0.0, 45.0, 90.0, 135.0, 180.0];
const HALF_FROM_C90: [f64; 5] = [90.0, 135.0, 180.0, 225.0, 270.0];
/// EULUMDAT stores the half about C 0 of a luminaire that is symmetric in C 90 - C 270.
const HALF_ABOUT_C0: [f64; 5] = [-90.0, -45.0, 0.0, 45.0, 90.0];
/// Without 45 degrees, at which planes that are repeated answer what mirrored ones do.
const QUADRANT: [f64; 4] = [0.0, 30.0, 60.0, 90.0];
/// EULUMDAT files of the pack have eight planes in the whole circle.
const EULUMDAT_QUADRANT: [f64; 3] = [0.0, 45.0, 90.0];
const ALL_GAMMAS: [f64; 7] = [0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0];
const LOWER_GAMMAS: [f64; 4] = [0.0, 30.0, 60.0, 90.0];
const UPPER_GAMMAS: [f64; 4] = [90.0, 120.0, 150.0, 180.0];
/// Even steps would place node 3 where node 2 is.
const UNEVEN_GAMMAS: [f64; 4] = [0.0, 60.0, 75.0, 90.0];
const UNEVEN_PLANES: [f64; 7] = [0.0, 90.0, 180.0, 225.0, 270.0, 315.0, 360.0];
/// The lamp flux of EULUMDAT files, by which the numbers of the table are divided.
const KILOLUMENS: f64 = 8.0;
const NATIVE_ANGLES: [f64; 7] = [-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0];
/// More than horizontal angles: a table in the wrong order is then no table with exchanged axes.
const NATIVE_VERTICALS: [f64; 13] = [-90.0, -75.0, -60.0, -45.0, -30.0, -15.0, 0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0];
const NATIVE_HALF: [f64; 4] = [0.0, 30.0, 60.0, 90.0];

/// All files of the pack, those of LM-63 first.
pub fn pack_files() -> Vec<PackFile> {
    let mut files = lm63_files();
    files.extend(lm63_ranges());
    files.extend(lm63_types());
    files.extend(eulumdat_files());
    files.extend(tm33_files());
    files.push(PackFile {
        name: "product.gldf",
        feature: "A GLDF container with two EULUMDAT files, of which product.xml refers to the second.",
        document: Document::Gldf(Eulumdat::with_symmetry(0)),
        ..type_c(&WHOLE_CIRCLE, &ALL_GAMMAS, ClosedForm::Skew, KILOLUMENS)
    });
    files
}

/// A file of type C without name, an LM-63 file unless it gets another document.
fn type_c(planes: &[f64], gammas: &[f64], form: ClosedForm, factor: f64) -> PackFile {
    PackFile {
        name: "",
        feature: "",
        form,
        table: Table::tabulate(Goniometer::C, planes, gammas, form, factor),
        document: Document::Lm63(Lm63::default()),
        directions: without_edges(nodes_of_type_c(planes), gammas),
        variants: vec![],
    }
}

/// Directions that are not on the end of a table that ends before a pole: there rounding decides between light and dark.
fn without_edges(directions: Vec<AskedDirection>, gammas: &[f64]) -> Vec<AskedDirection> {
    let is_edge = |gamma: f64| {
        let is_end = gammas.first() == Some(&gamma) || gammas.last() == Some(&gamma);
        is_end && gamma != 0.0 && gamma != 180.0
    };
    directions.into_iter().filter(|asked| !is_edge(asked.gamma_deg)).collect()
}

/// Directions on nodes of a table of type C with these planes, in steps of 30 degrees of gamma, or beyond its end.
fn nodes_of_type_c(planes: &[f64]) -> Vec<AskedDirection> {
    let oblique = planes.iter().copied().find(|c| (1.0..90.0).contains(c)).unwrap_or(45.0);
    let mut directions = vec![AskedDirection::exact(0.0, 0.0)];
    for gamma in [30.0, 60.0, 90.0, 120.0, 150.0] {
        directions.extend([0.0, 90.0, 180.0, 270.0].map(|c| AskedDirection::exact(c, gamma)));
    }
    let mirrored = [oblique, 180.0 - oblique, 180.0 + oblique, 360.0 - oblique];
    directions.extend(mirrored.map(|c| AskedDirection::exact(c, 60.0)));
    directions.push(AskedDirection::exact(0.0, 180.0));
    directions
}

/// LM-63 files about the fields before the table.
fn lm63_files() -> Vec<PackFile> {
    let file = |name, feature, lm63: Lm63, factor| PackFile {
        name,
        feature,
        document: Document::Lm63(lm63),
        ..type_c(&WHOLE_CIRCLE, &ALL_GAMMAS, ClosedForm::Skew, factor)
    };
    let plain = Lm63::default();
    vec![
        PackFile {
            variants: vec![Variant::UsdLuxAngleScale],
            ..file(
                "plain.ies",
                "Nothing special: LM-63-2002, absolute photometry, all planes, both hemispheres.",
                plain.clone(),
                1.0,
            )
        },
        file(
            "edition-1986.ies",
            "LM-63-1986: no line names the edition, and lines before TILT are labels.",
            Lm63 { edition: Edition::Lm63_1986, ..plain.clone() },
            1.0,
        ),
        file(
            "edition-1991.ies",
            "LM-63-1991: the first line is IESNA91.",
            Lm63 { edition: Edition::Lm63_1991, ..plain.clone() },
            1.0,
        ),
        file(
            "edition-1995.ies",
            "LM-63-1995: the first line is IESNA:LM-63-1995.",
            Lm63 { edition: Edition::Lm63_1995, ..plain.clone() },
            1.0,
        ),
        file(
            "edition-2019.ies",
            "LM-63-2019: the number behind the ballast factor, 1.1, is a code of how the file was made.",
            Lm63 { edition: Edition::Lm63_2019, third_number: 1.1, ..plain.clone() },
            1.0,
        ),
        file("multiplier.ies", "A candela multiplier of 2.5.", Lm63 { multiplier: 2.5, ..plain.clone() }, 2.5),
        file("ballast-factor.ies", "A ballast factor of 0.8.", Lm63 { ballast_factor: 0.8, ..plain.clone() }, 0.8),
        file(
            "ballast-lamp-factor-1991.ies",
            "A ballast-lamp photometric factor of 0.7 in LM-63-1991, which defines it.",
            Lm63 { edition: Edition::Lm63_1991, third_number: 0.7, ..plain.clone() },
            0.7,
        ),
        PackFile {
            variants: vec![Variant::ThirdNumberIgnored, Variant::ThirdNumberApplied],
            ..file(
                "third-number-1995.ies",
                "0.7 behind the ballast factor in LM-63-1995, which reserves the number.",
                Lm63 { edition: Edition::Lm63_1995, third_number: 0.7, ..plain.clone() },
                1.0,
            )
        },
        file(
            "all-factors.ies",
            "Relative photometry of 2 lamps with a multiplier of 2.5 and a ballast factor of 0.8.",
            Lm63 { lamps: 2, lumens_per_lamp: 4000.0, multiplier: 2.5, ballast_factor: 0.8, ..plain.clone() },
            2.0,
        ),
        file(
            "relative.ies",
            "Relative photometry: 2 lamps of 4000 lm.",
            Lm63 { lamps: 2, lumens_per_lamp: 4000.0, ..plain.clone() },
            1.0,
        ),
        PackFile {
            variants: vec![Variant::TiltIgnored, Variant::TiltApplied],
            ..file(
                "tilt-include.ies",
                "TILT=INCLUDE: four lines of tilt factors follow, 0.8 at every angle.",
                Lm63 { tilt: Tilt::Included, ..plain.clone() },
                1.0,
            )
        },
        file(
            "feet.ies",
            "Dimensions in feet: 1 ft along C 90 and 2 ft along C 0.",
            Lm63 { is_in_feet: true, dimensions: [1.0, 2.0, 0.0], ..plain.clone() },
            1.0,
        ),
        file(
            "wrapped-lines.ies",
            "Numbers of records over several lines, as LM-63 allows.",
            Lm63 { layout: Layout::Wrapped, ..plain.clone() },
            1.0,
        ),
        file(
            "misleading-keywords.ies",
            "Keywords that contain TILT= and numbers, and [MORE].",
            Lm63 { layout: Layout::MisleadingKeywords, ..plain },
            1.0,
        ),
    ]
}

/// LM-63 files about the ranges of angles.
fn lm63_ranges() -> Vec<PackFile> {
    let between = [(0.0, 40.0), (90.0, 110.0), (20.0, 60.0), (250.0, 90.0), (60.0, 50.0), (200.0, 70.0)];
    vec![
        PackFile {
            name: "planes-0-180.ies",
            feature: "Planes from 0 to 180: the other half is the mirror image in C 0 - C 180.",
            ..type_c(&HALF_FROM_C0, &ALL_GAMMAS, ClosedForm::MirroredInC0, 1.0)
        },
        PackFile {
            name: "planes-90-270.ies",
            feature: "Planes from 90 to 270: the other half is the mirror image in C 90 - C 270.",
            ..type_c(&HALF_FROM_C90, &ALL_GAMMAS, ClosedForm::MirroredInC90, 1.0)
        },
        PackFile {
            name: "planes-0-90.ies",
            feature: "Planes from 0 to 90: the other quadrants are mirror images.",
            ..type_c(&QUADRANT, &ALL_GAMMAS, ClosedForm::MirroredInBoth, 1.0)
        },
        PackFile {
            name: "single-plane.ies",
            feature: "A single plane, the same for every C.",
            ..type_c(&[0.0], &ALL_GAMMAS, ClosedForm::Axial, 1.0)
        },
        PackFile {
            name: "ends-at-90.ies",
            feature: "A table that ends at the horizon, with light: above it is dark.",
            ..type_c(&WHOLE_CIRCLE, &LOWER_GAMMAS, ClosedForm::Skew, 1.0)
        },
        PackFile {
            name: "begins-at-90.ies",
            feature: "A table that begins at the horizon, with light: below it is dark.",
            ..type_c(&WHOLE_CIRCLE, &UPPER_GAMMAS, ClosedForm::Skew, 1.0)
        },
        PackFile {
            name: "uneven-steps.ies",
            feature: "Angles in uneven steps.",
            directions: nodes_of_uneven_steps(),
            ..type_c(&UNEVEN_PLANES, &UNEVEN_GAMMAS, ClosedForm::Skew, 1.0)
        },
        PackFile {
            name: "interpolation.ies",
            feature: "Directions between the nodes: interpolations differ, and none is wrong.",
            directions: nodes_of_type_c(&WHOLE_CIRCLE)
                .into_iter()
                .chain(between.map(|(c, gamma)| AskedDirection::between(c, gamma)))
                .collect(),
            variants: vec![],
            ..type_c(&WHOLE_CIRCLE, &ALL_GAMMAS, ClosedForm::Skew, 1.0)
        },
    ]
}

/// Nodes of the file in uneven steps.
fn nodes_of_uneven_steps() -> Vec<AskedDirection> {
    let mut directions = vec![AskedDirection::exact(0.0, 0.0)];
    for gamma in [60.0, 75.0, 120.0] {
        directions.extend([0.0, 90.0, 180.0, 225.0, 270.0].map(|c| AskedDirection::exact(c, gamma)));
    }
    directions
}

/// LM-63 files of types A and B.
fn lm63_types() -> Vec<PackFile> {
    vec![
        PackFile {
            name: "type-a.ies",
            feature: "Photometric type A: H about the vertical axis, clockwise seen from above; V 0 is the horizon.",
            ..native(Goniometer::A, &NATIVE_ANGLES, ClosedForm::Skew, 1.0)
        },
        PackFile {
            name: "type-b.ies",
            feature: "Photometric type B: V about the horizontal axis, H 0 V 0 is the nadir and V 90 the horizon at C 0.",
            variants: vec![Variant::AimedAtNadir, Variant::AimedAtHorizon],
            ..native(Goniometer::B, &NATIVE_ANGLES, ClosedForm::Skew, 1.0)
        },
        PackFile {
            name: "type-b-half.ies",
            feature: "Photometric type B with H from 0 to 90: the half with negative H is the mirror image.",
            variants: vec![Variant::AimedAtNadir, Variant::AimedAtHorizon],
            ..native(Goniometer::B, &NATIVE_HALF, ClosedForm::MirroredInC0, 1.0)
        },
    ]
}

/// A file of type A or B without name.
fn native(goniometer: Goniometer, horizontals: &[f64], form: ClosedForm, factor: f64) -> PackFile {
    PackFile {
        name: "",
        feature: "",
        form,
        table: Table::tabulate(goniometer, horizontals, &NATIVE_VERTICALS, form, factor),
        document: Document::Lm63(Lm63::default()),
        directions: native_directions(goniometer),
        variants: vec![],
    }
}

/// Nodes of a table of type A or B, and directions beyond its end.
fn native_directions(goniometer: Goniometer) -> Vec<AskedDirection> {
    // Not on the edges of the table, where rounding decides between light and dark.
    let mut nodes = vec![(0.0, 0.0)];
    for angle in [-60.0, -30.0, 30.0, 60.0] {
        nodes.extend([(0.0, angle), (angle, 0.0)]);
    }
    for v in [-30.0, 60.0] {
        nodes.extend([(60.0, v), (-60.0, v), (30.0, v)]);
    }
    let mut directions: Vec<AskedDirection> =
        nodes.into_iter().map(|(h, v)| AskedDirection::native(goniometer, h, v)).collect();
    let beyond = match goniometer {
        // Behind the luminaire.
        Goniometer::A => [(180.0, 90.0), (180.0, 60.0), (135.0, 120.0), (225.0, 60.0)],
        // Above the horizon.
        Goniometer::B | Goniometer::C => [(0.0, 120.0), (180.0, 150.0), (60.0, 120.0), (0.0, 180.0)],
    };
    directions.extend(beyond.map(|(c, gamma)| AskedDirection::exact(c, gamma)));
    directions
}

/// EULUMDAT files.
fn eulumdat_files() -> Vec<PackFile> {
    let file = |name, feature, document: Eulumdat, factor: f64| {
        let (planes, form) = match document.symmetry {
            1 => (&[0.0][..], ClosedForm::Axial),
            2 => (&HALF_FROM_C0[..], ClosedForm::MirroredInC0),
            3 => (&HALF_ABOUT_C0[..], ClosedForm::MirroredInC90),
            4 => (&EULUMDAT_QUADRANT[..], ClosedForm::MirroredInBoth),
            _ => (&WHOLE_CIRCLE[..], ClosedForm::Skew),
        };
        PackFile { name, feature, document: Document::Eulumdat(document), ..type_c(planes, &ALL_GAMMAS, form, factor) }
    };
    let plain = Eulumdat::with_symmetry(0);
    vec![
        file(
            "isym-0.ldt",
            "Isym 0: all planes are stored. The lamp has 8000 lm, and intensities are in cd/klm.",
            plain.clone(),
            KILOLUMENS,
        ),
        file(
            "isym-1.ldt",
            "Isym 1: one plane is stored, the same for every C.",
            Eulumdat::with_symmetry(1),
            KILOLUMENS,
        ),
        file(
            "isym-2.ldt",
            "Isym 2: planes from 0 to 180 are stored, mirrored in C 0 - C 180.",
            Eulumdat::with_symmetry(2),
            KILOLUMENS,
        ),
        file(
            "isym-3.ldt",
            "Isym 3: planes from 270 over 0 to 90 are stored, mirrored in C 90 - C 270.",
            Eulumdat::with_symmetry(3),
            KILOLUMENS,
        ),
        file(
            "isym-4.ldt",
            "Isym 4: planes from 0 to 90 are stored, mirrored twice.",
            Eulumdat::with_symmetry(4),
            KILOLUMENS,
        ),
        file(
            "conversion-factor.ldt",
            "A conversion factor for luminous intensities of 0.9.",
            Eulumdat { conversion_factor: 0.9, ..plain.clone() },
            0.9 * KILOLUMENS,
        ),
        PackFile {
            name: "uplight.ldt",
            feature: "A table that begins at the horizon: DFF is 0 and only describes the table.",
            document: Document::Eulumdat(plain.clone()),
            ..type_c(&WHOLE_CIRCLE, &UPPER_GAMMAS, ClosedForm::Skew, KILOLUMENS)
        },
        file(
            "lamp-count.ldt",
            "2 lamps of 8000 lm together: the flux of a set is that of all its lamps.",
            Eulumdat { sets: vec![LampSet::new(2, 8000.0)], ..plain.clone() },
            KILOLUMENS,
        ),
        PackFile {
            variants: vec![Variant::FirstLampSet, Variant::LastLampSet, Variant::LampSetsSummed],
            ..file(
                "lamp-sets.ldt",
                "Two lamp sets, of 8000 and of 12000 lm.",
                Eulumdat { sets: vec![LampSet::new(1, 8000.0), LampSet::new(1, 12000.0)], ..plain.clone() },
                KILOLUMENS,
            )
        },
        file(
            "absolute.ldt",
            "Absolute photometry: the number of lamps is -1.",
            Eulumdat { sets: vec![LampSet::new(-1, 8000.0)], ..plain },
            KILOLUMENS,
        ),
    ]
}

/// TM-33 files.
fn tm33_files() -> Vec<PackFile> {
    let absolute = Tm33 { multiplier: 1.0, rated_lumens: None };
    let tm33 = |multiplier, rated_lumens| Document::Tm33(Tm33 { multiplier, rated_lumens });
    vec![
        PackFile {
            name: "tm33-type-c.xml",
            feature: "TM-33, type C, all planes.",
            document: Document::Tm33(absolute.clone()),
            ..type_c(&WHOLE_CIRCLE, &ALL_GAMMAS, ClosedForm::Skew, 1.0)
        },
        PackFile {
            name: "tm33-planes-90-270.xml",
            feature: "TM-33, type C, planes from 90 to 270, mirrored in C 90 - C 270.",
            document: Document::Tm33(absolute.clone()),
            ..type_c(&HALF_FROM_C90, &ALL_GAMMAS, ClosedForm::MirroredInC90, 1.0)
        },
        PackFile {
            name: "tm33-type-a.xml",
            feature: "TM-33, type A.",
            document: Document::Tm33(absolute.clone()),
            ..native(Goniometer::A, &NATIVE_ANGLES, ClosedForm::Skew, 1.0)
        },
        PackFile {
            name: "tm33-type-b.xml",
            feature: "TM-33, type B.",
            document: Document::Tm33(absolute),
            variants: vec![Variant::AimedAtNadir, Variant::AimedAtHorizon],
            ..native(Goniometer::B, &NATIVE_ANGLES, ClosedForm::Skew, 1.0)
        },
        PackFile {
            name: "tm33-multiplier.xml",
            feature: "TM-33 with a multiplier of 2.5.",
            document: tm33(2.5, None),
            ..type_c(&WHOLE_CIRCLE, &ALL_GAMMAS, ClosedForm::Skew, 2.5)
        },
        PackFile {
            name: "tm33-relative.xml",
            feature: "TM-33, relative photometry with 8000 rated lumens.",
            document: tm33(1.0, Some(8000.0)),
            ..type_c(&WHOLE_CIRCLE, &ALL_GAMMAS, ClosedForm::Skew, 1.0)
        },
    ]
}
