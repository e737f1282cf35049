//! Any bytes are an LM-63 file or are refused with a place; what was read survives being written.

#![no_main]

use libfuzzer_sys::fuzz_target;
use luminaire::photometry::lm63;

fuzz_target!(|bytes: &[u8]| {
    match lm63::parse_with(bytes, |_| Ok(b"1 2 0 90 1 .9".to_vec())) {
        Ok(read) => {
            assert!(read.distribution.flux().value() >= 0.0);
            let written = lm63::write_2019(&read);
            let again = lm63::parse(written.text.as_bytes()).expect("a written file is legal");
            assert_eq!(again.distribution, read.distribution);
            assert_eq!(again.lamp_lumens, read.lamp_lumens);
        }
        Err(error) => assert!(error.line >= 1 && error.column >= 1),
    }
});
