//! The readings as compact data for the script, which opens the error budget of a reading on request.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::super::words::{rounded, trimmed};
use super::palette::Palette;
use luxproof_model::Comparison;

/// Significant digits that a page shows; all digits are in report.json.
const SHOWN_DIGITS: usize = 7;

/// Rows for the script, with the words that they share.
#[derive(Default)]
pub(super) struct Rows {
    words: BTreeMap<String, usize>,
    rows: Vec<Value>,
}

impl Rows {
    /// Adds a comparison and returns its number for the script. The order of the fields is that of `page.js`.
    pub(super) fn add(&mut self, c: &Comparison, palette: &Palette) -> usize {
        let mut components: Vec<Value> = vec![];
        for part in c.budget.iter().flat_map(|b| &b.components) {
            components.push(json!([self.word_number(part.source.into_str()), short(Some(part.uncertainty))]));
        }
        let source = c.reference.as_ref().map_or("", |r| r.source.as_str());
        let diagnosis = c.diagnosis.as_deref().unwrap_or_default();
        let words = [&*c.key.case, &*c.key.engine, c.basis_name(), source, diagnosis, c.verdict.name()];
        let words = words.map(|word| self.word_number(word));
        let budget = c.budget.as_ref();
        let row = json!([
            words,
            c.meter.0,
            place(c),
            short(c.value),
            short(c.reference.as_ref().map(|r| r.value)),
            short(c.deviation),
            short(c.relative_deviation),
            short(Some(c.allowed())),
            components,
            c.quantity.unit(),
            short(c.normalized_error()),
            palette.index(&c.key.engine),
            short(budget.map(|b| b.combined)),
            short(budget.map(|b| b.expanded)),
            short(budget.map(|b| b.coverage_factor)),
            short(c.p_value),
        ]);
        self.rows.push(row);
        self.rows.len() - 1
    }

    /// The number of a word; each word is stored once.
    fn word_number(&mut self, word: &str) -> usize {
        let next = self.words.len();
        *self.words.entry(word.to_owned()).or_insert(next)
    }

    /// The JSON that the script reads; `<` is escaped so that no text can end the element.
    pub(super) fn json(&self) -> String {
        let mut words = vec![""; self.words.len()];
        for (word, &k) in &self.words {
            words[k] = word;
        }
        json!({"words": words, "rows": self.rows}).to_string().replace('<', "\\u003c")
    }
}

fn short(value: Option<f64>) -> Value {
    json!(value.and_then(|v| rounded(v, SHOWN_DIGITS)))
}

/// A meter's direction or its coordinates.
pub(super) fn place(c: &Comparison) -> String {
    match c.gamma_deg.zip(c.c_deg) {
        Some((gamma, plane)) => format!("C {} γ {}", trimmed(plane, 3), trimmed(gamma, 3)),
        None => format!("({}) m", c.at_m.map(|coordinate| trimmed(coordinate, 3)).join(", ")),
    }
}
