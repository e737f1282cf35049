//! `luxproof`: specs, procedures, engines, comparison and reports around the physics of [`luminaire`].
//!
//! [`audit::run`] goes all the way: specs -> [`plan::Plan`] -> [`record::Recording`] -> [`judge::Comparison`] -> [`report::Report`].
//! Imports point down only, in the order of ARCHITECTURE.md, which `ci/layers` prints and checks.

/// The worked example of the documentation, compiled and run as a test.
#[cfg(doctest)]
#[doc = include_str!("../../docs/adding-an-engine.md")]
pub struct AddingAnEngine;

pub mod audit;
pub mod bundle;
pub mod cli;
pub mod diagnosis;
pub mod engines;
pub mod experiments;
pub mod import;
pub mod judge;
pub mod laws;
pub mod measure;
pub mod plan;
pub mod procedures;
pub mod record;
pub mod report;
pub mod spec;
pub mod system;
pub mod trend;
