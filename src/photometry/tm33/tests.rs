//! What a TM-33 file means, and which files are refused, where and why.

use super::*;
use crate::photometry::{Symmetry, lm63};

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
    let second = PLAIN[PLAIN.find("  <Emitter>").unwrap()..PLAIN.find("</IES").unwrap()].to_string();
    let two = PLAIN.replace("</IESTM33-22>", &(second + "</IESTM33-22>"));
    assert!(parse(two.as_bytes()).unwrap_err().message().contains("several emitters"));
}

#[test]
fn entities_cannot_blow_up() {
    let bomb = PLAIN.replace("<IESTM33-22>", "<!DOCTYPE x [<!ENTITY a \"aaaa\">]><IESTM33-22>");
    assert!(parse(bomb.as_bytes()).unwrap_err().message().contains("DTD"));
}

#[test]
fn neither_attributes_nor_namespaces_take_the_square_of_their_number() {
    // Each is held against all others: without a limit the first takes minutes.
    let many = |what: &str| (0..200_000).map(|k| format!(" {what}{k}='u{k}'")).collect::<Vec<_>>().concat();
    let nested = (0..20_000).map(|k| format!("<b xmlns:a{k}='u{k}'>")).collect::<Vec<_>>().concat();
    for text in [
        PLAIN.replace("<Header>", &format!("<Header{}>", many("a"))),
        PLAIN.replace("<Header>", &format!("<Header{}>", many("xmlns:a"))),
        PLAIN.replace("<Header>", &nested),
        PLAIN.replace("<Header>", &format!("<!-- ' \" --><![CDATA[ '> ]]><?a '?><Header{}>", many("a"))),
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
