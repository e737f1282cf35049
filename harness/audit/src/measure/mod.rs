//! Takes readings: out of the cache or from the engine, within the machine's slots, in this process or a child process.

mod answer;
pub mod cache;
mod cache_miss;
mod joining;
mod machine;
mod outcome;
mod question;
mod reader;
mod running_jobs;
mod subprocess;

pub use answer::answer;
pub use cache_miss::{CacheMissPolicy, Failures, Needs, Node, RequestedReadings};
pub use machine::Machine;
pub use outcome::{AnswerSource, Cost, CostedMeasurement, Failure};
pub use question::{Instrument, Question, Trial};
pub use reader::Reader;
pub use running_jobs::{RunningJob, RunningJobs};
pub use subprocess::{Isolation, READ_ONE};
