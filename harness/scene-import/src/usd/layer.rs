//! The text form of a USD layer (usda) as prims with the values that an import reads; other values are passed over.
//!
//! Format: Pixar, *`OpenUSD`*, "Crate and text file formats", grammar of `pxr/usd/sdf/usdaFileFormat`.

use std::collections::{BTreeMap, HashMap};

use super::words::{Token, Words};
use crate::Up;
use crate::raw::Scene;
use luxproof_spec::SpecError;

/// More prims are none of a room's.
const MAX_PRIMS: usize = 200_000;
/// Prims below one another, and characters of a name: a path is as long as both.
const MAX_DEPTH: usize = 100;
const MAX_NAME_BYTES: usize = 200;
/// More texts in a list are no list of operations, and more numbers no mesh.
const MAX_TEXTS: usize = 10_000;
const MAX_NUMBERS: usize = 20_000_000;

/// Arcs by which other prims become a part of one.
const ARCS: [&str; 6] = ["references", "payload", "inherits", "specializes", "variantSets", "subLayers"];

/// Properties that are read; shader inputs and transforms by their first words.
const WANTED: [&str; 14] = [
    "points",
    "faceVertexCounts",
    "faceVertexIndices",
    "holeIndices",
    "indices",
    "elementType",
    "subdivisionScheme",
    "size",
    "visibility",
    "purpose",
    "material:binding",
    "primvars:displayColor",
    "info:id",
    "treatAsPoint",
];
const WANTED_PREFIXES: [&str; 3] = ["xformOp", "inputs:", "outputs:surface"];

/// Names of light inputs before `inputs:`, of layers before 2021.
const OLD_INPUTS: [&str; 17] = [
    "intensity",
    "exposure",
    "color",
    "normalize",
    "radius",
    "width",
    "height",
    "length",
    "diffuse",
    "enableColorTemperature",
    "texture:file",
    "shaping:ies:file",
    "shaping:ies:angleScale",
    "shaping:ies:normalize",
    "shaping:cone:angle",
    "shaping:cone:softness",
    "shaping:focus",
];

/// A value of a property, tuples and lists flat.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Numbers(Vec<f64>),
    /// Strings, tokens, assets, paths and words.
    Texts(Vec<String>),
}

/// A prim of the layer.
#[derive(Debug)]
pub(super) struct Prim {
    pub(super) name: String,
    /// Its schema, empty where it has none.
    pub(super) kind: String,
    pub(super) line: usize,
    pub(super) parent: Option<usize>,
    /// Whether it is defined, active, and no template of others.
    pub(super) is_there: bool,
    /// Whether `ShapingAPI` is applied to it: then its inputs have their defaults.
    pub(super) is_shaped: bool,
    properties: BTreeMap<String, Value>,
}

impl Prim {
    /// The numbers of a property, none where it has no value.
    pub(super) fn numbers(&self, name: &str) -> Option<&[f64]> {
        match self.properties.get(name)? {
            Value::Numbers(numbers) => Some(numbers),
            Value::Texts(_) => None,
        }
    }

    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name)?.first().copied()
    }

    pub(super) fn texts(&self, name: &str) -> Option<&[String]> {
        match self.properties.get(name)? {
            Value::Numbers(_) => None,
            Value::Texts(texts) => Some(texts),
        }
    }

    pub(super) fn text(&self, name: &str) -> Option<&str> {
        self.texts(name)?.first().map(String::as_str)
    }

    /// Whether a property is true; text layers say so by a number or a word.
    pub(super) fn is_true(&self, name: &str) -> bool {
        self.number(name).is_some_and(|number| number != 0.0) || self.text(name) == Some("true")
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.properties.contains_key(name)
    }
}

/// A layer: its prims, each after the one above it.
#[derive(Debug, Default)]
pub(super) struct Layer {
    pub(super) prims: Vec<Prim>,
    by_name: HashMap<(Option<usize>, String), usize>,
    pub(super) meters_per_unit: Option<f64>,
    pub(super) up: Option<Up>,
}

impl Layer {
    /// The prim at an absolute path; of a property the prim that has it.
    pub(super) fn prim_at(&self, path: &str) -> Option<usize> {
        let path = path.strip_prefix('/')?.split('.').next()?;
        let mut at = None;
        for name in path.split('/').take(MAX_DEPTH) {
            at = Some(*self.by_name.get(&(at, name.to_owned()))?);
        }
        at
    }

    pub(super) fn parse(scene: &Scene<'_>, text: &str) -> Result<Self, SpecError> {
        let parser = Parser { scene, words: Words::new(scene, text), layer: Self::default(), open: vec![] };
        parser.parse()
    }
}

struct Parser<'a> {
    scene: &'a Scene<'a>,
    words: Words<'a>,
    layer: Layer,
    /// The prims that the reader is in, from the outermost.
    open: Vec<usize>,
}

/// What metadata say of a prim or a layer.
#[derive(Default)]
struct Metadata {
    is_inactive: bool,
    is_shaped: bool,
    meters_per_unit: Option<f64>,
    up_axis: Option<String>,
}

impl<'a> Parser<'a> {
    fn parse(mut self) -> Result<Layer, SpecError> {
        if self.words.takes('(')? {
            let Metadata { meters_per_unit, up_axis, .. } = self.metadata()?;
            self.layer.meters_per_unit = meters_per_unit;
            self.layer.up = match up_axis.as_deref() {
                Some("Z") => Some(Up::Z),
                Some("Y") => Some(Up::Y),
                None => None,
                Some(_) => return Err(self.fault("upAxis is neither Y nor Z", "rotate the scene first")),
            };
        }
        loop {
            match self.words.next()? {
                Token::End if self.open.is_empty() => return Ok(self.layer),
                Token::Sign('}') if !self.open.is_empty() => {
                    self.open.pop();
                }
                Token::Sign(';' | ',') => {}
                Token::Word(word @ ("def" | "over" | "class")) => self.prim(word == "def")?,
                Token::Word("variantSet") => return Err(self.composed("variantSets")),
                Token::Word("reorder") if self.open.is_empty() => self.list_operation()?,
                Token::Word(word) if !self.open.is_empty() => self.property(word)?,
                other => return Err(self.unexpected(&other)),
            }
        }
    }

    /// `def Mesh "name" (metadata) {`
    fn prim(&mut self, is_defined: bool) -> Result<(), SpecError> {
        let line = self.words.line();
        let (kind, name) = match self.words.next()? {
            Token::Text(name) => (String::new(), name),
            Token::Word(kind) => match self.words.next()? {
                Token::Text(name) => (kind.to_owned(), name),
                other => return Err(self.unexpected(&other)),
            },
            other => return Err(self.unexpected(&other)),
        };
        if name.len() > MAX_NAME_BYTES || kind.len() > MAX_NAME_BYTES {
            return Err(self.fault("a prim has too long a name", "give it a shorter one"));
        }
        if self.layer.prims.len() >= MAX_PRIMS || self.open.len() >= MAX_DEPTH {
            let message = format!("more than {MAX_PRIMS} prims, or {MAX_DEPTH} below one another");
            return Err(self.fault(&message, "import a part of the scene"));
        }
        let metadata = if self.words.takes('(')? { self.metadata()? } else { Metadata::default() };
        self.words.expect('{')?;
        let parent = self.open.last().copied();
        let place = self.layer.prims.len();
        self.layer.by_name.insert((parent, name.clone()), place);
        let (is_there, is_shaped) = (is_defined && !metadata.is_inactive, metadata.is_shaped);
        self.layer.prims.push(Prim { name, kind, line, parent, is_there, is_shaped, properties: BTreeMap::new() });
        self.open.push(place);
        Ok(())
    }

    /// Reads metadata up to the closing parenthesis.
    fn metadata(&mut self) -> Result<Metadata, SpecError> {
        let mut found = Metadata::default();
        loop {
            match self.words.next()? {
                Token::Sign(')') => return Ok(found),
                Token::Word(name) if ARCS.contains(&name) => return Err(self.composed(name)),
                Token::Word(name) if self.words.takes('=')? => {
                    let value = self.value(matches!(name, "active" | "apiSchemas" | "metersPerUnit" | "upAxis"))?;
                    match (name, value) {
                        ("active", Some(Value::Texts(texts))) => found.is_inactive = texts == ["false"],
                        ("active", Some(Value::Numbers(numbers))) => found.is_inactive = numbers == [0.0],
                        ("apiSchemas", Some(Value::Texts(texts))) => {
                            found.is_shaped = texts.iter().any(|schema| schema == "ShapingAPI");
                        }
                        ("metersPerUnit", Some(Value::Numbers(numbers))) => {
                            found.meters_per_unit = numbers.first().copied();
                        }
                        ("upAxis", Some(Value::Texts(texts))) => found.up_axis = texts.into_iter().next(),
                        _ => {}
                    }
                }
                // Comments are strings alone, and operations on lists have words before their names.
                Token::Word(_) | Token::Text(_) | Token::Sign(';' | ',') => {}
                other => return Err(self.unexpected(&other)),
            }
        }
    }

    /// A property after its first word: qualifiers, a type, a name and a value, each of the last two with metadata.
    fn property(&mut self, first: &'a str) -> Result<(), SpecError> {
        let mut word = first;
        while matches!(
            word,
            "custom" | "uniform" | "varying" | "config" | "add" | "append" | "prepend" | "delete" | "reorder"
        ) {
            word = self.words.word()?;
        }
        // The word is a type or `rel`.
        if self.words.takes('[')? {
            self.words.expect(']')?;
        }
        let name = self.words.word()?;
        if self.words.takes('=')? {
            // Of a value that changes over time only the default is read.
            let value = self.value(is_wanted(name))?;
            if let (Some(value), Some(prim)) = (value, self.open.last()) {
                self.layer.prims[*prim].properties.insert(name.to_owned(), value);
            }
        }
        if self.words.takes('(')? {
            self.skip_to_end(1)?;
        }
        Ok(())
    }

    /// `reorder rootPrims = [...]`
    fn list_operation(&mut self) -> Result<(), SpecError> {
        self.words.word()?;
        self.words.expect('=')?;
        self.value(false).map(drop)
    }

    /// Reads a value; `None` where it is passed over, is none, or holds no numbers and texts.
    fn value(&mut self, is_wanted: bool) -> Result<Option<Value>, SpecError> {
        let token = self.words.next()?;
        let open = match token {
            Token::Number(number) => return Ok(Some(Value::Numbers(vec![number]))),
            Token::Word("None") => return Ok(None),
            Token::Word(word) => return Ok(Some(Value::Texts(vec![word.to_owned()]))),
            Token::Text(text) | Token::Asset(text) | Token::Path(text) => return Ok(Some(Value::Texts(vec![text]))),
            Token::Sign(open @ ('(' | '[' | '{')) => open,
            other => return Err(self.unexpected(&other)),
        };
        if !is_wanted || open == '{' {
            self.skip_to_end(1)?;
            return Ok(None);
        }
        self.list()
    }

    /// Reads what a bracket holds, flat.
    fn list(&mut self) -> Result<Option<Value>, SpecError> {
        let (mut depth, mut numbers, mut texts) = (1, vec![], vec![]);
        while depth > 0 {
            match self.words.next()? {
                Token::Sign('(' | '[') => depth += 1,
                Token::Sign(')' | ']') => depth -= 1,
                Token::Sign(',') => {}
                Token::Number(number) => numbers.push(number),
                Token::Word(word) => texts.push(word.to_owned()),
                Token::Text(text) | Token::Asset(text) | Token::Path(text) => texts.push(text),
                other => return Err(self.unexpected(&other)),
            }
            if numbers.len() > MAX_NUMBERS || texts.len() > MAX_TEXTS {
                return Err(self.fault("a list is too long", "import a part of the scene"));
            }
        }
        Ok(match (numbers.is_empty(), texts.is_empty()) {
            (false, true) => Some(Value::Numbers(numbers)),
            (true, false) => Some(Value::Texts(texts)),
            (true, true) | (false, false) => None,
        })
    }

    /// Passes over everything up to the end of so many open brackets.
    fn skip_to_end(&mut self, mut depth: usize) -> Result<(), SpecError> {
        while depth > 0 {
            match self.words.next()? {
                Token::Sign('(' | '[' | '{') => depth += 1,
                Token::Sign(')' | ']' | '}') => depth -= 1,
                end @ Token::End => return Err(self.unexpected(&end)),
                _ => {}
            }
        }
        Ok(())
    }

    fn unexpected(&self, token: &Token<'_>) -> SpecError {
        let what = match token {
            Token::End => "the file ends too early".to_owned(),
            Token::Sign(sign) => format!("`{}` is not expected here", sign.escape_default()),
            _ => "this is not expected here".to_owned(),
        };
        self.fault(&what, "the file is broken: export it again")
    }

    /// A prim that is made of others, without which it would be another one.
    fn composed(&self, arc: &str) -> SpecError {
        let help = "flatten it first: `usdcat --flatten scene.usda -o flat.usda`";
        self.fault(&format!("it is composed ({arc}), and only one layer is read"), help)
    }

    fn fault(&self, message: &str, help: &str) -> SpecError {
        self.scene.fault(Some(self.words.line()), message, help)
    }
}

fn is_wanted(name: &str) -> bool {
    WANTED.contains(&name)
        || OLD_INPUTS.contains(&name)
        || WANTED_PREFIXES.iter().any(|prefix| name.starts_with(prefix))
}
