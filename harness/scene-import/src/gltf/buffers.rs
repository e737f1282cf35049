//! Bytes behind a glTF document: GLB containers, data URIs, files beside it; and the numbers in them.

use std::borrow::Cow;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::DVec3;

use super::document::{Accessor, Document};
use crate::raw::{MAX_TRIANGLES, Scene};
use luxproof_process::printable::{Quoted, quoted_path};
use luxproof_spec::SpecError;

const BROKEN: &str = "the file is broken: export it again";

/// The JSON of a file, and the binary chunk of a GLB.
pub(super) fn chunks<'a>(scene: &Scene<'_>, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>), SpecError> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let fault = |message: &str| scene.fault(None, message, BROKEN);
    let version = word_at(bytes, 4);
    if version != Some(2) {
        let help = "export it as glTF 2.0";
        return Err(scene.fault(None, format!("a GLB of version {}", version.unwrap_or(0)), help));
    }
    let whole = word_at(bytes, 8).map_or(0, |length| length as usize);
    if whole > bytes.len() {
        return Err(fault("it is shorter than its header says"));
    }
    let (mut at, mut json, mut binary) = (12, None, None);
    while at < whole {
        let (Some(length), Some(kind)) = (word_at(bytes, at), word_at(bytes, at + 4)) else {
            return Err(fault("a chunk is cut short"));
        };
        let end = at + 8 + length as usize;
        let chunk = bytes.get(at + 8..end).ok_or_else(|| fault("a chunk is longer than the file"))?;
        match kind.to_le_bytes() {
            [b'J', b'S', b'O', b'N'] if json.is_none() => json = Some(chunk),
            [b'B', b'I', b'N', 0] if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at = end;
    }
    Ok((json.ok_or_else(|| fault("it has no JSON chunk"))?, binary))
}

/// The little-endian 32-bit word at an offset.
fn word_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes)
}

/// The bytes of all buffers, each read once.
pub(super) struct Buffers<'a> {
    scene: &'a Scene<'a>,
    document: &'a Document,
    bytes: Vec<Cow<'a, [u8]>>,
}

impl<'a> Buffers<'a> {
    pub(super) fn of(
        scene: &'a Scene<'a>,
        document: &'a Document,
        binary: Option<&'a [u8]>,
    ) -> Result<Self, SpecError> {
        let mut bytes = vec![];
        // A file named a thousand times is a thousand times as large.
        let mut left = luxproof_process::files::MAX_BYTES as usize;
        for (k, buffer) in document.buffers.0.iter().enumerate() {
            let fault = |message: String, help: &str| scene.fault(None, format!("buffers[{k}]: {message}"), help);
            let read: Cow<'a, [u8]> = match (&buffer.uri, binary) {
                (Some(uri), _) => uri_bytes(scene, uri).map_err(|(why, help)| fault(why, help))?.into(),
                (None, Some(binary)) if k == 0 => binary.into(),
                (None, _) => return Err(fault("it names no file".to_owned(), BROKEN)),
            };
            if read.len() < buffer.byte_length {
                let message = format!("it has {} bytes, and `byteLength` is {}", read.len(), buffer.byte_length);
                return Err(fault(message, "its file is cut short: copy or export it again"));
            }
            left = left.checked_sub(read.len()).ok_or_else(|| fault("all buffers are too large".to_owned(), BROKEN))?;
            bytes.push(read);
        }
        Ok(Self { scene, document, bytes })
    }

    /// The points of an accessor, in the mesh's own frame.
    pub(super) fn points(&self, accessor: usize) -> Result<Vec<DVec3>, SpecError> {
        let of = self.accessor(accessor, &["VEC3"])?;
        let elements = self.elements(accessor, of, 3)?;
        let points: Vec<DVec3> =
            elements.map(|element| DVec3::from_array([0, 1, 2].map(|k| number(of, element, k)))).collect();
        match points.iter().position(|p| !p.is_finite()) {
            Some(k) => Err(self.fault(accessor, &format!("point {k} is not finite"))),
            None => Ok(points),
        }
    }

    /// The colours of an accessor for so many points: red, green, blue and opacity, 1 where it has none.
    pub(super) fn colours(&self, accessor: usize, points: usize) -> Result<Vec<[f64; 4]>, SpecError> {
        let of = self.accessor(accessor, &["VEC3", "VEC4"])?;
        if of.count != points {
            return Err(self.fault(accessor, &format!("{} colours for {points} points", of.count)));
        }
        let components = if of.shape == "VEC4" { 4 } else { 3 };
        let elements = self.elements(accessor, of, components)?;
        let colours =
            elements.map(|element| [0, 1, 2, 3].map(|k| if k < components { number(of, element, k) } else { 1.0 }));
        Ok(colours.collect())
    }

    /// The indices of an accessor, each below a number of points.
    pub(super) fn indices(&self, accessor: usize, points: usize) -> Result<Vec<u32>, SpecError> {
        let of = self.accessor(accessor, &["SCALAR"])?;
        let decode: fn(&[u8]) -> u32 = match of.component_type {
            5121 => |b| u32::from(b[0]),
            5123 => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
            5125 => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            other => return Err(self.fault(accessor, &format!("indices of component type {other}"))),
        };
        let indices: Vec<u32> = self.elements(accessor, of, 1)?.map(decode).collect();
        match indices.iter().find(|index| **index as usize >= points) {
            Some(index) => Err(self.fault(accessor, &format!("index {index} of {points} points"))),
            None => Ok(indices),
        }
    }

    fn fault(&self, accessor: usize, message: &str) -> SpecError {
        self.scene.fault(None, format!("accessors[{accessor}]: {message}"), BROKEN)
    }

    fn accessor(&self, k: usize, shapes: &[&str]) -> Result<&'a Accessor, SpecError> {
        let of = self.document.accessors.0.get(k).ok_or_else(|| self.fault(k, "there is none"))?;
        if of.sparse.is_some() {
            let help = "export it without sparse accessors";
            return Err(self.scene.fault(None, format!("accessors[{k}] is sparse"), help));
        }
        // A triangle has three corners, and no more are read.
        if of.count > 3 * MAX_TRIANGLES {
            let help = "import a part of the scene, or have its meshes simplified first";
            return Err(self.scene.fault(None, format!("accessors[{k}]: {} elements are too many", of.count), help));
        }
        if shapes.contains(&of.shape.as_str()) {
            return Ok(of);
        }
        Err(self.fault(k, &format!("it is not {}", shapes.join(" or "))))
    }

    /// The bytes of each element, of so many components.
    fn elements(&self, k: usize, of: &Accessor, components: usize) -> Result<impl Iterator<Item = &[u8]>, SpecError> {
        let fault = |message: &str| self.fault(k, message);
        let size = component(of.component_type).ok_or_else(|| fault("its component type is unknown"))? * components;
        let views = &self.document.buffer_views.0;
        let view = of.buffer_view.and_then(|view| views.get(view)).ok_or_else(|| fault("it has no buffer view"))?;
        if view.extensions.as_ref().is_some_and(|all| all.meshopt.is_some()) {
            let help = "export it without compression, or run `gltf-transform copy` on it";
            return Err(self.scene.fault(
                None,
                format!("accessors[{k}] is compressed (EXT_meshopt_compression)"),
                help,
            ));
        }
        let buffer = self.bytes.get(view.buffer).ok_or_else(|| fault("its buffer is not there"))?;
        let end = view.byte_offset.checked_add(view.byte_length);
        let bytes = end.and_then(|end| buffer.get(view.byte_offset..end));
        let bytes = bytes.ok_or_else(|| fault("its buffer view reaches out of its buffer"))?;
        let stride = view.byte_stride.unwrap_or(size);
        if stride < size {
            return Err(fault("its elements overlap"));
        }
        // The last element need not be padded.
        let last = of.count.saturating_sub(1).checked_mul(stride).and_then(|at| at.checked_add(of.byte_offset));
        let end = last.and_then(|at| at.checked_add(if of.count == 0 { 0 } else { size }));
        let is_within = end.is_some_and(|end| end <= bytes.len());
        let first = of.byte_offset;
        if !is_within {
            return Err(fault("it reaches out of its buffer view"));
        }
        Ok((0..of.count).map(move |n| &bytes[first + n * stride..first + n * stride + size]))
    }
}

/// Of a component, in bytes.
fn component(kind: u32) -> Option<usize> {
    match kind {
        5120 | 5121 => Some(1),
        5122 | 5123 => Some(2),
        5125 | 5126 => Some(4),
        _ => None,
    }
}

/// The `k`-th number of an element.
fn number(of: &Accessor, element: &[u8], k: usize) -> f64 {
    let b = &element[k * component(of.component_type).unwrap_or(4)..];
    match of.component_type {
        5120 => unit(f64::from(b[0].cast_signed()), 127.0, of.normalized),
        5121 => unit(f64::from(b[0]), 255.0, of.normalized),
        5122 => unit(f64::from(i16::from_le_bytes([b[0], b[1]])), 32767.0, of.normalized),
        5123 => unit(f64::from(u16::from_le_bytes([b[0], b[1]])), 65535.0, of.normalized),
        _ => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
    }
}

/// An integer of `KHR_mesh_quantization`, as itself or as a part of the largest.
fn unit(value: f64, largest: f64, is_unit: bool) -> f64 {
    if is_unit { (value / largest).max(-1.0) } else { value }
}

/// The bytes of a data URI, or of a file beside the scene; or why not, and what to do.
pub(super) fn uri_bytes(scene: &Scene<'_>, uri: &str) -> Result<Vec<u8>, (String, &'static str)> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, encoded) = data.split_once(";base64,").ok_or(("a data URI that is not base64".to_owned(), BROKEN))?;
        return STANDARD.decode(encoded).map_err(|e| (format!("its data URI: {e}"), BROKEN));
    }
    if uri.contains("://") {
        return Err((format!("{} is on a network", Quoted(uri)), "fetch it, and name the file"));
    }
    let path = scene.path_of(&unescaped(uri));
    scene.read(&path).map_err(|e| (format!("{} cannot be read: {e}", quoted_path(&path)), "give it beside the .gltf"))
}

/// A relative URI as a file's name: `%20` is a blank.
fn unescaped(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let (mut name, mut k) = (vec![], 0);
    while k < bytes.len() {
        let escaped = bytes.get(k + 1..k + 3).filter(|_| bytes[k] == b'%');
        let byte = escaped.and_then(|two| u8::from_str_radix(std::str::from_utf8(two).ok()?, 16).ok());
        name.push(byte.unwrap_or(bytes[k]));
        k += if byte.is_some() { 3 } else { 1 };
    }
    String::from_utf8_lossy(&name).into_owned()
}
