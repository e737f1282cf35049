//! Cargo counts build dependencies of a crate with a build script alone.

fn main() {}
