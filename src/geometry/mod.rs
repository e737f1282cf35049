//! Rooms, surfaces and the configuration factors between them.

mod room;

pub use room::{Reflectances, Room, Surface};
