//! Any bytes are a EULUMDAT file or are refused with a place; what was read survives being written.

#![no_main]

use libfuzzer_sys::fuzz_target;
use luminaire::photometry::eulumdat;

fuzz_target!(|bytes: &[u8]| {
    match eulumdat::parse(bytes) {
        Ok(read) => {
            assert!(read.distribution.flux().value() >= 0.0);
            let written = eulumdat::write(&read);
            let again = eulumdat::parse(written.text.as_bytes()).expect("a written file is legal");
            // Planes that are no mirror images of each other cannot be listed again; that must be said.
            let same = again.distribution == read.distribution;
            assert!(same || !written.losses.is_empty());
            assert_eq!(again.distribution.gamma_deg(), read.distribution.gamma_deg());
        }
        Err(error) => assert!(error.line >= 1 && error.column >= 1),
    }
});
