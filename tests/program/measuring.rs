//! `luxproof bench` and `luxproof stress` as a user meets them, on our own solvers and one renderer.

use serde_json::Value;

use crate::support::{Folder, among, root};

fn axial() -> String {
    root().join("reference/specs/axial.yaml").to_str().unwrap().to_owned()
}

fn measured(folder: &Folder, verb: &str, more: &[&str]) -> Value {
    folder.luxproof(&[&[verb, &axial(), "--format", "json"], more].concat()).exits(0).json()
}

#[test]
fn stress_finds_no_drift_of_exact_light_and_goes_on_where_it_stopped() {
    let folder = Folder::for_renderers(&[]);
    let laws = "translation,meter_near_luminaire,dark";
    let args = ["--engines", "simulator,iesna,radiance", "--laws", laws, "--seconds", "0.2"];
    let report = measured(&folder, "stress", &args);
    assert_eq!(among(&report, "laws", &[]).len(), 9);
    for engine in ["simulator", "iesna"] {
        for law in among(&report, "laws", &[("engine", engine)]) {
            assert!(law["how"].is_null() && law["untried"] == 0, "{law}");
            assert!(law["breaks_at"].as_object().unwrap().is_empty(), "{law}");
        }
    }
    let of_radiance = among(&report, "laws", &[("engine", "radiance")]);
    assert!(of_radiance.iter().any(|l| l["worst_deviation"].is_number()), "{report}");
    let again = measured(&folder, "stress", &[&args[..], &["--minutes", "0"]].concat());
    assert_eq!(report, again);
}

#[test]
fn bench_reaches_the_exact_values_with_time_memory_and_error_on_record() {
    let folder = Folder::for_renderers(&[]);
    let procedures = ["--procedures", "direct_illuminance,indirect_illuminance"];
    let effort = ["--repetitions", "2", "--seconds", "0.1,0.3"];
    let args = [&["--engines", "simulator,iesna,radiance"], &procedures[..], &effort].concat();
    let report = measured(&folder, "bench", &args);
    let of = |engine: &str, procedure: &str| {
        among(&report, "curves", &[("engine", engine), ("procedure", procedure)])[0].clone()
    };
    let exact = of("simulator", "indirect_illuminance");
    assert!(exact["time_to"]["0.001"].as_f64().unwrap() > 0.0, "{exact}");
    for point in exact["points"].as_array().unwrap() {
        assert!(point["wall_s"].as_f64().unwrap() > 0.0 && point["peak_mib"].as_f64().unwrap() > 1.0, "{point}");
        assert!(point["relative_error"].as_f64().unwrap() < 1e-3, "{point}");
    }
    let sampled = &of("radiance", "indirect_illuminance")["points"][0];
    let at = |key: &str| sampled[key].as_f64().unwrap();
    assert!(at("relative_error_low") < at("relative_error") && at("relative_error") < at("relative_error_high"));
    assert!(at("relative_error") < 0.1 && at("cpu_s") > 0.0, "{sampled}");
    assert!(of("radiance", "direct_illuminance")["points"][0]["relative_error"].as_f64().unwrap() < 1e-5);
    assert_eq!(report["pareto"].as_array().unwrap().len(), 2);
}

#[test]
fn an_unknown_law_is_a_usage_error_with_the_nearest_name() {
    let args = ["stress", &axial(), "--laws", "mirrors"];
    Folder::new(&[]).luxproof(&args).exits(2).complains("did you mean `mirror`");
}
