//! Images that renderers write: pixmaps (Netpbm's `P6`). They have their numbers behind a text header, so no program has to read them.

use std::path::Path;

use super::EngineError;
use luxproof_model::EngineName;

/// Reads the pixels of an RGB image, row by row, as values from 0 to 1.
pub(super) fn read_rgb(engine: &EngineName, path: &Path) -> Result<Vec<[f64; 3]>, EngineError> {
    let bytes = std::fs::read(path).map_err(|source| EngineError::io(path, source))?;
    pixels(&bytes).map_err(|what| EngineError::output(engine.clone(), format!("its image {} {what}", path.display())))
}

/// Parses a pixmap.
fn pixels(bytes: &[u8]) -> Result<Vec<[f64; 3]>, String> {
    let mut rest = bytes.strip_prefix(b"P6").ok_or("is no pixmap")?;
    let [width, height, full] = [(); 3].map(|()| number(&mut rest));
    let (Some(width), Some(height), Some(full @ 1..=65535)) = (width, height, full) else {
        return Err("has no header of a pixmap".to_owned());
    };
    // One white space ends the header. The numbers follow, with the high byte first if they have two.
    let data = rest.get(1..).unwrap_or_default();
    let bytes_each = if full < 256 { 1 } else { 2 };
    let wanted = width.saturating_mul(height).saturating_mul(3 * bytes_each);
    if data.len() != wanted {
        return Err(format!("has {} bytes where {wanted} belong to its {width} x {height} pixels", data.len()));
    }
    let pixels = data.chunks_exact(3 * bytes_each);
    let rgb =
        |pixel: &[u8]| std::array::from_fn(|k| integer(&pixel[k * bytes_each..(k + 1) * bytes_each]) / full as f64);
    Ok(pixels.map(rgb).collect())
}

/// Returns the value of bytes, the highest first.
fn integer(bytes: &[u8]) -> f64 {
    bytes.iter().fold(0.0, |high, low| 256.0 * high + f64::from(*low))
}

/// Reads the next number of a header, behind white space and comments.
fn number(rest: &mut &[u8]) -> Option<usize> {
    loop {
        *rest = rest.trim_ascii_start();
        let Some(comment) = rest.strip_prefix(b"#") else { break };
        *rest = &comment[comment.iter().position(|b| *b == b'\n')?..];
    }
    let digits = rest.iter().take_while(|b| b.is_ascii_digit()).count();
    let (number, behind) = rest.split_at(digits);
    *rest = behind;
    std::str::from_utf8(number).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixmaps_are_read_to_the_last_step() {
        let mut bytes = b"P6\n# by hand\n2 1 # wide\n65535\n".to_vec();
        bytes.extend([0x00, 0x00, 0xff, 0xff, 0x80, 0x00, 0x00, 0x01, 0x12, 0x34, 0xff, 0xfe]);
        let step = |n: u16| f64::from(n) / 65535.0;
        assert_eq!(pixels(&bytes).unwrap(), [[0.0, 1.0, step(0x8000)], [step(1), step(0x1234), step(0xfffe)]]);
        // The first number may look like white space.
        assert_eq!(pixels(b"P6 1 1 255\n\n\x33\xff").unwrap(), [[10.0 / 255.0, 0.2, 1.0]]);
    }

    #[test]
    fn what_is_no_whole_pixmap_is_refused() {
        let sound = b"P6\n2 1\n255\n123456";
        assert!(pixels(sound).is_ok());
        for cut in 0..sound.len() {
            assert!(pixels(&sound[..cut]).is_err(), "{cut}");
        }
        let others: [&[u8]; 7] = [
            b"P3 1 1 255\n1 2 3",
            b"P6 1 1 255\n1234",
            b"P6 1 1 0\n123",
            b"P6 1 1 65536\n123456",
            b"P6 -1 1 255\n123",
            b"P6 18446744073709551615 18446744073709551615 255\n123",
            b"P6 # endless",
        ];
        for bytes in others {
            assert!(pixels(bytes).is_err(), "{bytes:?}");
        }
        let error = read_rgb(&EngineName::new("povray"), Path::new("/nowhere.ppm")).unwrap_err().to_string();
        assert!(error.contains("nowhere.ppm"), "{error}");
    }
}
