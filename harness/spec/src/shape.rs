//! Every fault in the shape of a file, not only the first: what does not fit is mended in the tree that was read, and read again.
//!
//! Each mended fault is reported once. Later faults at the same place, or in the value put there, are not reported.

use std::cell::Cell;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_path_to_error::Segment;
use serde_yaml::{Mapping, Value};

use super::faults::MAX_FAULTS;
use super::key_suggestions::homes;
use super::place::{below, get, last_key, parent, put, take};
use super::tree::Tree;
use super::{PlacePart, Source, SpecError, meant_key, nearest_key};

/// What a text says as a `T`, as far as it can be made one.
pub(super) struct Shaped<T> {
    /// With what was mended; `None` where nothing helped.
    pub(super) read: Option<T>,
    pub(super) faults: Vec<SpecError>,
    pub(super) mended: Mended,
}

/// Places at which something was put, or taken away, that nobody wrote.
#[derive(Clone, Debug, Default)]
pub(super) struct Mended(Vec<String>);

impl Mended {
    /// Whether a place is one of them, or lies in one.
    pub(super) fn holds(&self, path: &str) -> bool {
        self.0.iter().any(|mended| is_within(path, mended))
    }

    /// Whether what is said of a place may be of what nobody wrote there.
    pub(super) fn touches(&self, path: &str) -> bool {
        self.0.iter().any(|mended| is_within(path, mended) || is_within(mended, path))
    }
}

fn is_within(path: &str, whole: &str) -> bool {
    path.strip_prefix(whole).is_some_and(|rest| whole.is_empty() || rest.is_empty() || rest.starts_with(['.', '[']))
}

/// How often a tree may still be read to find further faults: as often as some megabytes hold it, so that a long text is not read for ever.
pub(super) struct Trials(Cell<usize>);

pub(super) const MAX_BYTES_READ_AGAIN: usize = 8 << 20;
const MAX_TRIALS: usize = 2000;

impl Trials {
    pub(super) fn of(text: &str) -> Self {
        Self(Cell::new((MAX_BYTES_READ_AGAIN / text.len().max(1)).min(MAX_TRIALS)))
    }

    fn spend(&self) -> bool {
        let left = self.0.get();
        self.0.set(left.saturating_sub(1));
        left > 0
    }

    /// How many faults are placed in a text: each place is looked for by a walk through all of it.
    pub(super) fn faults(&self) -> usize {
        (self.0.get() / 8).clamp(1, MAX_FAULTS)
    }
}

/// Reads a text, sound or not; its tree is none where it is no YAML.
pub(super) fn shaped<T: DeserializeOwned + JsonSchema>(source: &Source, tree: Option<&Tree>) -> Shaped<T> {
    let twice = tree.map(|tree| twice(source, tree)).unwrap_or_default();
    let first = match source.parse::<T>() {
        Ok(read) => return Shaped { read: Some(read), faults: twice, mended: Mended::default() },
        Err(first) => first,
    };
    let Some(tree) = tree else {
        // What is no YAML has no second fault, since nobody knows where the first ends.
        return Shaped { read: None, faults: vec![first], mended: Mended::default() };
    };
    let mut shaped = mended(source, tree.value.clone(), &Trials::of(&source.text));
    shaped.faults.extend(twice);
    if shaped.faults.is_empty() {
        shaped.faults.push(first);
    }
    shaped
}

/// Keys that stand twice: all but the first would say nothing.
fn twice(source: &Source, tree: &Tree) -> Vec<SpecError> {
    let help = "keep one of them; items of a list begin with a hyphen";
    let paths = tree.twice.iter().take(Trials::of(&source.text).faults());
    paths
        .map(|path| {
            let message = format!("the key `{}` stands here for the second time", last_key(path));
            source.error_at_part(PlacePart::SecondKey, path, message, help)
        })
        .collect()
}

/// Reads a tree, mending it until it is a `T`.
pub(super) fn mended<T: DeserializeOwned + JsonSchema>(
    source: &Source,
    mut value: Value,
    trials: &Trials,
) -> Shaped<T> {
    let (mut faults, mut mended, most) = (vec![], Mended::default(), trials.faults());
    loop {
        let flaw = match attempt::<T>(&value) {
            Ok(read) => return Shaped { read: Some(read), faults, mended },
            Err(flaw) => flaw,
        };
        if let Some(Moved { from, to }) = misplaced::<T>(&value, &flaw) {
            faults.push(moved(source, &from, &to));
            let taken = take(&mut value, &from);
            let put = taken.is_some_and(|taken| put(&mut value, &to, Some(taken)));
            if put && faults.len() < most && trials.spend() {
                continue;
            }
            return Shaped { read: None, faults, mended };
        }
        if !mended.holds(&flaw.place()) && !flaw.is_of_quotes() {
            faults.push(flaw.fault::<T>(source, get(&value, &flaw.path)));
        }
        if faults.len() >= most || !mend::<T>(&mut value, &flaw, trials) {
            return Shaped { read: None, faults, mended };
        }
        mended.0.push(flaw.place());
    }
}

/// What keeps a tree from being a `T`, the first of it.
#[derive(Debug)]
struct Flaw {
    /// Where the reader was.
    path: String,
    message: String,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// A key that is not known, its path being that of the flaw.
    Unknown,
    /// A key that is not there.
    Missing(String),
    Unfit,
}

fn attempt<T: DeserializeOwned>(value: &Value) -> Result<T, Flaw> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().iter().fold(String::new(), |path, segment| match segment {
            Segment::Seq { index } => format!("{path}[{index}]"),
            Segment::Map { key } => below(&path, key),
            Segment::Enum { .. } | Segment::Unknown => path,
        });
        let message = error.inner().to_string();
        let quoted = message.split('`').nth(1).unwrap_or_default().to_owned();
        let is_unknown = message.starts_with("unknown field `") || message.starts_with("unknown variant `");
        // Readers of our own are at the keys' whole when they meet one that they do not know.
        let here = below(&path, &quoted);
        if is_unknown && last_key(&path) == quoted {
            Flaw { path, message, kind: Kind::Unknown }
        } else if is_unknown && get(value, &path).is_some_and(|keys| keys.get(&quoted).is_some()) {
            Flaw { path: here, message, kind: Kind::Unknown }
        } else if message.starts_with("missing field `") {
            Flaw { path, message, kind: Kind::Missing(quoted) }
        } else {
            Flaw { path, message, kind: Kind::Unfit }
        }
    })
}

impl Flaw {
    /// What has to be mended.
    fn place(&self) -> String {
        match &self.kind {
            Kind::Missing(key) => below(&self.path, key),
            Kind::Unknown | Kind::Unfit => self.path.clone(),
        }
    }

    /// A number where text is meant is text as it was written.
    fn is_of_quotes(&self) -> bool {
        let is_scalar = ["integer", "floating point", "boolean"].iter().any(|s| self.message.contains(s));
        is_scalar && self.message.starts_with("invalid type") && self.message.ends_with("string")
    }

    /// The error of this flaw; `written` is the value at its place.
    fn fault<T: JsonSchema>(&self, source: &Source, written: Option<&Value>) -> SpecError {
        let key = last_key(&self.path);
        let message = mapping_message(&self.message, key).unwrap_or_else(|| plain(&self.message));
        let whole = parent(&self.path);
        let (spot, path, help) = match &self.kind {
            Kind::Unknown => (PlacePart::Key, whole, nearest_key(&self.message).or_else(|| home_of::<T>(&self.path))),
            Kind::Missing(key) => {
                let within = if self.path.is_empty() { "the file".to_owned() } else { format!("`{}`", self.path) };
                (PlacePart::Value, self.path.as_str(), Some(format!("{within} needs `{key}: ...`")))
            }
            Kind::Unfit => (
                PlacePart::Value,
                self.path.as_str(),
                nearest_key(&self.message).or_else(|| remedy(&self.message, key, written)),
            ),
        };
        let message = if path.is_empty() { message } else { format!("{path}: {message}") };
        SpecError { message, help, ..source.error_at_part(spot, &self.path, "", "") }
    }
}

/// What to do about a value that does not fit, where more can be said than that.
fn remedy(message: &str, key: &str, written: Option<&Value>) -> Option<String> {
    if let Some(help) = shape_remedy(message, key, written).or_else(|| percent_remedy(message)) {
        return Some(help);
    }
    let number = message.rsplit(' ').next().and_then(|word| word.parse::<f64>().ok());
    let help = match number {
        Some(percent) if message.contains("lies between 0 and 1") && percent > 1.0 && percent <= 100.0 => {
            return Some(format!("write {percent} % as {}", percent / 100.0));
        }
        _ if message.contains("fewer elements") => {
            "write decimals with a point and separate numbers by commas: 2.5, not 2,5"
        }
        _ if message.starts_with("invalid length") => "count the numbers in the brackets",
        _ if message.contains("string \"") && message.ends_with("expected f64") => {
            "give a number; where there is none in sight, a bracket or a comma may be missing before it"
        }
        _ if message.contains("lies between 0 and 1") => "give a number from 0 to 1",
        _ => return None,
    };
    Some(help.to_owned())
}

/// The message for a list where a mapping is expected; `None` for others.
fn mapping_message(message: &str, key: &str) -> Option<String> {
    let is_mapping_expected = ["expected a map", "expected struct ", "expected procedures by name"]
        .iter()
        .any(|words| message.contains(words));
    let is_list = message.starts_with("invalid type: sequence");
    (is_list && is_mapping_expected && !key.is_empty()).then(|| format!("`{key}` must be a mapping, not a list"))
}

/// How a list is written as a mapping, or a mapping as a list.
fn shape_remedy(message: &str, key: &str, written: Option<&Value>) -> Option<String> {
    if mapping_message(message, key).is_some() {
        let words = written.and_then(Value::as_sequence).into_iter().flatten().filter_map(Value::as_str);
        let entries: Vec<String> = words.map(|word| format!("{word}: {{}}")).collect();
        return Some(if entries.is_empty() {
            format!("write it with keys and without brackets or hyphens, such as {key}: {{KEY: VALUE}}")
        } else {
            format!("write {key}: {{{}}}", entries.join(", "))
        });
    }
    let is_list_missing = message.starts_with("invalid type: map") && message.contains("expected a sequence");
    is_list_missing.then(|| "begin each item of the list with a hyphen and a space: `- `".to_owned())
}

/// How a number with a percent sign is written.
fn percent_remedy(message: &str) -> Option<String> {
    let text = message.split_once("string \"")?.1.split_once('"')?.0;
    let percent: f64 = text.strip_suffix('%')?.trim().parse().ok()?;
    let expects_a_number = ["expected f64", "expected one number", "expected a number between 0 and 1"];
    expects_a_number
        .iter()
        .any(|words| message.contains(words))
        .then(|| format!("write {percent} % as {}", percent / 100.0))
}

/// Serde's words for shapes in those of who writes YAML.
pub(super) fn plain(message: &str) -> String {
    let words = [
        ("expected f64", "expected a number"),
        ("expected usize", "expected a whole number from 0"),
        ("expected u32", "expected a whole number from 0"),
        ("expected u64", "expected a whole number from 0"),
        ("expected a sequence", "expected a list"),
        ("expected an array of length", "expected a list of"),
        ("expected fewer elements in sequence", "expected fewer numbers"),
        ("expected a string", "expected text"),
        ("expected path string", "expected a path"),
        ("expected a map", "expected a mapping"),
        ("invalid type: unit value", "this is empty"),
        ("invalid type: sequence", "this is a list"),
        ("invalid type: map", "this is a mapping"),
    ];
    let mut plain = words.iter().fold(message.to_owned(), |text, (serde, ours)| text.replace(serde, ours));
    if let Some((head, _)) = plain.split_once("expected struct ") {
        plain = format!("{head}expected a mapping");
    }
    plain
}

/// Where a key belongs that is known elsewhere.
fn home_of<T: JsonSchema>(path: &str) -> Option<String> {
    let key = last_key(path);
    let home = homes::<T>(key).into_iter().next()?;
    Some(match home.strip_suffix("[]").or_else(|| home.strip_suffix(".*")) {
        _ if home.is_empty() && key == "unit" && path.contains("mesh") => {
            "a mesh is in metres: `unit` is a key of the whole spec and does not change meshes".to_owned()
        }
        _ if home.is_empty() => format!("`{key}` is a key of the whole spec: it belongs in the first column"),
        Some(list) => format!("`{key}` belongs in an entry of `{list}`"),
        None if home.contains(['[', '*']) => {
            format!("`{key}` belongs in `{}`", home.replace("[]", "").replace('*', "NAME"))
        }
        None => format!("`{key}` belongs in `{home}`"),
    })
}

/// A key at the wrong depth, whose place is free.
struct Moved {
    from: String,
    to: String,
}

fn misplaced<T: JsonSchema>(value: &Value, flaw: &Flaw) -> Option<Moved> {
    match &flaw.kind {
        Kind::Unknown => {
            let (key, here) = (last_key(&flaw.path), parent(&flaw.path));
            let mut homes = homes::<T>(key).into_iter().filter(|home| !home.contains(['[', '*']));
            let home = homes.find(|home| {
                let place = get(value, home);
                // A wrong indentation moves a key up, or down into the mapping before it.
                let is_by_indentation = here.starts_with(home.as_str()) || parent(home) == here;
                home != here && is_by_indentation && place.is_some_and(|v| v.is_mapping() && v.get(key).is_none())
            })?;
            Some(Moved { from: flaw.path.clone(), to: below(&home, key) })
        }
        Kind::Missing(key) => {
            let known = homes::<T>(key);
            let mut above = flaw.path.as_str();
            while !above.is_empty() {
                above = parent(above);
                if !known.iter().any(|home| home == above) && get(value, above).is_some_and(|v| v.get(key).is_some()) {
                    return Some(Moved { from: below(above, key), to: below(&flaw.path, key) });
                }
            }
            None
        }
        Kind::Unfit => None,
    }
}

fn moved(source: &Source, from: &str, to: &str) -> SpecError {
    let (key, home) = (last_key(from), parent(to));
    let (message, help) = if home.is_empty() {
        (
            format!("`{key}` stands in `{}`, where it does not belong", parent(from)),
            "move it out to the first column".to_owned(),
        )
    } else {
        (format!("`{key}` belongs in `{home}`"), format!("indent it, so that it stands below `{}:`", last_key(home)))
    };
    source.error_at_part(PlacePart::Key, from, message, help)
}

/// Makes something of a flaw that fits, whatever it means.
fn mend<T: DeserializeOwned>(value: &mut Value, flaw: &Flaw, trials: &Trials) -> bool {
    let place = flaw.place();
    if matches!(flaw.kind, Kind::Unknown) {
        let Some(taken) = take(value, &place).filter(|_| trials.spend()) else { return false };
        // A misspelt key is the key that was meant, not one too many and another missing.
        let meant = meant_key(&flaw.message).map(|key| below(parent(&place), key));
        if let Some(meant) = meant.filter(|meant| get(value, meant).is_none()) {
            put(value, &meant, Some(taken));
        }
        return true;
    }
    let earlier = get(value, &place).cloned();
    let written = earlier.as_ref().filter(|_| flaw.is_of_quotes()).and_then(|v| serde_yaml::to_string(v).ok());
    let text = written.map(|text| Value::from(text.trim_end()));
    let stock = [
        Value::Mapping(Mapping::new()),
        Value::Sequence(vec![]),
        Value::from(1),
        Value::Sequence(vec![Value::from(1); 2]),
        Value::Sequence(vec![Value::from(1); 3]),
        Value::from("x"),
    ];
    // What may be left out is, but in a list, whose other items keep their places.
    let leave = (earlier.is_some() && !place.ends_with(']')).then_some(None);
    for candidate in text.map(Some).into_iter().chain(leave).chain(stock.into_iter().map(Some)) {
        if !trials.spend() {
            return false;
        }
        if put(value, &place, candidate) && attempt::<T>(value).err().is_none_or(|next| next.comes_after(flaw, &place))
        {
            return true;
        }
    }
    false
}

impl Flaw {
    /// Whether it is another than the one that was mended.
    fn comes_after(&self, earlier: &Self, place: &str) -> bool {
        match &self.kind {
            // What was put there fits, and has keys of its own.
            Kind::Missing(_) if self.path == place => true,
            _ => self.place() != place && (self.path != earlier.path || self.message != earlier.message),
        }
    }
}
