//! The one way to a reading: out of the cache or by the engine, within the machine's slots, in this process or one apart.

mod answer;
mod asking;
pub mod cache;
mod joining;
mod machine;
mod outcome;
mod question;
mod reader;
mod subprocess;

pub use answer::answer;
pub use asking::{Asked, Asking, Failures, Needs, Node};
pub use machine::Machine;
pub use outcome::{Cost, Failure, Source, Taken};
pub use question::{Instrument, Question, Trial};
pub use reader::Reader;
pub use subprocess::{Isolation, READ_ONE};
