//! The readers over many photometric files: small ones of our own, and real ones of the folder `LUXPROOF_CORPUS`.
//!
//! Licences do not allow most real files in a repository. Each law holds for our own files as well, so that nothing
//! passes for want of a file.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use luxproof_calculators::ugr::{Spacing, UgrTable};
use luxproof_photometry::{Details, Difference, Likeness, Photometry, eulumdat, lm63};
use luxproof_scene::geometry::configuration_factor::opposed_rectangles;

/// The corpus, where a folder is named.
fn corpus() -> Option<PathBuf> {
    let folder = PathBuf::from(std::env::var_os("LUXPROOF_CORPUS")?);
    assert!(folder.is_dir(), "LUXPROOF_CORPUS names no folder: {}", folder.display());
    Some(folder)
}

/// A file of this repository.
fn own(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

/// Our own files and those of the corpus with this extension.
fn all_files(extension: &str) -> Vec<PathBuf> {
    let folders =
        ["reference/luminaires", "reference/cie171/luminaires", "fuzz/seeds/lm63", "fuzz/seeds/eulumdat"].map(own);
    let folders = folders.into_iter().chain(corpus());
    let found: Vec<PathBuf> = folders.flat_map(|folder| files(&folder, extension)).collect();
    // The fuzzer's seeds of types A and B are no tables of type C, into which the laws below convert.
    found.into_iter().filter(|file| !["type-a.ies", "type-b.ies"].iter().any(|name| file.ends_with(name))).collect()
}

/// Every file below a folder with this extension, or every one for an empty extension, in order.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = vec![];
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("the corpus can be listed") {
            let path = entry.expect("the corpus can be listed").path();
            if path.is_dir() {
                folders.push(path);
            } else if extension.is_empty() || path.extension().is_some_and(|e| e == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// The files that are refused, and a part of the reason. All others are read.
const REFUSED: [(&str, &str); 2] =
    [("PROVENANCE.md", "this is no photometric file"), ("make_analytic.py", "this is no photometric file")];

#[test]
fn every_file_is_read_or_refused_with_its_reason() {
    let others = [own("reference/luminaires/make_analytic.py")];
    let of_corpus = corpus().map(|folder| files(&folder, "")).unwrap_or_default();
    assert!(corpus().is_none() || of_corpus.len() >= 59, "{} files", of_corpus.len());
    let all = [all_files("ies"), all_files("ldt"), others.into(), of_corpus].concat();
    assert!(all.len() >= 27, "{} files", all.len());
    for file in all {
        let name = file.file_name().and_then(|name| name.to_str()).expect("names are UTF-8");
        let reason = REFUSED.iter().find(|(refused, _)| *refused == name).map(|(_, reason)| *reason);
        match (luxproof_photometry::read_file(&file), reason) {
            (Ok(read), None) => {
                let flux = read.distribution.flux().value();
                assert!(flux > 0.0 && flux.is_finite(), "{}", file.display());
                let ending = if read.format == "EULUMDAT" { "ldt" } else { "ies" };
                assert!(name.ends_with(ending), "{name} was read as {}", read.format);
            }
            (Err(error), Some(reason)) => assert!(error.message().contains(reason), "{error}"),
            (Ok(_), Some(_)) => panic!("{} is read but should be refused", file.display()),
            (Err(error), None) => panic!("{error}; {}", error.help()),
        }
    }
}

#[test]
fn files_of_a_closed_form_have_its_flux() {
    // The integrals of even and of Lambertian light, and of an uplight that is linear between its angles.
    let largest = |name: &str| {
        let read = luxproof_photometry::read_file(&own("reference/luminaires").join(name)).expect("it is legal");
        read.distribution.max_intensity().value()
    };
    let forms = [
        ("isotropic.ies", 4.0 * PI * largest("isotropic.ies"), 0.5),
        ("lambertian-point.ies", PI * largest("lambertian-point.ies"), 0.0),
        ("axial.ies", 1817.2814559, 1.0),
    ];
    for (name, expected, upward) in forms {
        let read = luxproof_photometry::read_file(&own("reference/luminaires").join(name)).expect("it is legal");
        let (flux, up) = (read.distribution.flux(), read.distribution.flux_between(90.0, 180.0));
        assert!((flux.value() / expected - 1.0).abs() < 1e-4, "{name}: {flux} {expected}");
        assert!((up / flux - upward).abs() < 1e-3, "{name}: {}", up / flux);
    }
}

/// EULUMDAT text of an axial table with these candela per 1000 lm at every fifth degree, and its declared output.
fn axial_eulumdat(candela: impl Fn(f64) -> f64, output_percent: f64) -> String {
    let head = "Maker\n1\n1\n4\n90\n37\n5\nreport\nname\nnumber\nfile\ndate\n100\n0\n50\n100\n0\n0\n0\n0\n0\n100";
    let lamps = format!("{output_percent}\n1\n0\n1\n1\nLED\n2000\n4000 K\n80\n25");
    let angles = [0.0, 90.0, 180.0, 270.0].into_iter().chain((0..=36).map(|g| 5.0 * f64::from(g)));
    let table = (0..=36).map(|g| candela(5.0 * f64::from(g)));
    let numbers: Vec<String> = [0.0; 10].into_iter().chain(angles).chain(table).map(|n| n.to_string()).collect();
    format!("{head}\n{lamps}\n{}\n", numbers.join("\n"))
}

/// A Lambertian downlight of this output ratio.
fn lambertian_eulumdat(output_percent: f64) -> Photometry {
    let text = axial_eulumdat(|g| (10.0 * output_percent / PI * g.to_radians().cos()).max(0.0), output_percent);
    eulumdat::parse(text.as_bytes()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

#[test]
fn a_lambertian_table_integrates_to_its_output_ratio_and_spreads_as_a_ceiling_does() {
    for output_percent in [100.0, 64.0] {
        let read = lambertian_eulumdat(output_percent);
        let Details::Eulumdat(details) = &read.details else { panic!("{:?}", read.details) };
        let integrated = 100.0 * read.distribution.flux().value() / details.lamp_sets[0].lumens;
        assert!((integrated / output_percent - 1.0).abs() < 0.002, "{integrated} {output_percent}");
    }
    // A direct ratio is the part of the light that falls on the floor. A whole ceiling of such light gives the form factor
    // of opposed squares of room index k; luminaires stand farther from the walls.
    let unknown = Photometry { details: Details::None, ..lambertian_eulumdat(100.0) };
    let again = eulumdat::parse(eulumdat::write(&unknown).text.as_bytes()).expect("a written file is legal");
    let Details::Eulumdat(details) = &again.details else { panic!("{:?}", again.details) };
    let room_indices = [0.6, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0];
    for (found, k) in details.direct_ratios.into_iter().zip(room_indices) {
        let of_ceiling = opposed_rectangles(2.0 * k, 2.0 * k, 1.0);
        assert!((-0.01..0.16).contains(&(found - of_ceiling)), "{k}: {found} {of_ceiling}");
    }
    assert!(details.direct_ratios.is_sorted());
}

#[test]
fn the_ledalite_pendant_gives_5297_lm_and_69_percent_of_it_upward() {
    let Some(corpus) = corpus() else { return };
    let read = luxproof_photometry::read_file(&corpus.join("radiance/examp1.ies")).expect("the pendant is legal");
    let (flux, up) = (read.distribution.flux(), read.distribution.flux_between(90.0, 180.0));
    assert!((flux.value() - 5297.0).abs() < 1.0, "{flux}");
    assert!((up / flux - 0.69).abs() < 0.005, "{}", up / flux);
}

#[test]
fn eulumdat_files_integrate_to_their_declared_output_ratio() {
    let Some(corpus) = corpus() else { return };
    for file in files(&corpus.join("eulumdat-py"), "ldt") {
        let read = luxproof_photometry::read_file(&file).expect("the samples are legal");
        let Details::Eulumdat(details) = &read.details else { panic!("{:?}", read.details) };
        let integrated = 100.0 * read.distribution.flux().value() / details.lamp_sets[0].lumens;
        let declared = details.output_ratio_percent;
        assert!((integrated / declared - 1.0).abs() < 0.002, "{}: {integrated} {declared}", file.display());
    }
}

/// Makers spread their luminaires each in their own way: the ratios agree in the middle, not to the last digit.
#[test]
fn direct_ratios_are_near_those_that_makers_computed() {
    let Some(corpus) = corpus() else { return };
    let mut off = vec![];
    for file in files(&corpus.join("eulumdat-py"), "ldt") {
        let read = luxproof_photometry::read_file(&file).expect("the samples are legal");
        let ratios = |details: &Details| match details {
            Details::Eulumdat(details) => details.direct_ratios,
            other => panic!("{other:?}"),
        };
        let declared = ratios(&read.details);
        if declared == [0.0; 10] {
            continue;
        }
        let unknown = Photometry { details: Details::None, ..read.clone() };
        let again = eulumdat::parse(eulumdat::write(&unknown).text.as_bytes()).expect("a written file is legal");
        let computed = ratios(&again.details);
        let differences: Vec<f64> = declared.iter().zip(computed).map(|(a, b)| b - a).collect();
        println!("{}: {differences:.3?}", file.display());
        off.extend(differences);
    }
    assert_eq!(off.len(), 70);
    off.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let (median, most) = (off[35].abs(), off[69].abs());
    println!("median {median:.3}, largest {most:.3}");
    assert!(median < 0.025 && most < 0.16, "{median} {most}");
}

#[test]
fn every_file_survives_being_written_in_its_own_format() {
    for file in all_files("ies") {
        let read = luxproof_photometry::read_file(&file).expect("the corpus is legal");
        let written = lm63::write_2019(&read);
        // What 2019 cannot hold: label lines without keyword.
        let labels = match file.file_name().and_then(|n| n.to_str()) {
            Some("examp1.ies" | "1986.ies") => 1,
            Some("vee.ies" | "display.ies") => 8,
            _ => 0,
        };
        let all = vec!["a label line"; labels].join(", ");
        let stated = format!("{all} written as [OTHER]: LM-63-2019 has no lines without keyword");
        let expected = if labels > 0 { vec![stated] } else { vec![] };
        assert_eq!(written.losses, expected, "{}", file.display());
    }
    for file in all_files("ldt") {
        let read = luxproof_photometry::read_file(&file).expect("the corpus is legal");
        let written = eulumdat::write(&read);
        assert_eq!(written.losses, Vec::<String>::new(), "{}", file.display());
        let again = eulumdat::parse(written.text.as_bytes()).expect("a written file is legal");
        assert_eq!(without_lints(again), without_lints(read), "{}", file.display());
    }
}

/// What a file says, not what its reader says of it or where it lay.
fn without_lints(photometry: Photometry) -> Photometry {
    Photometry { lints: vec![], source: vec![], ..photometry }
}

#[test]
fn conversion_keeps_every_intensity_to_the_last_bit_or_two() {
    for file in all_files("ldt").into_iter().chain(all_files("ies")) {
        let read = luxproof_photometry::read_file(&file).expect("the corpus is legal");
        for written in [lm63::write_2002(&read), eulumdat::write(&read)] {
            let parsed = lm63::parse(written.text.as_bytes()).or_else(|_| eulumdat::parse(written.text.as_bytes()));
            let again = parsed.expect("a written file is legal");
            for c in (0..72).map(|c| 5.0 * f64::from(c)) {
                for gamma in (0..=36).map(|g| 5.0 * f64::from(g)) {
                    let (a, b) = (read.distribution.intensity(c, gamma), again.distribution.intensity(c, gamma));
                    let scale = read.distribution.max_intensity();
                    assert!((a - b).value().abs() <= 1e-15 * scale.value(), "{}: {a} {b}", file.display());
                }
            }
        }
    }
}

/// No file of the corpus carries printed UGR values: what holds of every sound figure is asked.
#[test]
fn figures_of_every_file_hold_together() {
    for file in all_files("ldt").into_iter().chain(all_files("ies")) {
        let Ok(read) = luxproof_photometry::read_file(&file) else { continue };
        let (table, name) = (&read.distribution, file.display());
        let beam = table.beam().expect("every file of the corpus has light");
        assert!(
            table.intensity(beam.peak_deg[0], beam.peak_deg[1]).value() >= (1.0 - 1e-9) * beam.peak.value(),
            "{name}"
        );
        if let Ok(flux) = table.mid_zone_flux() {
            let (lab, exact) = (flux.between(0.0, 180.0).value(), table.flux().value());
            // Narrow beams are where middles of 10 degrees say least.
            assert!((lab / exact - 1.0).abs() < 0.25, "{name}: {lab} {exact}");
        }
        for spacing in [Spacing::Quarter, Spacing::Whole] {
            let Ok(ugr) = UgrTable::of(&read, spacing) else { continue };
            for row in &ugr.rows {
                for side in [row.crosswise, row.endwise].map(|side| side.map(|rating| rating.expect("it is seen"))) {
                    assert!(side.iter().all(|rating| rating.is_finite()), "{name}: {row:?}");
                    // Darker walls, ceilings: a darker background, more glare.
                    assert!(
                        side[0] < side[1] && side[2] < side[3] && side[0] < side[2] && side[3] < side[4],
                        "{name}: {row:?}"
                    );
                }
            }
        }
        let again = [lm63::write_2019(&read).text, eulumdat::write(&read).text];
        let again = [lm63::parse(again[0].as_bytes()), eulumdat::parse(again[1].as_bytes())];
        for same in again.into_iter().flatten() {
            let difference = Difference::between(&read, &same);
            assert_ne!(difference.likeness, Likeness::Different, "{name}: {difference:?}");
            let (turned, _) = same.turned(90.0);
            let (back, _) = turned.turned(-90.0);
            assert_eq!(Difference::between(&same, &back).likeness, Likeness::Equal, "{name}");
        }
    }
}
