//! Any bytes are a TM-33 file or are refused with a place; what was read can be written as LM-63.

#![no_main]

use libfuzzer_sys::fuzz_target;
use luminaire::photometry::{lm63, tm33};

fuzz_target!(|bytes: &[u8]| {
    match tm33::parse(bytes) {
        Ok(read) => {
            assert!(read.distribution.flux().value() >= 0.0);
            let written = lm63::write_2019(&read);
            let again = lm63::parse(written.text.as_bytes()).expect("a written file is legal");
            assert_eq!(again.distribution, read.distribution);
        }
        Err(error) => assert!(error.line >= 1 && error.column >= 1),
    }
});
