#![no_main]

use arbitrary::Unstructured;

#[path = "../targets.rs"]
#[allow(dead_code)]
mod targets;
#[path = "../valid_files.rs"]
mod valid_files;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut choices = Unstructured::new(bytes);
    let Ok((name, generate)) = choices.choose(&valid_files::ALL).copied() else { return };
    if let Ok(file) = generate(&mut choices)
        && let Some((_, target)) = targets::ALL.into_iter().find(|(of, _)| *of == name)
    {
        target(&file);
    }
});
