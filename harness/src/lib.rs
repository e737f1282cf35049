//! `luxproof`: specs, procedures, engines, comparison and reports around the physics of [`luminaire`].
//!
//! Data flows one way; each arrow is one function and each artefact a file:
//! spec file -> [`spec::Spec`] -> scene -> plan -> readings -> comparison -> report.

pub mod engines;
pub mod process;
pub mod reading;
