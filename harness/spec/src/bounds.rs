//! What no YAML text may be, whosever it is: deeper than it can be read, larger than it looks, or written to do something to a terminal.

use std::cell::Cell;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, EnumAccess, Error, MapAccess, SeqAccess, VariantAccess, Visitor};

use luxproof_process::printable::is_unprintable;

/// How deep lists and mappings may lie in one another: what a YAML reader makes of deeper ones takes it the square of their number.
const MAX_DEPTH: usize = 64;

/// How many values aliases may add to a text, and so many bytes of text count as one.
const MAX_ADDED: usize = 100_000;
const BYTES_OF_A_VALUE: usize = 16;

/// The line, counted from 1, at which lists and mappings in brackets lie too deep in one another; those in quotes count as well.
pub(super) fn too_deep(text: &str) -> Option<usize> {
    let mut depth = 0_usize;
    text.lines()
        .position(|line| {
            line.bytes().any(|byte| {
                match byte {
                    b'[' | b'{' => depth += 1,
                    b']' | b'}' => depth = depth.saturating_sub(1),
                    _ => {}
                }
                depth > MAX_DEPTH
            })
        })
        .map(|line| line + 1)
}

/// How many values a text has, its aliases followed, at most.
///
/// Refused where aliases multiply it (a list of a hundred aliases of one long list is small and fills the memory), and where a value
/// holds a character that does something. What the parser itself refuses it is left to tell.
pub(super) fn values(text: &str) -> Result<usize, serde_yaml::Error> {
    /// Whether a character does something else than show.
    fn is_suspect(c: char) -> bool {
        is_unprintable(c) && !matches!(c, '\n' | '\r' | '\t' | '\u{feff}')
    }
    // No value is shorter than `0,`.
    let own = text.len() / 2 + 1;
    let has_aliases = text.contains('*') && text.contains('&');
    // Whatever does something is there as it is, or as an escape.
    if !has_aliases && !text.contains('\\') && !text.chars().any(is_suspect) {
        return Ok(own);
    }
    let most = own + MAX_ADDED;
    let left = Cell::new(most);
    match Survey(&left).deserialize(serde_yaml::Deserializer::from_str(text)) {
        Err(error) if error.to_string().contains(REFUSED) => Err(error),
        Ok(()) | Err(_) => Ok(most - left.get()),
    }
}

/// Stands in what is refused here, and nowhere else.
const REFUSED: &str = "no text of this kind is read";

/// Passes over all values, and holds none.
#[derive(Clone, Copy)]
struct Survey<'a>(&'a Cell<usize>);

impl Survey<'_> {
    fn count<E: Error>(self, values: usize) -> Result<(), E> {
        match self.0.get().checked_sub(values) {
            Some(left) => {
                self.0.set(left);
                Ok(())
            }
            None => Err(E::custom(format_args!(
                "{REFUSED}: its aliases add more than {MAX_ADDED} values to it; write it out, or make several of it"
            ))),
        }
    }
}

impl<'de> DeserializeSeed<'de> for Survey<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Survey<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any value")
    }

    fn visit_bool<E: Error>(self, _: bool) -> Result<(), E> {
        self.count(1)
    }

    fn visit_i64<E: Error>(self, _: i64) -> Result<(), E> {
        self.count(1)
    }

    fn visit_i128<E: Error>(self, _: i128) -> Result<(), E> {
        self.count(1)
    }

    fn visit_u64<E: Error>(self, _: u64) -> Result<(), E> {
        self.count(1)
    }

    fn visit_u128<E: Error>(self, _: u128) -> Result<(), E> {
        self.count(1)
    }

    fn visit_f64<E: Error>(self, _: f64) -> Result<(), E> {
        self.count(1)
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        self.count(1)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<(), E> {
        if let Some(c) = text.chars().find(|c| is_unprintable(*c) && !matches!(c, '\n' | '\t')) {
            let code = u32::from(c);
            return Err(E::custom(format_args!(
                "{REFUSED}: it holds U+{code:04X}, which shows nothing and does something; leave it out"
            )));
        }
        self.count(1 + text.len() / BYTES_OF_A_VALUE)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        self.count(1)?;
        while seq.next_element_seed(self)?.is_some() {}
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        self.count(1)?;
        while map.next_key_seed(self)?.is_some() {
            map.next_value_seed(self)?;
        }
        Ok(())
    }

    /// What has a tag.
    fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<(), A::Error> {
        let ((), tagged) = data.variant_seed(self)?;
        tagged.newtype_variant_seed(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> Option<String> {
        values(text).err().map(|error| error.to_string())
    }

    #[test]
    fn aliases_may_repeat_and_not_multiply() {
        let list = format!("[{}]", "0,".repeat(60_000));
        let of = |count: usize| format!("a: &a {list}\nb: [{}]\n", "*a,".repeat(count));
        assert!((120_000..125_000).contains(&values(&of(1)).unwrap()), "{:?}", values(&of(1)));
        assert!(refusal(&of(2)).unwrap().contains("aliases add more than"));
        let text = format!("a: &a {}\nb: [{}]\n", "x".repeat(500_000), "*a,".repeat(100));
        assert!(refusal(&text).unwrap().contains("aliases add more than"));
        // Nine times ten of ten: the parser itself refuses that.
        let lists = (1..10).map(|k| format!("a{k}: &a{k} [{}]\n", format!("*a{},", k - 1).repeat(10)));
        let nested = format!("a0: &a0 [0,0]\n{}", lists.collect::<Vec<_>>().concat());
        assert!(refusal(&nested).is_some() || serde_yaml::from_str::<serde_yaml::Value>(&nested).is_err());
        assert_eq!(values("a: &a {b: 1}\nc: {<<: *a}\nd: !t *a\n").map(|count| count < 20).ok(), Some(true));
    }

    #[test]
    fn what_does_something_is_refused_at_its_place_and_no_line_feed() {
        for text in
            ["a: 1\nb: \"\\e]0;x\"\n", "a: 1\n\"\\x9b\": 2\n", "a: 1\nb: [\u{202e}x]\n", "a: 1\nb: !t \"\\0\"\n"]
        {
            let error = values(text).unwrap_err();
            assert!(
                error.to_string().contains("U+") && error.location().is_some_and(|place| place.line() == 2),
                "{error}"
            );
        }
        for text in ["a: \"one\\ntwo\\tthree \\\\ \\u00e9\"\n", "a: |\n  one\n  two\n", "\u{feff}a: \\\n"] {
            assert_eq!(refusal(text), None, "{text}");
        }
    }
}
