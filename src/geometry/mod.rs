//! Rooms, surfaces and the configuration factors between them.

pub mod configuration_factor;
mod room;

pub use room::{Reflectances, Room, Surface};
