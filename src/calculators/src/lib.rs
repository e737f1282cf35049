//! The IESNA methods of lighting calculation and their closed forms, each with a statement of its validity.
//!
//! | module | computes | exact counterpart |
//! |---|---|---|
//! | [`inverse_square`] | direct illuminance of points | [`inverse_square::lambertian_twin`] |
//! | [`zonal_cavity`] | coefficients of utilization and exitance | [`zonal_multiplier`], [`zonal_cavity::balance`] |
//! | [`exitance_difference`] | indirect and total illuminance of points (IP-ED) | [`uniform_surfaces`] |
//! | [`ugr`] | unified glare rating in standard rooms, and for observers in any scene | a room built luminaire by luminaire, in its tests |
//! | [`closed_form`] | laws of rooms, spheres and planes | the laws are exact |
//!
//! Neither this crate nor the simulator depends on the other, so that each can verify the other.

#![warn(missing_docs)]

pub mod closed_form;
mod deviation;
pub mod exitance_difference;
pub mod inverse_square;
mod layers;
mod room_flux;
pub mod ugr;
pub mod uniform_surfaces;
mod utilization_print;
mod validity;
pub mod zonal_cavity;
pub mod zonal_multiplier;

pub use deviation::{DeviationSplit, Uncertain};
pub use validity::{Calculated, NotApplicable, Validity};
