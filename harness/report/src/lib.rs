//! Views of a report: terminal, Markdown, JUnit, CSV and HTML. The JSON form of [`luxproof_model`] has all digits.

mod budget;
mod csv;
mod exit_reason;
mod html;
mod junit;
mod markdown;
mod matrix;
mod notes;
mod papers;
pub mod svg;
mod symmetry;
mod terminal;
mod verdict_lines;
pub mod words;

pub use budget::budgets;
pub use csv::csv;
pub use html::table;
pub use html::{AttachedReport, AttachedReportError, keep as keep_page, page};
pub use html::{BASE_STYLE, minus};
pub use junit::junit;
pub use markdown::markdown;
pub use terminal::{Detail, Letters, Screen, Style, terminal};

/// The name of the HTML page in the folder of a run.
pub const PAGE: &str = "report.html";
