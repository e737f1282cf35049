//! The history of nightly runs: one JSON line a comparison, trends over nights, change points, a static site.
//!
//! A history is a text file that only grows, so that any tool can read it and a version control system can keep it. What
//! follows from it (series, change points, the site) is computed anew from the lines each time; nothing is stored twice.

mod change;
mod entry;
mod limits;
mod repeat;
mod series;
mod site;
#[cfg(test)]
mod synthetic;
mod told;
mod trend;

pub use change::{Change, Level, NIGHTS_PER_FALSE_ALARM, Part, changes};
pub use entry::{Entry, HistoryError, add, entries};
pub use series::{History, Key, Series, VersionChange};
pub use site::site;
