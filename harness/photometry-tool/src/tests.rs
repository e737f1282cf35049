//! The output, files and exit codes of the command.

use std::path::Path;

use clap::Parser;
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening, lm63};

use super::*;

#[derive(Debug, Parser)]
struct CommandLine {
    #[command(flatten)]
    args: PhotometryArgs,
}

fn arguments(line: &[&str]) -> PhotometryArgs {
    CommandLine::try_parse_from(std::iter::once(&"photometry").chain(line)).unwrap().args
}

/// A pendant of 1000 lm lamps: cos downward, a little light up, wider across C90.
fn pendant() -> Photometry {
    let gamma: Vec<f64> = (0..=36).map(|k| 5.0 * f64::from(k)).collect();
    let mut candela = vec![];
    for width in [1.0, 1.2] {
        candela.extend(
            gamma.iter().map(
                |&g| {
                    if g < 90.0 { 200.0 * (g / width).to_radians().cos().max(0.0) } else { (g - 90.0) / 3.0 }
                },
            ),
        );
    }
    let distribution = LuminousIntensityDistribution::new(vec![0.0, 90.0], gamma.clone(), candela).unwrap();
    Photometry {
        lamp_lumens: Some(1000.0),
        opening: LuminousOpening::Box { x_m: 1.2, y_m: 0.1, height_m: 0.0 },
        input_watts: Some(10.0),
        keywords: vec![("LUMINAIRE".into(), "Pendant <1 & 2>".into())],
        ..Photometry::of(distribution)
    }
}

#[test]
fn the_summary_has_the_fields_of_the_contract() {
    let record = Reading { file: "a.ies".into(), result: Ok(pendant()) }.record().unwrap();
    for field in ["file", "format", "flux_lm", "flux_up_lm", "flux_down_lm", "max_cd", "symmetry", "lint"] {
        assert!(record.get(field).is_some(), "{field}");
    }
    let number = |field: &str| record[field].as_f64().unwrap();
    assert_eq!(record["symmetry"], "quadrant");
    assert!((number("flux_up_lm") + number("flux_down_lm") - number("flux_lm")).abs() < 1e-9);
    assert!((number("efficacy_lm_per_w") - number("flux_lm") / 10.0).abs() < 1e-12);
    assert_eq!(number("max_cd"), 200.0);
}

#[test]
fn the_summary_reads_well() {
    let summary = Summary::of(Path::new("pendant.ies"), &pendant()).to_string();
    insta::assert_snapshot!(summary);
}

/// The points of the path of a class.
fn path_points(svg: &str, class: &str) -> Vec<Vec<f64>> {
    let start = format!("path class=\"{class}\" d=\"M");
    let path = svg.split('<').find_map(|tag| tag.strip_prefix(&start)).unwrap().split('"').next().unwrap();
    path.split('L').map(|point| point.split(' ').map(|n| n.parse().unwrap()).collect()).collect()
}

#[test]
fn the_diagram_has_each_intensity_at_its_angle_and_radius() {
    let svg = polar::diagram("pendant.ies", &pendant());
    // 200 cd/klm at the nadir: four rings of 50, each in two halves, the outermost at 200 units.
    assert_eq!(svg.matches(" 0 0 1 ").count(), 4, "{svg}");
    assert!(svg.contains(">cd/klm<") && svg.contains(">150<") && svg.contains("Pendant &lt;1 &amp; 2&gt;"));
    for (class, wide) in [("curve", 1.0), ("curve dashed", 1.2)] {
        let points = path_points(&svg, class);
        assert_eq!(points.len(), 2 * 181);
        let expected = 200.0 * (60.0f64 / wide).to_radians().cos();
        // From the zenith down the left side to the nadir and up the right one; rounded to a tenth.
        for (point, side) in [(&points[181 + 60], 1.0), (&points[180 - 60], -1.0)] {
            assert!((point[0] - 240.0 - side * expected * 60f64.to_radians().sin()).abs() < 0.051, "{point:?}");
            assert!((point[1] - 274.0 - expected * 60f64.to_radians().cos()).abs() < 0.051, "{point:?}");
        }
    }
}

#[test]
fn a_downlight_has_half_rings() {
    let table = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![730.0, 0.0]).unwrap();
    let svg = polar::diagram("spot.ies", &Photometry::of(table));
    assert_eq!((svg.matches(" 0 0 1 ").count(), svg.matches(" 0 0 0 ").count()), (0, 4), "{svg}");
    assert!(svg.contains(">cd<") && svg.contains(">800<") && svg.contains("spot.ies, "));
}

#[test]
fn conversion_follows_the_extension_and_refusal_is_exit_2() {
    let folder = tempfile::tempdir().unwrap();
    let text = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(text("a.ies"), lm63::write_2002(&pendant()).text).unwrap();
    std::fs::write(text("bad.ies"), "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 0\n0 90\n0\n5\n").unwrap();
    let exit =
        run(&arguments(&[&text("a.ies"), "--convert", &text("b.ldt"), "--polar", &text("a.svg")]), Trust::Own).unwrap();
    assert_eq!(exit, Exit::Passed);
    let converted = luxproof_photometry::read_file(Path::new(&text("b.ldt"))).unwrap();
    assert_eq!(converted.format, "EULUMDAT");
    assert_eq!(converted.distribution, pendant().distribution);
    assert!(std::fs::read_to_string(text("a.svg")).unwrap().starts_with("<svg "));
    assert_eq!(run(&arguments(&[&text("a.ies"), &text("bad.ies"), "--json"]), Trust::Own).unwrap(), Exit::Usage);
    assert!(run(&arguments(&[&text("a.ies"), "--convert", &text("b.doc")]), Trust::Own).is_err());
    assert!(run(&arguments(&[&text("a.ies"), &text("a.ies"), "--polar", "x.svg"]), Trust::Own).is_err());
    assert!(run(&arguments(&[&text("a.ies"), "--format", "sarif"]), Trust::Own).is_err());
}

#[test]
fn sarif_names_rule_level_and_line_of_lints_and_refusals() {
    let odd = " IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 0.9 0\n0 90\n0\n5 5\n";
    let readings = [odd, "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 0\n0 90\n0\n5 x\n"].map(|text| {
        Reading { file: "a b.ies".into(), result: lm63::parse(text.as_bytes()).map_err(|error| spec_error(&error)) }
    });
    let log: serde_json::Value = serde_json::from_str(&sarif::format_log(&readings).unwrap()).unwrap();
    let results = log["runs"][0]["results"].as_array().unwrap();
    let found: Vec<_> = results
        .iter()
        .map(|r| (r["ruleId"].as_str().unwrap(), r["level"].as_str().unwrap(), region(r)["startLine"].as_u64()))
        .collect();
    let expected = [
        ("lm63/leading-blanks", "note", Some(1)),
        ("lm63/ballast-lamp-factor", "warning", Some(4)),
        ("lm63/keywords", "note", None),
        ("refused", "error", Some(7)),
    ];
    assert_eq!(found, expected);
    assert_eq!(region(&results[3])["startColumn"], 3);
    assert_eq!(results[0]["locations"][0]["physicalLocation"]["artifactLocation"]["uri"], "a%20b.ies");
    assert!(format_lints(&readings).starts_with("a b.ies:1: note: blanks"));
}

fn region(result: &serde_json::Value) -> &serde_json::Value {
    &result["locations"][0]["physicalLocation"]["region"]
}

#[test]
fn utilization_is_of_the_lamps_flux_and_falls_with_the_cavity_ratio() {
    let text = format_utilization(&[Reading { file: "a.ies".into(), result: Ok(pendant()) }]).unwrap();
    assert!(text.starts_with("a.ies: of lamp flux, 1000.0 lm\n"), "{text}");
    let first_column: Vec<u32> = (0..=10)
        .map(|ratio| {
            let row = text.lines().rev().nth(10 - ratio).unwrap();
            let cells: Vec<u32> = row.split_whitespace().map(|c| c.parse().unwrap()).collect();
            assert_eq!(cells[0] as usize, ratio);
            cells[1]
        })
        .collect();
    assert!(first_column.windows(2).all(|w| w[1] < w[0]), "{first_column:?}");
    // Without walls every lumen reaches the work plane or the ceiling once: (down + .8 up) / (1 - .8 x .2), per lamp lumen.
    let distribution = pendant().distribution;
    let (down, up) = (distribution.flux_between(0.0, 90.0).value(), distribution.flux_between(90.0, 180.0).value());
    assert_eq!(f64::from(first_column[0]), (100.0 * (down + 0.8 * up) / 1000.0 / (1.0 - 0.16)).round());
}

#[test]
fn a_diagram_of_next_to_nothing_or_of_more_than_all_has_few_rings_and_finite_places() {
    for candela in [5e-324, 1e-310, 1e308] {
        let table = LuminousIntensityDistribution::new(vec![0.0], vec![0.0, 90.0], vec![candela, 0.0]).unwrap();
        let svg = polar::diagram("dark.ies", &Photometry::of(table));
        let curve = svg.split("class=\"curve\"").nth(1).unwrap().split('>').next().unwrap();
        assert!(svg.len() < 20_000 && !curve.contains("inf") && !curve.contains("NaN"), "{candela:e}: {svg}");
    }
}

/// Converts `a.ies` in a folder: the exit code and what is read back.
fn convert(folder: &Path, out: &str, options: &[&str]) -> (Exit, Photometry) {
    let [from, out] = ["a.ies", out].map(|name| folder.join(name).display().to_string());
    let line = [&[from.as_str(), "--convert", out.as_str()], options].concat();
    let exit = run(&arguments(&line), Trust::Own).unwrap();
    (exit, luxproof_photometry::read_file(Path::new(&out)).unwrap())
}

#[test]
fn a_conversion_takes_edition_and_policy_and_a_turn_is_denied_with_warnings() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("a.ies"), lm63::write_2002(&pendant()).text).unwrap();
    let (exit, old) = convert(folder, "old.ies", &["--edition", "1995", "--deny", "warnings"]);
    assert_eq!((exit, old.format.as_str()), (Exit::Passed, "LM-63-1995"));
    let (exit, unturned) = convert(folder, "unturned.ldt", &["--deny", "warnings"]);
    assert_eq!((exit, unturned.distribution), (Exit::Failed, pendant().distribution));
    let (_, turned) = convert(folder, "turned.ldt", &["--forward", "keep-forward"]);
    assert_eq!(turned.opening, LuminousOpening::Box { x_m: 0.1, y_m: 1.2, height_m: 0.0 });
    assert_eq!(turned.distribution.plane(0), pendant().distribution.plane(1));
    let (exit, xml) = convert(folder, "a.xml", &["--deny", "warnings"]);
    assert_eq!((exit, xml.format.as_str(), xml.distribution), (Exit::Passed, "TM-33-23", pendant().distribution));
    assert!(CommandLine::try_parse_from(["photometry", "a.ies", "--edition", "1995"]).is_err());
}

#[test]
fn damage_is_refused_or_forgiven_as_asked() {
    let folder = tempfile::tempdir().unwrap();
    let damaged = folder.path().join("a.ies").display().to_string();
    std::fs::write(&damaged, lm63::write_2002(&pendant()).text.replace("1 1 10\r\n", "1 1 -1\r\n")).unwrap();
    for (options, expected) in
        [(&[][..], Exit::Usage), (&["--tolerant"], Exit::Passed), (&["--tolerant", "--deny", "warnings"], Exit::Failed)]
    {
        let line = [&[damaged.as_str()], options].concat();
        assert_eq!(run(&arguments(&line), Trust::Own).unwrap(), expected, "{options:?}");
    }
}
