//! `report.json` on disk: it is written whole with a checksum, verified when read, and an earlier report is renamed.

mod comparison_lines;
mod previous_report;
mod read;
#[cfg(test)]
mod tests;
mod write;

pub use previous_report::subject_at;
pub use read::{ReadError, ReportError, from_json, read};
pub use write::{keep, keep_again, keep_anew, keep_in};
