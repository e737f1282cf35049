//! USD scenes as text (.usda): the meshes of all prims where their transforms place them, and the lights of `UsdLux`.
//!
//! One layer is read, without composition: what takes in other layers or prims is refused with the command that flattens
//! it. Source: Pixar, *`OpenUSD`*, `UsdGeom`, `UsdShade` and `UsdLux`.

mod layer;
mod lights;
mod materials;
mod transforms;
mod words;

use glam::{DMat4, DVec3};

use super::Up;
use super::raw::{Kind, NO_MATERIAL, Primaries, Raw, Scene};
use luxproof_process::printable::Quoted;
use luxproof_spec::SpecError;

use layer::{Layer, Prim};
use materials::{Binding, Materials};

/// Decimals of 32-bit floats, as exporters write points.
const PRECISION: f64 = 1e-6;
/// What a unit is where a layer does not say, in metres.
const DEFAULT_UNIT_M: f64 = 0.01;

const FLATTEN: &str = "write it as one layer of text: `usdcat --flatten scene.usd -o flat.usda`";

const BROKEN: &str = "the file is broken: export it again";

/// Shapes that are no meshes, and what becomes of them.
const OTHER_SHAPES: [(&str, &str); 11] = [
    ("Sphere", "spheres (export them as meshes)"),
    ("Cylinder", "cylinders (export them as meshes)"),
    ("Cylinder_1", "cylinders (export them as meshes)"),
    ("Cone", "cones (export them as meshes)"),
    ("Capsule", "capsules (export them as meshes)"),
    ("Capsule_1", "capsules (export them as meshes)"),
    ("Plane", "planes (export them as meshes)"),
    ("BasisCurves", "curves"),
    ("NurbsPatch", "curved patches (export them as meshes)"),
    ("Points", "points"),
    ("Volume", "volumes"),
];

/// Reads a scene of units as long as it says, or as the user says.
pub(super) fn read<'a>(scene: &'a Scene<'a>, given_unit_m: Option<f64>) -> Result<Raw<'a>, SpecError> {
    let bytes = scene.bytes()?;
    let layer = Layer::parse(scene, text_of(scene, &bytes)?)?;
    let mut raw = Raw::new(scene, PRECISION, Primaries::Rec709);
    let unit_m = given_unit_m.or(layer.meters_per_unit).unwrap_or(DEFAULT_UNIT_M);
    if !(unit_m.is_finite() && unit_m > 0.0) {
        return Err(scene.fault(None, "metersPerUnit is no length", "correct it, such as `metersPerUnit = 1`"));
    }
    raw.unit_m = Some(unit_m);
    raw.up = Some(layer.up.unwrap_or(Up::Y));
    let mut reader = Reader { raw, layer: &layer, materials: Materials::default(), unit_m };
    reader.prims()?;
    Ok(reader.raw)
}

/// The text of a layer; other forms of USD are refused.
fn text_of<'b>(scene: &Scene<'_>, bytes: &'b [u8]) -> Result<&'b str, SpecError> {
    let message = if bytes.starts_with(b"PXR-USDC") {
        "this is a binary layer (usdc), and only text (usda) is read"
    } else if bytes.starts_with(b"PK\x03\x04") {
        "this is a package (usdz), and only text (usda) is read"
    } else if !bytes.starts_with(b"#usda") {
        "this is no usda: its first line is not `#usda 1.0`"
    } else {
        let text = std::str::from_utf8(bytes);
        return text.map_err(|_| scene.fault(None, "this is no text in UTF-8", FLATTEN));
    };
    Err(scene.fault(None, message, FLATTEN))
}

/// What holds for a prim and those below it.
#[derive(Clone, Copy, Debug)]
struct State {
    to_world: DMat4,
    /// Whether it is defined, active and drawn.
    is_there: bool,
    binding: Option<Binding>,
}

const ROOT: State = State { to_world: DMat4::IDENTITY, is_there: true, binding: None };

struct Reader<'s, 'a> {
    raw: Raw<'s>,
    layer: &'a Layer,
    materials: Materials,
    unit_m: f64,
}

impl<'a> Reader<'_, 'a> {
    /// Walks all prims; each stands after the one above it.
    fn prims(&mut self) -> Result<(), SpecError> {
        let mut states: Vec<State> = Vec::with_capacity(self.layer.prims.len());
        for (k, prim) in self.layer.prims.iter().enumerate() {
            let above = prim.parent.map_or(ROOT, |parent| states[parent]);
            let state = self.state(prim, above)?;
            if state.is_there {
                self.prim(k, prim, &state)?;
            }
            states.push(state);
        }
        Ok(())
    }

    fn state(&mut self, prim: &Prim, above: State) -> Result<State, SpecError> {
        if !above.is_there || !prim.is_there {
            return Ok(State { is_there: false, ..above });
        }
        let hidden = [
            (prim.text("visibility") == Some("invisible"), "prims that are invisible"),
            (matches!(prim.text("purpose"), Some("proxy" | "guide")), "prims that are proxies or guides"),
        ];
        if let Some((_, what)) = hidden.into_iter().find(|(is_hidden, _)| *is_hidden) {
            self.raw.leave_out(what, 1, Some(prim.line));
            return Ok(State { is_there: false, ..above });
        }
        let to_world = transforms::to_world(prim, &above.to_world).map_err(|why| {
            self.fault(prim, &format!("its transform: {why}"), "write its xformOps with plain values")
        })?;
        let own = prim.text("material:binding").map(|path| self.materials.bind(&mut self.raw, self.layer, path));
        Ok(State { to_world, is_there: true, binding: own.transpose()?.or(above.binding) })
    }

    fn prim(&mut self, k: usize, prim: &'a Prim, state: &State) -> Result<(), SpecError> {
        match prim.kind.as_str() {
            "Mesh" => self.mesh(k, prim, state),
            "Cube" => self.cube(prim, state),
            "PointInstancer" => Err(self.fault(prim, "it draws others many times", "export its instances as meshes")),
            kind => {
                let other = OTHER_SHAPES.iter().find(|(name, _)| *name == kind);
                if let Some((_, what)) = other {
                    self.raw.leave_out(what, 1, Some(prim.line));
                    return Ok(());
                }
                self.light(prim, &state.to_world)
            }
        }
    }

    fn cube(&mut self, prim: &Prim, state: &State) -> Result<(), SpecError> {
        let half = 0.5 * prim.number("size").unwrap_or(2.0);
        let corners: Vec<DVec3> = (0..8_u32)
            .map(|k| DVec3::from_array([0, 1, 2].map(|axis| if k >> axis & 1 == 1 { half } else { -half })))
            .map(|corner| state.to_world.transform_point3(corner))
            .collect();
        let material = self.material(prim, state.binding);
        for face in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
            let corners = face.map(|corner: usize| corners[corner]);
            self.raw.polygon(material, Some(prim.line), &corners)?;
        }
        Ok(())
    }

    fn mesh(&mut self, place: usize, prim: &Prim, state: &State) -> Result<(), SpecError> {
        let numbers = prim.numbers("points").unwrap_or_default();
        let counts = prim.numbers("faceVertexCounts").unwrap_or_default();
        let indices = prim.numbers("faceVertexIndices").unwrap_or_default();
        if !numbers.len().is_multiple_of(3) {
            return Err(self.fault(prim, "its points have not three coordinates each", BROKEN));
        }
        let points: Vec<DVec3> =
            numbers.chunks_exact(3).map(|p| state.to_world.transform_point3(DVec3::new(p[0], p[1], p[2]))).collect();
        if points.iter().any(|point| !point.is_finite()) {
            return Err(self.fault(prim, "a point of it is not finite", BROKEN));
        }
        let holes = prim.numbers("holeIndices").unwrap_or_default();
        if !holes.is_empty() {
            return Err(self.fault(prim, "it has holes (holeIndices)", "leave these faces out of the mesh"));
        }
        if prim.text("subdivisionScheme").unwrap_or("catmullClark") != "none" {
            self.raw.note("subdivision surfaces are taken as their control meshes (subdivisionScheme)");
        }
        let mut materials = vec![self.material(prim, state.binding); counts.len()];
        self.subsets(place, &mut materials)?;
        let (mut first, mut corners) = (0_usize, vec![]);
        for (count, material) in counts.iter().zip(materials) {
            let end = whole(*count).and_then(|count| first.checked_add(count)).filter(|end| *end <= indices.len());
            let Some(end) = end else {
                return Err(self.fault(prim, "its faces have more corners than it lists", BROKEN));
            };
            corners.clear();
            for index in &indices[first..end] {
                let point = whole(*index).and_then(|index| points.get(index));
                let Some(point) = point else {
                    return Err(self.fault(prim, "a corner of it is none of its points", BROKEN));
                };
                corners.push(*point);
            }
            first = end;
            if corners.len() < 3 {
                return Err(self.fault(prim, "a face of it has fewer than three corners", "leave it out"));
            }
            self.raw.polygon(material, Some(prim.line), &corners)?;
        }
        Ok(())
    }

    /// Gives the faces of a mesh the materials of its subsets, which stand below it.
    fn subsets(&mut self, mesh: usize, materials: &mut [u32]) -> Result<(), SpecError> {
        let below = self.layer.prims.iter().skip(mesh + 1).take_while(|prim| prim.parent >= Some(mesh));
        for subset in below.filter(|prim| prim.kind == "GeomSubset" && prim.parent == Some(mesh) && prim.is_there) {
            let Some(path) = subset.text("material:binding") else { continue };
            let binding = self.materials.bind(&mut self.raw, self.layer, path)?;
            for index in subset.numbers("indices").unwrap_or_default() {
                let face = whole(*index).and_then(|index| materials.get_mut(index));
                let Some(face) = face else {
                    return Err(self.fault(subset, "it names a face that its mesh has not", BROKEN));
                };
                *face = binding.material;
            }
        }
        Ok(())
    }

    /// The material of a shape: what it is bound to, or its own colour.
    fn material(&mut self, prim: &Prim, binding: Option<Binding>) -> u32 {
        if let Some(binding) = binding {
            return binding.material;
        }
        match prim.numbers("primvars:displayColor") {
            Some([red, green, blue]) => self.materials.of_colour(&mut self.raw, [*red, *green, *blue], prim.line),
            Some(_) => {
                let what = Kind::Other("of colours that vary over its faces (displayColor)".to_owned());
                self.materials.named(&mut self.raw, "displayColor", what, Some(prim.line))
            }
            None => self.materials.named(&mut self.raw, NO_MATERIAL, Kind::Unknown, None),
        }
    }

    fn fault(&self, prim: &Prim, message: &str, help: &str) -> SpecError {
        self.raw.scene.fault(Some(prim.line), format!("`{}`: {message}", Quoted(&prim.name)), help)
    }
}

/// A whole number.
fn whole(number: f64) -> Option<usize> {
    (number >= 0.0 && number.fract() == 0.0 && number < 1e15).then_some(number as usize)
}
