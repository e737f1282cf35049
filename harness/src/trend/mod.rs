//! Over time: readings that somebody accepted, and what nights say after nights.

pub mod baseline;
pub mod history;
