//! The whole program as its users meet it: one binary, one file a topic. tests/README.md says how to run part of it.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that cannot go on has failed")]

mod action;
mod any_bytes;
mod at_home;
mod baselines;
mod bundle;
mod by_hand;
mod cache;
mod calibration;
mod command_line;
mod compare;
mod conformance;
mod cylindrical;
mod external_adapter;
mod faults;
mod furnished_office;
mod glare;
mod guide;
mod hunt;
mod import;
mod long_report;
mod luminance;
mod main_job;
mod measuring;
mod mesh_files;
mod mistakes;
mod negative_controls;
mod photometric_figures;
mod planning;
mod policy;
mod readers;
mod recessed;
mod releases;
mod repeatability;
mod repetitions;
mod rooms;
mod sets_of_meters;
mod stated_errors;
mod stops;
mod suite;
mod supervision;
mod support;
mod untrusted;
mod web;
mod workload;
