//! Wavefront OBJ files as they are: vertices, faces and the names of their materials, each face with its line.
//!
//! Format: Wavefront, *Advanced Visualizer*, appendix B1. Normals, texture and smoothing are passed over.

use std::collections::{BTreeMap, HashMap};
use std::io::BufRead;
use std::ops::Range;

use glam::DVec3;

/// A file's polygons.
#[derive(Clone, Debug, Default)]
pub struct Obj {
    /// In the file's unit and axes.
    pub vertices: Vec<DVec3>,
    /// In the order of the file.
    pub faces: Vec<Face>,
    /// Names after `usemtl`, in the order of their first use.
    pub materials: Vec<String>,
    /// Names after `g` and `o`, in the order of their first use; before them stands [`NO_GROUP`].
    pub groups: Vec<String>,
    /// Names after `mtllib`, each with its line.
    pub libraries: Vec<(String, usize)>,
    /// What is no face: how many points, lines, curves and surfaces there are, and the line of the first.
    pub others: BTreeMap<&'static str, (usize, usize)>,
    corners: Vec<u32>,
}

/// A polygon of three corners or more.
#[derive(Clone, Debug)]
pub struct Face {
    corners: Range<usize>,
    /// An index into `materials`; `None` before the first `usemtl`.
    pub material: Option<usize>,
    /// An index into `groups`.
    pub group: usize,
    /// Counted from 1.
    pub line: usize,
}

/// The group of faces that are in none, or in one without a name.
pub const NO_GROUP: &str = "unnamed_object";

/// What is wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {message}")]
pub struct ObjFault {
    /// Counted from 1.
    pub line: usize,
    /// What is wrong there.
    pub message: String,
}

/// Elements that are no faces of polygons.
const OTHERS: [(&str, &str); 5] =
    [("p", "points"), ("l", "lines"), ("curv", "curves"), ("curv2", "curves"), ("surf", "free-form surfaces")];

impl Obj {
    /// Reads a file; names need not be UTF-8.
    pub fn read(reader: &mut impl BufRead) -> Result<Self, ObjFault> {
        let mut obj = Self::default();
        let (mut materials, mut groups) = (HashMap::new(), HashMap::new());
        let (mut material, mut group) = (None, place_of(NO_GROUP, &mut groups, &mut obj.groups));
        let (mut number, mut bytes) = (0, vec![]);
        loop {
            let first = number + 1;
            let fault = |message: String| ObjFault { line: first, message };
            let lines = logical(reader, &mut bytes).map_err(|e| fault(e.to_string()))?;
            if lines == 0 {
                break;
            }
            number += lines;
            let line = String::from_utf8_lossy(&bytes);
            let (keyword, rest) = line.trim().split_once(char::is_whitespace).unwrap_or((line.trim(), ""));
            match keyword {
                "v" => obj.vertices.push(vertex(rest).map_err(fault)?),
                "f" => obj.face(rest, Place { material, group, line: first }).map_err(fault)?,
                "usemtl" => material = Some(place_of(rest.trim(), &mut materials, &mut obj.materials)),
                "g" | "o" => {
                    let name = Some(rest.trim()).filter(|name| !name.is_empty()).unwrap_or(NO_GROUP);
                    group = place_of(name, &mut groups, &mut obj.groups);
                }
                "mtllib" => obj.libraries.push((rest.trim().to_owned(), first)),
                _ => {
                    if let Some((_, what)) = OTHERS.iter().find(|(word, _)| *word == keyword) {
                        obj.others.entry(what).or_insert((0, first)).0 += 1;
                    }
                }
            }
        }
        if let Some((fault, line)) = obj.faces.iter().find_map(|face| {
            let beyond = obj.corners_of(face).iter().find(|v| **v as usize >= obj.vertices.len())?;
            Some((format!("there is no vertex {}: the file has {}", beyond + 1, obj.vertices.len()), face.line))
        }) {
            return Err(ObjFault { line, message: fault });
        }
        Ok(obj)
    }

    /// Indices of a face's vertices.
    pub fn corners_of(&self, face: &Face) -> &[u32] {
        &self.corners[face.corners.clone()]
    }

    fn face(&mut self, rest: &str, Place { material, group, line }: Place) -> Result<(), String> {
        let start = self.corners.len();
        for word in rest.split_whitespace() {
            // A comment behind the corners, as some programs write.
            if word.starts_with('#') {
                break;
            }
            self.corners.push(corner(word, self.vertices.len())?);
        }
        let corners = start..self.corners.len();
        if corners.len() < 3 {
            return Err(format!("a face of {} corners", corners.len()));
        }
        self.faces.push(Face { corners, material, group, line });
        Ok(())
    }
}

/// Where a face stands.
struct Place {
    material: Option<usize>,
    group: usize,
    line: usize,
}

/// The place of a name among those that are known, to which it is added if it is new.
fn place_of(name: &str, known: &mut HashMap<String, usize>, names: &mut Vec<String>) -> usize {
    if let Some(place) = known.get(name) {
        return *place;
    }
    known.insert(name.to_owned(), names.len());
    names.push(name.to_owned());
    names.len() - 1
}

/// A Wavefront OBJ file of vertices and triangles that reads back as the same numbers, with a line about it.
pub fn write(about: &str, vertices: &[DVec3], triangles: &[[u32; 3]]) -> String {
    format!("# {about}\n{}{}", lines_of_vertices(vertices), lines_of_faces(triangles))
}

/// The same with triangles in groups, by name.
pub fn write_groups<'a>(
    about: &str,
    vertices: &[DVec3],
    groups: impl Iterator<Item = (&'a str, &'a [[u32; 3]])>,
) -> String {
    let mut text = format!("# {about}\n{}", lines_of_vertices(vertices));
    for (name, triangles) in groups {
        text += &format!("g {name}\n{}", lines_of_faces(triangles));
    }
    text
}

fn lines_of_vertices(vertices: &[DVec3]) -> String {
    vertices.iter().map(line_of_vertex).collect()
}

fn lines_of_faces(triangles: &[[u32; 3]]) -> String {
    triangles.iter().map(line_of_face).collect()
}

fn line_of_vertex(v: &DVec3) -> String {
    format!("v {} {} {}\n", v.x, v.y, v.z)
}

fn line_of_face([a, b, c]: &[u32; 3]) -> String {
    format!("f {} {} {}\n", a + 1, b + 1, c + 1)
}

/// Reads a line, and those that it goes on in after a `\`, without their ends; how many these are.
fn logical(reader: &mut impl BufRead, bytes: &mut Vec<u8>) -> std::io::Result<usize> {
    bytes.clear();
    let mut lines = 0;
    loop {
        if reader.read_until(b'\n', bytes)? == 0 {
            return Ok(lines);
        }
        lines += 1;
        while bytes.last().is_some_and(|b| b"\r\n".contains(b)) {
            bytes.pop();
        }
        match bytes.last_mut() {
            Some(last) if *last == b'\\' => *last = b' ',
            _ => return Ok(lines),
        }
    }
}

/// Three coordinates; a weight of 1 or a colour may follow.
fn vertex(rest: &str) -> Result<DVec3, String> {
    let mut numbers = [0.0; 7];
    let mut count = 0;
    for word in rest.split_whitespace().take_while(|word| !word.starts_with('#')) {
        let place = numbers.get_mut(count).ok_or("a vertex of more than seven numbers")?;
        *place = word.parse().map_err(|_| format!("`{}` is no number", shortened(word)))?;
        count += 1;
    }
    match count {
        ..=2 => Err(format!("a vertex of {count} coordinates")),
        4 if numbers[3] != 1.0 => Err(format!("a vertex of weight {}, which polygons have none of", numbers[3])),
        _ => Ok(DVec3::new(numbers[0], numbers[1], numbers[2])),
    }
}

/// The vertex of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 0; below 0 it counts from the last before it.
fn corner(word: &str, vertices: usize) -> Result<u32, String> {
    let none = || format!("`{}` names no vertex", shortened(word));
    let number: i64 = word.split('/').next().and_then(|first| first.parse().ok()).ok_or_else(none)?;
    let index = if number < 0 {
        i64::try_from(vertices).ok().and_then(|n| n.checked_add(number))
    } else {
        number.checked_sub(1)
    };
    index.and_then(|index| u32::try_from(index).ok()).filter(|index| *index < u32::MAX).ok_or_else(none)
}

/// So much of a word as a message holds.
fn shortened(word: &str) -> String {
    word.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &[u8]) -> Result<Obj, ObjFault> {
        Obj::read(&mut { text })
    }

    #[test]
    fn faces_know_their_material_and_line() {
        let obj = read(
            b"# M\xf6bel\nmtllib a b.mtl\nv 0 0 0 1\r\nv 1 0 0 .5 .5 .5\nv 1 1 0 # here\n\tv 0 1 0\nf 1 2 3\nusemtl dark oak\n\
              f 1/2/3 2//1 \\\n 3/4 -1 # there\nl 1 2\ng back wall\nusemtl red\nf -1 -2 -3\nusemtl dark oak\nf 1 2 3",
        )
        .unwrap();
        assert_eq!(obj.libraries, [("a b.mtl".to_owned(), 2)]);
        assert_eq!(obj.materials, ["dark oak", "red"]);
        let faces: Vec<_> = obj.faces.iter().map(|f| (obj.corners_of(f).to_vec(), f.material, f.line)).collect();
        assert_eq!(faces[1], (vec![0, 1, 2, 3], Some(0), 9));
        assert_eq!(faces[2], (vec![3, 2, 1], Some(1), 14));
        assert_eq!(obj.groups, [NO_GROUP, "back wall"]);
        assert_eq!(obj.faces.iter().map(|f| f.group).collect::<Vec<_>>(), [0, 0, 1, 1]);
        assert_eq!((faces[0].1, faces[3].1, faces.len()), (None, Some(0), 4));
        assert_eq!(obj.others["lines"], (1, 11));
    }

    #[test]
    fn errors_name_their_line() {
        for (text, line, says) in [
            ("v 0 0 0\nv 0 1\n", 2, "2 coordinates"),
            ("v 0 0 x\n", 1, "`x` is no number"),
            ("v 0 0 0 0.5\n", 1, "weight 0.5"),
            ("v 0 0 0 0 0 0 0 0\n", 1, "more than seven"),
            ("v 0 0 0\n\nf 1 1\n", 3, "2 corners"),
            ("v 0 0 0\nf 1 1 2\nv 1 1 1\nf 1 2 9\n", 4, "no vertex 9: the file has 2"),
            ("v 0 0 0\nf 1 0 1\n", 2, "`0` names no vertex"),
            ("v 0 0 0\nf 1 -2 1\n", 2, "`-2` names no vertex"),
            ("v 0 0 0\nf 1 99999999999999999999 1\n", 2, "names no vertex"),
            ("v 0 0 0\nf 1 9223372036854775807 1\n", 2, "names no vertex"),
            ("v 0 0 0\nf 1 -9223372036854775808 1\n", 2, "names no vertex"),
            ("f a/1 2 3\n", 1, "`a/1` names no vertex"),
        ] {
            let fault = read(text.as_bytes()).unwrap_err();
            assert!(fault.line == line && fault.message.contains(says), "{text:?}: {fault}");
        }
    }
}
