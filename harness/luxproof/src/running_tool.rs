//! Which luxproof this is, as `build.rs` found its sources.

use luxproof_model::Tool;

/// The running program.
pub fn running_tool() -> Tool {
    let commit = Some(env!("LUXPROOF_COMMIT")).filter(|commit| !commit.is_empty());
    Tool {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        commit: commit.map(str::to_owned),
        dirty: commit.map(|_| env!("LUXPROOF_DIRTY") == "true"),
    }
}
