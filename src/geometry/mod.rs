//! Rooms, surfaces and the configuration factors between them.

pub mod bvh;
pub mod configuration_factor;
mod mesh;
mod room;

pub use mesh::{Mesh, MeshError};
pub use room::{Reflectances, Room, Surface};
