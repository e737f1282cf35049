//! Score cards: what each renderer can be trusted for, release by release, computed from reports and drawn as a static site.
//!
//! [`Capabilities`] maps cases to capabilities. [`Cards::of`] collects the evidence of reports and applies the rule of
//! [`judge`] to every renderer, release and capability. [`site`] draws the pages.

mod capabilities;
mod cards;
mod case_difference;
mod cell;
mod deviation;
mod error;
mod evidence;
mod release_label;
pub mod site;
mod site_folder;
mod slug;
mod stated_tolerance;

#[cfg(test)]
mod fixtures;

pub use capabilities::{Capabilities, Capability, CapabilityId, CaseSelector, EXAMPLE_FILE, NotShown};
pub use cards::{
    CardRun, Cards, CellCard, CellEvidence, Change, ReleaseCard, ReleaseEvidence, RendererCard, RunId, Since,
    Verification,
};
pub use case_difference::{CaseDifference, compare_cases};
pub use cell::{Cell, Place, Spread, Standing, WorstPoint, judge};
pub use deviation::{Deviation, Measure};
pub use error::CardsError;
pub use evidence::{CaseEvidence, Measurement, Outcome, PointEvidence, Remark, VerdictCounts};
pub use release_label::ReleaseLabel;
pub use site_folder::{SITE_FILE, SiteFolder, SiteFolderError};
pub use slug::slug;
pub use stated_tolerance::StatedTolerance;
