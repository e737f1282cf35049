//! `luxproof selftest --repetitions`: readings of other seeds tell whether standard errors are honest.

use serde_json::Value;

use crate::support::{Answer, Folder, MINE, SKEW_LAMP, SKEW_ROOM, adapter, among, root};

/// Twelve seeds of the example adapter with normal noise of a tenth of a percent, of which it states so much.
fn honesty(stated: f64) -> Answer {
    let noise = "        chance = random.Random(f\"{job['seed']} {meter['id']}\"); error = 1e-3 * lux; lux += error * chance.gauss(0, 1)";
    let noisy = adapter()
        .replace(
            "\"error_bound_lx\": 1e-12 * lux",
            &format!("\"std_error_lx\": {stated} * error, \"degrees_of_freedom\": 60"),
        )
        .replacen("\nimport ", "\nimport random\nimport ", 1)
        .replace("        readings.append", &format!("{noise}\n        readings.append"));
    let spec = [SKEW_ROOM, MINE].concat();
    let folder = Folder::new(&[("spec.yaml", &spec), ("lamp.ies", SKEW_LAMP), ("adapter.py", &noisy)]);
    folder.luxproof(&["selftest", "--repetitions", "12", "--format", "json", "spec.yaml"])
}

fn finding(report: &Value) -> &str {
    among(report, "groups", &[("engine", "mine"), ("procedure", "direct_illuminance")])[0]["finding"].as_str().unwrap()
}

#[test]
fn a_program_learns_what_its_standard_errors_are_worth() {
    for (stated, code, reported) in [(1.0, 0, "honest"), (0.5, 1, "too_small"), (2.0, 1, "too_large")] {
        let report = honesty(stated).exits(code).json();
        assert_eq!(finding(&report), reported, "{stated}: {report}");
    }
}

#[test]
fn a_renderer_reads_with_every_seed_and_determined_light_is_not_counted() {
    let folder = Folder::for_renderers(&[]);
    let axial = root().join("reference/specs/axial.yaml");
    let args =
        ["selftest", "--repetitions", "3", "--engines", "radiance", "--relative-error", "0.05", "--seconds", "1"];
    let args = [&args[..], &["--format", "json", axial.to_str().unwrap()]].concat();
    let report = folder.luxproof(&args).exits(0).json();
    let of = |procedure: &str| among(&report, "groups", &[("procedure", procedure)])[0].clone();
    let indirect = of("indirect_illuminance");
    assert!(indirect["counted"] == 4 && indirect["all"]["ratio"].as_f64().unwrap() > 0.1, "{indirect}");
    let determined = of("luminous_intensity");
    assert!(determined["counted"] == 0 && determined["finding"] == "not_sampled", "{determined}");
    // Our own solvers do not take part.
    assert!(
        among(&report, "groups", &[("engine", "simulator")]).is_empty() && report["skips"] == serde_json::json!([])
    );
    assert_eq!(folder.luxproof(&args).exits(0).json(), report, "one seed, the same readings");
}

#[test]
fn options_of_repetitions_need_specs_and_sense() {
    let folder = Folder::new(&[]);
    folder.luxproof(&["selftest", "--repetitions", "3"]).exits(2);
    folder.luxproof(&["selftest", "--engines", "radiance"]).exits(2);
    let axial = root().join("reference/specs/axial.yaml");
    let args = ["selftest", "--repetitions", "3", axial.to_str().unwrap()];
    folder.luxproof(&[&args[..], &["--relative-error", "0"]].concat()).exits(2).complains("numbers above 0");
    folder.luxproof(&[&args[..], &["--engines", "radiance"]].concat()).exits(3);
}
