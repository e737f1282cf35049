//! Reader of the luminous part of ANSI/IES TM-33-18 and TM-33-23 XML files.
//!
//! Source: ANSI/IES TM-33-18 and -23, *Standard Format for the Electronic Transfer of Luminaire Optical Data*: root
//! `IESTM33-18` or `IESTM33-22`, header, emitters; in an emitter `LuminousData/LuminousIntensity` with one
//! `IntData h= v=` a direction. The primary text could not be read; the element names are those of published
//! schemas and files. The variant spelling `IntensityData horz= vert=`, directly in `LuminousData`, is read too.

mod write;

#[cfg(test)]
mod tests;

use std::collections::{HashMap, HashSet};

use roxmltree::{Document, Node, ParsingOptions};

use super::error::{Problem, ReadError, in_candela};
use super::goniometer::{Goniometer, Table};
use super::lint::Lints;
use super::planes;
use super::text::{Text, decode, harmless};
use super::{Details, LuminousOpening, Photometry};

pub use self::write::write;

/// Header elements and the LM-63 keywords that say the same.
const KEYWORDS: [(&str, &str); 6] = [
    ("Manufacturer", "MANUFAC"),
    ("CatalogNumber", "LUMCAT"),
    ("Description", "LUMINAIRE"),
    ("Laboratory", "TESTLAB"),
    ("ReportNumber", "TEST"),
    ("ReportDate", "ISSUEDATE"),
];

/// Reads a TM-33 file.
pub fn parse(bytes: &[u8]) -> Result<Photometry, ReadError> {
    let decoded = decode(Text::new(bytes).bytes);
    let text = Text::new(decoded.as_bytes());
    // Every node costs the reader memory; none is shorter than `<a/>`.
    let nodes_limit = u32::try_from(decoded.len()).unwrap_or(u32::MAX).max(16);
    let options = ParsingOptions { allow_dtd: false, nodes_limit, ..ParsingOptions::default() };
    if let Some(at) = crowded(&decoded) {
        let message =
            format!("a tag of more than {MAX_ATTRIBUTES} attributes, or more than {MAX_NAMESPACES} namespaces");
        return Err(text.error(at, Problem::Xml { message }));
    }
    let document = Document::parse_with_options(&decoded, options).map_err(|error| {
        let position = error.pos();
        let (line, column) = (position.row as usize, position.col as usize);
        ReadError { line, column, ..text.error(0, Problem::Xml { message: error.to_string() }) }
    })?;
    let reader = Reader { text: &text };
    let root = document.root_element();
    let mut lints = Lints::default();
    let format = reader.format(root)?;
    let emitter = reader.emitter(root)?;
    let data = reader.required(emitter, "LuminousData")?;
    let intensity = child(data, "LuminousIntensity").unwrap_or(data);
    let goniometer = reader.goniometer(data)?;
    let table = reader.table(intensity, data)?;
    let distribution = planes::distribution(&text, goniometer, table, &mut lints)?;
    reader.remarks(root, emitter, &mut lints)?;
    let rated = reader.rated_lumens(emitter)?;
    let absolute = [intensity, data].into_iter().find_map(|node| content(node, "AbsolutePhotometry"));
    let relative = absolute.is_some_and(|value| matches!(value.as_str(), "false" | "0"));
    let watts = reader.number(emitter, "InputWattage")?.or(reader.number(emitter, "InputWatts")?);
    let photometry = Photometry {
        format: format.into(),
        distribution,
        lamp_lumens: rated.filter(|_| relative),
        opening: LuminousOpening::Point,
        input_watts: watts.filter(|watts| *watts > 0.0),
        keywords: keywords(root),
        details: Details::None,
        lints: vec![],
        source: vec![],
    };
    Ok(photometry.with_lints(lints))
}

/// The most attributes of a tag, and different declarations of namespaces in a file: the reader holds each against all others. An angle
/// has two attributes.
const MAX_ATTRIBUTES: usize = 64;
const MAX_NAMESPACES: usize = 64;

/// Where a tag has too many attributes, or namespaces become too many.
fn crowded(text: &str) -> Option<usize> {
    let mut known = HashSet::new();
    let mut is_one_more = |at: usize| {
        known.insert(text[at..].split(|c: char| c.is_whitespace() || c == '>').next());
        known.len() > MAX_NAMESPACES
    };
    let namespace = text.match_indices("xmlns").map(|(at, _)| at).find(|at| is_one_more(*at));
    namespace.or_else(|| {
        let mut rest = 0;
        while let Some(start) = text[rest..].find('<').map(|at| rest + at) {
            let tag = &text[start..];
            // What is no tag has an end of its own.
            let other = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")]
                .into_iter()
                .find(|(begin, _)| tag.starts_with(begin));
            let (length, attributes) = match other {
                Some((_, end)) => (tag.find(end).map_or(tag.len(), |at| at + end.len()), 0),
                None => tag_of(tag),
            };
            if attributes > MAX_ATTRIBUTES {
                return Some(start);
            }
            rest = start + length;
        }
        None
    })
}

/// The length of the tag that a text begins with, and how many attributes it has: what stands in quotes is a value.
fn tag_of(text: &str) -> (usize, usize) {
    let (mut quote, mut attributes) = (None, 0);
    for (at, byte) in text.bytes().enumerate() {
        match (quote, byte) {
            (Some(open), _) if open == byte => quote = None,
            (None, b'"' | b'\'') => quote = Some(byte),
            (None, b'=') => attributes += 1,
            (None, b'>') => return (at + 1, attributes),
            _ => {}
        }
    }
    (text.len(), attributes)
}

/// Whether the bytes begin as XML.
pub(crate) fn looks_like(text: &Text) -> bool {
    text.bytes.trim_ascii_start().starts_with(b"<")
}

struct Reader<'a> {
    text: &'a Text<'a>,
}

impl Reader<'_> {
    fn error(&self, node: Node, problem: Problem) -> ReadError {
        self.text.error(node.range().start, problem)
    }

    fn format(&self, root: Node) -> Result<&'static str, ReadError> {
        match root.tag_name().name() {
            "IESTM33-18" | "LuminaireOpticalData" => Ok("TM-33-18"),
            "IESTM33-22" | "IESTM33-23" => Ok("TM-33-23"),
            other => {
                let message = format!("the root element is <{other}>, not <IESTM33-18> or <IESTM33-22>");
                Err(self.error(root, Problem::Xml { message }))
            }
        }
    }

    fn required<'d>(&self, parent: Node<'d, 'd>, name: &str) -> Result<Node<'d, 'd>, ReadError> {
        child(parent, name).ok_or_else(|| {
            let message = format!("<{}> lacks the element <{name}>", parent.tag_name().name());
            self.error(parent, Problem::Xml { message })
        })
    }

    /// The one emitter with luminous data.
    fn emitter<'d>(&self, root: Node<'d, 'd>) -> Result<Node<'d, 'd>, ReadError> {
        let emitters = || root.children().filter(|node| is(*node, "Emitter"));
        let mut luminous = emitters().filter(|node| child(*node, "LuminousData").is_some());
        match (luminous.next(), luminous.next()) {
            (Some(emitter), None) => Ok(emitter),
            (Some(_), Some(second)) => {
                let what = "a luminaire of several emitters with an intensity distribution each".into();
                Err(self.error(second, Problem::Unsupported { what }))
            }
            (None, _) => {
                let message = "no <Emitter> holds <LuminousData>".into();
                Err(self.error(root, Problem::Xml { message }))
            }
        }
    }

    fn goniometer(&self, data: Node) -> Result<Goniometer, ReadError> {
        let Some(node) = child(data, "PhotometryType") else { return Ok(Goniometer::C) };
        match node.text().unwrap_or_default().trim() {
            "C" | "CIE-C" | "CIE_C" | "CIE _ C" | "TypeC" | "CIE C" => Ok(Goniometer::C),
            "B" | "CIE-B" | "CIE_B" | "CIE _ B" | "TypeB" | "CIE B" => Ok(Goniometer::B),
            "A" | "CIE-A" | "CIE_A" | "CIE _ A" | "TypeA" | "CIE A" => Ok(Goniometer::A),
            other => Err(self.error(node, Problem::Unsupported { what: format!("the photometry type `{other}`") })),
        }
    }

    /// A number in a child element, `None` where there is no such element.
    fn number(&self, parent: Node, name: &str) -> Result<Option<f64>, ReadError> {
        let Some(node) = child(parent, name) else { return Ok(None) };
        let value = node.text().unwrap_or_default();
        let number = self.finite(node, name, value)?;
        if number >= 0.0 {
            return Ok(Some(number));
        }
        let problem = Problem::OutOfRange { what: name.into(), found: number, expected: "zero or more" };
        Err(self.error(node, problem))
    }

    /// Rated lumens of all emitters of this kind together; zero counts as unknown.
    fn rated_lumens(&self, emitter: Node) -> Result<Option<f64>, ReadError> {
        let quantity = self.number(emitter, "Quantity")?.unwrap_or(1.0);
        let lumens = quantity * self.number(emitter, "RatedLumens")?.unwrap_or(0.0);
        if quantity >= 1.0 && lumens.is_finite() {
            return Ok((lumens > 0.0).then_some(lumens));
        }
        let (what, found) = ("Quantity".into(), quantity);
        Err(self.error(
            emitter,
            Problem::OutOfRange { what, found, expected: "at least one, and no more than makes sense" },
        ))
    }

    fn finite(&self, node: Node, what: &str, value: &str) -> Result<f64, ReadError> {
        let (what, found) = (what.to_string(), value.trim().to_string());
        match found.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            Ok(_) => Err(self.error(node, Problem::NotFinite { what, found })),
            Err(_) => Err(self.error(node, Problem::NotANumber { what, found })),
        }
    }

    /// The intensities, each multiplied by the multiplier, in a full grid of their angles.
    fn table(&self, intensity: Node, data: Node) -> Result<Table, ReadError> {
        let multiplier = match self.number(intensity, "Multiplier")? {
            Some(multiplier) => multiplier,
            None => self.number(data, "Multiplier")?.unwrap_or(1.0),
        };
        let mut values: HashMap<(u64, u64), f64> = HashMap::new();
        let (mut horizontal_deg, mut vertical_deg) = (vec![], vec![]);
        for node in intensity.children().filter(|n| ["IntData", "IntensityData"].contains(&n.tag_name().name())) {
            let angle = |names: [&str; 2]| {
                let value = names.iter().find_map(|name| node.attribute(*name)).unwrap_or_default();
                // Adding zero makes minus zero plus zero.
                self.finite(node, &format!("the angle {}", names[0]), value).map(|angle| angle + 0.0)
            };
            let (h, v) = (angle(["h", "horz"])?, angle(["v", "vert"])?);
            let value = self.finite(node, "an intensity", node.text().unwrap_or_default())?;
            if value < 0.0 {
                let problem =
                    Problem::OutOfRange { what: "an intensity".into(), found: value, expected: "zero or more" };
                return Err(self.error(node, problem));
            }
            let candela = in_candela("an intensity", value, multiplier).map_err(|problem| self.error(node, problem))?;
            if values.insert((h.to_bits(), v.to_bits()), candela).is_some() {
                let message = format!("the intensity at h {h} v {v} is given twice");
                return Err(self.error(node, Problem::Xml { message }));
            }
            horizontal_deg.push(h);
            vertical_deg.push(v);
        }
        for angles in [&mut horizontal_deg, &mut vertical_deg] {
            angles.sort_by(f64::total_cmp);
            angles.dedup();
        }
        self.counted(intensity, horizontal_deg.len(), vertical_deg.len())?;
        let mut candela = Vec::with_capacity(values.len());
        for h in &horizontal_deg {
            for v in &vertical_deg {
                let Some(value) = values.get(&(h.to_bits(), v.to_bits())) else {
                    let message = format!("the intensity at h {h} v {v} is missing from the grid");
                    return Err(self.error(intensity, Problem::Xml { message }));
                };
                candela.push(*value);
            }
        }
        let at = intensity.range().start;
        Ok(Table { vertical_deg, vertical_at: at, horizontal_deg, horizontal_at: at, candela, candela_at: at })
    }

    /// The declared counts of angles, where given, must be those found.
    fn counted(&self, intensity: Node, horizontal: usize, vertical: usize) -> Result<(), ReadError> {
        for (name, found) in [("NumberHorz", horizontal), ("NumberVert", vertical)] {
            if let Some(declared) = self.number(intensity, name)?
                && declared != found as f64
            {
                let message = format!("<{name}> says {declared}, but there are {found} different angles");
                return Err(self.error(intensity, Problem::Xml { message }));
            }
        }
        if vertical < 2 || horizontal < 1 {
            let message = "there are fewer than two vertical angles with an intensity (<IntData h= v=>)".into();
            return Err(self.error(intensity, Problem::Xml { message }));
        }
        Ok(())
    }

    /// What the file says and this reader does not use.
    fn remarks(&self, root: Node, emitter: Node, lints: &mut Lints) -> Result<(), ReadError> {
        for (name, consequence) in [
            ("Quantity", "the intensities were taken for the whole luminaire"),
            ("BallastFactor", "the intensities were not multiplied by it"),
        ] {
            if let Some(value) = self.number(emitter, name)?
                && value != 1.0
            {
                let line = self.text.line_of(emitter.range().start);
                lints.warn("tm33/emitter", line, format!("<{name}> is {value}; {consequence}"));
            }
        }
        if let Some(dimensions) = child(root, "Luminaire") {
            let line = self.text.line_of(dimensions.range().start);
            lints.note("tm33/opening", line, "the luminaire's dimensions say nothing of its luminous opening: a point");
        }
        Ok(())
    }
}

/// Whether a node is an element of this name, whatever its namespace.
fn is(node: Node, name: &str) -> bool {
    node.is_element() && node.tag_name().name() == name
}

fn child<'d>(parent: Node<'d, 'd>, name: &str) -> Option<Node<'d, 'd>> {
    parent.children().find(|node| is(*node, name))
}

/// Text of a child element, trimmed; `None` where it is absent or empty.
fn content(parent: Node, name: &str) -> Option<String> {
    let text = child(parent, name)?.text().unwrap_or_default().trim();
    (!text.is_empty()).then(|| text.to_string())
}

/// The header's texts in file order.
fn keywords(root: Node) -> Vec<(String, String)> {
    let Some(header) = child(root, "Header") else { return vec![] };
    let keyword = |node: Node| {
        // A reference such as `&#13;` says what no line of a file can.
        let value = node.text().unwrap_or_default().trim().replace('\r', " ");
        let value = harmless(&value);
        let name = node.tag_name().name();
        if name == "Comments" && !value.is_empty() {
            return Some(write::keyword_of(&value));
        }
        let known = KEYWORDS.iter().find(|(element, _)| *element == name).map(|(_, key)| (*key).to_string());
        (!value.is_empty()).then(|| (known.unwrap_or_else(|| format!("_{name}")), value.to_string()))
    };
    header.children().filter(Node::is_element).filter_map(keyword).collect()
}
