//! Papers: their printed tables as references, and what of the distance between a paper's calculation and its renderings is whose.

mod fit;
mod input;
mod shares;
mod tables;

pub use fit::Misfit;
pub(super) use input::Input;
pub use shares::{PaperSplit, Share, Stages, shares};
pub use tables::{PHOTOMETRY, Published, PublishedColumn, PublishedError, PublishedFlux, PublishedRow, PublishedTable};
