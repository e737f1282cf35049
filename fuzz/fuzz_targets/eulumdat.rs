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
            assert_eq!(again.distribution.c_deg(), read.distribution.c_deg());
            assert_eq!(again.distribution.gamma_deg(), read.distribution.gamma_deg());
        }
        Err(error) => assert!(error.line >= 1 && error.column >= 1),
    }
});
