//! The review of a run before it is saved as a baseline: old and new values of each entry, with a reason for each.

use std::io::{BufRead, Write};

use itertools::Itertools;

use super::{Changes, Entry, EntryChange, MeterChange, State};
use luxproof_model::ReadingKey;

#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    pub accepted: Vec<Entry>,
    pub declined: usize,
}

/// Meters of one entry that are shown, the most changed first.
const SHOWN_METERS: usize = 12;

/// A run under review: its candidates and what was accepted before.
#[derive(Clone, Copy, Debug)]
pub struct Review<'a> {
    pub changes: &'a Changes,
    pub accepted: &'a [Entry],
    pub candidates: &'a [Entry],
}

impl<'a> Review<'a> {
    /// The entries that are new or changed.
    fn open(self) -> Vec<(&'a EntryChange, &'a Entry)> {
        let changed = self.changes.entries.iter().filter(|c| c.state != State::Unchanged);
        changed.filter_map(|c| self.candidates.iter().find(|e| e.key == c.key).map(|e| (c, e))).collect()
    }

    /// Asks about every new or changed entry; the end of the input declines the rest.
    pub fn ask(self, now: &str, input: &mut dyn BufRead, output: &mut dyn Write) -> std::io::Result<Decision> {
        let open = self.open();
        let mut decision = Decision { accepted: vec![], declined: 0 };
        for (k, (change, entry)) in open.iter().enumerate() {
            self.write_entry((k + 1, open.len()), change, entry, output)?;
            match ask_decision(input, output)? {
                Answer::Accept(reason) => decision.accepted.push(entry.accepted_for(&reason, now)),
                Answer::Decline => decision.declined += 1,
                Answer::Quit => {
                    decision.declined += open.len() - k;
                    break;
                }
            }
        }
        Ok(decision)
    }

    /// Accepts every new or changed entry for one reason, and writes old and new values.
    pub fn accept_all(self, reason: &str, now: &str, output: &mut dyn Write) -> std::io::Result<Decision> {
        let open = self.open();
        let mut decision = Decision { accepted: vec![], declined: 0 };
        for (k, (change, entry)) in open.iter().enumerate() {
            self.write_entry((k + 1, open.len()), change, entry, output)?;
            decision.accepted.push(entry.accepted_for(reason, now));
        }
        Ok(decision)
    }

    /// Writes the name, the state and the old and new values of an entry; `of_all` is its number and that of all.
    fn write_entry(
        self,
        of_all: (usize, usize),
        change: &EntryChange,
        entry: &Entry,
        output: &mut dyn Write,
    ) -> std::io::Result<()> {
        let (ReadingKey { case, procedure, engine }, version, state) =
            (&entry.key, &entry.version, change.state.name());
        writeln!(output, "\n[{}/{}] {state} {case} {procedure} {engine} {version}", of_all.0, of_all.1)?;
        let before = self.accepted.iter().find(|before| before.key == entry.key);
        write_change(change, before, entry, output)
    }
}

enum Answer {
    Accept(String),
    Decline,
    Quit,
}

/// Asks whether an entry is accepted, and for what reason.
fn ask_decision(input: &mut dyn BufRead, output: &mut dyn Write) -> std::io::Result<Answer> {
    loop {
        let Some(word) = ask_line("accept? [y]es, [n]o, [q]uit: ", input, output)? else { return Ok(Answer::Quit) };
        match word.as_str() {
            "y" | "yes" => break,
            "n" | "no" => return Ok(Answer::Decline),
            "q" | "quit" => return Ok(Answer::Quit),
            _ => writeln!(output, "y, n or q")?,
        }
    }
    loop {
        match ask_line("reason: ", input, output)? {
            None => return Ok(Answer::Quit),
            Some(reason) if !reason.is_empty() => return Ok(Answer::Accept(reason)),
            Some(_) => writeln!(output, "a baseline needs a reason: why is this right?")?,
        }
    }
}

/// Asks a question and reads a line; `None` at the end of the input.
fn ask_line(question: &str, input: &mut dyn BufRead, output: &mut dyn Write) -> std::io::Result<Option<String>> {
    write!(output, "{question}")?;
    output.flush()?;
    let mut line = String::new();
    let read = input.read_line(&mut line)?;
    Ok((read > 0).then(|| line.trim().to_owned()))
}

/// Writes the notes, the mean shift and the most changed meters of an entry.
fn write_change(
    change: &EntryChange,
    before: Option<&Entry>,
    entry: &Entry,
    output: &mut dyn Write,
) -> std::io::Result<()> {
    for note in change.notes.iter().chain(&change.instrument) {
        writeln!(output, "  {note}")?;
    }
    if let Some(mean) = change.mean {
        writeln!(output, "  mean shift {mean}")?;
    }
    if change.meters.is_empty() {
        for reading in entry.readings.iter().take(SHOWN_METERS) {
            // The old value of another task is shown, although it is not compared.
            let old = before.and_then(|before| before.readings.iter().find(|old| old.meter == reading.meter));
            let old = old.map_or_else(|| "none".to_owned(), |old| format!("{:.6}", old.value));
            let (meter, value, unit) = (&reading.meter, reading.value, reading.quantity.unit());
            writeln!(output, "  {meter:<16} old {old} new {value:.6} {unit}")?;
        }
        return write_remaining(entry.readings.len(), output);
    }
    for m in change.meters.iter().sorted_by(|a, b| a.p_value.total_cmp(&b.p_value)).take(SHOWN_METERS) {
        let change = m.new - m.old;
        let in_u = if m.uncertainty > 0.0 { in_uncertainties(change / m.uncertainty) } else { "exact".to_owned() };
        let mark = if m.significant { "  <- changed" } else { "" };
        let (MeterChange { meter, old, new, .. }, unit) = (m, m.quantity.unit());
        writeln!(output, "  {meter:<16} old {old:.6} new {new:.6} {unit}, change {change:+.6}: {in_u}{mark}")?;
    }
    write_remaining(change.meters.len(), output)
}

/// A change in standard uncertainties, as far as the number means anything.
pub(super) fn in_uncertainties(change: f64) -> String {
    const MOST: f64 = 1000.0;
    if change.abs() > MOST { format!("more than {MOST} u") } else { format!("{change:+.1} u") }
}

/// Writes how many meters are not shown.
fn write_remaining(meters: usize, output: &mut dyn Write) -> std::io::Result<()> {
    if meters > SHOWN_METERS { writeln!(output, "  and {} more meters", meters - SHOWN_METERS) } else { Ok(()) }
}

impl Entry {
    /// The entry as accepted for a reason at a time.
    #[must_use]
    pub fn accepted_for(&self, reason: &str, now: &str) -> Self {
        Self { reason: reason.to_owned(), accepted: now.to_owned(), ..self.clone() }
    }
}
