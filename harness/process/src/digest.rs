//! Hashes as text.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

use sha2::{Digest, Sha256};

pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").ok();
        text
    })
}

/// SHA-256 of a file, by pieces: libraries may be larger than what memory is left.
pub fn of_file(path: &Path) -> io::Result<String> {
    copy(&mut File::open(path)?, &mut io::sink()).map(|(hash, _)| hash)
}

/// Bytes that are copied at a time; on the stack, since a bundle may have many small files.
const BUFFER_BYTES: usize = 1 << 14;

/// Copies bytes and tells their SHA-256 and how many they are.
pub fn copy(from: &mut impl Read, to: &mut impl Write) -> io::Result<(String, u64)> {
    let (mut hash, mut buffer, mut length) = (Sha256::new(), [0; BUFFER_BYTES], 0);
    loop {
        let n = from.read(&mut buffer)?;
        if n == 0 {
            return Ok((hexadecimal(&hash.finalize()), length));
        }
        hash.update(&buffer[..n]);
        to.write_all(&buffer[..n])?;
        length += n as u64;
    }
}
