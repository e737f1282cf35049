//! Images that renderers wrote, read with OpenImageIO in a process of its own.

use std::path::Path;

use super::{EngineError, Workbench};
use crate::record::EngineName;

const DRIVER: &str = include_str!("../../drivers/read_image.py");

/// The pixels of an RGB image, row by row; integer formats as 0..=1.
pub(super) fn read_rgb(engine: &EngineName, workbench: &Workbench, path: &Path) -> Result<Vec<[f64; 3]>, EngineError> {
    let output = |what: String| EngineError::Output { engine: engine.clone(), what };
    let python = workbench.site.python().ok_or_else(|| {
        output("OpenImageIO is not there to read its image; run `luxproof engines install`".to_owned())
    })?;
    let invocation = workbench.invoke(python).args(["-I".as_ref(), "-".as_ref(), path.as_os_str()]);
    let done = invocation.stdin(DRIVER.as_bytes().to_vec()).run()?;
    pixels(&done.stdout).map_err(|what| output(format!("OpenImageIO {what} of {}", path.display())))
}

fn pixels(bytes: &[u8]) -> Result<Vec<[f64; 3]>, String> {
    let end = bytes.iter().position(|b| *b == b'\n').ok_or("gave no header")?;
    let header = std::str::from_utf8(&bytes[..end]).map_err(|_| "gave no text header")?;
    let sizes: Vec<usize> = header.split_whitespace().map_while(|w| w.parse().ok()).collect();
    let &[width, height, 3] = sizes.as_slice() else {
        return Err(format!("gave the header `{header}`, not three channels,"));
    };
    let (data, wanted) = (&bytes[end + 1..], width.saturating_mul(height).saturating_mul(24));
    if data.len() != wanted {
        return Err(format!("gave {} bytes where {wanted} belong to the {width} x {height} pixels", data.len()));
    }
    let value = |b: &[u8], k: usize| f64::from_le_bytes(std::array::from_fn(|i| b[8 * k + i]));
    Ok(data.chunks_exact(24).map(|b| [value(b, 0), value(b, 1), value(b, 2)]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engines::{Site, fixtures};

    #[test]
    fn a_sixteen_bit_pixmap_is_read_to_the_last_step_and_a_short_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let workbench = fixtures::workbench(Site::of_user().unwrap(), folder.path());
        let path = folder.path().join("two.ppm");
        let mut bytes = b"P6\n2 1\n65535\n".to_vec();
        bytes.extend([0x00, 0x00, 0xff, 0xff, 0x80, 0x00, 0x00, 0x01, 0x12, 0x34, 0xff, 0xfe]);
        std::fs::write(&path, &bytes).unwrap();
        let read = read_rgb(&EngineName::new("povray"), &workbench, &path).unwrap();
        let step = |n: u16| f64::from(n) / 65535.0;
        assert_eq!(read, [[0.0, 1.0, step(0x8000)], [step(1), step(0x1234), step(0xfffe)]]);
        std::fs::write(&path, &bytes[..bytes.len() - 3]).unwrap();
        assert!(read_rgb(&EngineName::new("povray"), &workbench, &path).is_err());
    }

    #[test]
    fn what_is_not_an_rgb_image_is_refused() {
        assert!(pixels(b"").is_err());
        assert!(pixels(b"1 1 1\n01234567").is_err());
        assert!(pixels(b"1 1 3\n0123").is_err());
        assert!(pixels(b"18446744073709551615 2 3\n").is_err());
    }
}
