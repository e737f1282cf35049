//! The history of nightly runs: JSON lines, trends over nights, change points, a static site.
//!
//! A history is a text file that only grows, so that any tool can read it and a version control system can store it. Series,
//! change points and the site are computed from its lines each time, so nothing is stored twice.

mod change;
mod drift;
mod figure;
mod file;
mod innovation;
mod limits;
mod line;
mod monitor;
mod series;
mod site;
#[cfg(test)]
mod synthetic;

pub use change::{Change, Course, Level, NIGHTS_PER_FALSE_ALARM, Part, changes};
pub use file::{Addition, add};
pub use line::{HistoryError, Line, Numbers, lines};
pub use series::{History, Key, Series, VersionChange};
pub use site::{in_words, site};
