//! What the rest needs of the machine: files seen whole, folders with one holder, envelopes for what is kept, processes with a limit, slots, random numbers.

pub mod clock;
pub mod digest;
pub mod envelope;
pub mod files;
pub mod foreign_json;
pub mod output_lock;
pub mod printable;
pub mod process;
pub mod random;
mod rows;
pub mod slots;
