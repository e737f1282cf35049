//! The IES conformance pack: small photometric files that provoke one feature each, the intensities that they state, and
//! what readers answer that make a frequent mistake.
//!
//! A table contains a closed form at its nodes ([`ClosedForm`]), so that expected intensities need no reader. Answers of
//! wrong readers come from one model of a reader with a switch for each [`Mistake`]. [`judge`] searches the mistakes that
//! give the answers of a [`Submission`].

#![warn(missing_docs)]

mod catalogue;
mod closed_form;
mod command;
mod document;
mod expected;
mod explanation;
mod interpolation;
mod judge;
mod layout;
mod mistake;
mod model_reader;
mod own_answers;
mod pack;
mod pack_file;
mod quantities;
mod submission;
mod table;

#[cfg(test)]
mod second_reader_tests;
#[cfg(test)]
mod tests;

pub use catalogue::{PACK_VERSION, pack_files};
pub use closed_form::ClosedForm;
pub use command::{ConformanceArgs, run};
pub use expected::{Axes, Direction, Expected, Flux, MistakeAnswer, VariantAnswer};
pub use explanation::PartialExplanation;
pub use judge::{FileJudgement, FileVerdict, Judgement, judge};
pub use mistake::{Mistake, Variant};
pub use own_answers::own_submission;
pub use pack::{IndexEntry, NamedSentence, PackError, PackIndex, WrittenFile, written_files};
pub use pack_file::{PackFile, Place};
pub use quantities::QuantityFault;
pub use submission::{FileAnswer, ReaderName, Scale, Submission, SubmissionError};
