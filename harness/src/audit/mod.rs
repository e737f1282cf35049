//! From specs to a report: runs, further looks where a comparison is undecided, and the doctor's quick look at one engine.

pub mod doctor;
pub mod run;
pub mod sequential;
