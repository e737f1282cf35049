//! The suite of analytic cases on real renderers, and how a spec's cases make one report.

use serde_json::Value;

use crate::support::{ENGINES, Folder, among, is_night, run_reference};

fn names(report: &Value) -> Vec<&str> {
    report["cases"].as_array().unwrap().iter().map(|c| c["name"].as_str().unwrap()).collect()
}

#[test]
fn direct_light_of_the_analytic_suite_is_read_right_by_every_engine() {
    let specs = [
        "cie171/5.2-point",
        "cie171/5.3-area",
        "cie171/5.4-flux",
        "cie171/5.6-disc",
        "analytic/furnace",
        "analytic/s1",
        "analytic/s2",
    ];
    let cases = ["5.2-point", "5.3-area", "5.4-flux", "5.6-disc", "furnace", "s1", "s2/direct"];
    are_read_right(&specs, &cases, &[], &ENGINES, "seconds: 100");
}

#[test]
fn daylight_of_the_analytic_suite_is_read_right() {
    // Openings are sampled: by every renderer at night alone.
    let engines: &[&str] = if is_night() { &ENGINES } else { &["simulator", "iesna", "radiance"] };
    let specs = ["cie171/*-aside", "cie171/*-far", "cie171/5.9-roof", "cie171/5.10-roof-glass", "cie171/5.11-facade"];
    let cases = [
        "5.10-aside",
        "5.11-aside",
        "5.12-aside",
        "5.13-aside/sky-16",
        "5.14-aside/sky-16",
        "5.9-aside",
        "5.11-far",
        "5.12-far",
        "5.9-far/sky-1",
        "5.9-far/sky-5",
        "5.9-roof/1m-sky-16",
        "5.10-roof-glass/1m-sky-16",
        "5.11-facade/2x1m-sky-16",
    ];
    are_read_right(
        &specs,
        &cases,
        &["*-aside*", "*-far*", "1m-sky-16"],
        engines,
        "relative_error: 0.003, seconds: 100",
    );
}

/// However busy the machine is: the specs' own seconds leave readings undecided beside other work.
fn run_patiently(budget: &str, args: &[&str]) -> (Value, Option<i32>) {
    let profile = format!("profiles: {{patient: {{budget: {{{budget}}}}}}}\n");
    let folder = Folder::new(&[("patient.yaml", &profile)]);
    let policy = folder.path("patient.yaml");
    run_reference(&[args, &["--policy", policy.to_str().unwrap(), "--profile", "patient"]].concat())
}

fn are_read_right(specs: &[&str], cases: &[&str], filters: &[&str], engines: &[&str], budget: &str) {
    let specs: Vec<String> = specs.iter().map(|spec| format!("reference/{spec}.yaml")).collect();
    let engines_asked = engines.join(",");
    let asked = ["--procedures", "direct_illuminance", "--engines", &engines_asked];
    let filters = filters.iter().flat_map(|filter| ["--filter", *filter]);
    let asked: Vec<&str> = specs.iter().map(String::as_str).chain(asked).chain(filters).collect();
    let (report, code) = run_patiently(budget, &asked);
    assert_eq!(code, Some(0), "{}", report["summary"]);
    assert_eq!(names(&report), cases);
    for case in names(&report) {
        for &engine in engines {
            let of = |list: &str| among(&report, list, &[("case", case), ("engine", engine)]);
            let ran = !of("recordings").is_empty();
            // Inverse square does not apply closer than five times an opening's size, and says so.
            let why = of("skips").first().map_or("", |s| s["reason"].as_str().unwrap());
            let is_far_from_points = engine == "iesna" && why.contains("five-times rule");
            // POV-Ray's grid of points cannot tell how much of an opening shows through a hole.
            let is_no_grid = engine == "povray" && ["5.13-aside/sky-16", "5.14-aside/sky-16"].contains(&case);
            assert!(ran || is_far_from_points || is_no_grid, "{case} {engine}: {why}");
        }
        // The known values stand in the report as references of their own, each with its uncertainty.
        let of_case = among(&report, "comparisons", &[("case", case)]);
        let name = format!(", {}, ", table_of(case));
        let derived = of_case.iter().filter(|c| c["reference"]["source"].as_str().unwrap().contains(&name));
        let mut count = 0;
        for c in derived {
            count += 1;
            assert!(c["reference"]["basis"] == "closed_form" || c["reference"]["basis"] == "simulator", "{c}");
            assert!(c["reference"]["uncertainty"].as_f64().unwrap() > 0.0, "{c}");
        }
        assert!(count > 0, "{case}: no known value among {} comparisons", of_case.len());
    }
}

/// The table with the values of a case.
fn table_of(case: &str) -> &str {
    let spec = case.split('/').next().unwrap();
    if spec.ends_with("-aside") || spec.ends_with("-far") || !spec.starts_with("5.") {
        spec
    } else {
        spec.split('-').next().unwrap()
    }
}

#[test]
fn reflected_light_behind_a_screen_and_in_a_closed_room_is_read_right() {
    let specs = ["reference/cie171/5.7-screen.yaml", "reference/cie171/5.8-interreflection.yaml"];
    let asked = ["--procedures", "indirect_illuminance", "--engines", "radiance"];
    let (report, code) = run_patiently("seconds: 100", &[&specs[..], &asked].concat());
    assert_eq!(code, Some(0), "{}", report["summary"]);
    assert_eq!(
        names(&report),
        ["5.7-screen", "5.8-interreflection/rho-10", "5.8-interreflection/rho-50", "5.8-interreflection/rho-90"]
    );
    // The closed form of case 5.8 is that of the mean: Gauss weights of the meters (i, j), i <= j.
    let w = [0.1739274226, 0.3260725774, 0.3260725774, 0.1739274226];
    let weight = |i: usize, j: usize| if i == j { w[i] * w[j] } else { 2.0 * w[i] * w[j] };
    let weights: Vec<f64> = (0..4).flat_map(|i| (i..4).map(move |j| weight(i, j))).collect();
    for (case, law) in [("rho-10", 11.574), ("rho-50", 104.167), ("rho-90", 937.5)] {
        for (engine, allowed) in [("simulator", 1e-3), ("radiance", 8e-3)] {
            let readings =
                among(&report, "readings", &[("case", &format!("5.8-interreflection/{case}")), ("engine", engine)]);
            let values: Vec<f64> = readings.iter().map(|r| r["value"].as_f64().unwrap()).collect();
            assert_eq!(values.len(), weights.len(), "{case} {engine}");
            let mean: f64 = values.iter().zip(&weights).map(|(v, w)| v * w).sum();
            assert!((mean / law - 1.0).abs() < allowed, "{case} {engine}: mean {mean} for {law}");
        }
    }
}

#[test]
fn a_case_that_is_for_one_engine_skips_the_others_and_says_so() {
    let (report, code) = run_reference(&[
        "reference/specs/cachet.yaml",
        "--procedures",
        "direct_illuminance",
        "--engines",
        "radiance,povray",
    ]);
    assert_eq!(code, Some(0), "{}", report["summary"]);
    assert_eq!(names(&report), ["cachet/point-seven", "cachet/lum1-seven", "cachet/lum2-seven"]);
    let skips = among(&report, "skips", &[("engine", "povray")]);
    let of_povray: Vec<&str> = skips.iter().map(|s| s["case"].as_str().unwrap()).collect();
    assert_eq!(of_povray, ["cachet/lum1-seven", "cachet/lum2-seven"], "{skips:?}");
    assert_eq!(report["published"].as_array().unwrap().len(), 1);
    assert_eq!(report["published"][0]["cases"].as_array().unwrap().len(), 3);
}
