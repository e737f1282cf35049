//! The one way to a reading: out of the cache or by the engine, within the machine's slots, in this process or one apart.

pub mod cache;
mod isolated;
mod machine;
mod reader;

pub use isolated::*;
pub use machine::Machine;
pub use reader::{Reader, Source, Taken};
