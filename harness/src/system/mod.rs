//! What the rest needs of the machine: files seen whole, processes with a limit, slots, random numbers.

pub mod files;
pub mod process;
pub(crate) mod random;
pub mod slots;
