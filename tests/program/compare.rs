//! Cases of one spec against each other: ratios with their uncertainty, engine by engine and held against the reference's.

use serde_json::Value;

use crate::support::{Folder, LAMP, ROOM, among};

const CASES: &str = "meters:
  desk: {surface: {of: floor, distance_m: 0.75, margin_m: 0.5, counts: [4, 3]}}
procedures:
  total_illuminance: {meters: desk, bounces: converged}
budget: {relative_error: 0.004, seconds: 30}
cases:
  - name: grey
  - {name: painted, room: {reflectance: {walls: 0.7}}}
  - {name: dimmed, luminaires: {lamp: {flux_scale: 0.5}}}
compare: [[grey, painted], [grey, dimmed]]
";

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap_or_else(|| panic!("no number: {of}"))
}

#[test]
fn a_change_makes_of_each_engines_light_what_it_makes_of_the_references() {
    let folder = Folder::for_renderers(&[("spec.yaml", &format!("{ROOM}{CASES}")), ("lamp.ies", LAMP)]);
    let answer = folder.run(&["--engines", "simulator,radiance"]).exits(0);
    answer.prints("spec/painted / spec/grey total_illuminance desk, radiance: ").prints("errors cancel");
    let report = folder.report();
    let of = |engine: &str, after: &str| {
        let found = among(&report, "ratios", &[("engine", engine), ("before", "spec/grey"), ("after", after)]);
        assert_eq!(found.len(), 1, "{engine} {after}");
        found[0].clone()
    };
    let (exact, radiance) = (of("simulator", "spec/painted"), of("radiance", "spec/painted"));
    let (truth, mean) = (number(&exact["mean"]["ratio"]["value"]), &radiance["mean"]);
    assert!(truth > 1.05 && exact["mean"]["agreement"].is_null(), "{truth}");
    let (deviation, expanded) = (number(&mean["agreement"]["deviation"]), number(&mean["agreement"]["expanded"]));
    assert!((number(&mean["ratio"]["value"]) - truth - deviation).abs() < 1e-12, "{mean}");
    assert!(deviation.abs() <= expanded && expanded < 0.02 && mean["agreement"]["verdict"] == "pass", "{mean}");
    let meters = radiance["meters"].as_array().unwrap();
    assert!(meters.len() == 12 && meters.iter().all(|m| m["agreement"]["verdict"] != "fail"), "{radiance}");
    // Where flux alone is another, errors cancel, but of what a spot check reads anew.
    for (engine, within) in [("simulator", 1e-9), ("radiance", 1e-3)] {
        let dimmed = of(engine, "spec/dimmed");
        let one = dimmed["meters"].as_array().unwrap().iter().filter(|m| m["errors_cancel"] == true).count();
        assert!(one >= 10, "{engine}: {dimmed}");
        assert!((number(&dimmed["mean"]["ratio"]["value"]) - 0.5).abs() <= within, "{dimmed}");
    }
    assert_eq!(radiance["mean"]["errors_cancel"], false);
    // Maps of both cases end at the same light.
    let page = folder.luxproof(&["report", "out/report.json", "--format", "html"]).exits(0).stdout;
    let section = page.split("<section id=\"ratios\"").nth(1).unwrap().split("</section>").next().unwrap();
    let ends: Vec<&str> = section
        .split("</figure>")
        .filter_map(|figure| figure.rsplit_once("class=\"cells\""))
        .map(|(_, bar)| bar)
        .collect();
    assert_eq!(ends.len(), 4, "two maps a pair");
    assert!(ends[0] == ends[1] && ends[2] == ends[3] && ends[0] != ends[2], "{ends:?}");
    let markdown = folder.luxproof(&["report", "out/report.json", "--format", "markdown"]).exits(0);
    markdown.prints("spec/dimmed / spec/grey total_illuminance desk, radiance");
}

#[test]
fn a_pair_with_one_engine_left_out_is_reported() {
    let folder = Folder::new(&[("spec.yaml", &format!("{ROOM}{CASES}")), ("lamp.ies", LAMP)]);
    let answer = folder.run(&["--engines", "simulator,iesna", "--filter", "painted"]).exits(0);
    answer.complains("it is not compared with spec/grey, which was not run");
    assert!(folder.report()["ratios"].is_null());
}
