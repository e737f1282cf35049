//! What an engine may do on Linux (Landlock): read what the user may read, write below folders of its own alone, no TCP,
//! no signal to what it did not start.

use std::path::PathBuf;

use landlock::{
    ABI, Access, AccessFs, AccessNet, LandlockStatus, RestrictionStatus, Ruleset, RulesetAttr, RulesetCreatedAttr,
    RulesetError, RulesetStatus, Scope, path_beneath_rules,
};

/// What is asked for: an older kernel gives what it has of it.
const WANTED: ABI = ABI::V6;
/// The first version that keeps programs from the network.
const NETWORK: ABI = ABI::V4;

/// Devices that hold nothing.
const DEVICES: [&str; 2] = ["/dev/null", "/dev/zero"];

/// Confines the calling thread, and all that it starts from then on.
pub(super) fn enter(writable: &[PathBuf]) -> Result<RestrictionStatus, RulesetError> {
    let everything = AccessFs::from_all(WANTED);
    Ruleset::default()
        .handle_access(everything)?
        .handle_access(AccessNet::from_all(NETWORK))?
        .scope(Scope::from_all(WANTED))?
        .create()?
        .add_rules(path_beneath_rules(["/"], AccessFs::from_read(WANTED)))?
        .add_rules(path_beneath_rules(writable, everything))?
        .add_rules(path_beneath_rules(DEVICES, AccessFs::from_file(WANTED)))?
        .restrict_self()
}

/// What confines engines on this machine, in words; tried by a thread that ends.
pub(super) fn in_words() -> String {
    let tried = std::thread::spawn(|| enter(&[])).join();
    match tried {
        Ok(Ok(RestrictionStatus { ruleset: RulesetStatus::FullyEnforced, .. })) => {
            "on (Landlock): engines write below their own folders alone, and reach no network by TCP".to_owned()
        }
        Ok(Ok(RestrictionStatus { ruleset: RulesetStatus::PartiallyEnforced, landlock, .. })) => {
            format!("on in part: {}, and all of it needs Linux 6.12", version(landlock))
        }
        Ok(Ok(RestrictionStatus { landlock, .. })) => format!("off: {}", version(landlock)),
        Ok(Err(error)) => format!("off: {error}"),
        Err(_) => "off: it could not be tried".to_owned(),
    }
}

fn version(landlock: LandlockStatus) -> String {
    match landlock {
        LandlockStatus::NotImplemented => "this kernel has no Landlock, which came with Linux 5.13".to_owned(),
        LandlockStatus::NotEnabled => "this kernel was started without Landlock (`lsm=landlock,...`)".to_owned(),
        LandlockStatus::Available { effective_abi, .. } => {
            format!("this kernel has version {} of Landlock", effective_abi as i32)
        }
    }
}
