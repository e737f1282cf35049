//! The meaning of LM-63 files, and refusals with their places and reasons.

use super::*;
use crate::{LuminousOpening, Problem, Symmetry};

/// A whole file of this first line, ten numbers, three numbers and table.
fn file(first: &str, ten: &str, three: &str, table: &str) -> String {
    let keywords = "[TEST] 1\n[TESTLAB] Lab\n[ISSUEDATE] 2024-01-02\n[MANUFAC] Maker\n";
    format!("{first}\n{keywords}TILT=NONE\n{ten}\n{three}\n{table}\n")
}

const AXIAL: &str = "0 90 180\n0\n100 50 25";

fn codes(photometry: &Photometry) -> Vec<&str> {
    photometry.lints.iter().map(|lint| lint.code).collect()
}

/// Line, column and problem of the refusal.
fn refusal(text: &str) -> (usize, usize, Problem) {
    let error = parse(text.as_bytes()).expect_err("the file must be refused");
    (error.line, error.column, error.problem)
}

#[test]
fn a_plain_file_is_read_without_remark() {
    let text = file("IESNA:LM-63-2002", "2 1500 1 3 1 1 2 0.3 1.2 0", "1 1 36", AXIAL);
    let read = parse(text.as_bytes()).unwrap();
    assert_eq!(read.format, "LM-63-2002");
    assert_eq!(read.lints, []);
    assert_eq!(read.lamp_lumens, Some(3000.0));
    assert_eq!(read.input_watts, Some(36.0));
    assert_eq!(read.opening, LuminousOpening::Box { x_m: 1.2, y_m: 0.3, height_m: 0.0 });
    assert_eq!(read.keyword("manufac"), Some("Maker"));
    assert_eq!(read.distribution.symmetry(), Symmetry::Axial);
    assert_eq!(read.distribution.plane(0), [100.0, 50.0, 25.0]);
}

#[test]
fn each_edition_multiplies_by_its_own_factors() {
    for (first, expected) in [
        ("a label", 300.0),
        ("IESNA91", 300.0),
        ("IESNA:LM-63-1995", 300.0),
        ("IESNA:LM-63-2002", 100.0),
        ("IES:LM-63-2019", 100.0),
    ] {
        let text = file(first, "1 -1 2 3 1 1 2 0 0 0", "0.5 3 0", AXIAL);
        assert_eq!(parse(text.as_bytes()).unwrap().distribution.plane(0)[0], expected, "{first}");
    }
}

/// Reads a file that must be accepted.
fn read_accepted(text: &str) -> Photometry {
    parse(text.as_bytes()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

#[test]
fn feet_become_metres_and_minus_one_is_absolute_photometry() {
    let text = file("IESNA:LM-63-2002", "1 -1 1 3 1 1 1 -10 -10 0", "1 1 0", AXIAL);
    let read = parse(text.as_bytes()).unwrap();
    assert_eq!(read.lamp_lumens, None);
    assert_eq!(read.input_watts, None);
    assert_eq!(read.opening, LuminousOpening::Ellipse { x_m: 3.048, y_m: 3.048, height_m: 0.0 });
}

#[test]
fn width_length_and_height_are_each_in_the_unit_of_the_file() {
    // Width 2, length 3 and height 4; the width is across, along y.
    for (units, metres) in [(1, 0.3048), (2, 1.0)] {
        let text = file("IESNA:LM-63-2002", &format!("1 1000 1 3 1 1 {units} 2 3 4"), "1 1 0", AXIAL);
        let LuminousOpening::Box { x_m, y_m, height_m } = parse(text.as_bytes()).unwrap().opening else {
            panic!("no box")
        };
        for (found, expected) in [(x_m, 3.0), (y_m, 2.0), (height_m, 4.0)] {
            assert!((found - expected * metres).abs() < 1e-12, "{units}: {found} {expected}");
        }
    }
}

#[test]
fn quirks_are_tolerated_and_each_is_named() {
    let ten = "1 -1 1 3 1 1 2 0 0 0";

    for (first, edition) in [
        ("IESNA95", "LM-63-1995"),
        ("IESNA: LM-63-2002", "LM-63-2002"),
        ("IESNA:LM-63-91", "LM-63-1991"),
        (" IESNA:LM-63-1995", "LM-63-1995"),
        ("IES:LM-63-19", "LM-63-2019"),
    ] {
        let found = read_accepted(&file(first, ten, "1 1 0", AXIAL));
        assert_eq!(found.format, edition);
        let code = if first.starts_with(' ') { "lm63/leading-blanks" } else { "lm63/edition" };
        assert!(codes(&found).contains(&code), "{first}: {:?}", found.lints);
    }
    let plain = file("IESNA:LM-63-2002", ten, "1 1 0", AXIAL);
    let expected = read_accepted(&plain).distribution;
    for (from, to, code) in [
        ("1 -1 1 3 1 1 2 0 0 0", "1 -1 1\n3 1\n1 2 0 0 0", "lm63/broken-record"),
        ("100 50 25", "100. 50. 25.", "lm63/bare-point"),
        ("100 50 25", "100,50, 25", "lm63/commas"),
        ("100 50 25", "100 50 25\nEND OF FILE", "lm63/trailing-text"),
        ("[TEST] 1", "[TEST] 1\n[MORE] and more", "lm63/more"),
        ("[TEST] 1", "[TEST] 1\n[LAMP CAT] x", "lm63/keyword-blank"),
        ("[TEST] 1", "[TEST] 1\n no bracket", "lm63/label"),
        ("[TEST] 1", "", "lm63/keywords"),
        ("TILT=NONE", "Tilt = none", "lm63/tilt-spelling"),
        ("IESNA", "\u{feff}IESNA", "lm63/byte-order-mark"),
        ("\n0\n100", "\n45\n100", "planes/single"),
        ("0 90 180", "0 90 179", "planes/vertical-range"),
    ] {
        let found = read_accepted(&plain.replacen(from, to, 1));
        assert!(codes(&found).contains(&code), "{code}: {:?}", found.lints);
        if code != "planes/vertical-range" {
            assert_eq!(found.distribution, expected, "{code}");
        }
    }
    let latin = plain.replacen("Maker", "Müller", 1).chars().map(|c| c as u8).collect::<Vec<u8>>();
    let found = parse(&latin).unwrap();
    assert_eq!(found.keyword("MANUFAC"), Some("Müller"));
    assert_eq!(found.lints[0].code, "lm63/not-ascii");
    assert_eq!(found.lints[0].line, 5);
}

#[test]
fn more_lines_belong_to_the_keyword_before_them() {
    let text = file("IESNA:LM-63-2002", "1 -1 1 3 1 1 2 0 0 0", "1 1 0", AXIAL);
    let text = text.replacen("[TEST] 1", "[TEST] 1\n[OTHER] a\n[MORE]   b\n[MORE]c", 1);
    assert_eq!(parse(text.as_bytes()).unwrap().keyword("OTHER"), Some("a\nb\nc"));
}

#[test]
fn refusals_name_the_place() {
    let ten = "1 -1 1 3 1 1 2 0 0 0";
    let plain = file("IESNA:LM-63-2002", ten, "1 1 0", AXIAL);
    // Lines: 1 edition, 2-5 keywords, 6 TILT, 7 ten, 8 three, 9 vertical, 10 horizontal, 11 candela.
    for (from, to, line, column, word) in [
        ("100 50 25", "100 50", 12, 1, "candela value 3 of 3"),
        ("100 50 25", "100 50 25 12", 11, 11, "more numbers"),
        ("100 50 25", "100 NaN 25", 11, 5, "not finite"),
        ("100 50 25", "100 1e999 25", 11, 5, "not finite"),
        ("100 50 25", "100 1e301 25", 11, 5, "`1e301 x 1.0`, which is not finite or beyond 1e300"),
        ("100 50 25", "100 -50 25", 11, 5, "zero or more"),
        ("100 50 25", "100 fifty 25", 11, 5, "should be a number"),
        ("0 90 180", "0 90 90", 9, 6, "rise strictly"),
        ("0 90 180", "0 90 181", 9, 1, "within 0"),
        ("3 1 1 2 0", "3 1 4 2 0", 7, 12, "1 (C), 2 (B) or 3 (A)"),
        ("3 1 1 2 0", "3 1 1 3 0", 7, 14, "feet"),
        ("3 1 1 2 0", "1 1 1 2 0", 7, 8, "at least 2"),
        ("3 1 1 2 0", "2.5 1 1 2 0", 7, 8, "whole number"),
        ("3 1 1 2 0", "1e9 1 1 2 0", 7, 8, "bytes follow"),
        ("3 1 1 2 0", "3 1e300 1 2 0", 7, 10, "bytes follow"),
        ("1 -1 1", "1 -2 1", 7, 3, "-1 for absolute"),
        ("1 -1 1", "0 -1 1", 7, 1, "whole number"),
        ("1 -1 1", "2 1e308 1", 7, 3, "finite"),
        ("1 -1 1", "1 -1 0", 7, 6, "positive"),
        ("1 -1 1", "1 -1 1e-300 3 1 1 2 0 0 0 1e-300 1 0 ", 7, 6, "product"),
        ("TILT=NONE\n", "", 11, 1, "TILT="),
        ("TILT=NONE", "TILT=lamp.tlt", 6, 6, "without a folder"),
    ] {
        let (found_line, found_column, problem) = refusal(&plain.replacen(from, to, 1));
        let message = problem.to_string();
        assert!(message.contains(word), "{to:?}: {message}");
        assert_eq!((found_line, found_column), (line, column), "{to:?}: {message}");
    }
}

/// The tilt factors of an LM-63 file.
fn tilt(photometry: Photometry) -> Option<Tilt> {
    match photometry.details {
        Details::Lm63(details) => details.tilt,
        other @ (Details::None | Details::Eulumdat(_)) => panic!("{other:?}"),
    }
}

#[test]
fn tilt_factors_are_stored() {
    let plain = file("IESNA:LM-63-2002", "1 1000 1 3 1 1 2 0 0 0", "1 1 0", AXIAL);
    let records = "2\n3\n0 45 90\n1 .95 .9\n";
    let expected = Tilt { geometry: 2, angles_deg: vec![0.0, 45.0, 90.0], factors: vec![1.0, 0.95, 0.9] };

    let included = plain.replacen("TILT=NONE\n", &format!("TILT=INCLUDE\n{records}"), 1);
    assert_eq!(tilt(parse(included.as_bytes()).unwrap()), Some(expected.clone()));
    let named = plain.replacen("TILT=NONE", "TILT=lamp.tlt", 1);
    let read = parse_with(named.as_bytes(), |name| {
        assert_eq!(name, "lamp.tlt");
        Ok(records.into())
    });
    assert_eq!(tilt(read.unwrap()), Some(expected));
    assert_eq!(
        tilt_file_opener(Path::new("a/b.ies"), &|path| std::fs::read(path))("../x").unwrap_err(),
        "only a file in the same folder is looked for"
    );
}

/// A file of type C planes with this intensity at gamma 90.
fn read_planes(c: &[f64], intensity: impl Fn(f64) -> f64) -> Photometry {
    let angles: Vec<String> = c.iter().map(f64::to_string).collect();
    let rows: Vec<String> = c.iter().map(|&c| format!("5 {} 5", intensity(c))).collect();
    let table = format!("0 90 180\n{}\n{}", angles.join(" "), rows.join("\n"));
    let ten = format!("1 -1 1 3 {} 1 2 0 0 0", c.len());
    read_accepted(&file("IESNA:LM-63-2002", &ten, "1 1 0", &table))
}

/// The intensity at gamma 90.
fn at(photometry: &Photometry, c: f64) -> f64 {
    photometry.distribution.intensity(c, 90.0).value()
}

#[test]
fn planes_of_every_range_get_their_c_angles() {
    let quadrant = read_planes(&[0.0, 30.0, 90.0], |c| c);
    assert_eq!((quadrant.distribution.symmetry(), at(&quadrant, 150.0)), (Symmetry::Quadrant, 30.0));
    let c0 = read_planes(&[0.0, 100.0, 180.0], |c| c);
    assert_eq!((c0.distribution.symmetry(), at(&c0, 260.0)), (Symmetry::BilateralC0, 100.0));
    let c90 = read_planes(&[90.0, 100.0, 270.0], |c| c);
    assert_eq!((c90.distribution.symmetry(), at(&c90, 80.0)), (Symmetry::BilateralC90, 100.0));
    let about_zero = read_planes(&[-90.0, -10.0, 90.0], |c| 100.0 + c);
    assert_eq!((about_zero.distribution.symmetry(), at(&about_zero, 350.0)), (Symmetry::BilateralC90, 90.0));
    assert_eq!(at(&about_zero, 190.0), 90.0);
    let second_half = read_planes(&[180.0, 300.0, 360.0], |c| c);
    assert_eq!((second_half.distribution.symmetry(), at(&second_half, 60.0)), (Symmetry::BilateralC0, 300.0));
    let around = read_planes(&[-180.0, -20.0, 0.0, 70.0, 180.0], |c| 180.0 + (c + 180.0).rem_euclid(360.0));
    assert_eq!(around.distribution.symmetry(), Symmetry::None);
    assert_eq!((at(&around, 340.0), at(&around, 70.0), at(&around, 180.0)), (340.0, 430.0, 180.0));
    let open = read_planes(&[0.0, 90.0, 180.0, 270.0], |c| c);
    assert_eq!(codes(&open), ["planes/open-circle"]);
    assert_eq!((at(&open, 270.0), at(&open, 315.0)), (270.0, 135.0));
}

/// Numbers separated by blanks.
fn join(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// A file of this photometric type with the table `intensity(h, v)`.
fn spherical(kind: &str, h: &[f64], v: &[f64], intensity: impl Fn(f64, f64) -> f64) -> Photometry {
    let rows: Vec<String> = h.iter().map(|&h| join(&v.iter().map(|&v| intensity(h, v)).collect::<Vec<_>>())).collect();
    let table = format!("{}\n{}\n{}", join(v), join(h), rows.join("\n"));
    let ten = format!("1 -1 1 {} {} {kind} 2 0 0 0", v.len(), h.len());
    parse(file("IESNA:LM-63-2002", &ten, "1 1 0", &table).as_bytes()).unwrap()
}

fn every(step: i32, from: i32, to: i32) -> Vec<f64> {
    (from / step..=to / step).map(|k| f64::from(k * step)).collect()
}

/// An intensity without symmetry.
fn skew(h: f64, v: f64) -> f64 {
    1000.0 + 3.0 * h + v
}

#[test]
fn type_a_is_type_c_turned_and_exact_at_every_node() {
    let (h, v) = (every(15, -90, 90), every(10, -90, 90));
    let read = spherical("3", &h, &v, skew);
    for &h in &h {
        for &v in &v {
            // Photometric horizontal is H 0 V 0; H turns clockwise seen from above.
            assert_eq!(read.distribution.intensity(-h, 90.0 + v).value(), skew(h, v), "H {h} V {v}");
        }
    }
    assert_eq!(read.distribution.intensity(180.0, 90.0).value(), 0.0);
    assert!(codes(&read).contains(&"planes/edge"));
    let half = spherical("3", &every(15, 0, 90), &v, skew);
    assert_eq!(half.distribution.symmetry(), Symmetry::BilateralC0);
    assert_eq!(half.distribution.intensity(-15.0, 100.0).value(), skew(15.0, 10.0));
    assert_eq!(half.distribution.intensity(15.0, 100.0).value(), skew(15.0, 10.0));
}

/// The direction of type B angles.
fn direction_of_type_b(h: f64, v: f64) -> glam::DVec3 {
    let ((sh, ch), (sv, cv)) = (h.to_radians().sin_cos(), v.to_radians().sin_cos());
    glam::DVec3::new(ch * sv, -sh, -ch * cv)
}

#[test]
fn type_b_goes_through_every_node() {
    let (h, v) = (every(10, -90, 90), every(10, -90, 90));
    for (h, symmetry) in [(h, Symmetry::None), (every(10, 0, 90), Symmetry::BilateralC0)] {
        let read = spherical("2", &h, &v, |h, v| skew(h, v) * direction_of_type_b(h, v).z.abs());
        assert_eq!(read.distribution.symmetry(), symmetry);
        for &h in &h {
            for &v in &v {
                let towards = direction_of_type_b(h, v);
                let (found, expected) = (read.distribution.intensity_towards(towards), skew(h, v) * towards.z.abs());
                assert!((found.value() - expected).abs() < 1e-9, "H {h} V {v}: {found} {expected}");
            }
        }
    }
    let symmetric = spherical("2", &every(10, 0, 90), &v, |h, v| direction_of_type_b(h, v).z.abs());
    assert_eq!(symmetric.distribution.symmetry(), Symmetry::Quadrant);
    // A Lambertian source of 1 cd gives pi lumens; the file's own bilinear table is 0.5 % below it.
    let flux = symmetric.distribution.flux().value();
    assert!((flux / std::f64::consts::PI - 1.0).abs() < 0.01, "{flux}");
}

#[test]
fn a_fine_type_b_table_is_read_as_it_is() {
    let v = every(1, -60, 60);
    let read = spherical("2", &v, &v, |h, v| 1000.0 * (1.0 - h.abs() / 60.0) * (1.0 - v.abs() / 60.0));
    let distribution = &read.distribution;
    assert_eq!((distribution.c_deg().len(), distribution.gamma_deg().len()), (121, 121));
    assert!((distribution.intensity(0.0, 30.0).value() - 500.0).abs() < 1e-9);
}

#[test]
fn the_reference_file_of_case_s1_gives_its_converged_flux() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference/luminaires/axial.ies");
    let read = crate::read_file(&path).unwrap();
    approx::assert_relative_eq!(read.distribution.flux().value(), 1817.2814559, max_relative = 1e-9);
}

/// Converts a file of one edition to another: the three numbers, the intensity at the nadir, the losses.
fn converted(first: &str, three: &str, to: Edition) -> (String, f64, Vec<String>) {
    let read = parse(file(first, "1 -1 1 3 1 1 2 0 0 0", three, AXIAL).as_bytes()).unwrap();
    let written = write(&read, to);
    let three = written.text.lines().find(|line| line.ends_with(" 10")).unwrap().to_string();
    let again = parse(written.text.as_bytes()).unwrap();
    (three, again.distribution.plane(0)[0], written.losses)
}

#[test]
fn the_third_number_means_in_each_edition_what_it_meant_in_the_file() {
    const FACTOR: f64 = 100.0 * 0.9;
    for to in Edition::ALL {
        // A factor is in the intensities and multiplies once.
        for first in ["a label", "IESNA91", "IESNA:LM-63-1995"] {
            let (three, intensity, losses) = converted(first, "1 0.9 10", to);
            assert_eq!((three.as_str(), intensity), ("1 1 10", FACTOR), "{first} {to:?}");
            assert!(losses.iter().all(|loss| !loss.contains("ballast")), "{losses:?}");
        }
        // What is reserved means nothing.
        let (three, intensity, losses) = converted("IESNA:LM-63-2002", "1 0.9 10", to);
        assert_eq!((three.as_str(), intensity), ("1 1 10", 100.0), "{to:?}");
        let stated = losses.join("\n");
        assert!(stated.contains("0.9 behind the ballast factor was dropped: LM-63-2002 reserves"), "{stated}");
        // A file generation type is one in 2019 alone.
        let (three, intensity, losses) = converted("IES:LM-63-2019", "1 1.1 10", to);
        assert_eq!(intensity, 100.0);
        if to == Edition::Lm63_2019 {
            assert_eq!((three.as_str(), losses), ("1 1.1 10", vec![]));
        } else {
            assert_eq!(three, "1 1 10");
            assert!(losses.join("\n").contains("file generation type 1.1 was dropped"), "{losses:?}");
        }
    }
    let (three, intensity, losses) = converted("IESNA:LM-63-1995", "1 0 10", Edition::Lm63_1995);
    assert_eq!((three.as_str(), intensity), ("1 1 10", 100.0));
    assert!(losses.join("\n").contains("LM-63-1995 reserves"), "{losses:?}");
}

#[test]
fn editions_before_2002_have_other_keywords_and_shorter_lines() {
    let long = "word ".repeat(60);
    let text = file("IES:LM-63-2019", "1 -1 1 3 1 1 2 -0.1 -0.2 0.3", "1 1 10", AXIAL);
    let read = parse(text.replacen("[TEST] 1", &format!("[TEST] 1\n[OTHER] {long}"), 1).as_bytes()).unwrap();
    let old = write(&read, Edition::Lm63_1995);
    assert!(old.text.starts_with("IESNA:LM-63-1995\r\n"), "{}", old.text);
    assert!(old.text.lines().all(|line| line.len() <= 130), "{}", old.text);
    assert!(old.text.contains("\n[DATE] 2024-01-02\r") && old.text.contains("\n[_TESTLAB] Lab\r"), "{}", old.text);
    let stated = old.losses.join("\n");
    for message in [
        "[OTHER] broken into lines of at most 130 characters",
        "[TESTLAB] written as [_TESTLAB]: LM-63-1995 does not define it",
        "[ISSUEDATE] written as [DATE]",
    ] {
        assert!(stated.contains(message), "{stated}");
    }
    let again = parse(old.text.as_bytes()).unwrap();
    assert_eq!((again.format.as_str(), again.opening), ("LM-63-1995", read.opening));
    assert_eq!(again.lints.iter().map(|l| l.code).collect::<Vec<_>>(), ["lm63/more"]);
    assert_eq!(old.notes, Vec::<String>::new());
    let notes = write(&Photometry { keywords: vec![], ..read.clone() }, Edition::Lm63_1995).notes;
    assert_eq!(notes, ["LM-63-1995 asks for the keywords [TEST] [MANUFAC], of which nothing is known"]);
    // Two lines of the limit of 2002.
    assert_eq!(write(&read, Edition::Lm63_2002).text.matches("[MORE]").count(), 1);
}

/// Reads a file of these parts tolerantly, and checks that a strict reader refuses it if and only if damage was accepted.
fn read_tolerantly(ten: &str, three: &str, table: &str) -> Result<(Vec<&'static str>, Photometry), ReadError> {
    let text = file("IESNA:LM-63-2002", ten, three, table);
    let strict = parse(text.as_bytes());
    let read = read(text.as_bytes(), |_| Err(String::new()), Tolerance::Harmless)?;
    assert_eq!(strict.is_err(), read.lints.iter().any(|lint| lint.code.starts_with("forgiven/")), "{strict:?}");
    Ok((read.lints.iter().map(|lint| lint.code).collect(), read))
}

#[test]
fn a_tolerant_reader_accepts_harmless_damage_with_a_warning() {
    let ten = "1 -1 1 3 1 1 2 0 0 0";
    let (codes, read) = read_tolerantly(ten, "1 1 -1", AXIAL).unwrap();
    assert_eq!((codes, read.input_watts), (vec!["forgiven/watts"], None));
    assert_eq!((read.lints[0].line, read.lints[0].severity), (8, crate::Severity::Warning));
    assert_eq!(read_tolerantly("0 -1 1 3 1 1 2 0 0 0", "1 1 0", AXIAL).unwrap().0, ["forgiven/lamps"]);
    let (codes, read) = read_tolerantly("1 0 1 3 1 1 2 0 0 0", "1 1 0", AXIAL).unwrap();
    assert_eq!((codes, read.lamp_lumens), (vec!["forgiven/lumens"], None));
    assert_eq!(read_tolerantly(ten, "1 1 0", "0 90 180\n0\n100 50 25 0 0").unwrap().0, ["forgiven/surplus"]);
    let (codes, read) = read_tolerantly(ten, "1 1 0", "0 90 180\n0\n100 50 -0.1").unwrap();
    assert_eq!((codes, read.distribution.plane(0)), (vec!["forgiven/negative"], &[100.0, 50.0, 0.0][..]));
    // The last plane equals the first, which replaces its missing values.
    let circle =
        |last: &str| format!("0 90 180\n0 120 240 360\n9.00 1.00 2.00\n9.00 3.00 2.00\n9.00 4.00 2.00\n{last}");
    let ten = "1 -1 1 3 4 1 2 0 0 0";
    for last in ["9 1", "9", ""] {
        let (codes, read) = read_tolerantly(ten, "1 1 0", &circle(last)).unwrap();
        assert_eq!((codes, read.distribution.plane(3)), (vec!["forgiven/cut"], &[9.0, 1.0, 2.0][..]));
    }
    assert_eq!(read_tolerantly(ten, "1 1 0", &circle("9 1 2")).unwrap().0, Vec::<&str>::new());
}

#[test]
fn damage_that_can_change_light_is_refused() {
    let (ten, circle) = ("1 -1 1 3 1 1 2 0 0 0", "1 -1 1 3 4 1 2 0 0 0");
    for (ten, three, table, word) in [
        (ten, "1 1 0", "0 90 180\n0\n100 50 25 1 2 3", "more numbers"),
        (ten, "1 1 0", "0 90 180\n0\n100 50", "ends where"),
        // The table has one angle or plane more than the header states: all values are shifted.
        (ten, "1 1 0", "0 45 90 180\n0\n100 70 50 25", "more numbers"),
        ("1 -1 1 3 2 1 2 0 0 0", "1 1 0", "0 90 180\n0 45 90\n9 1 2\n9 3 2", "more numbers"),
        (ten, "1 1 0", "0 90 180\n0\n100 50 -5", "-5"),
        (ten, "0 1 0", AXIAL, "ballast factor"),
        ("1.5 -1 1 3 1 1 2 0 0 0", "1 1 0", AXIAL, "number of lamps"),
        (circle, "1 1 0", "0 90 180\n0 120 240 360\n9.00 1.00 2.00\n9.00 3.00 2.00\n9.00 4.00 2.00\n9 3", "ends where"),
        (circle, "1 1 0", "0 90 180\n0 120 240 360\n9.00 1.00 2.00\n9.00 3.00 2.00\n9.00 4.00", "ends where"),
    ] {
        let error = read_tolerantly(ten, three, table).expect_err(word);
        assert!(error.message().contains(word), "{word}: {error}");
    }
}

#[test]
fn a_file_in_utf16_is_the_same_file_and_its_places_are_its_own() {
    let text = file("IESNA:LM-63-2002", "1 -1 1 3 1 1 2 0 0 0", "1 1 10", AXIAL).replace("Maker", "M\u{fc}ller");
    let bytes =
        |text: &str| [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect::<Vec<u8>>();
    let read = parse(&bytes(&text)).unwrap();
    assert_eq!((read.keyword("MANUFAC"), read.lints[0].code), (Some("M\u{fc}ller"), "lm63/utf-16"));
    assert_eq!(read.distribution, parse(text.as_bytes()).unwrap().distribution);
    let error = parse(&bytes(&text.replace("50 25", "50 x"))).unwrap_err();
    assert_eq!((error.line, error.column), (11, 8));
}

#[test]
fn labels_stay_labels_in_1986_and_become_other_later() {
    let text = file("a lamp", "1 -1 1 3 1 1 2 0 0 0", "1 1 10", AXIAL).replacen("[TEST] 1", "of ours", 1);
    let read = parse(text.as_bytes()).unwrap();
    let old = write(&read, Edition::Lm63_1986);
    assert!(!old.losses.iter().any(|loss| loss.contains("label")), "{old:?}");
    assert!(old.text.starts_with("a lamp\r\nof ours\r\n"), "{old:?}");
    let new = write(&read, Edition::Lm63_1991);
    assert!(new.losses[0].contains("a label line, a label line written as [OTHER]"), "{:?}", new.losses);
    // A label that a reader would take for something else becomes a keyword.
    for label in ["TILT=NONE", "[x] y", "two\nlines", "IESNA91"] {
        let odd = Photometry { keywords: vec![(String::new(), label.into())], ..read.clone() };
        let again = parse(write(&odd, Edition::Lm63_1986).text.as_bytes()).unwrap();
        assert_eq!(again.keywords, [("OTHER".to_string(), label.to_string())]);
    }
}
