//! Direct illuminance from points and from luminous openings, behind boxes that hide some of them.
//!
//! A part dA with normal n of an opening of projected area P(w) has the intensity I(w) max(0, n·w) dA / P(w) towards
//! w, so that all parts together have the intensity of the table; the body of a luminaire blocks no light. A flat
//! opening has I(w) dA / A on both sides. Where the table is a cosine at every node, the opening has one luminance and
//! Lambert's polygon formula holds but for the interpolation, which counts as an error.

use std::f64::consts::PI;

use glam::DVec3;

use super::quadrature::Gauss;
use super::visibility::{Occluder, Polygon, candidates, clip, visible_pieces};
use super::{Bounded, direct};
use crate::geometry::configuration_factor::element_to_polygon;
use crate::photometry::{LuminousIntensityDistribution, LuminousOpening, Symmetry};
use crate::scene::{Luminaire, LuminaireModel, Meter};

/// Relative deviation of a table from a cosine that passes for rounding of its figures; it counts as an error.
const COSINE_ROUNDING: f64 = 1e-5;

/// Halvings of a triangle after which an integral stops improving.
const DEEPEST: u32 = 9;

/// A luminaire as the deterministic solvers see it.
#[derive(Clone, Debug)]
pub(super) struct Emitter {
    luminaire: Luminaire,
    faces: Vec<Face>,
    /// Extents of the opening, for its projected area.
    extent_m: DVec3,
    lambertian: Option<Lambertian>,
}

/// A flat part of an opening, in the world; an outward normal, or none where both sides shine.
#[derive(Clone, Debug)]
struct Face {
    polygon: Polygon,
    outward: Option<DVec3>,
}

/// One luminance on the lower side of a flat opening, and the largest relative error of saying so: of interpolation and of rounded figures.
#[derive(Clone, Copy, Debug)]
struct Lambertian {
    exitance: f64,
    interpolation: f64,
}

impl Emitter {
    /// `None` where the opening is round: its outline is no polygon.
    pub(super) fn new(luminaire: &Luminaire) -> Option<Self> {
        let luminaire = luminaire.clone();
        let point = Self { luminaire: luminaire.clone(), faces: vec![], extent_m: DVec3::ZERO, lambertian: None };
        if luminaire.model == LuminaireModel::Point {
            return Some(point);
        }
        let extent_m = match luminaire.photometry.opening {
            LuminousOpening::Point => return Some(point),
            LuminousOpening::Box { x_m, y_m, height_m } => DVec3::new(x_m, y_m, height_m),
            _ => return None,
        };
        let flat = extent_m.min_element() == 0.0;
        if flat && (extent_m.z != 0.0 || extent_m.x * extent_m.y == 0.0) {
            return None;
        }
        let own = Occluder { min_m: -0.5 * extent_m, max_m: 0.5 * extent_m };
        let to_world = |p: DVec3| luminaire.position_m + luminaire.orientation * p;
        let face = |(axis, far): (usize, bool)| Face {
            polygon: own.face(axis, far).map(to_world).to_vec(),
            outward: (!flat).then(|| luminaire.orientation * DVec3::AXES[axis] * if far { 1.0 } else { -1.0 }),
        };
        let sides = [(2, false), (2, true), (0, false), (0, true), (1, false), (1, true)];
        let faces = sides.into_iter().take(if flat { 1 } else { 6 }).map(face).collect();
        let lambertian = if flat { lambertian(&luminaire, extent_m.x * extent_m.y) } else { None };
        Some(Self { faces, extent_m, lambertian, ..point })
    }

    /// Illuminance in lux at an element, integrated until two refinements agree within `relative_error`.
    pub(super) fn illuminance(&self, meter: &Meter, occluders: &[Occluder], relative_error: f64) -> Bounded {
        if self.faces.is_empty() {
            let hidden = occluders.iter().any(|o| o.blocks(meter.position_m, self.luminaire.position_m));
            return if hidden { Bounded::default() } else { direct::point(&self.luminaire, meter) };
        }
        let mut sum = Bounded::default();
        for face in &self.faces {
            let above = clip(&face.polygon, meter.normal, meter.position_m);
            if above.len() < 3 || face.outward.is_some_and(|n| n.dot(meter.position_m - above[0]) <= 0.0) {
                continue;
            }
            let hiding = candidates(meter.position_m, &above, occluders);
            for piece in visible_pieces(meter.position_m, &above, &hiding) {
                sum = sum + self.piece_illuminance(face, &piece, meter, relative_error);
            }
        }
        sum
    }

    fn piece_illuminance(&self, face: &Face, piece: &[DVec3], meter: &Meter, relative_error: f64) -> Bounded {
        if let Some(lambertian) = self.lambertian {
            let down = self.luminaire.orientation * DVec3::NEG_Z;
            if down.dot(meter.position_m - piece[0]) <= 0.0 {
                return Bounded::default();
            }
            let value = lambertian.exitance * element_to_polygon(meter.position_m, meter.normal, piece);
            return Bounded { value, bound: value * (lambertian.interpolation + 1e-13) };
        }
        integrate(piece, relative_error, &|from: DVec3| {
            let away = meter.position_m - from;
            let r2 = away.length_squared();
            let cosine = -away.dot(meter.normal) / r2.sqrt();
            self.luminaire.intensity_towards(away).value() * self.share(face, away / r2.sqrt()) * cosine.max(0.0) / r2
        })
    }

    /// The part of the intensity that a square metre of a face has.
    fn share(&self, face: &Face, direction: DVec3) -> f64 {
        let Some(outward) = face.outward else { return 1.0 / (self.extent_m.x * self.extent_m.y) };
        let own = (self.luminaire.orientation.transpose() * direction).abs();
        let e = self.extent_m;
        let projected = own.dot(DVec3::new(e.y * e.z, e.x * e.z, e.x * e.y));
        outward.dot(direction).max(0.0) / projected
    }

    /// Whether it has no extent.
    pub(super) fn is_point(&self) -> bool {
        self.faces.is_empty()
    }

    /// Illuminance in lux at a meter of a luminaire without extent by way of a flat polygon that faces along `normal` and
    /// reflects everything: over what is both lit and seen of it, where the light is as smooth as the table.
    pub(super) fn reflected(
        &self,
        meter: &Meter,
        polygon_m: &[DVec3],
        normal: DVec3,
        occluders: &[Occluder],
        relative_error: f64,
    ) -> Bounded {
        let from = self.luminaire.position_m;
        let above = clip(polygon_m, meter.normal, meter.position_m);
        let faces = |point: DVec3| (point - polygon_m[0]).dot(normal) > 0.0;
        if above.len() < 3 || !faces(from) || !faces(meter.position_m) {
            return Bounded::default();
        }
        let light = |p: DVec3| {
            let away = p - meter.position_m;
            let r2 = away.length_squared();
            let cosines = away.dot(meter.normal).max(0.0) * -away.dot(normal) / r2;
            direct::point(&self.luminaire, &Meter { position_m: p, normal }).value * cosines / (PI * r2)
        };
        let mut sum = Bounded::default();
        for lit in visible_pieces(from, &above, &candidates(from, &above, occluders)) {
            let hiding = candidates(meter.position_m, &lit, occluders);
            for seen in visible_pieces(meter.position_m, &lit, &hiding) {
                sum = sum + integrate(&seen, relative_error, &light);
            }
        }
        sum
    }

    /// Direct illuminance in lux at nodes of a flat polygon that faces along `normal`.
    ///
    /// Where a point luminaire's sharp shadow crosses the polygon, every node gets the exact mean.
    pub(super) fn illuminance_at_nodes(
        &self,
        nodes_m: [DVec3; 9],
        polygon_m: &[DVec3],
        normal: DVec3,
        occluders: &[Occluder],
    ) -> [f64; 9] {
        let from = self.luminaire.position_m;
        if self.faces.is_empty() && (from - polygon_m[0]).dot(normal) > 0.0 {
            let lux = |p: DVec3| direct::point(&self.luminaire, &Meter { position_m: p, normal }).value;
            let hiding = candidates(from, polygon_m, occluders);
            if hiding.is_empty() {
                return nodes_m.map(lux);
            }
            let pieces = visible_pieces(from, polygon_m, &hiding);
            let flux: f64 = pieces.iter().map(|piece| integrate(piece, 1e-5, &lux).value).sum();
            return [flux / area_m2(polygon_m); 9];
        }
        nodes_m.map(|position_m| self.illuminance(&Meter { position_m, normal }, occluders, 1e-5).value)
    }
}

/// Recognises I0 cos gamma, dark above, at every node of a table, as far as its figures are written out.
fn lambertian(luminaire: &Luminaire, area_m2: f64) -> Option<Lambertian> {
    let table: &LuminousIntensityDistribution = &luminaire.photometry.distribution;
    if table.symmetry() != Symmetry::Axial || table.gamma_deg()[0] != 0.0 {
        return None;
    }
    let (gammas, plane) = (table.gamma_deg(), table.plane(0));
    let cosine = |g: f64| if g < 90.0 { g.to_radians().cos() } else { 0.0 };
    let off = |(g, i): (&f64, &f64)| ((i - plane[0] * cosine(*g)).abs() - 1e-12 * plane[0]).max(0.0);
    // Relative at every node, and so at what is interpolated between two; infinite where the cosine is dark.
    let relative = |node: (&f64, &f64)| if off(node) == 0.0 { 0.0 } else { off(node) / (plane[0] * cosine(*node.0)) };
    let rounding = gammas.iter().zip(plane).map(relative).fold(0.0, f64::max);
    if !gammas.contains(&90.0) || rounding > COSINE_ROUNDING {
        return None;
    }
    let widest = gammas.windows(2).filter(|w| w[0] < 90.0).map(|w| (w[1] - w[0]).to_radians()).fold(0.0, f64::max);
    // A chord of the cosine lies below it by at most the square of the step over 8, relative.
    let exitance = PI * plane[0] * luminaire.flux_scale / area_m2;
    Some(Lambertian { exitance, interpolation: widest * widest / 8.0 + rounding })
}

/// Area of a convex flat polygon.
fn area_m2(polygon: &[DVec3]) -> f64 {
    let fan = (2..polygon.len()).map(|k| (polygon[k - 1] - polygon[0]).cross(polygon[k] - polygon[0]));
    0.5 * fan.sum::<DVec3>().length()
}

/// Integral over a convex flat polygon, by triangles that are quartered until two rules agree.
fn integrate(polygon: &[DVec3], relative_error: f64, f: &impl Fn(DVec3) -> f64) -> Bounded {
    let rule = Gauss::new(5);
    let triangles: Vec<_> = (2..polygon.len()).map(|k| [polygon[0], polygon[k - 1], polygon[k]]).collect();
    let coarse: Vec<f64> = triangles.iter().map(|t| on_triangle(t, &rule, f)).collect();
    let scale = coarse.iter().sum::<f64>().abs();
    let mut sum = Bounded::default();
    for (triangle, value) in triangles.iter().zip(coarse) {
        sum = sum + refine(triangle, value, 0.1 * relative_error * scale, &rule, f, 0);
    }
    sum
}

fn refine(t: &[DVec3; 3], value: f64, tolerance: f64, rule: &Gauss, f: &impl Fn(DVec3) -> f64, depth: u32) -> Bounded {
    let [ab, bc, ca] = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(p, q)| 0.5 * (p + q));
    let quarters = [[t[0], ab, ca], [ab, t[1], bc], [ca, bc, t[2]], [ab, bc, ca]];
    let values = quarters.map(|q| on_triangle(&q, rule, f));
    let better: f64 = values.iter().sum();
    let difference = (better - value).abs();
    if difference <= tolerance || depth == DEEPEST {
        return Bounded { value: better, bound: difference + 1e-14 * better.abs() };
    }
    let parts = quarters.iter().zip(values).map(|(q, v)| refine(q, v, 0.25 * tolerance, rule, f, depth + 1));
    parts.fold(Bounded::default(), |a, b| a + b)
}

/// A product rule on a triangle, collapsed towards its first corner.
fn on_triangle(t: &[DVec3; 3], rule: &Gauss, f: &impl Fn(DVec3) -> f64) -> f64 {
    let area = (t[1] - t[0]).cross(t[2] - t[0]).length();
    let mut sum = 0.0;
    for (a, wa) in rule.nodes.iter().zip(&rule.weights) {
        for (b, wb) in rule.nodes.iter().zip(&rule.weights) {
            let p = t[0] + *a * (t[1].lerp(t[2], *b) - t[0]);
            sum += wa * wb * a * f(p);
        }
    }
    sum * area
}
