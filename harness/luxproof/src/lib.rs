//! `luxproof`, the program: the command line and bundles over the crates of the workspace.
//!
//! `docs/architecture.md` has the map of the crates.

/// The worked example of the documentation, compiled and run as a test.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/adding-an-engine.md")]
pub struct AddingAnEngine;

pub mod bundle;
pub mod cli;
mod running_tool;
pub mod standard_tables;
pub mod study;

pub use running_tool::running_tool;
