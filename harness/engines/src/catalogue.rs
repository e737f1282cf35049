//! The engines that everybody has, one line each.

use std::borrow::{Borrow, Cow};

use super::contract::{Engine, Entry};
use super::{cycles, iesna, luxcore, mitsuba, povray, radiance, simulator, web};
use luxproof_model::{EngineName, Release, family};

/// In the order of reports: our own witnesses first.
pub const ALL: &[&Entry] = &[
    &simulator::ENTRY,
    &iesna::ENTRY,
    &mitsuba::ENTRY,
    &radiance::ENTRY,
    &povray::ENTRY,
    &cycles::ENTRY,
    &luxcore::ENTRY,
    &web::THREE,
    &web::BABYLON,
    &web::THREE_GPU_PATHTRACER,
];

pub fn all() -> Vec<Box<dyn Engine>> {
    ALL.iter().map(|entry| entry.engine()).collect()
}

/// What an engine is, or the one of which it is a release.
pub fn entry(name: &str) -> Option<&'static Entry> {
    ALL.iter().copied().find(|entry| entry.name == *family(name))
}

/// The engine that a name looks like without being its own: it differs by case, by signs between letters, or by letters of the
/// same look (`Mitsuba`, `mitsuba_`, `m1tsuba`, `rnitsuba`).
pub fn look_alike(name: &str) -> Option<&'static Entry> {
    let (drawn, is_own) = (drawn(family(name)), entry(name).is_some());
    ALL.iter().copied().find(|entry| !is_own && self::drawn(&entry.name) == drawn)
}

/// A name as a reader sees it in haste: small letters and digits, one for all that look the same.
fn drawn(name: &str) -> String {
    let letters = name.chars().flat_map(char::to_lowercase).filter(|c| c.is_alphanumeric());
    let plain: String = letters
        .map(|c| match c {
            '0' => 'o',
            '1' | 'i' => 'l',
            '3' => 'e',
            '4' => 'a',
            '5' => 's',
            '8' => 'b',
            c => c,
        })
        .collect();
    plain.replace("rn", "m").replace("vv", "w")
}

/// Whether an engine takes part, and is installed, only where it is named; releases do.
pub fn is_on_request(name: &str) -> bool {
    entry(name).is_some_and(|entry| entry.is_on_request || entry.name != *name)
}

/// Where an engine stands among the others in reports: releases behind the engine that they are of, oldest first. Programs of the
/// user's come first.
pub fn place(name: &EngineName) -> (Option<usize>, Option<Release>) {
    (ALL.iter().position(|entry| entry.name == *name.family()), name.release())
}

/// Whether an engine is among those that are named; where none is, whether it takes part all the same.
pub fn is_chosen(name: &EngineName, named: &[impl Borrow<str>]) -> bool {
    if named.is_empty() { !is_on_request(name.as_str()) } else { named.iter().any(|n| name.as_str() == n.borrow()) }
}

/// An engine as its makers write it, with its release where that is named; one of the user's by its name.
pub fn display_name(name: &str) -> Cow<'_, str> {
    let Some(entry) = entry(name) else { return name.into() };
    match name.split_once('@') {
        Some((_, release)) => format!("{} {release}", entry.display_name).into(),
        None => entry.display_name.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_what_their_engines_say_of_themselves() {
        for entry in ALL {
            let engine = (entry.make)();
            assert_eq!(engine.name(), entry.name);
            let key = entry.fits_coordinates;
            assert!(key.is_none_or(|key| engine.settings().iter().any(|k| k.key == key)), "{}", entry.name);
        }
        let reported = ["povray", "mine", "mitsuba@3.5.2", "mine@2"].map(display_name);
        assert_eq!(reported, ["POV-Ray", "mine", "Mitsuba 3.5.2", "mine@2"]);
    }

    #[test]
    fn names_that_a_reader_takes_for_an_engine_are_found_and_others_are_not() {
        for name in ["Mitsuba", "mitsuba ", "m1tsuba", "rnitsuba", "mitsuba\u{200b}", "POV-Ray", "s1mulator@1"] {
            assert!(look_alike(name).is_some(), "{name}");
        }
        for name in ["mitsuba", "mitsuba@3.5.2", "mitsuba-2016", "iray", "lux meter"] {
            assert!(look_alike(name).is_none(), "{name}");
        }
    }
}
