//! Procedures: what is measured, one row of a table each ([`table`]), and the tasks that they make of a scene.
//!
//! A procedure is a job for everyone: its readings are made of weighted sums of illuminances, so that engines know nothing of procedures.

mod asked;
mod form;
pub mod known;
mod reads;
pub(crate) mod shapes;
pub mod table;
mod task;

pub use asked::Procedures;
pub use form::{AngleLists, Angles, AnyLight, Asked, AtAngles, AtMeters, AtOpening, Form, Names};
pub use reads::{Aimed, Aspect, Made, Reads};
pub use table::{Procedure, Reference};
pub use task::{Direction, Sets, Target, Task};
