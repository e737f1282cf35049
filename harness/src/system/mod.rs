//! What the rest needs of the machine: files seen whole, folders with one holder, envelopes for what is kept, processes with a limit, slots, random numbers.

pub mod claim;
pub mod day;
pub(crate) mod digest;
pub mod envelope;
pub mod files;
pub(crate) mod printable;
pub mod process;
pub(crate) mod random;
mod rows;
pub mod slots;
