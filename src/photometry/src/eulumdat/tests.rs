//! The meaning of EULUMDAT files, and refusals with their places and reasons.

use super::*;
use crate::{Problem, Symmetry};

/// Lines of a file of this symmetry. The intensity at gamma 90 is the C angle plus 1, in cd/klm.
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
fn every_symmetry_gives_its_planes_their_c_angles() {
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

#[test]
fn each_loss_has_its_own_cause() {
    // The last plane is not the first: EULUMDAT has no plane 360.
    let c_deg = vec![0.0, 90.0, 180.0, 270.0, 360.0];
    let candela = [100.0, 50.0, 100.0, 40.0, 100.0, 30.0, 100.0, 20.0, 100.0, 48.0].to_vec();
    let open = LuminousIntensityDistribution::new(c_deg, vec![0.0, 90.0], candela).unwrap();
    let ring = LuminousOpening::Ellipse { x_m: 0.2, y_m: 0.1, height_m: 0.0 };
    let keywords = [("LUMCAT", "a b"), ("LUMCAT", "c"), ("NAME", "d"), ("LUMINAIRE", "e\nf"), ("LAMP", "LED")];
    let keywords = keywords.map(|(key, value)| (key.to_string(), value.to_string())).to_vec();
    // In kilolumens of 1 nothing is rounded.
    let written = write(&Photometry { lamp_lumens: Some(1000.0), opening: ring, keywords, ..Photometry::of(open) });
    let expected = [
        "the plane C 360 was dropped: EULUMDAT closes the circle with C 0, which differs from it by up to 2e0 cd",
        "the luminous opening, an ellipse of 0.2 m along C0, 0.1 m along C90 and 0 m high, became a box of 0.2 m along C0, 0.1 m \
         along C90 and 0 m high: EULUMDAT has boxes of some width and upright round openings alone",
        "[LUMCAT] given more than once, and EULUMDAT has one line for it",
        "[NAME] dropped: EULUMDAT has no line for it",
        "[LUMINAIRE] its lines were joined: EULUMDAT has one",
    ];
    assert_eq!(written.losses, expected);
}

#[test]
fn planes_that_cannot_be_listed_are_written_out_and_that_is_no_loss_of_light() {
    let half = LuminousIntensityDistribution::new(
        vec![90.0, 130.0, 270.0],
        vec![0.0, 90.0],
        vec![9.0, 1.0, 9.0, 2.0, 9.0, 3.0],
    );
    let written = write(&Photometry::of(half.unwrap()));
    assert!(
        written.losses[0].contains("the light is the same") && !written.losses[0].contains("rounding"),
        "{written:?}"
    );
}

/// The losses of a EULUMDAT file with changed details that is written as LM-63.
fn losses_as_lm63(plain: &Photometry, change: impl Fn(&mut EulumdatDetails)) -> String {
    let Details::Eulumdat(details) = &plain.details else { panic!("{:?}", plain.details) };
    let mut details = details.clone();
    change(&mut details);
    let details = Details::Eulumdat(details);
    crate::lm63::write_2019(&Photometry { details, ..plain.clone() }).losses.join("\n")
}

/// Removes all declared ratios.
fn clear_ratios(details: &mut EulumdatDetails) {
    (details.downward_flux_percent, details.output_ratio_percent, details.direct_ratios) = (0.0, 0.0, [0.0; 10]);
}

#[test]
fn filled_fields_that_another_format_lacks_are_losses() {
    let axial = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![100.0, 0.0]).unwrap();
    let plain =
        parse(write(&Photometry { lamp_lumens: Some(500.0), ..Photometry::of(axial) }).text.as_bytes()).unwrap();
    assert_eq!(losses_as_lm63(&plain, clear_ratios), "");
    let losses = losses_as_lm63(&plain, |_| ());
    let expected = "the declared downward flux fraction, the declared light output ratio, direct ratios";
    assert!(losses.ends_with(expected), "{losses}");
    let losses = losses_as_lm63(&plain, |details| {
        clear_ratios(details);
        details.measured_tilt_deg = 15.0;
        details.lamp_sets.push(details.lamp_sets[0].clone());
    });
    let expected = "fields for them: the tilt during measurement, 1 of 2 lamp sets";
    assert!(losses.ends_with(expected), "{losses}");
}

/// Reads lines with a tolerance for damage.
fn read_tolerantly(lines: &[String]) -> Result<Photometry, ReadError> {
    super::read(lines.join("\n").as_bytes(), Tolerance::Harmless)
}

/// The axial file with more lines at its end.
fn axial_with(rest: &[&str]) -> Vec<String> {
    axial().into_iter().chain(rest.iter().map(ToString::to_string)).collect()
}

#[test]
fn a_tolerant_reader_accepts_harmless_damage_with_a_warning() {
    let sound = read(&axial()).unwrap();
    // The width of the luminaire, and the watts of its lamps.
    for (line, value) in [(13, "-50"), (31, "-1")] {
        let mut damaged = axial();
        damaged[line] = value.into();
        let found = read_tolerantly(&damaged).unwrap();
        assert!(read(&damaged).is_err() && codes(&found).contains(&"forgiven/negative-field"), "{:?}", found.lints);
        assert_eq!(found.distribution, sound.distribution);
    }
    for rest in [&["0", "0"][..], &["7", "1", "7"], &["7", "1", "7", "7", "1", "7", ""]] {
        let found = read_tolerantly(&axial_with(rest)).unwrap();
        assert!(read(&axial_with(rest)).is_err() && codes(&found).contains(&"forgiven/surplus"), "{:?}", found.lints);
        assert_eq!(found.distribution, sound.distribution);
    }
    // A gamma angle more than the head states shifts all values.
    let mut shifted = axial();
    let at = shifted.len() - 4;
    shifted.insert(at, "100".into());
    for last in ["0", "180"] {
        shifted.push(last.into());
        assert!(read_tolerantly(&shifted).is_err(), "{shifted:?}");
    }
    // A second, different plane; the width and height of the opening; and the factor of all intensities.
    assert!(read_tolerantly(&axial_with(&["7", "2", "7"])).is_err());
    for line in [16, 17, 23] {
        let mut damaged = axial();
        damaged[line] = "-1".into();
        assert!(read_tolerantly(&damaged).is_err(), "line {}", line + 1);
    }
}

#[test]
fn a_file_in_utf16_is_the_same_file() {
    let text = axial().join("\r\n");
    let bytes: Vec<u8> = [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let (read, plain) = (parse(&bytes).unwrap(), parse(text.as_bytes()).unwrap());
    assert_eq!((read.distribution, read.keywords, read.details), (plain.distribution, plain.keywords, plain.details));
}
