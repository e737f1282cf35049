//! `luxproof`: specs, procedures, engines, comparison and reports around the physics of [`luminaire`].
//!
//! Data flows one way; each arrow is one function and each artefact a file:
//! spec file -> [`spec::Case`] -> [`plan::Plan`] -> [`reading::Recording`] -> [`diff::Comparison`] -> [`report::Report`].
//! Imports point down only: spec < reading < procedures < engines < cache < plan < run < diff < {diagnosis | sequential} < report < baseline < cli.

/// The worked example of the documentation, compiled and run as a test.
#[cfg(doctest)]
#[doc = include_str!("../../docs/adding-an-engine.md")]
pub struct AddingAnEngine;

pub mod baseline;
pub mod bench;
pub mod cache;
pub mod cli;
pub mod diagnosis;
pub mod diff;
pub mod doctor;
pub mod engines;
mod files;
pub mod history;
pub mod measure;
pub mod photometry_command;
pub mod plan;
pub mod procedures;
pub mod process;
mod random;
pub mod reading;
pub mod report;
pub mod run;
pub mod selftest;
pub mod sequential;
pub mod slots;
pub mod spec;
pub mod stress;
