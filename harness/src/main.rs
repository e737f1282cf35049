//! The `luxproof` program.

fn main() {}
