//! Lines that tell a method's share of a deviation from the renderer's.

use super::Report;
use crate::judge::Split;

/// The widest split of each case, procedure and engine, in their order.
pub(super) fn widest(report: &Report) -> Vec<&Split> {
    let mut widest: Vec<&Split> = vec![];
    for split in &report.splits {
        let alike =
            |s: &&mut &Split| (&s.case, &s.procedure, &s.engine) == (&split.case, &split.procedure, &split.engine);
        match widest.iter_mut().find(alike) {
            Some(found) if found.whole.abs() < split.whole.abs() => *found = split,
            Some(_) => {}
            None => widest.push(split),
        }
    }
    widest
}

/// Where a split was read, in words.
pub(super) fn place(report: &Report, split: &Split) -> String {
    let case = if report.is_suite() { format!("{} ", split.case) } else { String::new() };
    format!("{case}{} {}", split.procedure, split.meter)
}
