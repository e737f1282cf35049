//! Files that are valid, or nearly so, built from any bytes: damage to them reaches what lies behind a reader's first line.
//!
//! One function a format. Each takes its choices from the bytes, so that a fuzzer steers it, and random bytes do as well.

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};

use arbitrary::{Result, Unstructured};
use serde_json::Value;

pub(crate) type Generator = fn(&mut Unstructured<'_>) -> Result<Vec<u8>>;

/// All of them, by the names of their targets.
pub(crate) const ALL: [(&str, Generator); 6] =
    [("lm63", lm63), ("eulumdat", eulumdat), ("tm33", tm33), ("gldf", gldf), ("spec", spec), ("report", report)];

/// Lines between the parts of a file.
fn joined(values: &[f64], separator: &str) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(separator)
}

/// A number of hundredths.
fn number(choices: &mut Unstructured<'_>, low: i32, high: i32) -> Result<f64> {
    Ok(f64::from(choices.int_in_range(100 * low..=100 * high)?) / 100.0)
}

/// So many rising angles from the first to the last.
fn angles(choices: &mut Unstructured<'_>, first: f64, last: f64, inner: usize) -> Result<Vec<f64>> {
    let mut all = vec![first, last];
    for _ in 0..inner {
        all.push(first + (last - first) * f64::from(choices.int_in_range(1..=999)?) / 1000.0);
    }
    all.sort_by(f64::total_cmp);
    all.dedup();
    Ok(all)
}

fn intensities(choices: &mut Unstructured<'_>, count: usize) -> Result<Vec<f64>> {
    (0..count).map(|_| number(choices, 0, 2000)).collect()
}

/// A text of a few characters that a header may hold.
fn text(choices: &mut Unstructured<'_>) -> Result<String> {
    let words = ["Maker", "A & B", "\u{b5}m", "<x>", "TILT", "\"quoted\"", "", "a b c", "1e5", "[MORE]"];
    Ok((*choices.choose(&words)?).to_owned())
}

/// LM-63 of any edition, tilt, type and unit.
fn lm63(choices: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let editions = ["a label", "IESNA91", "IESNA:LM-63-1995", "IESNA:LM-63-2002", "IES:LM-63-2019"];
    let mut file = format!("{}\n", choices.choose(&editions)?);
    for keyword in ["TEST", "TESTLAB", "ISSUEDATE", "MANUFAC", "LUMCAT", "_OWN"] {
        if choices.ratio(2, 3)? {
            let _ = writeln!(file, "[{keyword}] {}", text(choices)?);
        }
    }
    if choices.ratio(1, 4)? {
        file += "TILT=INCLUDE\n1\n3\n0 45 90\n1 .95 .9\n";
    } else {
        file += "TILT=NONE\n";
    }
    let kind = *choices.choose(&[1, 1, 2, 3])?;
    let (lows, highs) = if kind == 1 { (vec![0.0, 90.0], vec![90.0, 180.0]) } else { (vec![-90.0, 0.0], vec![90.0]) };
    let (low, high) = (*choices.choose(&lows)?, *choices.choose(&highs)?);
    let count = choices.int_in_range(0..=5)?;
    let vertical = angles(choices, low, if low < high { high } else { 180.0 }, count)?;
    let ends = if kind == 1 { vec![0.0, 90.0, 180.0, 360.0] } else { vec![90.0] };
    let (first, last) = (if kind == 1 { 0.0 } else { *choices.choose(&[-90.0, 0.0])? }, *choices.choose(&ends)?);
    let count = choices.int_in_range(0..=4)?;
    let horizontal = if first == last { vec![first] } else { angles(choices, first, last, count)? };
    let lumens = *choices.choose(&["-1", "1000", "0.5", "12345.6"])?;
    let units = choices.int_in_range(1..=2)?;
    let (width, length, height) = (number(choices, -1, 2)?, number(choices, -1, 2)?, number(choices, 0, 1)?);
    let multiplier = number(choices, 1, 10)?;
    let (rows, columns) = (vertical.len(), horizontal.len());
    let _ = writeln!(file, "1 {lumens} {multiplier} {rows} {columns} {kind} {units} {width} {length} {height}");
    let _ = writeln!(file, "{} 1 {}", number(choices, 1, 2)?, number(choices, 0, 100)?);
    let separator = *choices.choose(&[" ", "\n", ",", "  ", "\r\n"])?;
    let table = intensities(choices, rows * columns)?;
    let _ = writeln!(file, "{}\n{}", joined(&vertical, separator), joined(&horizontal, separator));
    let _ = writeln!(file, "{}", joined(&table, separator));
    Ok(file.into_bytes())
}

/// EULUMDAT of any symmetry, with one or several sets of lamps.
fn eulumdat(choices: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let symmetry: usize = choices.int_in_range(0..=4)?;
    let planes = *choices.choose(&[4_usize, 8, 12, 24])?;
    let rows: usize = choices.int_in_range(2..=10)?;
    let last_deg = *choices.choose(&[90.0, 180.0])?;
    let separator = *choices.choose(&["\n", "\r\n"])?;
    let mut lines: Vec<String> = vec![text(choices)?, choices.int_in_range(1..=3)?.to_string(), symmetry.to_string()];
    let step_deg = 360.0 / planes as f64;
    lines.extend([
        planes.to_string(),
        step_deg.to_string(),
        rows.to_string(),
        (last_deg / (rows as f64 - 1.0)).to_string(),
    ]);
    for _ in 0..5 {
        lines.push(text(choices)?);
    }
    // Length, width (0 where round), height, luminous length and width, and four heights of the luminous area, in mm.
    for _ in 0..9 {
        lines.push((10.0 * number(choices, 0, 100)?).round().to_string());
    }
    lines.extend([number(choices, 0, 100)?, number(choices, 1, 100)?, number(choices, 1, 2)?].map(|n| n.to_string()));
    lines.push("0".to_owned());
    let sets = choices.int_in_range(1..=3)?;
    lines.push(sets.to_string());
    for _ in 0..sets {
        let lumens = number(choices, 1, 9000)?;
        lines.extend(["1".to_owned(), text(choices)?, lumens.to_string(), "4000 K".to_owned(), "80".to_owned()]);
        lines.push(number(choices, 1, 200)?.to_string());
    }
    for _ in 0..10 {
        lines.push(number(choices, 0, 1)?.to_string());
    }
    lines.extend((0..planes).map(|k| (k as f64 * step_deg).to_string()));
    lines.extend((0..rows).map(|k| (k as f64 * last_deg / (rows as f64 - 1.0)).to_string()));
    let listed = [planes, 1, planes / 2 + 1, planes / 2 + 1, planes / 4 + 1][symmetry];
    lines.extend(intensities(choices, listed * rows)?.iter().map(f64::to_string));
    Ok((lines.join(separator) + separator).into_bytes())
}

/// An emitter of TM-33 with a whole grid of intensities.
fn emitter(choices: &mut Unstructured<'_>, kind: &str) -> Result<String> {
    let is_c = kind == "CIE-C";
    let count = choices.int_in_range(0..=4)?;
    let vertical = angles(choices, if is_c { 0.0 } else { -90.0 }, 90.0, count)?;
    let last_deg = *choices.choose(&[90.0, 180.0, 360.0])?;
    let count = choices.int_in_range(0..=3)?;
    let horizontal = if is_c { angles(choices, 0.0, last_deg, count)? } else { angles(choices, -90.0, 90.0, count)? };
    let mut data = String::new();
    for h in &horizontal {
        for v in &vertical {
            let _ = write!(data, "<IntData h=\"{h}\" v=\"{v}\">{}</IntData>", number(choices, 0, 2000)?);
        }
    }
    let (quantity, multiplier) = (choices.int_in_range(1..=3)?, number(choices, 1, 10)?);
    let is_absolute: bool = choices.arbitrary()?;
    let (rows, columns) = (vertical.len(), horizontal.len());
    Ok(format!(
        "<Emitter><Quantity>{quantity}</Quantity><RatedLumens>900</RatedLumens><LuminousData><PhotometryType>{kind}</PhotometryType>\
         <LuminousIntensity><AbsolutePhotometry>{is_absolute}</AbsolutePhotometry><Multiplier>{multiplier}</Multiplier>\
         <NumberHorz>{columns}</NumberHorz><NumberVert>{rows}</NumberVert>{data}</LuminousIntensity></LuminousData></Emitter>"
    ))
}

fn tm33(choices: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let root = *choices.choose(&["IESTM33-18", "IESTM33-22"])?;
    let kind = *choices.choose(&["CIE-C", "CIE-C", "CIE-B", "CIE-A"])?;
    // A sum with tables of types A and B takes seconds, since it has the grid of a finer table of type C.
    let count = if kind == "CIE-C" { choices.int_in_range(1..=3)? } else { 1 };
    let emitters = (0..count).map(|_| emitter(choices, kind)).collect::<Result<Vec<_>>>()?.concat();
    let maker = text(choices)?.replace('&', "&amp;").replace('<', "&lt;");
    let header = format!("<Header><Manufacturer>{maker}</Manufacturer></Header>");
    Ok(format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<{root}>{header}{emitters}</{root}>\n").into_bytes())
}

/// A container with one or two photometric files, stored or compressed.
fn gldf(choices: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let mut archive = zip::ZipWriter::new(Cursor::new(vec![]));
    let (mut listed, mut named) = (String::new(), String::new());
    for name in ["a", "b"].into_iter().take(choices.int_in_range(1..=2)?) {
        let (kind, extension, bytes) = match choices.int_in_range(0..=1)? {
            0 => ("ldc/eulumdat", "ldt", eulumdat(choices)?),
            _ => ("ldc/ies", "ies", lm63(choices)?),
        };
        let _ = write!(
            listed,
            "<File id=\"f{name}\" contentType=\"{kind}\" type=\"localFileName\">{name}.{extension}</File>"
        );
        let _ = write!(named, "<Photometry id=\"{name}\"><PhotometryFileReference fileId=\"f{name}\"/></Photometry>");
        store(&mut archive, &format!("ldc/{name}.{extension}"), &bytes, choices.arbitrary()?);
    }
    let product = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Root><Header><Manufacturer>Maker</Manufacturer></Header><GeneralDefinitions>\
         <Files>{listed}</Files><Photometries>{named}</Photometries></GeneralDefinitions></Root>"
    );
    store(&mut archive, "product.xml", product.as_bytes(), choices.arbitrary()?);
    Ok(archive.finish().expect("memory can be written").into_inner())
}

fn store(archive: &mut zip::ZipWriter<Cursor<Vec<u8>>>, name: &str, bytes: &[u8], is_compressed: bool) {
    let method = if is_compressed { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
    let options = zip::write::SimpleFileOptions::default().compression_method(method);
    let written = archive.start_file(name, options).map_err(std::io::Error::other);
    written.and_then(|()| archive.write_all(bytes)).expect("memory can be written");
}

/// A spec with luminaires, bodies, meters and procedures in any number; its luminaire is `lamp.ies`.
fn spec(choices: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let size_m = [number(choices, 3, 20)?, number(choices, 3, 20)?, number(choices, 2, 5)?];
    let share = |choices: &mut Unstructured<'_>| number(choices, 0, 1).map(|n| n.min(0.95));
    let inside = |choices: &mut Unstructured<'_>| -> Result<String> {
        let mut at_m = vec![];
        for extent in size_m {
            at_m.push(extent * f64::from(choices.int_in_range(1..=99)?) / 100.0);
        }
        Ok(format!("[{}]", joined(&at_m, ", ")))
    };
    let mut file = format!("luxproof: 1\ntitle: {:?}\nroom:\n  size_m: [{}]\n", text(choices)?, joined(&size_m, ", "));
    let (floor, walls, ceiling) = (share(choices)?, share(choices)?, share(choices)?);
    let _ = writeln!(file, "  reflectance: {{floor: {floor}, walls: {walls}, ceiling: {ceiling}}}\nluminaires:");
    for k in 0..choices.int_in_range(1..=4)? {
        let (at_m, azimuth, tilt) = (inside(choices)?, number(choices, 0, 360)?, number(choices, 0, 180)?);
        let _ = writeln!(
            file,
            "  - {{id: lamp{k}, photometry: lamp.ies, at_m: {at_m}, rotate_deg: {{azimuth: {azimuth}, tilt: {tilt}}}, model: point, \
             flux_scale: {}}}",
            number(choices, 0, 3)?
        );
    }
    file += "meters:\n";
    let groups = choices.int_in_range(1..=3)?;
    for k in 0..groups {
        let normal = *choices.choose(&["[0, 0, 1]", "[0, 0, -1]", "[1, 0, 0]"])?;
        let points = (0..choices.int_in_range(1..=3)?).map(|_| inside(choices)).collect::<Result<Vec<_>>>()?;
        let _ = writeln!(file, "  plane{k}: {{points_m: [{}], normal: {normal}}}", points.join(", "));
    }
    file += "procedures:\n";
    let (group, bounces) = (choices.int_in_range(0..=groups - 1)?, choices.int_in_range(1..=5)?);
    let procedures = [
        format!("direct_illuminance: {{meters: plane{group}}}"),
        format!("indirect_illuminance: {{meters: plane{group}, bounces: {bounces}}}"),
        format!("total_illuminance: {{meters: plane{group}}}"),
        "luminous_intensity: {luminaire: lamp0, distance_m: 5, angles: {gamma_deg: [0, 30], c_deg: [0]}}".to_owned(),
    ];
    let _ = writeln!(file, "  {}", procedures[0]);
    for procedure in &procedures[1..] {
        if choices.arbitrary()? {
            let _ = writeln!(file, "  {procedure}");
        }
    }
    if choices.arbitrary()? {
        let _ = writeln!(file, "tolerances:\n  direct_illuminance: {{relative: {}}}", share(choices)?);
    }
    if choices.arbitrary()? {
        let _ = writeln!(file, "budget: {{relative_error: 0.01, seconds: {}}}", number(choices, 1, 60)?);
    }
    Ok(file.into_bytes())
}

/// The seed report with other values of the same kinds in the fields that allow them, written with its checksum as this program writes it.
fn report(choices: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let mut value: Value = serde_json::from_str(include_str!("seeds/report/report.json")).expect("the seed is JSON");
    let fields: Vec<String> = value.as_object().into_iter().flatten().map(|(name, _)| name.clone()).collect();
    for field in fields {
        let mut changed = value.clone();
        change_leaves(&mut changed[&field], choices)?;
        // A word of a list of choices has few others.
        if serde_json::from_value::<luxproof_model::Report>(changed.clone()).is_ok() {
            value = changed;
        }
    }
    value["luxproof"] = luxproof_model::REPORT_VERSION.into();
    let mut report: luxproof_model::Report = serde_json::from_value(value).expect("every change was tried");
    let folder = tempfile::tempdir().expect("there is a temporary folder");
    let path = folder.path().join("report.json");
    luxproof_report_file::keep(&mut report, &path).expect("it can be written");
    Ok(std::fs::read(&path).expect("it was written"))
}

/// Changes some leaves of a JSON value to others of the same kind, and repeats or drops items of lists.
pub(crate) fn change_leaves(value: &mut Value, choices: &mut Unstructured<'_>) -> Result<()> {
    match value {
        Value::Object(fields) => fields.values_mut().try_for_each(|field| change_leaves(field, choices)),
        Value::Array(items) => {
            items.iter_mut().try_for_each(|item| change_leaves(item, choices))?;
            match choices.int_in_range(0..=29)? {
                0 => items.clear(),
                1 => drop(items.pop()),
                2 => items.extend(items.clone()),
                _ => {}
            }
            Ok(())
        }
        Value::Number(number) if choices.ratio(1, 10)? => {
            let numbers = [0.0, -0.0, 1.0, -1.0, 1e-300, 1e300, 5e-324, 0.1, 1e15];
            // An integer stays one.
            let other = *choices.choose(&numbers)?;
            *value = if number.is_f64() { other.into() } else { choices.int_in_range(0..=u32::MAX)?.into() };
            Ok(())
        }
        Value::Bool(flag) if choices.ratio(1, 10)? => {
            *flag = !*flag;
            Ok(())
        }
        Value::String(words) if choices.ratio(1, 40)? => {
            let others = ["", "a", "\u{202e}x", "<b>", "a|b", "simulator", "1e5", "../x"];
            (*choices.choose(&others)?).clone_into(words);
            Ok(())
        }
        _ => Ok(()),
    }
}
