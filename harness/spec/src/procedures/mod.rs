//! Procedures: what is measured, one row of a table each ([`table`]), and the tasks that they make of a scene.
//!
//! A procedure is a job for everyone: its readings are made of weighted sums of illuminances, so that engines know nothing of procedures.

mod form;
pub mod known;
mod reads;
mod requests;
pub mod table;
mod task;

pub use form::{AngleLists, Angles, AnyLight, AtAngles, AtMeters, AtOpening, Form, Names, ProcedureRequest};
pub(crate) use reads::horizontal;
pub use reads::{Aimed, Aspect, ReadingKind, Reads};
pub use requests::Procedures;
pub use table::{Procedure, Reference, row};
pub use task::{Direction, Sets, Target, Task};
