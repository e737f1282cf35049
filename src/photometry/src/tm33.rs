//! Reader of the luminous part of ANSI/IES TM-33-18 and TM-33-23 XML files.
//!
//! Source: ANSI/IES TM-33-18 and -23, *Standard Format for the Electronic Transfer of Luminaire Optical Data*. The root
//! is `IESTM33-18` or `IESTM33-22`, with a header and emitters. An emitter has `LuminousData/LuminousIntensity` with one
//! `IntData h= v=` for each direction. The standard itself was not available: the element names are those of published
//! schemas and files. The reader also accepts `IntensityData horz= vert=` directly in `LuminousData`.

mod emitters;
mod header;
mod write;

#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::collections::HashMap;

use roxmltree::Node;

use super::error::{Problem, ReadError, in_candela};
use super::goniometer::{Goniometer, Table};
use super::header_lints::{self, Header};
use super::lint::Lints;
use super::planes;
use super::text::{Text, decode, without_utf16};
use super::xml::{self, child, content};
use super::{Details, LuminousIntensityDistribution, LuminousOpening, Photometry, Tolerance};

pub use self::write::write;

/// Reads a TM-33 file.
pub fn parse(bytes: &[u8]) -> Result<Photometry, ReadError> {
    read(bytes, None, Tolerance::Strict)
}

/// Reads the emitter of this name or number, or else the whole luminaire.
pub(super) fn read(bytes: &[u8], which: Option<&str>, tolerance: Tolerance) -> Result<Photometry, ReadError> {
    let unicode = without_utf16(bytes);
    let decoded = decode(Text::new(&unicode).bytes);
    let text = Text::new(decoded.as_bytes());
    let document = xml::parse_document(&text, &decoded)?;
    let reader = Reader { text: &text };
    let root = document.root_element();
    let mut lints = Lints::new(tolerance);
    if matches!(unicode, Cow::Owned(_)) {
        lints.note("tm33/utf-16", 1, "the file is UTF-16");
    }
    let format = reader.format(root)?;
    let emitters = reader.select_emitters(root, which)?;
    let lights =
        emitters.iter().map(|emitter| reader.read_light(*emitter, &mut lints)).collect::<Result<Vec<_>, _>>()?;
    if let Some(dimensions) = child(root, "Luminaire") {
        let line = text.line_of(dimensions.range().start);
        lints.note("tm33/opening", line, "the luminaire's dimensions say nothing of its luminous opening: a point");
    }
    let light = match &lights[..] {
        [one] => one.clone(),
        several => {
            let line = text.line_of(emitters[1].range().start);
            let count = several.len();
            let message =
                format!("the intensities of {count} emitters, which share one centre and orientation, were added up");
            lints.note("tm33/emitters", line, message);
            emitters::add_lights(several).map_err(|problem| text.error(emitters[1].range().start, problem))?
        }
    };
    let keywords = header::read_keywords(root);
    let lines = header::lines_of(&decoded, keywords.iter().map(|keyword| keyword.at));
    let texts = keywords.iter().zip(lines).map(|(keyword, line)| (&keyword.key[..], &keyword.text[..], line));
    let header = Header {
        texts: texts.collect(),
        distribution: &light.distribution,
        lamp_lumens: light.lamp_lumens,
        watts: light.input_watts,
        records: None,
        lamp_line: text.line_of(emitters[0].range().start),
    };
    header_lints::check(&header, &mut lints);
    let photometry = Photometry {
        format: format.into(),
        distribution: light.distribution,
        lamp_lumens: light.lamp_lumens,
        opening: LuminousOpening::Point,
        input_watts: light.input_watts,
        keywords: keywords.into_iter().map(|keyword| (keyword.key, keyword.text)).collect(),
        details: Details::None,
        lints: vec![],
        source: vec![],
    };
    Ok(photometry.with_lints(lints))
}

/// Whether the bytes begin as XML.
pub(crate) fn looks_like(text: &Text) -> bool {
    text.bytes.trim_ascii_start().starts_with(b"<")
}

/// The light of one emitter or of all emitters together.
#[derive(Clone)]
struct Light {
    distribution: LuminousIntensityDistribution,
    lamp_lumens: Option<f64>,
    input_watts: Option<f64>,
}

/// Reads the elements of a document and locates its errors in the text.
struct Reader<'a> {
    text: &'a Text<'a>,
}

impl Reader<'_> {
    /// A refusal at a node.
    fn error(&self, node: Node, problem: Problem) -> ReadError {
        self.text.error(node.range().start, problem)
    }

    /// The edition of the standard, by the root element.
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

    /// A child element that must exist.
    fn required_child<'d>(&self, parent: Node<'d, 'd>, name: &str) -> Result<Node<'d, 'd>, ReadError> {
        child(parent, name).ok_or_else(|| {
            let message = format!("<{}> lacks the element <{name}>", parent.tag_name().name());
            self.error(parent, Problem::Xml { message })
        })
    }

    /// Reads the light of one emitter.
    fn read_light(&self, emitter: Node, lints: &mut Lints) -> Result<Light, ReadError> {
        let data = self.required_child(emitter, "LuminousData")?;
        let intensity = child(data, "LuminousIntensity").unwrap_or(data);
        let goniometer = self.read_goniometer(data)?;
        let table = self.read_table(intensity, data, lints)?;
        let distribution = planes::build_distribution(self.text, goniometer, table, lints)?;
        self.warn_of_unused_fields(emitter, lints)?;
        let rated = self.read_rated_lumens(emitter, lints)?;
        let absolute = [intensity, data].into_iter().find_map(|node| content(node, "AbsolutePhotometry"));
        let is_relative = absolute.is_some_and(|value| matches!(value.as_str(), "false" | "0"));
        let mut watts = None;
        for name in ["InputWattage", "InputWatts"] {
            watts = watts.or(self.unused_number(emitter, name, lints)?);
        }
        let input_watts = watts.filter(|watts| *watts > 0.0);
        Ok(Light { distribution, lamp_lumens: rated.filter(|_| is_relative), input_watts })
    }

    /// Reads the photometric type; type C where the file states none.
    fn read_goniometer(&self, data: Node) -> Result<Goniometer, ReadError> {
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
        let number = self.parse_finite(node, name, value)?;
        if number >= 0.0 {
            return Ok(Some(number));
        }
        let problem = Problem::OutOfRange { what: name.into(), found: number, expected: "zero or more" };
        Err(self.error(node, problem))
    }

    /// A number as [`Self::number`] reads it that affects no intensity: a tolerant reader ignores a negative one.
    fn unused_number(&self, parent: Node, name: &str, lints: &mut Lints) -> Result<Option<f64>, ReadError> {
        let result = self.number(parent, name);
        if let Err(ReadError { line, problem: Problem::OutOfRange { found, .. }, .. }) = &result
            && lints.accept_damage("forgiven/negative-field", *line, format!("<{name}> is {found}; it was left out"))
        {
            return Ok(None);
        }
        result
    }

    /// Rated lumens of all emitters of this kind together; zero counts as unknown.
    fn read_rated_lumens(&self, emitter: Node, lints: &mut Lints) -> Result<Option<f64>, ReadError> {
        let quantity = self.number(emitter, "Quantity")?.unwrap_or(1.0);
        let lumens = quantity * self.unused_number(emitter, "RatedLumens", lints)?.unwrap_or(0.0);
        if quantity >= 1.0 && lumens.is_finite() {
            return Ok((lumens > 0.0).then_some(lumens));
        }
        let (what, found) = ("Quantity".into(), quantity);
        Err(self.error(
            emitter,
            Problem::OutOfRange { what, found, expected: "at least one, and no more than makes sense" },
        ))
    }

    /// Parses a finite number.
    fn parse_finite(&self, node: Node, what: &str, value: &str) -> Result<f64, ReadError> {
        let (what, found) = (what.to_string(), value.trim().to_string());
        match found.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            Ok(_) => Err(self.error(node, Problem::NotFinite { what, found })),
            Err(_) => Err(self.error(node, Problem::NotANumber { what, found })),
        }
    }

    /// Reads the intensities, multiplied by the multiplier, as a full grid of their angles.
    fn read_table(&self, intensity: Node, data: Node, lints: &mut Lints) -> Result<Table, ReadError> {
        let multiplier = match self.number(intensity, "Multiplier")? {
            Some(multiplier) => multiplier,
            None => self.number(data, "Multiplier")?.unwrap_or(1.0),
        };
        // The bits of the angles are the key: equal angles have equal bits.
        let mut values: HashMap<(u64, u64), f64> = HashMap::new();
        let (mut horizontal_deg, mut vertical_deg) = (vec![], vec![]);
        for node in intensity.children().filter(|n| ["IntData", "IntensityData"].contains(&n.tag_name().name())) {
            let (h, v) = (self.read_angle(node, ["h", "horz"])?, self.read_angle(node, ["v", "vert"])?);
            let value = self.parse_finite(node, "an intensity", node.text().unwrap_or_default())?;
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
        self.check_counts(intensity, horizontal_deg.len(), vertical_deg.len(), lints)?;
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

    /// Reads an angle from the first of two attributes that exists.
    fn read_angle(&self, node: Node, names: [&str; 2]) -> Result<f64, ReadError> {
        let value = names.iter().find_map(|name| node.attribute(*name)).unwrap_or_default();
        let angle = self.parse_finite(node, &format!("the angle {}", names[0]), value)?;
        // Adding zero turns minus zero into plus zero, which has other bits.
        Ok(angle + 0.0)
    }

    /// Checks the declared counts of angles, where given.
    fn check_counts(
        &self,
        intensity: Node,
        horizontal: usize,
        vertical: usize,
        lints: &mut Lints,
    ) -> Result<(), ReadError> {
        for (name, found) in [("NumberHorz", horizontal), ("NumberVert", vertical)] {
            if let Some(declared) = self.number(intensity, name)?
                && declared != found as f64
            {
                let message = format!("<{name}> says {declared}, but there are {found} different angles");
                // A wrong count is harmless: every value has its angles, and an incomplete grid is refused.
                if lints.accept_damage("forgiven/count", self.text.line_of(intensity.range().start), message.clone()) {
                    continue;
                }
                return Err(self.error(intensity, Problem::Xml { message }));
            }
        }
        if vertical < 2 || horizontal < 1 {
            let message = "there are fewer than two vertical angles with an intensity (<IntData h= v=>)".into();
            return Err(self.error(intensity, Problem::Xml { message }));
        }
        Ok(())
    }

    /// Warns of fields that this reader does not apply to the intensities.
    fn warn_of_unused_fields(&self, emitter: Node, lints: &mut Lints) -> Result<(), ReadError> {
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
        Ok(())
    }
}
