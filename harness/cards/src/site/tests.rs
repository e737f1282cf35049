//! The pages as a browser gets them: links, escaping, and paths.

use std::collections::{BTreeMap, BTreeSet};

use luxproof_model::{Report, Tool};

use super::{SiteFile, files};
use crate::fixtures::{MadeCase, capabilities, report};
use crate::{CardRun, Cards, Verification};

fn site(reports: &[Report]) -> Vec<SiteFile> {
    let runs: Vec<(CardRun, &Report)> = reports.iter().map(|r| (CardRun::of(r, Verification::Own), r)).collect();
    let (cards, evidence) = Cards::of(&capabilities(2), &runs, Tool::default()).unwrap();
    files(&cards, &evidence).unwrap()
}

fn content<'a>(files: &'a [SiteFile], path: &str) -> &'a str {
    let file = files.iter().find(|file| file.path == path);
    &file.unwrap_or_else(|| panic!("no {path} in {:?}", files.iter().map(|f| &f.path).collect::<Vec<_>>())).content
}

fn usual() -> Vec<Report> {
    let right = [
        MadeCase::new("a").off(0.001, 0.001),
        MadeCase::new("b").off(0.0, 0.001),
        MadeCase::new("a").hidden(7).off(0.0, 0.001),
    ];
    let wrong = [MadeCase::new("a").off(0.5, 0.001), MadeCase::new("b").off(0.0, 0.001)];
    vec![report("rays@1.0", "1.0", &right), report("rays@2.0", "2.0", &wrong), report("other", "v3.1 (x)", &right)]
}

/// The values of an attribute in a page.
fn attributes<'a>(page: &'a str, name: &str) -> Vec<&'a str> {
    let start = format!(" {name}=\"");
    page.split(start.as_str()).skip(1).filter_map(|rest| rest.split('"').next()).collect()
}

/// The path that a link leads to from a page.
fn resolve(from: &str, link: &str) -> String {
    let mut parts: Vec<&str> = from.split('/').collect();
    parts.pop();
    for part in link.split('/') {
        match part {
            ".." => assert!(parts.pop().is_some(), "{link} of {from} leaves the site"),
            part => parts.push(part),
        }
    }
    parts.join("/")
}

fn is_page(file: &SiteFile) -> bool {
    file.content.starts_with("<!DOCTYPE html>")
}

#[test]
fn every_link_leads_to_a_page_and_an_anchor_of_the_site() {
    let files = site(&usual());
    let anchors: BTreeMap<&str, BTreeSet<&str>> =
        files.iter().map(|file| (file.path.as_str(), attributes(&file.content, "id").into_iter().collect())).collect();
    let mut links = 0;
    for page in files.iter().filter(|file| is_page(file)) {
        for link in attributes(&page.content, "href") {
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if path.is_empty() { page.path.clone() } else { resolve(&page.path, path) };
            let known = anchors.get(target.as_str()).unwrap_or_else(|| panic!("{}: no page {link}", page.path));
            assert!(anchor.is_empty() || known.contains(anchor), "{}: no anchor {link}", page.path);
            links += 1;
        }
    }
    assert!(links > 40, "{links}");
}

#[test]
fn a_cell_has_a_sign_a_text_and_a_class_and_leads_to_the_evidence_of_its_release() {
    let files = site(&usual());
    let index = content(&files, "index.html");
    let cell = index.split("<td ").find(|cell| cell.contains("data-renderer=\"rays\"")).unwrap();
    assert!(
        cell.starts_with("class=\"s-wrong\"") && cell.contains("✕") && cell.contains("wrong, off by up to 51\u{a0}%"),
        "{cell}"
    );
    assert!(cell.contains("href=\"renderers/rays/direct.html#r-2.0\"") && cell.contains("worst: a"), "{cell}");
    assert!(cell.contains("since <strong>2.0</strong>, before: within 0.20"), "{cell}");
    let evidence = content(&files, "renderers/rays/direct.html");
    for text in ["floor[0]", "150.000 lx", "100.000 lx", "+50.00 ± 0.10 %", "hidden, seed 7", "within 0.20 %"] {
        assert!(evidence.contains(text), "no {text}");
    }
}

#[test]
fn pages_state_the_stated_tolerance_of_rows_and_of_cells() {
    let mut reports = usual();
    reports[2].engines[0].role = luxproof_model::Role::Reference;
    reports[2].comparisons.iter_mut().for_each(|c| c.tolerance.relative = 0.1);
    // A solver of luxproof's own with the tolerance of the renderers.
    let mut solver = report("solver", "1", &[MadeCase::new("a").off(0.0, 0.0), MadeCase::new("b").off(0.0, 0.0)]);
    solver.engines[0].role = luxproof_model::Role::Reference;
    reports.push(solver);
    let files = site(&reports);
    let index = content(&files, "index.html");
    assert!(index.contains("tolerance 1\u{a0}%</span>"), "{index}");
    // luxproof's own hand method has its own limit, and says so.
    let cell = index.split("<td ").find(|cell| cell.contains("data-renderer=\"other\"")).unwrap();
    assert!(cell.contains("judged by the accuracy that it claims: 10\u{a0}%"), "{cell}");
    assert!(content(&files, "renderers/rays/direct.html").contains("<strong>Tolerance</strong>: 1 % (the larger"));
    assert!(content(&files, "renderers/other/direct.html").contains("What they do not claim"));
    let cell = index.split("<td ").find(|cell| cell.contains("data-renderer=\"solver\"")).unwrap();
    assert!(cell.contains("s-accurate") && !cell.contains("hand method"), "{cell}");
    assert!(content(&files, "capabilities.html").contains("<dt>furnace</dt>"));
}

#[test]
fn a_capability_that_nothing_was_tested_for_has_no_row_and_is_named_below_the_table() {
    let reports = usual();
    let runs: Vec<(CardRun, &Report)> = reports.iter().map(|r| (CardRun::of(r, Verification::Own), r)).collect();
    let mut all = capabilities(2);
    let mut other = all.capabilities[0].clone();
    (other.id, other.title) = ("bodies".to_owned().try_into().unwrap(), "Bodies".to_owned());
    other.cases = serde_json::from_str(r#"[{"case": "far", "procedures": ["direct_illuminance"]}]"#).unwrap();
    other.minimum_cases = 1;
    // First in the file, so that the numbers of rows shift.
    all.capabilities.insert(0, other);
    let (cards, evidence) = Cards::of(&all, &runs, Tool::default()).unwrap();
    let files = files(&cards, &evidence).unwrap();
    for page in ["index.html", "hidden.html", "renderers/rays/index.html"] {
        let page = content(&files, page);
        assert_eq!(page.matches(">Bodies</a>").count(), 1, "{page}");
        let (_, below) = page.split_once("Without a row").unwrap();
        assert!(below.contains(">Bodies</a>"), "{below}");
    }
    assert_eq!(release_data(content(&files, "index.html"))["capabilities"], serde_json::json!(["direct"]));
}

#[test]
fn a_cell_leads_to_the_json_of_its_run_and_names_the_cases_to_repeat() {
    let reports = usual();
    let mut run = CardRun::of(&reports[0], Verification::Own);
    (run.report, run.bundle) = (Some("runs/1/report.html".to_owned()), Some("runs/1/bundle.zip".to_owned()));
    (run.report_bytes, run.bundle_bytes) = (Some(3_456_000), Some(999));
    run.request = Some(luxproof_model::Request::default());
    run.bundled_specs =
        ["a", "b", "hidden-7-a"].iter().map(|case| (format!("{case}.yaml"), format!("specs/{case}.yaml"))).collect();
    let (cards, evidence) = Cards::of(&capabilities(2), &[(run, &reports[0])], Tool::default()).unwrap();
    let files = files(&cards, &evidence).unwrap();
    let page = content(&files, "renderers/rays/direct.html");
    assert!(page.contains("href=\"../../runs/1/report.json\""), "{page}");
    assert!(page.contains("report.json</code></a> (3.5 MB)") && page.contains("Bundle</a> (0.1 MB)"), "{page}");
    assert!(page.contains("--filter a --filter hidden-7-a --filter b"), "{page}");
}

#[test]
fn declined_cases_make_a_row_where_the_publication_has_enough_of_them() {
    let given = [MadeCase::new("a").unsupported(), MadeCase::new("b").unsupported()];
    let all = site(&[report("web", "1", &given)]);
    assert!(content(&all, "index.html").contains("<td class=\"s-unsupported\""));
    // One case of at least two says nothing about the row.
    let one = site(&[report("web", "1", &given[..1])]);
    let (table, below) = content(&one, "index.html").split_once("Without a row").unwrap();
    assert!(!table.contains("td class=\"s-unsupported\"") && below.contains("Direct light"), "{below}");
}

/// The data from which the first page unfolds older releases.
fn release_data(index: &str) -> serde_json::Value {
    let (_, rest) = index.split_once("<script id=\"releases\" type=\"application/json\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn the_first_page_has_the_cells_of_older_releases_and_their_links_lead_to_pages() {
    let files = site(&usual());
    let data = release_data(content(&files, "index.html"));
    let renderer = data["renderers"].as_array().unwrap().iter().find(|renderer| renderer["name"] == "rays").unwrap();
    assert_eq!(renderer["releases"], serde_json::json!([["2.0", "r-2.0"], ["1.0", "r-1.0"]]));
    let code = renderer["cells"][0][0].as_u64().unwrap() as usize;
    // 1.0 is the first, so that nothing changed; 0 is the number of `accurate`.
    assert_eq!((code % 2, data["texts"][code / 2].as_str()), (0, Some("0within 0.20\u{a0}%")));
    assert_eq!(data["states"][0], serde_json::json!(["accurate", "✓"]));
    let page = format!("renderers/rays/{}.html", data["capabilities"][0].as_str().unwrap());
    assert!(attributes(content(&files, &page), "id").contains(&"r-1.0"));
}

#[test]
fn the_page_of_hidden_variants_has_both_bounds_and_names_who_is_right_in_public_only() {
    let files = site(&usual());
    let page = content(&files, "hidden.html");
    assert!(page.contains("No renderer is right in the public cases only."));
    assert!(page.contains("--seed 7 --out hidden"));
    let cell = page.split("<td ").find(|cell| cell.contains("data-renderer=\"other\"")).unwrap();
    assert!(cell.contains("similar") && cell.contains("<strong>0.20\u{a0}%</strong>, a"), "{cell}");
    let tuned = [
        MadeCase::new("a").off(0.0, 0.001),
        MadeCase::new("b").off(0.0, 0.001),
        MadeCase::new("a").hidden(7).off(0.05, 0.001),
    ];
    let files = site(&[report("tuned@1.0", "1.0", &tuned)]);
    for page in ["index.html", "hidden.html"] {
        let page = content(&files, page);
        let (_, list) = page.split_once("Right in the public cases only").unwrap();
        assert!(list.contains("renderers/tuned/direct.html#r-1.0"), "{list}");
    }
    // Without variants nothing is said about them.
    let files = site(&[report("rays", "1.0", &[MadeCase::new("a").off(0.0, 0.0), MadeCase::new("b").off(0.0, 0.0)])]);
    assert!(!files.iter().any(|file| file.path == "hidden.html" || file.content.contains("hidden.html")));
}

#[test]
fn pages_load_nothing_and_work_without_their_script() {
    for file in site(&usual()).iter().filter(|file| is_page(file)) {
        let page = &file.content;
        assert!(page.contains("default-src 'none'"), "{}", file.path);
        assert!(!page.contains("http:") && !page.contains("https:") && !page.contains(" src="), "{}", file.path);
    }
}

#[test]
fn names_of_strangers_are_neither_markup_nor_paths() {
    let evil = "</script><img src=x onerror=alert(1)>\"'";
    let mut given = MadeCase::new("a").off(0.5, 0.0);
    given.title = evil.to_owned();
    let mut wrong = report("../../<b>up", "../<i>1\"", &[given, MadeCase::new("b").off(0.0, 0.0)]);
    wrong.comparisons[0].diagnosis = Some(evil.to_owned());
    wrong.recordings[0].command = Some(evil.to_owned());
    wrong.spec.title = evil.to_owned();
    let files = site(&[wrong]);
    for file in &files {
        assert!(file.path.split('/').all(|part| !part.is_empty() && !part.starts_with('.')), "{}", file.path);
        assert!(file.path.bytes().all(|b| b.is_ascii_alphanumeric() || b"/._-".contains(&b)), "{}", file.path);
        if is_page(file) {
            for markup in ["<img", "<b>", "<i>", "</script><img"] {
                assert!(!file.content.contains(markup), "{}: {markup}", file.path);
            }
            assert!(attributes(&file.content, "href").iter().all(|link| !link.contains(['<', '\'', ' '])));
        }
    }
}

#[test]
fn a_plot_shows_public_cases_as_circles_and_hidden_ones_as_squares() {
    let files = site(&usual());
    let page = content(&files, "renderers/other/direct.html");
    assert_eq!((page.matches("<circle").count(), page.matches("<rect").count()), (2, 1));
}
