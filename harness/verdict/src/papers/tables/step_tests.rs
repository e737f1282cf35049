//! The steps of published tables, by examples that were worked out by hand.

use luxproof_model::MeterId;
use luxproof_scene::Meter;
use luxproof_spec::procedures::Direction;

use super::*;

const TEXT: &str = "luxproof_published: 1
citation: {title: \"A paper\"}
rounding: {units_in_last_digit: 1}
tables:
  luminous_intensity:
    name: Table 1
    quantity: luminous_intensity_cd
    columns:
      file: {reference: true, engine: photometry, model: point, meaning: \"as stated\"}
      lum: {reference: false, engine: radiance, model: area, also: [impostor], meaning: \"as rendered\"}
    rows:
      - {gamma_deg: 90, c_deg: 0, cells: {file: \"4.5\", lum: \"0\"}, total: \"4.5\"}
  indirect_illuminance:
    name: Table 2
    quantity: illuminance_lx
    bounces: 3
    columns:
      hand: {reference: true, engine: iesna, model: point, meaning: \"by hand\"}
      deep: {reference: false, engine: radiance, model: point, bounces: 3, meaning: \"as rendered\"}
    totals: {hand: \"3\"}
    rows:
      - {at_m: [0, 0, 0], normal: [0, 0, 2], cells: {hand: \"1.25\", deep: \"1.3\"}}
      - {at_m: [1, 0, 0], normal: [0, 0, 1], cells: {}}
";

fn parse(text: &str) -> Result<Published, PublishedError> {
    Published::parse(Path::new("paper.yaml"), text.as_bytes().to_vec())
}

#[test]
fn a_file_of_another_version_or_with_a_cell_that_is_no_number_is_refused() {
    assert!(parse(TEXT).is_ok());
    for (right, wrong, says) in [
        ("luxproof_published: 1", "luxproof_published: 2", "format version 2"),
        ("\"1.25\"", "\"n/a\"", "the cell \"n/a\" is no number"),
        ("total: \"4.5\"", "total: \"x\"", "the cell \"x\" is no number"),
        ("hand: \"3\"", "hand: \"y\"", "the cell \"y\" is no number"),
    ] {
        let error = parse(&TEXT.replacen(right, wrong, 1)).unwrap_err();
        assert!(error.message.contains(says), "{error}");
    }
}

#[test]
fn a_table_has_a_cell_for_each_print_and_one_for_an_empty_row() {
    let published = parse(TEXT).unwrap();
    assert_eq!(published.count_cells(), 2 + 2 + 1);
    assert_eq!(Vec::from_iter(published.engines()), ["iesna", "radiance"]);
    let table = &published.tables[&ProcedureId::IndirectIlluminance];
    assert_eq!(table.reference_column(), Some("hand"));
    assert_eq!((table.decimals("hand"), table.decimals("deep"), table.decimals("none")), (2, 1, 0));
}

/// A fault of a file that its user may read or not.
fn fault(message: &str, trust: Trust) -> SpecError {
    let error = PublishedError { file: "paper.yaml".to_owned(), message: message.to_owned() };
    error.fault(Path::new("paper.yaml"), trust)
}

#[test]
fn an_error_has_the_place_that_ends_its_message() {
    let placed = fault("unknown key `a at line b` at line 7 column 12", Trust::Own);
    assert_eq!(placed.message, "unknown key `a at line b`");
    assert_eq!((placed.line, placed.column), (Some(7), Some(12)));
    let plain = fault("is not UTF-8", Trust::Own);
    assert_eq!((plain.message.as_str(), plain.line, plain.column), ("is not UTF-8", None, None));
    // What a stranger's file says is not quoted.
    assert!(!fault("unknown key `secret` at line 7 column 12", Trust::Stranger).message.contains("secret"));
}

#[test]
fn a_total_differs_from_its_sum_by_more_than_the_rounding_of_numbers() {
    for (total, cells, excess) in [
        ("10", &["4", "6"][..], None),
        ("10.5", &["4", "6"], Some(0.5)),
        ("9", &["4", "6"], Some(-1.0)),
        // Relative to a total of 10, or to 1.
        ("10.00000000999", &["4", "6"], None),
        ("10.000000011", &["4", "6"], Some(1.1e-8)),
        ("0.5000000009", &["0.5"], None),
        ("0.5000000011", &["0.5"], Some(1.1e-9)),
        ("10", &["4", "6", "n/a"], None),
        ("n/a", &["4", "6"], None),
    ] {
        let (total, cells) = (total.to_owned(), cells.iter().map(|cell| (*cell).to_owned()).collect_vec());
        let found = total_excess(Some(&total), cells.iter());
        assert_eq!(found.is_some(), excess.is_some(), "{total} {cells:?}: {found:?}");
        assert!(found.zip(excess).is_none_or(|(a, b)| (a - b).abs() < 1e-12), "{total} {cells:?}: {found:?}");
    }
    assert_eq!(total_excess(None, std::iter::empty()), None);
    assert!(describe_mismatch("10.5", 0.5).ends_with("add up to 10"));
    assert_eq!(parse_number(" 2.5 "), Some(2.5));
}

#[test]
fn two_excesses_are_the_same_up_to_the_rounding_of_numbers() {
    for (of_row, of_column, is_same) in [
        (0.5, 0.5, true),
        (0.5, 0.5 + 0.9e-9, true),
        (0.5, 0.5 + 1.1e-9, false),
        (0.5, 0.5 - 1.1e-9, false),
        (100.0, 100.0 + 0.9e-7, true),
        (-100.0, -100.0 - 0.9e-7, true),
        (100.0, 100.0 + 1.1e-7, false),
    ] {
        assert_eq!(have_same_excess(of_row, of_column), is_same, "{of_row} {of_column}");
    }
}

fn row_at(at_m: [f64; 3], normal: [f64; 3]) -> Row {
    Row { gamma_deg: None, c_deg: None, at_m: Some(at_m), normal: Some(normal), cells: BTreeMap::new(), total: None }
}

fn row_towards(gamma_deg: f64, c_deg: f64) -> Row {
    Row { gamma_deg: Some(gamma_deg), c_deg: Some(c_deg), at_m: None, normal: None, ..row_at([0.0; 3], [0.0; 3]) }
}

#[test]
fn a_row_is_in_the_direction_of_its_angles_and_at_the_poles_in_every_plane() {
    // Down is gamma 0, x is C 0 and y is C 90.
    for (gamma_deg, c_deg, local, is_in) in [
        (90.0, 0.0, DVec3::X, true),
        (90.0, 90.0, DVec3::Y, true),
        (90.0, 270.0, DVec3::NEG_Y, true),
        (90.0, 0.0, DVec3::Y, false),
        (45.0, 0.0, DVec3::new(1.0, 0.0, -1.0), true),
        (135.0, 0.0, DVec3::new(1.0, 0.0, -1.0), false),
        (0.0, 77.0, DVec3::NEG_Z, true),
        (180.0, 77.0, DVec3::Z, true),
        (0.0, 77.0, DVec3::Z, false),
    ] {
        assert_eq!(row_towards(gamma_deg, c_deg).is_in_direction(local), is_in, "{gamma_deg} {c_deg} {local}");
    }
    assert!(!row_at([0.0; 3], [0.0, 0.0, 1.0]).is_in_direction(DVec3::NEG_Z));
    for (angle, is_equal) in [(Some(30.0 + 0.9e-6), true), (Some(30.0 - 1.1e-6), false), (None, false)] {
        assert_eq!(is_same(angle, 30.0), is_equal, "{angle:?}");
    }
}

/// A target at a place, or in a direction seen from a luminaire.
fn target(position_m: [f64; 3], direction: Option<(f64, f64)>) -> Target {
    let meter = Meter { position_m: position_m.into(), normal: DVec3::Z };
    let direction = direction.map(|(gamma_deg, c_deg)| Direction { c_deg, gamma_deg });
    Target { direction, ..Target::of_one(MeterId::new("grid", 0), meter, 1.0) }
}

#[test]
fn a_row_is_at_a_target_within_a_millionth_of_a_metre_or_degree() {
    let place = target([1.0, 2.0, 3.0], None);
    for (at_m, normal, is_at) in [
        ([1.0, 2.0, 3.0 + 0.9e-6], [0.0, 0.0, 1.0], true),
        ([1.0, 2.0, 3.0 + 1.1e-6], [0.0, 0.0, 1.0], false),
        ([1.0, 2.0, 3.0], [0.0, 0.0, 5.0], true),
        ([1.0, 2.0, 3.0], [1.1e-6, 0.0, 1.0], false),
        ([1.0, 2.0, 3.0], [0.0, 0.0, -1.0], false),
    ] {
        assert_eq!(row_at(at_m, normal).is_at(&place), is_at, "{at_m:?} {normal:?}");
    }
    let towards = target([1.0, 2.0, 3.0], Some((30.0, 90.0)));
    for (gamma_deg, c_deg, is_at) in [
        (30.0 + 0.9e-6, 90.0 - 0.9e-6, true),
        (30.0 + 1.1e-6, 90.0, false),
        (30.0 - 1.1e-6, 90.0, false),
        (30.0, 90.0 + 1.1e-6, false),
        (30.0, 90.0 - 1.1e-6, false),
    ] {
        assert_eq!(row_towards(gamma_deg, c_deg).is_at(&towards), is_at, "{gamma_deg} {c_deg}");
    }
    assert!(!row_towards(30.0, 90.0).is_at(&place) && !row_at([1.0, 2.0, 3.0], [0.0, 0.0, 1.0]).is_at(&towards));
}

/// A task of a procedure at the origin with this light.
fn task_of(procedure: ProcedureId, quantity: Quantity, transport: Transport) -> Task {
    Task { procedure, quantity, transport, targets: vec![target([0.0; 3], None)], ..crate::fixtures::task(0) }
}

/// A task of the second table with so many bounces.
fn reflected(bounces: Bounces) -> Task {
    let mut task = task_of(ProcedureId::IndirectIlluminance, Quantity::Illuminance, Transport::Indirect(bounces));
    let lamp = luxproof_engines::fixtures::luminaire("lamp", DVec3::Z, luxproof_engines::fixtures::lambertian());
    task.scene.luminaires = vec![lamp];
    task
}

/// The columns that judge an engine in a task.
fn columns(published: &Published, task: &Task, engine: &str) -> Vec<String> {
    let references = published.references(task, &task.targets[0], engine, &[]);
    references.iter().map(|r| luxproof_model::published_column(&r.source).to_owned()).collect()
}

#[test]
fn a_column_judges_its_engine_with_its_model_and_its_bounces() {
    let published = parse(TEXT).unwrap();
    assert_eq!(columns(&published, &reflected(Bounces::AtMost(3)), "radiance"), ["deep"]);
    assert_eq!(columns(&published, &reflected(Bounces::AtMost(3)), "iesna"), ["hand"]);
    assert!(columns(&published, &reflected(Bounces::AtMost(2)), "radiance").is_empty());
    assert!(columns(&published, &reflected(Bounces::Converged), "radiance").is_empty());
    assert_eq!(columns(&published, &reflected(Bounces::Converged), "iesna"), ["hand"]);
    assert!(columns(&published, &reflected(Bounces::AtMost(3)), "mitsuba").is_empty());
    // Another model, which a column may allow.
    let mut of_areas = reflected(Bounces::AtMost(3));
    of_areas.scene.luminaires[0].model = luxproof_scene::LuminaireModel::Area;
    assert!(columns(&published, &of_areas, "radiance").is_empty());
    let allowing = parse(&TEXT.replacen("bounces: 3, meaning", "also: [area], bounces: 3, meaning", 1)).unwrap();
    assert_eq!(columns(&allowing, &of_areas, "radiance"), ["deep"]);
    // Another quantity is another table, and another place another row.
    let of_luminance = Task { quantity: Quantity::Luminance, ..reflected(Bounces::AtMost(3)) };
    assert!(columns(&published, &of_luminance, "radiance").is_empty());
    let elsewhere = Task { targets: vec![target([9.0; 3], None)], ..reflected(Bounces::AtMost(3)) };
    assert!(columns(&published, &elsewhere, "radiance").is_empty());
    // Derived values judge every engine.
    let derived = parse(&TEXT.replacen("{title:", "{basis: closed_form, title:", 1)).unwrap();
    assert_eq!(columns(&derived, &reflected(Bounces::AtMost(3)), "mitsuba"), ["deep", "hand"]);
    assert_eq!(columns(&derived, &reflected(Bounces::AtMost(2)), "mitsuba"), ["hand"]);
}

fn misfit(row: usize, column: &str) -> Misfit {
    let (column, printed) = (column.to_owned(), "1.3".to_owned());
    Misfit { row, column, printed, expected: 9.0, half_width: 0.1, by: vec![] }
}

#[test]
fn a_reference_has_the_interval_of_its_digits_and_the_caveat_of_its_cell() {
    let published = parse(TEXT).unwrap();
    let task = reflected(Bounces::AtMost(3));
    for (misfits, has_caveat) in
        [(vec![], false), (vec![misfit(0, "deep")], true), (vec![misfit(1, "deep"), misfit(0, "hand")], false)]
    {
        let found = published.references(&task, &task.targets[0], "radiance", &misfits);
        assert_eq!((found[0].value, found[0].caveat.is_some()), (1.3, has_caveat), "{misfits:?}");
        assert!((found[0].uncertainty - 0.1 / 3f64.sqrt()).abs() < 1e-12);
    }
}

#[test]
fn a_table_has_the_rows_at_targets_and_derived_values_have_none() {
    let published = parse(TEXT).unwrap();
    let mut task = reflected(Bounces::AtMost(3));
    task.targets.push(target([9.0; 3], None));
    let table = published.table(&task, "room").unwrap();
    assert_eq!((table.name.as_str(), table.rows.len(), table.columns.len()), ("Table 2", 1, 2));
    assert_eq!((table.rows[0].row, table.rows[0].place.as_str()), (0, "(0, 0, 0)"));
    assert_eq!(published.table(&Task { quantity: Quantity::Luminance, ..task.clone() }, "room"), None);
    assert_eq!(published.table(&Task { targets: vec![target([9.0; 3], None)], ..task.clone() }, "room"), None);
    let derived = parse(&TEXT.replacen("{title:", "{basis: closed_form, title:", 1)).unwrap();
    assert_eq!(derived.table(&task, "room"), None);
    assert!(derived.misfits(&task).is_empty());
}

/// A table of two rows and two columns, of which totals are given.
fn table_with_totals(rows: [&str; 2], columns: [&str; 2]) -> Published {
    let [first, second] = rows;
    let [a, b] = columns;
    let text = format!(
        "luxproof_published: 1
citation: {{title: \"A paper\"}}
rounding: {{units_in_last_digit: 1}}
tables:
  indirect_illuminance:
    name: Table 2
    quantity: illuminance_lx
    columns:
      a: {{reference: true, engine: iesna, model: point, meaning: \"by hand\"}}
      b: {{reference: false, engine: radiance, model: point, meaning: \"as rendered\"}}
    totals: {{a: \"{a}\", b: \"{b}\"}}
    rows:
      - {{at_m: [0, 0, 0], normal: [0, 0, 1], cells: {{a: \"1\", b: \"2\"}}, total: \"{first}\"}}
      - {{at_m: [1, 0, 0], normal: [0, 0, 1], cells: {{a: \"3\", b: \"4\"}}, total: \"{second}\"}}
"
    );
    parse(&text).unwrap()
}

#[test]
fn a_cell_was_changed_where_its_row_and_its_column_have_the_same_excess_or_one_has_all() {
    for (rows, columns, changed) in [
        (["3", "7"], ["4", "6"], &[][..]),
        // The second row of `a` was 8 and is 3.
        (["3", "12"], ["9", "6"], &[(1, "a", 8.0)][..]),
        // Two cells were changed by different numbers.
        (["5", "12"], ["9", "8"], &[(0, "b", 4.0), (1, "a", 8.0)]),
        // One row has the excess of two columns.
        (["13", "7"], ["7", "13"], &[(0, "a", 4.0), (0, "b", 9.0)]),
        // One column has the excess of two rows.
        (["6", "14"], ["14", "6"], &[(0, "a", 4.0), (1, "a", 10.0)]),
        // A row alone shows no cell.
        (["3", "12"], ["4", "6"], &[]),
        // Two rows and two columns whose excesses have nothing in common show none.
        (["4", "9"], ["8", "11"], &[]),
    ] {
        let published = table_with_totals(rows, columns);
        let table = &published.tables[&ProcedureId::IndirectIlluminance];
        assert_eq!(table.changed(), changed, "{rows:?} {columns:?}");
    }
}

#[test]
fn totals_are_reported_that_no_changed_cell_explains() {
    let task = reflected(Bounces::AtMost(3));
    for (rows, columns, findings) in [
        (["3", "7"], ["4", "6"], 0),
        (["3", "12"], ["9", "6"], 0),
        (["3", "12"], ["4", "6"], 1),
        (["4", "9"], ["8", "11"], 4),
    ] {
        let published = table_with_totals(rows, columns);
        let table = &published.tables[&ProcedureId::IndirectIlluminance];
        let found = published.total_findings(ProcedureId::IndirectIlluminance, table);
        assert_eq!(found.len(), findings, "{rows:?} {columns:?}: {found:?}");
        // The second row is at no meter of the task.
        assert_eq!(published.findings(&[&task]).len(), findings + 1);
        let of_luminance = Task { quantity: Quantity::Luminance, ..task.clone() };
        assert!(published.findings(&[&of_luminance]).is_empty());
    }
}

#[test]
fn a_changed_cell_is_a_misfit_with_what_it_was() {
    let published = table_with_totals(["3", "12"], ["9", "6"]);
    let found = published.misfits(&reflected(Bounces::AtMost(3)));
    let [misfit] = &found[..] else { panic!("{found:?}") };
    assert_eq!((misfit.row, misfit.column.as_str(), misfit.printed.as_str()), (1, "a", "3"));
    assert_eq!((misfit.expected, misfit.half_width), (8.0, 0.0));
    let table = &published.tables[&ProcedureId::IndirectIlluminance];
    let original = |row, column| published.original_cell(table, &table.changed(), row, (column, 0)).unwrap().value;
    assert_eq!((original(1, "a"), original(0, "a"), original(1, "b")), (8.0, 1.0, 4.0));
}
