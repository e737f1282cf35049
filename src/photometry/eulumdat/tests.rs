//! What a EULUMDAT file means, and which files are refused, where and why.

use super::*;
use crate::photometry::{Problem, Symmetry};

/// Lines of a file of this symmetry whose intensity at gamma 90 is 1 more than its C angle, in cd/klm.
fn lines(symmetry: u8, c_deg: &[f64], stored: &[f64]) -> Vec<String> {
    let head = "Maker|2|S|M|0|3|90|Report|Name|Number|File|Date|1200|100|50|1100|80|10|0|10|0|0|0|1|0\
                |1|2|LED|2000|4000 K|80|25|0|0|0|0|0|0|0|0|0|0";
    let head = head.replace('S', &symmetry.to_string()).replace("|M|", &format!("|{}|", c_deg.len()));
    let mut lines: Vec<String> = head.split('|').map(str::to_string).collect();
    lines.extend(c_deg.iter().map(f64::to_string));
    lines.extend(["0", "90", "180"].map(str::to_string));
    lines.extend(stored.iter().flat_map(|c| ["7".to_string(), (c + 1.0).to_string(), "7".to_string()]));
    lines
}

fn axial() -> Vec<String> {
    lines(1, &[0.0], &[0.0])
}

fn read(lines: &[String]) -> Result<Photometry, ReadError> {
    parse((lines.join("\r\n") + "\r\n").as_bytes())
}

fn codes(photometry: &Photometry) -> Vec<&str> {
    photometry.lints.iter().map(|lint| lint.code).collect()
}

#[test]
fn intensities_are_per_kilolumen_of_the_lamps() {
    let found = read(&axial()).unwrap();
    assert_eq!(found.distribution.plane(0), [14.0, 2.0, 14.0]);
    assert_eq!((found.lamp_lumens, found.input_watts), (Some(2000.0), Some(25.0)));
    assert_eq!(found.opening, LuminousOpening::Box { x_m: 0.08, y_m: 1.1, height_m: 0.01 });
    assert_eq!(found.keyword("MANUFAC"), Some("Maker"));
    assert_eq!(found.lints, []);
}

#[test]
fn every_symmetry_puts_its_planes_where_they_belong() {
    let around: Vec<f64> = (0..8).map(|k| f64::from(k) * 45.0).collect();
    for (symmetry, stored, expected, at) in [
        (0, &around[..], Symmetry::None, [(45.0, 45.0), (315.0, 315.0), (337.5, 157.5)]),
        (1, &[0.0][..], Symmetry::Axial, [(45.0, 0.0), (200.0, 0.0), (300.0, 0.0)]),
        (2, &[0.0, 45.0, 90.0, 135.0, 180.0], Symmetry::BilateralC0, [(45.0, 45.0), (315.0, 45.0), (270.0, 90.0)]),
        (3, &[270.0, 315.0, 0.0, 45.0, 90.0], Symmetry::BilateralC90, [(45.0, 45.0), (135.0, 45.0), (225.0, 315.0)]),
        (4, &[0.0, 45.0, 90.0], Symmetry::Quadrant, [(45.0, 45.0), (135.0, 45.0), (270.0, 90.0)]),
    ] {
        let found = read(&lines(symmetry, &around, stored)).unwrap();
        assert_eq!(found.distribution.symmetry(), expected);
        assert!(!codes(&found).contains(&"ldt/mirror"));
        for (c, value) in at {
            assert_eq!(found.distribution.intensity(c, 90.0).value(), 2.0 * (value + 1.0), "Isym {symmetry}, C {c}");
        }
    }
}

#[test]
fn liberties_are_tolerated_and_each_is_named() {
    let plain = read(&axial()).unwrap();
    for (line, value, code) in [
        (8, "\"Report\"", "ldt/quoted"),
        (9, "Näme", "ldt/not-ascii"),
        (25, "", "ldt/blank"),
        (25, "0,5", "ldt/decimal-comma"),
        (24, "2", "ldt/conversion-factor"),
        (24, "", "ldt/conversion-factor"),
        (27, "0", "ldt/lamps"),
        (23, "50", "ldt/output-ratio"),
        (22, "10", "ldt/downward-flux"),
        (49, "7\r\nremark", "ldt/trailing-text"),
        (1, "\u{feff}Maker", "ldt/byte-order-mark"),
    ] {
        let mut changed = axial();
        changed[line - 1] = value.into();
        let found = read(&changed).unwrap_or_else(|error| panic!("{error}"));
        assert!(codes(&found).contains(&code), "{code}: {:?}", found.lints);
        if (line, value) != (24, "2") {
            assert_eq!(found.distribution, plain.distribution, "{code}");
        }
    }
}

#[test]
fn negative_lamps_mean_absolute_photometry_and_the_first_set_counts() {
    let mut changed = axial();
    changed[26] = "-1".into();
    assert_eq!(read(&changed).unwrap().lamp_lumens, None);
    let mut changed = axial();
    changed[25] = "2".into();
    changed.splice(32..32, ["1", "other", "9999", "", "", "99"].map(String::from));
    let found = read(&changed).unwrap();
    assert_eq!((found.lamp_lumens, codes(&found)), (Some(2000.0), vec!["ldt/lamp-sets"]));
    let Details::Eulumdat(details) = found.details else { panic!("{:?}", found.details) };
    assert_eq!(details.lamp_sets[1].kind, "other");
}

#[test]
fn planes_that_are_no_mirror_images_are_remarked() {
    let around = [4.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0];
    let found = read(&lines(3, &around, &[270.0, 315.0, 4.0, 45.0, 90.0])).unwrap();
    assert_eq!(codes(&found)[0], "ldt/mirror");
    assert_eq!(found.distribution.intensity(176.0, 90.0).value(), 10.0);
    assert!(!write(&found).losses.is_empty());
}

#[test]
fn refusals_name_the_line() {
    for (line, value, at, word) in [
        (3, "5", 3, "whole numbers"),
        (4, "1000000000", 4, "bytes follow"),
        (4, "2.5", 4, "whole number"),
        (6, "1", 6, "two of gamma"),
        (13, "x", 13, "should be a number"),
        (13, "nan", 13, "not finite"),
        (16, "-1", 16, "zero or more"),
        (26, "0", 26, "one at least"),
        (29, "0", 29, "positive"),
        (29, "", 29, "should be a number"),
        (45, "0", 45, "rise strictly"),
        (46, "181", 46, "gamma"),
        (48, "-3", 48, "zero or more"),
        (48, "1e400", 48, "not finite"),
        (49, "7\r\n7", 50, "more numbers"),
    ] {
        let mut changed = axial();
        changed[line - 1] = value.into();
        let error = read(&changed).expect_err(word);
        assert!(error.message().contains(word), "{line} {value:?}: {error}");
        assert_eq!((error.line, error.column), (at, 1), "{error}");
    }
    let short = &axial()[..48];
    let error = read(short).unwrap_err();
    let expected = "the intensity at C 0 gamma 180".into();
    assert_eq!((error.line, error.problem), (49, Problem::UnexpectedEnd { expected }));
    let error = read(&lines(4, &[0.0, 60.0, 120.0, 180.0], &[0.0, 60.0])).unwrap_err();
    assert!(error.message().contains("must be 90"), "{error}");
}
