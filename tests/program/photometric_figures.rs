//! `luxproof photometry report`, `diff` and `orient` as a person calls them.

use crate::support::{Folder, LAMP};

/// A street luminaire: 90 cd at gamma 45 towards C 0, 10 towards C 180, on a plate of 60 x 20 cm.
const STREET: &str = "IESNA:LM-63-2002\n[TEST] 1\n[TESTLAB] us\n[ISSUEDATE] 2026\n[MANUFAC] us\nTILT=NONE\n\
    1 -1 1 4 3 1 2 .2 .6 0\n1 1 10\n0 45 90 180\n0 90 180\n50 90 0 0\n50 40 0 0\n50 10 0 0\n";

#[test]
fn a_report_prints_every_figure_draws_and_keeps_the_plain_call_as_it_was() {
    let folder = Folder::new(&[("a.ies", LAMP), ("dark.ies", &LAMP.replace("100 80 0", "0 0 0"))]);
    let plain = folder.luxproof(&["photometry", "a.ies"]).exits(0).prints("CIE flux code").stdout;
    assert!(!plain.contains("UGR"));
    let report = folder.luxproof(&["photometry", "report", "a.ies", "--svg", "drawn"]).exits(0);
    report.prints("beam angle (50 %)").prints("zonal lumens").prints("UGR");
    for name in ["polar", "isocandela"] {
        assert!(folder.read(&format!("drawn/{name}.svg")).starts_with("<svg "), "{name}");
    }
    let json = folder.luxproof(&["photometry", "report", "a.ies", "--json"]).exits(0).stdout;
    let record: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(record["schema"], "luxproof-photometric-report/1");
    folder.luxproof(&["photometry", "report", "dark.ies"]).exits(0).prints("not available: every intensity is zero");
    folder.luxproof(&["photometry", "report", "dark.ies", "--deny", "warnings"]).exits(1).complains("[dark]");
    folder.luxproof(&["photometry", "report", "none.ies"]).exits(2).complains("none.ies");
}

#[test]
fn a_difference_has_a_verdict_a_place_a_map_and_an_exit_code() {
    let folder = Folder::new(&[
        ("a.ies", STREET),
        ("rounded.ies", &STREET.replace("50 40 0 0", "50 40.4 0 0")),
        ("other.ies", &STREET.replace("50 40 0 0", "50 43 0 0")),
        ("bad.ies", "IESNA:LM-63-2002\nTILT=NONE\nx\n"),
    ]);
    let diff =
        |b: &str, code: i32| folder.luxproof(&["photometry", "diff", "a.ies", b, "--svg", "map.svg"]).exits(code);
    diff("a.ies", 0).prints("a.ies and a.ies: equal\n");
    diff("rounded.ies", 0).prints("equal within rounding");
    diff("other.ies", 1)
        .prints("different")
        .prints("40.0000 -> 43.0000 cd at C 90.000° gamma 45.000°, +3.3333 % of the peak");
    assert!(folder.read("map.svg").contains("full colour 3.00000 cd"));
    folder.luxproof(&["photometry", "diff", "a.ies", "bad.ies"]).exits(2).complains("bad.ies:3");
    let json = folder.luxproof(&["photometry", "diff", "a.ies", "other.ies", "--json"]).exits(1).stdout;
    let record: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (record["verdict"].as_str(), record["largest_difference"]["difference_cd"].as_f64()),
        (Some("different"), Some(3.0))
    );
}

#[test]
fn a_luminaire_is_turned_into_the_other_formats_forward() {
    let folder = Folder::new(&[("a.ies", STREET)]);
    folder
        .luxproof(&["photometry", "orient", "a.ies"])
        .exits(0)
        .prints("C 0°, across the street")
        .prints("light leans to       C 0°");
    let to = ["photometry", "orient", "a.ies", "--to", "forward-c90", "--out", "a.ldt"];
    folder.luxproof(&to).exits(0).prints("turned by");
    folder
        .luxproof(&["photometry", "orient", "a.ldt"])
        .exits(0)
        .prints("C 90°, across the street")
        .prints("light leans to       C 90°");
    // There and back it is what it was; what differs are words that formats keep.
    folder.luxproof(&["photometry", "orient", "a.ldt", "--turn", "-90", "--out", "back.ies"]).exits(0);
    folder.luxproof(&["photometry", "diff", "a.ies", "back.ies"]).exits(0).prints("equal\n");
    let slanted = ["photometry", "orient", "a.ies", "--turn", "30", "--out", "b.ies"];
    folder.luxproof(&slanted).exits(0).complains("stays along the axes");
    for wrong in [
        &["--to", "forward-c0"][..],
        &["--out", "x.ies"],
        &["--turn", "nan", "--out", "x.ies"],
        &["--turn", "9", "--out", "x.doc"],
    ] {
        folder.luxproof(&[&["photometry", "orient", "a.ies"], wrong].concat()).exits(2);
    }
}
