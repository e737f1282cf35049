//! Rooms, surfaces and the configuration factors between them.

pub mod bvh;
pub mod configuration_factor;
mod mesh;
pub mod obj;
pub mod polygon;
mod room;

pub use mesh::{Mesh, MeshError, is_inside_closed, solid_angle_sr};
pub use room::{Reflectances, Room, Surface};
