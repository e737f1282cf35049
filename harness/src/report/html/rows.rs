//! The readings as rows: compact data for the script, which opens the error budget of a reading on request.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::super::words::{rounded, trimmed};
use super::palette::Palette;
use crate::judge::Comparison;

/// Rows that have been given out, with the words they share.
#[derive(Default)]
pub(super) struct Rows {
    words: BTreeMap<String, usize>,
    rows: Vec<Value>,
}

impl Rows {
    /// Takes a comparison in; its number for the script.
    pub(super) fn add(&mut self, c: &Comparison, palette: &Palette) -> usize {
        let components = c.budget.iter().flat_map(|b| &b.components);
        let components: Vec<Value> =
            components.map(|part| json!([self.word(part.source.into_str()), short(Some(part.uncertainty))])).collect();
        let source = c.reference.as_ref().map_or("", |r| r.source.as_str());
        let diagnosis = c.diagnosis.as_deref().unwrap_or_default();
        let words = [&*c.key.case, &*c.key.engine, c.basis_name(), source, diagnosis, c.verdict.name()];
        let words = words.map(|w| self.word(w));
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

    fn word(&mut self, word: &str) -> usize {
        let next = self.words.len();
        *self.words.entry(word.to_owned()).or_insert(next)
    }

    /// What the script reads; `<` is escaped so that no text can end the element.
    pub(super) fn json(&self) -> String {
        let mut words = vec![""; self.words.len()];
        for (word, &k) in &self.words {
            words[k] = word;
        }
        json!({"words": words, "rows": self.rows}).to_string().replace('<', "\\u003c")
    }
}

/// Seven significant digits: what a page shows; all of them are in report.json.
fn short(value: Option<f64>) -> Value {
    json!(value.and_then(|v| rounded(v, 7)))
}

pub(super) fn place(c: &Comparison) -> String {
    let number = |value| trimmed(value, 3);
    match c.gamma_deg.zip(c.c_deg) {
        Some((gamma, plane)) => format!("C {} γ {}", number(plane), number(gamma)),
        None => format!("({}) m", c.at_m.map(number).join(", ")),
    }
}
