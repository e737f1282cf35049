//! Papers: their printed tables as references, and the shares of their deviations.

mod cells;
mod fit;
mod input;
mod paper_splits;
mod shares;
mod tables;

pub use cells::{Cell, Standing, cells};
pub(super) use input::Input;
pub use paper_splits::paper_splits;
pub use shares::{Stages, shares};
pub use tables::{PHOTOMETRY, Published, PublishedError};
