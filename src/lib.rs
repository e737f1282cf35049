//! `luminaire`: the physics of luminaires in rooms, knowing no renderer, no process and no report.
//!
//! Layers, each importing only what stands above it:
//!
//! | module | holds |
//! |---|---|
//! | [`units`] | photometric quantities as `f64` newtypes |
//! | [`photometry`] | luminous intensity distributions and the files that carry them |
//! | [`geometry`] | rooms, surfaces, meshes, configuration factors |
//! | [`scene`] | what is simulated: room, obstacles, luminaires, meters |
//! | [`simulator`] | exact solutions of a scene, each value with its error bound |
//! | [`calculators`] | the IESNA methods and closed forms |
//!
//! Invariants: SI and `f64` inside; degrees in files, radians in arithmetic; the simulator and the calculators
//! never import each other, so that each can bear witness against the other.

#![warn(missing_docs)]

pub mod calculators;
pub mod geometry;
pub mod photometry;
pub mod scene;
pub mod simulator;
pub mod units;

/// What a study that takes long takes in every test run, and what it takes where `LUXPROOF_NIGHTLY` is set, as `ci/nightly` does.
#[cfg(test)]
fn by_night<T>(night: T, day: T) -> T {
    if std::env::var_os("LUXPROOF_NIGHTLY").is_some() { night } else { day }
}
