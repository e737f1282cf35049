//! Round trips: a written file gives back the photometry or states the loss, and no bytes make a reader panic.

use proptest::prelude::*;

use super::*;

/// Rising angles in tenths of a degree between two ends, both included.
fn angles(first: u32, last: u32) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::btree_set(10 * first..=10 * last, 0..6).prop_map(move |mut tenths| {
        tenths.extend([10 * first, 10 * last]);
        tenths.into_iter().map(|t| f64::from(t) / 10.0).collect()
    })
}

fn planes() -> impl Strategy<Value = Vec<f64>> {
    prop_oneof![Just(vec![0.0]), angles(0, 90), angles(0, 180), angles(90, 270), angles(0, 360)]
}

fn intensity() -> impl Strategy<Value = f64> {
    prop_oneof![4 => 0.0..1e5, 1 => Just(0.0), 1 => 0.0..1e-300, 1 => 0.0..1e250]
}

fn distribution() -> impl Strategy<Value = LuminousIntensityDistribution> {
    let gamma = prop_oneof![angles(0, 90), angles(0, 180), angles(90, 180), angles(20, 130)];
    (planes(), gamma).prop_flat_map(|(c, gamma)| {
        let (planes, gammas) = (c.len(), gamma.len());
        prop::collection::vec(intensity(), planes * gammas).prop_map(move |mut candela| {
            if c[planes - 1] == 360.0 {
                candela.truncate((planes - 1) * gammas);
                candela.extend_from_within(..gammas);
            }
            LuminousIntensityDistribution::new(c.clone(), gamma.clone(), candela).unwrap()
        })
    })
}

/// A dimension in metres.
fn size() -> std::ops::Range<f64> {
    0.001..3.0
}

fn opening() -> impl Strategy<Value = LuminousOpening> {
    prop_oneof![
        Just(LuminousOpening::Point),
        (size(), size(), 0.0..1.0).prop_map(|(x_m, y_m, height_m)| LuminousOpening::Box { x_m, y_m, height_m }),
        (size(), size(), 0.0..1.0).prop_map(|(x_m, y_m, height_m)| LuminousOpening::Ellipse { x_m, y_m, height_m }),
        (size(), size(), size()).prop_map(|(x_m, y_m, z_m)| LuminousOpening::Ellipsoid { x_m, y_m, z_m }),
        (size(), size(), any::<bool>()).prop_map(|(length_m, diameter_m, x)| {
            let axis = if x { HorizontalAxis::X } else { HorizontalAxis::Y };
            LuminousOpening::LyingCylinder { axis, length_m, diameter_m }
        }),
    ]
}

fn photometry() -> impl Strategy<Value = Photometry> {
    let keyword = ("[A-Z_]{4,8}", "[a-zäé0-9 .,-]{0,20}(\n[a-z]{1,8}){0,2}");
    let keyword =
        keyword.prop_map(|(k, v): (String, String)| (k, v.split('\n').map(str::trim).collect::<Vec<_>>().join("\n")));
    let keywords = prop::collection::vec(keyword.prop_filter("MORE joins", |(k, _)| k != "MORE"), 0..4);
    (distribution(), prop::option::of(0.1..1e5), opening(), prop::option::of(0.1..500.0), keywords).prop_map(
        |(distribution, lamp_lumens, opening, input_watts, keywords)| Photometry {
            lamp_lumens,
            opening,
            input_watts,
            keywords,
            ..Photometry::of(distribution)
        },
    )
}

/// Compares everything but the name of the format and the lints, which belong to a file.
fn same(a: &Photometry, b: &Photometry) -> bool {
    a.details == b.details && same_light(a, b)
}

/// Compares as [`same`] does, without the fields that only one format has.
fn same_light(a: &Photometry, b: &Photometry) -> bool {
    let [a, b] =
        [a, b].map(|p| Photometry { format: String::new(), lints: vec![], details: Details::None, ..p.clone() });
    a == b
}

/// The details of an LM-63 file of 2019 with the same lamps and tilt.
fn details_of_2019(photometry: &Photometry) -> lm63::Lm63Details {
    let Details::Lm63(details) = &photometry.details else { panic!("{:?}", photometry.details) };
    let (edition, third_number) = (lm63::Edition::Lm63_2019, lm63::ThirdNumber::FileGeneration(1.0));
    lm63::Lm63Details { edition, third_number, ..details.clone() }
}

/// The keywords in alphabetical order.
fn sorted_keywords(photometry: &Photometry) -> Vec<(String, String)> {
    let mut keywords = photometry.keywords.clone();
    keywords.sort();
    keywords
}

/// Reads a file in a format.
fn read_format(format: FileFormat, text: &str) -> Photometry {
    let read = match format {
        FileFormat::Lm63(_) => lm63::parse(text.as_bytes()),
        FileFormat::Eulumdat => eulumdat::parse(text.as_bytes()),
        FileFormat::Tm33 => tm33::parse(text.as_bytes()),
    };
    read.unwrap()
}

proptest! {
    #[test]
    fn every_edition_of_lm63_holds_every_photometry(x in photometry()) {
        for edition in lm63::Edition::ALL {
            let written = lm63::write(&x, edition);
            prop_assert_eq!(&written.losses, &Vec::<String>::new());
            let again = lm63::parse(written.text.as_bytes()).unwrap();
            prop_assert!(same_light(&again, &x));
            prop_assert_eq!(&again.format, edition.name());
            let most = if edition < lm63::Edition::Lm63_2002 { 130 } else { 254 };
            prop_assert!(written.text.lines().all(|line| line.chars().count() <= most || !line.contains(' ')));
            let twice = lm63::parse(lm63::write_2019(&again).text.as_bytes()).unwrap();
            prop_assert_eq!(details_of_2019(&twice), details_of_2019(&again));
        }
    }

    #[test]
    fn eulumdat_gives_back_what_it_holds_and_the_rest_is_stated(x in photometry()) {
        let written = eulumdat::write(&x);
        let held = eulumdat::parse(written.text.as_bytes()).map_err(|e| TestCaseError::fail(e.to_string()))?;
        if written.losses.is_empty() {
            prop_assert!(same_light(&held, &x));
        }
        prop_assert!(x.opening == held.opening || written.losses.iter().any(|l| l.contains("opening")));
        prop_assert!(x.distribution == held.distribution || written.losses.iter().any(|l| l.contains("intensities") || l.contains("planes")));
        let (flux, now) = (x.distribution.flux().value(), held.distribution.flux().value());
        prop_assert!((flux - now).abs() <= 1e-12 * flux, "{flux} {now}");
        let again = eulumdat::write(&held);
        prop_assert_eq!(&again.losses, &Vec::<String>::new());
        prop_assert!(same(&eulumdat::parse(again.text.as_bytes()).unwrap(), &held));
    }

    #[test]
    fn tm33_holds_everything_but_openings_to_the_last_digit(x in photometry()) {
        let written = tm33::write(&x);
        let again = tm33::parse(written.text.as_bytes()).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(&again.distribution, &x.distribution);
        prop_assert_eq!((again.lamp_lumens, again.input_watts), (x.lamp_lumens, x.input_watts));
        prop_assert_eq!(sorted_keywords(&again), sorted_keywords(&x));
        let mut losses = written.losses.iter();
        prop_assert!(
            losses.all(|loss| loss.contains("opening") || loss.contains("stand in the order of")),
            "{:?}",
            written.losses
        );
        prop_assert!(x.opening == again.opening || written.losses.iter().any(|loss| loss.contains("opening")));
        prop_assert_eq!(tm33::write(&again).losses, Vec::<String>::new());
        prop_assert_eq!(tm33::write(&again).text, written.text);
    }

    #[test]
    fn no_bytes_make_a_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let refused = [lm63::parse(&bytes).is_err(), eulumdat::parse(&bytes).is_err(), tm33::parse(&bytes).is_err()];
        prop_assert_eq!(refused, [true; 3]);
    }

    #[test]
    fn no_damage_to_a_file_makes_a_reader_panic(
        x in photometry(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), "[-0-9.,e \n\"a-z]{0,3}"), 1..4),
        cut in any::<prop::sample::Index>(),
    ) {
        type Reader = fn(&[u8]) -> Result<Photometry, ReadError>;
        let files: [(String, Reader); 4] = [
            (lm63::write_2002(&x).text, lm63::parse),
            (lm63::write(&x, lm63::Edition::Lm63_1986).text, lm63::parse),
            (eulumdat::write(&x).text, eulumdat::parse),
            (tm33::write(&x).text, tm33::parse),
        ];
        for (text, read) in files {
            let mut bytes = text.into_bytes();
            for (at, patch) in &damage {
                let at = at.index(bytes.len());
                bytes.splice(at..(at + patch.len()).min(bytes.len()), patch.bytes());
            }
            for bytes in [&bytes[..], &bytes[..cut.index(bytes.len())]] {
                match read(bytes) {
                    Ok(read) => prop_assert!(read.distribution.flux().value() >= 0.0),
                    Err(error) => prop_assert!(error.line >= 1 && error.column >= 1 && !error.help().is_empty()),
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn a_conversion_by_way_of_any_formats_keeps_the_light_or_says_so(x in photometry()) {
        let formats = [FileFormat::Tm33, FileFormat::Eulumdat, FileFormat::Lm63(lm63::Edition::Lm63_1995)];
        for (first, second) in formats.iter().flat_map(|first| formats.iter().map(move |second| (first, second))) {
            let middle = read_format(*first, &first.write(&x).text);
            for policy in [ForwardPolicy::KeepAngles, ForwardPolicy::KeepForward] {
                let aimed = middle.aimed_for(*second, policy);
                let written = second.write(&aimed.photometry);
                let last = read_format(*second, &written.text);
                let (flux, now) = (x.distribution.flux().value(), last.distribution.flux().value());
                prop_assert!((flux - now).abs() <= 1e-9 * flux, "{:?} {:?} {} {}", first, second, flux, now);
                let same = aimed.photometry.distribution == last.distribution;
                prop_assert!(same || !written.losses.is_empty());
            }
        }
    }
}
