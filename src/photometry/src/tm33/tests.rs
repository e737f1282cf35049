//! The meaning of TM-33 files, and refusals with their places and reasons.

use super::*;
use crate::{Symmetry, lm63};

const PLAIN: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<IESTM33-22>
  <Version>1.1</Version>
  <Header>
    <Manufacturer>Maker &amp; Sons</Manufacturer>
    <CatalogNumber>42</CatalogNumber>
    <GTIN>7</GTIN>
  </Header>
  <Emitter>
    <Quantity>1</Quantity>
    <RatedLumens>900</RatedLumens>
    <InputWattage>12.5</InputWattage>
    <LuminousData>
      <PhotometryType>CIE-C</PhotometryType>
      <LuminousIntensity>
        <AbsolutePhotometry>false</AbsolutePhotometry>
        <Multiplier>2</Multiplier>
        <NumberHorz>2</NumberHorz>
        <NumberVert>3</NumberVert>
        <IntData h="0" v="0">50</IntData><IntData h="0" v="45">40</IntData><IntData h="0" v="90">0</IntData>
        <IntData h="90" v="0">50</IntData><IntData h="90" v="90">5</IntData><IntData h="90" v="45">20</IntData>
      </LuminousIntensity>
    </LuminousData>
  </Emitter>
</IESTM33-22>
"#;

#[test]
fn the_luminous_part_is_read() {
    let read = parse(PLAIN.as_bytes()).unwrap();
    assert_eq!(read.format, "TM-33-23");
    assert_eq!(read.lints, []);
    assert_eq!((read.lamp_lumens, read.input_watts), (Some(900.0), Some(12.5)));
    assert_eq!(read.keyword("MANUFAC"), Some("Maker & Sons"));
    assert_eq!(read.keyword("_GTIN"), Some("7"));
    assert_eq!(read.distribution.symmetry(), Symmetry::Quadrant);
    assert_eq!(read.distribution.plane(1), [100.0, 40.0, 10.0]);
}

#[test]
fn variants_mean_the_same() {
    let expected = parse(PLAIN.as_bytes()).unwrap().distribution;
    let verbose = PLAIN.replace("IntData", "IntensityData").replace(" h=", " horz=").replace(" v=", " vert=");
    let flat = PLAIN.replace("<LuminousIntensity>", "").replace("</LuminousIntensity>", "");
    let spaced = PLAIN.replace("<IESTM33-22>", "<t:IESTM33-22 xmlns:t=\"urn:x\">").replace("</IES", "</t:IES");
    for text in [verbose, flat, spaced, format!("\u{feff}{PLAIN}")] {
        assert_eq!(parse(text.as_bytes()).unwrap().distribution, expected);
    }
    let eighteen = PLAIN.replace("IESTM33-22", "IESTM33-18").replace("false", "true");
    let read = parse(eighteen.as_bytes()).unwrap();
    assert_eq!((read.format.as_str(), read.lamp_lumens), ("TM-33-18", None));
    let many = PLAIN.replace("<Quantity>1", "<Quantity>3");
    let read = parse(many.as_bytes()).unwrap();
    assert_eq!((read.lints[0].code, read.lints[0].line), ("tm33/emitter", 9));
}

#[test]
fn refusals_name_the_place() {
    for (from, to, line, column, word) in [
        ("IESTM33-22", "html", 2, 1, "root element"),
        ("</IESTM33-22>", "", 1, 1, "never closed"),
        ("Emitter>", "Emitted>", 2, 1, "no <Emitter>"),
        ("CIE-C", "Gaussian", 14, 7, "Gaussian"),
        ("<NumberVert>3", "<NumberVert>4", 15, 7, "3 different angles"),
        ("v=\"45\">20", "v=\"46\">20", 15, 7, "4 different angles"),
        ("v=\"45\">20", "v=\"90\">20", 21, 77, "twice"),
        (">20<", ">-20<", 21, 77, "zero or more"),
        (">20<", ">twenty<", 21, 77, "should be a number"),
        (">20<", ">NaN<", 21, 77, "not finite"),
        ("h=\"90\" v=\"0\"", "h=\"80\" v=\"0\"", 15, 7, "3 different"),
        ("<Quantity>1", "<Quantity>0", 9, 3, "at least one"),
        ("<Multiplier>2", "<Multiplier>-2", 17, 9, "zero or more"),
    ] {
        let text = PLAIN.replace(from, to);
        let error = parse(text.as_bytes()).expect_err(word);
        assert!(error.message().contains(word), "{to}: {error}");
        assert_eq!((error.line, error.column), (line, column), "{to}: {error}");
    }
}

#[test]
fn a_multiplier_of_the_data_counts_where_the_intensities_have_none() {
    let middle = |text: &str| parse(text.as_bytes()).unwrap().distribution.plane(1)[1];
    let outer = PLAIN.replace("<PhotometryType>", "<Multiplier>3</Multiplier><PhotometryType>");
    // 20 cd at h 90 v 45, times 2; the multiplier nearest to the intensities applies, and no product of both.
    assert_eq!((middle(PLAIN), middle(&outer)), (40.0, 40.0));
    assert_eq!(middle(&outer.replace("<Multiplier>2</Multiplier>", "")), 60.0);
    assert_eq!(middle(&PLAIN.replace("<Multiplier>2</Multiplier>", "")), 20.0);
}

#[test]
fn the_rated_lumens_of_several_emitters_of_a_kind_add_up() {
    for (quantity, lumens) in [("3", Some(2700.0)), ("1", Some(900.0))] {
        let text = PLAIN.replace("<Quantity>1", &format!("<Quantity>{quantity}"));
        let read = parse(text.as_bytes()).unwrap();
        assert_eq!(read.lamp_lumens, lumens);
        // The intensities are those of the whole luminaire.
        assert_eq!(read.distribution.plane(1), [100.0, 40.0, 10.0]);
    }
    // Absolute photometry states no lumens of a lamp.
    assert_eq!(parse(PLAIN.replace("false", "true").as_bytes()).unwrap().lamp_lumens, None);
}

/// The emitter of the plain file, with what is changed in it.
fn emitter(changes: &[(&str, &str)]) -> String {
    let plain = PLAIN[PLAIN.find("  <Emitter>").unwrap()..PLAIN.find("</IES").unwrap()].to_string();
    changes.iter().fold(plain, |text, (from, to)| text.replace(from, to))
}

fn with_emitters(emitters: &[String]) -> String {
    let (head, tail) = (PLAIN.find("  <Emitter>").unwrap(), PLAIN.find("</IES").unwrap());
    format!("{}{}{}", &PLAIN[..head], emitters.concat(), &PLAIN[tail..])
}

#[test]
fn emitters_in_one_place_add_up() {
    let one = parse(PLAIN.as_bytes()).unwrap();
    let two = parse(with_emitters(&[emitter(&[]), emitter(&[])]).as_bytes()).unwrap();
    assert_eq!((two.lamp_lumens, two.input_watts, two.lints[0].code), (Some(1800.0), Some(25.0), "tm33/emitters"));
    let (flux, twice) = (one.distribution.flux().value(), two.distribution.flux().value());
    assert!((twice - 2.0 * flux).abs() < 1e-8 * flux, "{flux} {twice}");
    // An uplight, axial, that ends with light at its edge, and has neither lumens nor watts.
    let up = r#"<Emitter><LuminousData><IntData h="0" v="100">8</IntData><IntData h="0" v="180">8</IntData></LuminousData></Emitter>"#;
    let both = parse(with_emitters(&[emitter(&[]), up.into()]).as_bytes()).unwrap();
    assert_eq!((both.lamp_lumens, both.input_watts), (None, None));
    let [below, edge, above] = [60.0, 95.0, 150.0].map(|gamma| both.distribution.intensity(30.0, gamma).value());
    assert_eq!((edge, above), (0.0, 8.0));
    assert!((below - one.distribution.intensity(30.0, 60.0).value()).abs() < 1e-9);
    // Both emitters state the same place.
    let placed = emitter(&[("<Emitter>", "<Emitter><EmitterCenter x='1' y='0' z='0'/>")]);
    assert!(parse(with_emitters(&[placed.clone(), placed]).as_bytes()).is_ok());
}

/// The intensity at h 90 v 45 of the named emitter.
fn middle_of_emitter(text: &str, name: &str) -> Result<f64, ReadError> {
    read(text.as_bytes(), Some(name), Tolerance::Strict).map(|read| read.distribution.plane(1)[1])
}

#[test]
fn emitters_in_different_places_are_listed_and_one_can_be_named() {
    let left = emitter(&[("<Emitter>", "<Emitter><ID>left</ID><EmitterCenter x='-1' y='0' z='0'/>")]);
    let right =
        emitter(&[("<Emitter>", "<Emitter><Description>right</Description><EmitterCenter x='1' y='0' z='0'/>")]);
    let right = right.replace(">20<", ">30<");
    let text = with_emitters(&[left, right]);
    let error = parse(text.as_bytes()).unwrap_err();
    assert_eq!(error.problem, Problem::Several { names: vec!["left".into(), "2".into()] });
    assert!(error.help().contains('#') && error.line > 9);
    for (name, expected) in [("left", 40.0), ("1", 40.0), ("2", 60.0), ("right", 60.0)] {
        assert_eq!(middle_of_emitter(&text, name), Ok(expected), "{name}");
    }
    assert!(
        middle_of_emitter(&text, "top").unwrap_err().message().contains("no photometry `top`; it holds `left`, `2`")
    );
}

/// An emitter with angles that no other emitter has.
fn emitter_with_unique_angles(k: usize) -> String {
    let table = format!("<IntData h='0' v='1.{k:05}'>1</IntData><IntData h='0' v='2.{k:05}'>1</IntData>");
    let far = format!("<IntData h='90' v='1.{k:05}'>1</IntData><IntData h='90' v='2.{k:05}'>1</IntData>");
    let middle =
        format!("<IntData h='8.{k:05}' v='1.{k:05}'>1</IntData><IntData h='8.{k:05}' v='2.{k:05}'>1</IntData>");
    format!("<Emitter><LuminousData>{table}{middle}{far}</LuminousData></Emitter>")
}

#[test]
fn a_sum_of_too_many_emitters_is_refused() {
    // A grid of the angles of all emitters has the square of their number.
    let emitters: Vec<String> = (0..3000).map(emitter_with_unique_angles).collect();
    let error = parse(with_emitters(&emitters).as_bytes()).unwrap_err();
    assert!(error.message().contains("the sum of 3000 emitters"), "{error}");
}

#[test]
fn a_tolerant_reader_accepts_harmless_damage_with_a_warning() {
    let expected = parse(PLAIN.as_bytes()).unwrap().distribution;
    for (from, to, code) in [
        ("<InputWattage>12.5", "<InputWattage>-1", "forgiven/negative-field"),
        ("<RatedLumens>900", "<RatedLumens>-1", "forgiven/negative-field"),
        ("<NumberVert>3", "<NumberVert>4", "forgiven/count"),
    ] {
        let text = PLAIN.replace(from, to);
        assert!(parse(text.as_bytes()).is_err());
        let found = read(text.as_bytes(), None, Tolerance::Harmless).unwrap();
        assert_eq!((found.lints[0].code, &found.distribution), (code, &expected));
    }
    assert!(read(PLAIN.replace(">20<", ">-20<").as_bytes(), None, Tolerance::Harmless).is_err());
}

#[test]
fn a_file_in_utf16_is_the_same_file_whatever_it_declares() {
    for text in [PLAIN.to_string(), PLAIN.replace("UTF-8", "UTF-16")] {
        let bytes: Vec<u8> = [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
        let read = parse(&bytes).unwrap();
        assert_eq!((read.lints[0].code, read.keyword("MANUFAC")), ("tm33/utf-16", Some("Maker & Sons")));
    }
}

#[test]
fn a_keyword_without_an_element_becomes_a_comment_that_is_read_back() {
    let keywords =
        [("MANUFAC", "a < b & c"), ("LAMP", "LED\nboard"), ("MANUFAC", "other"), ("_Comments", "no key"), ("TEST", "")];
    let keywords = keywords.map(|(key, value)| (key.to_string(), value.to_string())).to_vec();
    let photometry = Photometry { keywords: keywords.clone(), ..parse(PLAIN.as_bytes()).unwrap() };
    let written = write(&photometry);
    assert_eq!(written.losses, Vec::<String>::new(), "{}", written.text);
    assert!(written.text.contains("<Manufacturer>a &lt; b &amp; c</Manufacturer>"), "{}", written.text);
    assert!(written.text.contains("<Comments>[LAMP] LED\nboard</Comments>"), "{}", written.text);
    assert_eq!(parse(written.text.as_bytes()).unwrap().keywords, keywords);
}

#[test]
fn entities_cannot_blow_up() {
    let bomb = PLAIN.replace("<IESTM33-22>", "<!DOCTYPE x [<!ENTITY a \"aaaa\">]><IESTM33-22>");
    assert!(parse(bomb.as_bytes()).unwrap_err().message().contains("DTD"));
}

/// Many different attributes.
fn many_attributes(prefix: &str) -> String {
    (0..200_000).map(|k| format!(" {prefix}{k}='u{k}'")).collect::<Vec<_>>().concat()
}

#[test]
fn neither_attributes_nor_namespaces_take_the_square_of_their_number() {
    // The parser compares each with all others: without a limit the first takes minutes.
    let nested = (0..20_000).map(|k| format!("<b xmlns:a{k}='u{k}'>")).collect::<Vec<_>>().concat();
    for text in [
        PLAIN.replace("<Header>", &format!("<Header{}>", many_attributes("a"))),
        PLAIN.replace("<Header>", &format!("<Header{}>", many_attributes("xmlns:a"))),
        PLAIN.replace("<Header>", &nested),
        PLAIN.replace("<Header>", &format!("<!-- ' \" --><![CDATA[ '> ]]><?a '?><Header{}>", many_attributes("a"))),
    ] {
        let error = parse(text.as_bytes()).unwrap_err();
        assert!(error.message().contains("more than 64"), "{error}");
    }
    // What stands in quotes is no attribute, and one namespace is one however often it is declared.
    let equal = "=".repeat(1000);
    let often = PLAIN.replace("<IntData", &format!("<IntData xmlns='urn:x' a='>{equal}'"));
    assert_eq!(
        parse(often.as_bytes()).map(|read| read.distribution),
        parse(PLAIN.as_bytes()).map(|read| read.distribution)
    );
}

#[test]
fn no_text_breaks_out_of_the_line_that_it_is_written_on() {
    let text = PLAIN.replace("Maker &amp; Sons", "Maker&#13;TILT=INCLUDE&#x9b;31m&#x202e;");
    let read = parse(text.as_bytes()).unwrap();
    assert_eq!(read.keyword("MANUFAC"), Some("Maker TILT=INCLUDE\u{fffd}31m\u{fffd}"));
    let again = lm63::parse(lm63::write_2019(&read).text.as_bytes()).unwrap();
    assert_eq!(again.distribution, read.distribution);
}
