//! The review of a run before its readings become a baseline: entry by entry, old beside new, and a reason for each.

use std::io::{BufRead, Write};

use itertools::Itertools;

use super::{Changes, Entry, EntryChange, MeterChange, State};
use crate::record::ReadingKey;

#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    pub accepted: Vec<Entry>,
    pub declined: usize,
}

/// Meters shown of one entry, those that changed most first.
const SHOWN: usize = 12;

/// Asks about every entry that is new or changed; ending the input declines the rest.
pub fn review(
    changes: &Changes,
    candidates: &[Entry],
    now: &str,
    input: &mut dyn BufRead,
    output: &mut dyn Write,
) -> std::io::Result<Decision> {
    let changed = changes.entries.iter().filter(|c| c.state != State::Unchanged);
    let open: Vec<(&EntryChange, &Entry)> =
        changed.filter_map(|c| candidates.iter().find(|e| e.key == c.key).map(|e| (c, e))).collect();
    let mut decision = Decision { accepted: vec![], declined: 0 };
    for (k, (change, entry)) in open.iter().enumerate() {
        let ReadingKey { case, procedure, engine } = &entry.key;
        writeln!(output, "\n[{}/{}] {case} {procedure} {engine} {}", k + 1, open.len(), entry.version)?;
        describe(change, entry, output)?;
        match answer(input, output)? {
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

enum Answer {
    Accept(String),
    Decline,
    Quit,
}

fn answer(input: &mut dyn BufRead, output: &mut dyn Write) -> std::io::Result<Answer> {
    loop {
        let Some(word) = ask("accept? [y]es, [n]o, [q]uit: ", input, output)? else { return Ok(Answer::Quit) };
        match word.as_str() {
            "y" | "yes" => break,
            "n" | "no" => return Ok(Answer::Decline),
            "q" | "quit" => return Ok(Answer::Quit),
            _ => writeln!(output, "y, n or q")?,
        }
    }
    loop {
        match ask("reason: ", input, output)? {
            None => return Ok(Answer::Quit),
            Some(reason) if !reason.is_empty() => return Ok(Answer::Accept(reason)),
            Some(_) => writeln!(output, "a baseline needs a reason: why is this right?")?,
        }
    }
}

/// One line of the input; `None` at its end.
fn ask(question: &str, input: &mut dyn BufRead, output: &mut dyn Write) -> std::io::Result<Option<String>> {
    write!(output, "{question}")?;
    output.flush()?;
    let mut line = String::new();
    let read = input.read_line(&mut line)?;
    Ok((read > 0).then(|| line.trim().to_owned()))
}

fn describe(change: &EntryChange, entry: &Entry, output: &mut dyn Write) -> std::io::Result<()> {
    for note in &change.notes {
        writeln!(output, "  {note}")?;
    }
    if let Some(mean) = change.mean {
        writeln!(output, "  mean shift {mean}")?;
    }
    if change.meters.is_empty() {
        for reading in entry.readings.iter().take(SHOWN) {
            writeln!(output, "  {:<16} new {:.6} {}", reading.meter, reading.value, reading.quantity.unit())?;
        }
        return more(entry.readings.len(), output);
    }
    for m in change.meters.iter().sorted_by(|a, b| a.p_value.total_cmp(&b.p_value)).take(SHOWN) {
        let change = m.new - m.old;
        let in_u = if m.uncertainty > 0.0 { format!("{:+.1} u", change / m.uncertainty) } else { "exact".to_owned() };
        let mark = if m.significant { "  <- changed" } else { "" };
        let (MeterChange { meter, old, new, .. }, unit) = (m, m.quantity.unit());
        writeln!(output, "  {meter:<16} old {old:.6} new {new:.6} {unit}, change {change:+.6}: {in_u}{mark}")?;
    }
    more(change.meters.len(), output)
}

fn more(meters: usize, output: &mut dyn Write) -> std::io::Result<()> {
    if meters > SHOWN { writeln!(output, "  and {} more meters", meters - SHOWN) } else { Ok(()) }
}

impl Entry {
    #[must_use]
    pub fn accepted_for(&self, reason: &str, now: &str) -> Self {
        Self { reason: reason.to_owned(), accepted: now.to_owned(), ..self.clone() }
    }
}
