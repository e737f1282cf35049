//! Direct light from points and from luminous openings, behind boxes that hide some of them.
//!
//! A part dA with normal n of an opening of projected area P(w) has the intensity I(w) max(0, n·w) dA / P(w) towards
//! w, so that all parts together have the intensity of the table; the body of a luminaire blocks no light. A flat
//! opening has I(w) dA / A on both sides. Where the table is a cosine at every node, the opening has one luminance and
//! Lambert's polygon formula holds but for the interpolation, which counts as an error.

mod sheet;
pub(super) mod sight;
mod steps;

use std::f64::consts::PI;
use std::sync::LazyLock;

use glam::DVec3;

use super::quadrature::Gauss;
use super::visibility::{Occluder, candidates, clip, visible_pieces};
use super::{Bounded, direct};
use luxproof_photometry::{LuminousIntensityDistribution, Symmetry};
use luxproof_scene::geometry::configuration_factor::element_to_polygon;
use luxproof_scene::opening::Opening;
use luxproof_scene::{Luminaire, Meter};
use sheet::{OpeningPart, Part, facing};
use steps::Steps;

/// Relative deviation of a table from a cosine that passes for rounding of its figures; it counts as an error.
const COSINE_ROUNDING: f64 = 1e-5;
/// Tables whose steps of 5 degrees or less part them from a cosine by no more than this are one.
const ROUGH: f64 = 1e-3;
/// Halvings of a triangle or a square after which an integral stops improving.
const DEEPEST: u32 = 9;
/// Rules that differ by less than this part of what is allowed see a smooth integrand. Other differences are those of kinks, whose size
/// is chance: they count as a larger part at least, and of the whole they are not believed.
const SMOOTH: f64 = 1e-4;
const BY_CHANCE: f64 = 0.25;
const SURE_DEPTH: u32 = 2;
/// How many times the difference of two rules the finer one may be off: where a table has a kink, halving gains no more than chance.
const KINKED: f64 = 2.0;
/// Parts of an integral after which it stops improving: what is left is its bound.
const MOST_PARTS: u32 = 4000;

/// How far off a fourth corner may lie from a parallelogram's, in shorter sides: by rounding.
const SQUARE: f64 = 1e-12;

/// Steps along each edge of a sheet where no light was found within, and how often the brightest step is looked at more closely.
const OUTLINE: usize = 16;
const CLOSER: usize = 3;
/// Light below this part of what a luminaire would give that faces the meter at its brightest counts as none: what
/// rises above a horizon between two steps of the outline, or is lit through a table's last figures alone. Slivers a
/// thousandth as high as the opening, behind a table of cos³, were off by 2e-10 of it where two rules agreed.
const UNTOLD: f64 = 1e-9;

/// Nearer than this to the plane of an opening is in it, and less than this part of its peak is the rounding of a cosine of 90 degrees.
const IN_PLANE_M: f64 = 1e-9;
const NO_LIGHT: f64 = 1e-12;

/// The rule along each side of a part, and the one that confirms it: its nodes lie elsewhere.
static RULE: LazyLock<Gauss> = LazyLock::new(|| Gauss::new(5));
static CONFIRMING: LazyLock<Gauss> = LazyLock::new(|| Gauss::new(8));

/// A luminaire as the deterministic solvers see it.
#[derive(Clone, Debug)]
pub(super) struct Emitter {
    luminaire: Luminaire,
    /// The largest intensity of all.
    peak_cd: f64,
    opening: Opening,
    lambertian: Option<Lambertian>,
    /// The light in which the table ends, at most: beyond it there is none.
    cut_off_cd: Option<f64>,
    /// What else an opening's light jumps at.
    steps: Steps,
}

/// What an integrand does at a place: whether it is within what it jumps at, and by how much at most; nothing where it jumps nowhere.
type Jump = Option<(bool, f64)>;

/// One luminance on the lower side of a flat opening, and the largest relative error of saying so: of interpolation and of rounded figures.
#[derive(Clone, Copy, Debug)]
struct Lambertian {
    exitance: f64,
    interpolation: f64,
}

/// How finely light is integrated: to a part of itself, or to so many lux where that is more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Precision {
    pub(super) relative_error: f64,
    pub(super) error_lux: f64,
}

impl Precision {
    /// To a part of itself, however dim it is.
    pub(super) const fn relative(relative_error: f64) -> Self {
        Self { relative_error, error_lux: 0.0 }
    }
}

/// A meter in a luminaire's own frame.
struct LocalMeter {
    position_m: DVec3,
    normal: DVec3,
}

impl LocalMeter {
    fn of(luminaire: &Luminaire, meter: &Meter) -> Self {
        let turn = luminaire.orientation.transpose();
        Self { position_m: turn * (meter.position_m - luminaire.position_m), normal: turn * meter.normal }
    }
}

impl OpeningPart {
    /// Integral of what its parts give, whose jumps are reported for the weight that they have there.
    fn integral(&self, precision: Precision, f: &impl Fn(&Part) -> f64, jump: &impl Fn(&Part, f64) -> Jump) -> Bounded {
        if self.is_disc() {
            // Its radius goes with the root of its area.
            return integrate_square(precision, &|[s, v]| 2.0 * s * f(&self.part([s * s, v])), &|[s, v]| {
                jump(&self.part([s * s, v]), 2.0 * s)
            });
        }
        integrate_square(precision, &|uv| f(&self.part(uv)), &|uv| jump(&self.part(uv), 1.0))
    }
}

impl Emitter {
    pub(super) fn new(luminaire: &Luminaire) -> Self {
        let opening = Opening::of_luminaire(luminaire);
        let horizontal = matches!(opening, Opening::Box(half) if half.z == 0.0);
        let flat_m2 = opening.flat_area_m2().filter(|_| horizontal);
        let lambertian = flat_m2.and_then(|area_m2| lambertian(luminaire, area_m2));
        let peak_cd = luminaire.photometry.distribution.max_intensity().value() * luminaire.flux_scale;
        let edge_cd = luminaire.photometry.distribution.edge_intensity().value() * luminaire.flux_scale;
        let cut_off_cd = (edge_cd > 0.0).then_some(edge_cd);
        let steps = Steps::of(&luminaire.photometry.distribution);
        Self { luminaire: luminaire.clone(), peak_cd, opening, lambertian, cut_off_cd, steps }
    }

    /// Whether it has no extent.
    pub(super) fn is_point(&self) -> bool {
        self.opening == Opening::Point
    }

    /// Whether it is a point or has flat faces with straight edges.
    pub(super) fn is_polygonal(&self) -> bool {
        matches!(self.opening, Opening::Point | Opening::Box(_))
    }

    /// Photometric centre.
    pub(super) fn centre_m(&self) -> DVec3 {
        self.luminaire.position_m
    }

    /// Lower and upper corner of a box that holds all of it.
    pub(super) fn bounds_m(&self) -> [DVec3; 2] {
        let half = self.opening.half_m();
        let turn = self.luminaire.orientation;
        let reach = turn.x_axis.abs() * half.x + turn.y_axis.abs() * half.y + turn.z_axis.abs() * half.z;
        [self.centre_m() - reach, self.centre_m() + reach]
    }

    /// The most illuminance in lux that it gives any place of a box: its peak from its nearest place, and nothing behind an opening
    /// whose table ends in a horizon.
    pub(super) fn most_lux(&self, [min_m, max_m]: [DVec3; 2]) -> f64 {
        let [low, high] = self.bounds_m();
        let apart_m = (min_m - high).max(low - max_m).max(DVec3::ZERO);
        let down = self.luminaire.orientation * DVec3::NEG_Z;
        let lowest_m = DVec3::select(down.cmpge(DVec3::ZERO), max_m, min_m);
        let is_behind = down.dot(lowest_m - self.centre_m()) <= IN_PLANE_M - self.opening.half_m().z;
        if self.peak_cd == 0.0 || is_behind && is_dark_above(&self.luminaire) {
            return 0.0;
        }
        self.peak_cd / apart_m.length_squared()
    }

    /// Whether it sends light anywhere.
    pub(super) fn shines(&self) -> bool {
        self.peak_cd > 0.0
    }

    /// Illuminance in lux at an element, integrated until two refinements agree as precisely as asked.
    ///
    /// Boxes are cut out exactly of what has straight edges; nothing may stand before a round opening.
    pub(super) fn illuminance(&self, meter: &Meter, occluders: &[Occluder], precision: Precision) -> Bounded {
        if self.is_point() {
            let hidden = occluders.iter().any(|o| o.blocks(meter.position_m, self.luminaire.position_m));
            return if hidden { Bounded::default() } else { direct::point(&self.luminaire, meter) };
        }
        let own = LocalMeter::of(&self.luminaire, meter);
        let mut sum = Bounded::default();
        for sheet in facing(&self.opening, own.position_m) {
            let found = match sheet {
                OpeningPart::Face { corner_m, edges_m } => {
                    self.face_illuminance(&sheet, corner_m, edges_m, meter, occluders, precision)
                }
                _ => sheet.integral(precision, &|part| self.density(&own, part), &|part, weight| {
                    self.jump(&own, part, weight)
                }),
            };
            let edges = [
                ([0.0, 0.0], [1.0, 0.0]),
                ([1.0, 0.0], [1.0, 1.0]),
                ([1.0, 1.0], [0.0, 1.0]),
                ([0.0, 1.0], [0.0, 0.0]),
            ];
            let is_dark = found.value == 0.0;
            sum = sum + found;
            if !matches!(sheet, OpeningPart::Face { .. }) && is_above(self.opening.half_m(), &own) {
                sum.bound += self.ignored_lux(&own);
                let looks = edges
                    .into_iter()
                    .map(|([a, b], [c, d])| self.brightest(&own, &|t| sheet.part([a + t * (c - a), b + t * (d - b)])));
                sum.bound += if is_dark { looks.fold(0.0, f64::max) } else { 0.0 };
            }
        }
        sum
    }

    /// Light too dim to count, in lux.
    fn ignored_lux(&self, own: &LocalMeter) -> f64 {
        let nearest_m = own.position_m.abs() - self.opening.half_m();
        UNTOLD * self.peak_cd / nearest_m.max(DVec3::ZERO).length_squared().max(self.opening.half_m().length_squared())
    }

    /// The brightest that is found along an edge: of what reaches above the meter's horizon there, the highest is met closely.
    ///
    /// Where a rule's nodes see nothing, what is lit is a sliver between them: the part of a convex sheet beyond a plane, the
    /// meter's horizon or the luminaire's own, which reaches the outline if it is there at all.
    fn brightest(&self, own: &LocalMeter, edge: &impl Fn(f64) -> Part) -> f64 {
        let mut brightest =
            (0..=OUTLINE).map(|k| self.density(own, &edge(k as f64 / OUTLINE as f64))).fold(0.0, f64::max);
        let (mut from, mut to) = (0.0, 1.0);
        for _ in 0..CLOSER {
            let step = (to - from) / OUTLINE as f64;
            let all = (0..=OUTLINE).map(|k| from + step * k as f64);
            let heights = all.map(|t| (t, (edge(t).at_m - own.position_m).dot(own.normal)));
            let Some((highest, _)) = heights.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            brightest = brightest.max(self.density(own, &edge(highest)));
            (from, to) = ((highest - step).max(0.0), (highest + step).min(1.0));
        }
        brightest
    }

    fn face_illuminance(
        &self,
        sheet: &OpeningPart,
        corner_m: DVec3,
        [a, b]: [DVec3; 2],
        meter: &Meter,
        occluders: &[Occluder],
        precision: Precision,
    ) -> Bounded {
        let corners = [corner_m, corner_m + a, corner_m + a + b, corner_m + b].map(|p| self.to_world(p));
        let above = clip(&corners, meter.normal, meter.position_m);
        let mut sum = Bounded::default();
        if above.len() < 3 {
            return sum;
        }
        let area_m2 = sheet.part([0.5; 2]).area_m2;
        let hiding = candidates(meter.position_m, &above, occluders);
        for piece in visible_pieces(meter.position_m, &above, &hiding) {
            sum = sum + self.piece_illuminance(area_m2, &piece, meter, precision);
        }
        sum
    }

    fn piece_illuminance(&self, face_m2: DVec3, piece: &[DVec3], meter: &Meter, precision: Precision) -> Bounded {
        if let Some(lambertian) = self.lambertian {
            let down = self.luminaire.orientation * DVec3::NEG_Z;
            if down.dot(meter.position_m - piece[0]) <= 0.0 {
                return Bounded::default();
            }
            let value = lambertian.exitance * element_to_polygon(meter.position_m, meter.normal, piece);
            let bound = value * (lambertian.interpolation + 1e-13);
            // A table of wide steps is a cosine at its nodes alone: where that is too rough, what it says is integrated.
            let asked_lux = (precision.relative_error * value).max(precision.error_lux);
            if lambertian.interpolation <= ROUGH || bound <= asked_lux {
                return Bounded { value, bound };
            }
        }
        let own = LocalMeter::of(&self.luminaire, meter);
        let unit_m2 = face_m2.normalize_or_zero();
        let mut found =
            integrate(piece, precision, &|from| self.density(&own, &self.unit_part(from, unit_m2)), &|from| {
                self.jump(&own, &self.unit_part(from, unit_m2), 1.0)
            });
        found.bound += self.ignored_lux(&own);
        if found.value == 0.0 {
            let looks = (0..piece.len()).map(|k| {
                let (from, to) = (piece[k], piece[(k + 1) % piece.len()]);
                self.brightest(&own, &|t| self.unit_part(from.lerp(to, t), unit_m2))
            });
            let piece_m2 = (2..piece.len()).map(|k| (piece[k - 1] - piece[0]).cross(piece[k] - piece[0]).length());
            found.bound += 0.5 * piece_m2.sum::<f64>() * looks.fold(0.0, f64::max);
        }
        found
    }

    /// A part of unit area at a place of the world, with its area along its normal.
    fn unit_part(&self, from_m: DVec3, unit_m2: DVec3) -> Part {
        Part { at_m: self.luminaire.orientation.transpose() * (from_m - self.luminaire.position_m), area_m2: unit_m2 }
    }

    /// One part's light as an estimate of the whole luminaire's, and where it comes from.
    pub(super) fn sample(&self, meter: &Meter, [u, v]: [f64; 2]) -> (f64, DVec3) {
        if self.is_point() {
            return (direct::point(&self.luminaire, meter).value, self.luminaire.position_m);
        }
        let own = LocalMeter::of(&self.luminaire, meter);
        let sheets = facing(&self.opening, own.position_m);
        let weights: Vec<f64> = sheets.iter().map(|sheet| drawing_weight(sheet, own.position_m)).collect();
        let total: f64 = weights.iter().sum();
        let mut rest = u * total;
        for (k, (sheet, weight)) in sheets.iter().zip(&weights).enumerate() {
            if rest < *weight || k + 1 == sheets.len() {
                let (across, share) = if total > 0.0 { (rest / weight, weight / total) } else { (u, 1.0) };
                let part = sheet.part([across.clamp(0.0, 1.0), v]);
                return (self.density(&own, &part) / share, self.to_world(part.at_m));
            }
            rest -= weight;
        }
        (0.0, self.luminaire.position_m)
    }

    /// Illuminance in lux by a part of the opening.
    fn density(&self, meter: &LocalMeter, part: &Part) -> f64 {
        let Some((away, lux_per_cd)) = self.path(meter, part) else { return 0.0 };
        let table = &self.luminaire.photometry.distribution;
        table.intensity_towards(away).value() * self.luminaire.flux_scale * lux_per_cd
    }

    /// What a part's light does where the table ends in light or has a step, `weight` times.
    fn jump(&self, meter: &LocalMeter, part: &Part, weight: f64) -> Jump {
        let steps_cd = self.steps.largest_cd().map(|cd| cd * self.luminaire.flux_scale);
        let largest_cd = match (self.cut_off_cd, steps_cd) {
            (Some(a), Some(b)) => a.max(b),
            (either, other) => either.or(other)?,
        };
        let lux_per_cd = self.path(meter, part).map_or(0.0, |(_, lux_per_cd)| lux_per_cd);
        let (table, away) = (&self.luminaire.photometry.distribution, meter.position_m - part.at_m);
        let is_within = self.cut_off_cd.is_some() && table.covers(away);
        let is_beyond = steps_cd.is_some() && self.steps.is_beyond(table.own_angles_deg(away));
        Some((is_within != is_beyond, weight * largest_cd * lux_per_cd))
    }

    /// The direction from a part of the opening to a meter above whose horizon it is, and the illuminance in lux that it gives for every
    /// candela that the luminaire has there.
    fn path(&self, meter: &LocalMeter, part: &Part) -> Option<(DVec3, f64)> {
        let path = meter.position_m - part.at_m;
        let square = path.length_squared();
        let away = path / square.sqrt();
        let cosine = -away.dot(meter.normal);
        // A place upon the luminaire has no direction: 0 / 0.
        if cosine <= 0.0 || cosine.is_nan() {
            return None;
        }
        let share = match (self.opening.flat_area_m2(), &self.opening) {
            (_, Opening::Line(_) | Opening::Point) => 1.0,
            (Some(whole_m2), _) => part.area_m2.length() / whole_m2,
            (None, opening) => part.area_m2.dot(away).max(0.0) / opening.projected_area_m2(away),
        };
        Some((away, share * cosine / square))
    }

    fn to_world(&self, own_m: DVec3) -> DVec3 {
        self.luminaire.position_m + self.luminaire.orientation * own_m
    }
}

/// How often a sheet is drawn from a place: as its area shows from there, at least a thousandth of it.
fn drawing_weight(sheet: &OpeningPart, from_m: DVec3) -> f64 {
    let part = sheet.part([0.5; 2]);
    part.area_m2.dot((from_m - part.at_m).normalize_or_zero()).abs().max(1e-3 * part.area_m2.length())
}

/// Whether a corner of a box about a luminaire's centre lies above a meter's horizon.
fn is_above(half_m: DVec3, own: &LocalMeter) -> bool {
    half_m.dot(own.normal.abs()) > own.position_m.dot(own.normal)
}

/// Recognises I0 cos gamma, dark above, at every node of a table, as far as its figures are written out.
fn lambertian(luminaire: &Luminaire, area_m2: f64) -> Option<Lambertian> {
    let table: &LuminousIntensityDistribution = &luminaire.photometry.distribution;
    if table.symmetry() != Symmetry::Axial || table.gamma_deg()[0] != 0.0 {
        return None;
    }
    let (gammas, plane) = (table.gamma_deg(), table.plane(0));
    let nodes = gammas.iter().zip(plane);
    let rounding = nodes.map(|(gamma, cd)| deviation_from_cosine(*gamma, *cd, plane[0])).fold(0.0, f64::max);
    if !gammas.contains(&90.0) || rounding > COSINE_ROUNDING {
        return None;
    }
    let widest = gammas.windows(2).filter(|w| w[0] < 90.0).map(|w| (w[1] - w[0]).to_radians()).fold(0.0, f64::max);
    // A chord of the cosine lies below it by at most the square of the step over 8, relative.
    let exitance = PI * plane[0] * luminaire.flux_scale / area_m2;
    Some(Lambertian { exitance, interpolation: widest * widest / 8.0 + rounding })
}

/// How far a node of a table is off a cosine of a peak, relative to that, and so what is interpolated between two nodes; infinite where
/// the cosine is dark.
fn deviation_from_cosine(gamma_deg: f64, candela: f64, peak_cd: f64) -> f64 {
    let cosine_cd = if gamma_deg < 90.0 { peak_cd * gamma_deg.to_radians().cos() } else { 0.0 };
    let off_cd = ((candela - cosine_cd).abs() - 1e-12 * peak_cd).max(0.0);
    if off_cd == 0.0 { 0.0 } else { off_cd / cosine_cd }
}

/// Whether a table has no light above its horizon: it is zero at every node there and at the last one before.
fn is_dark_above(luminaire: &Luminaire) -> bool {
    let table = &luminaire.photometry.distribution;
    table.is_dark_above(table.max_intensity() * NO_LIGHT)
}

/// A part of a domain of integration, which can be quartered.
trait Piece: Sized {
    /// A point of the domain.
    type Place: Copy;

    fn quarters(&self) -> [Self; 4];

    /// The integral by a product rule.
    fn sum(&self, rule: &Gauss, f: &impl Fn(Self::Place) -> f64) -> f64;

    /// What a jump within it may be worth.
    fn unresolved(&self, jump: &impl Fn(Self::Place) -> Jump) -> f64;
}

/// A square of the unit square: corner and side.
struct Square([f64; 2], f64);

/// A triangle in space.
struct Triangle([DVec3; 3]);

impl Square {
    fn place(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let Self([u, v], side) = self;
        [u + side * a, v + side * b]
    }
}

impl Piece for Square {
    type Place = [f64; 2];

    fn quarters(&self) -> [Self; 4] {
        [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5], [0.5, 0.5]].map(|at| Self(self.place(at), 0.5 * self.1))
    }

    fn sum(&self, rule: &Gauss, f: &impl Fn([f64; 2]) -> f64) -> f64 {
        let mut sum = 0.0;
        for (a, wa) in rule.points() {
            for (b, wb) in rule.points() {
                sum += wa * wb * f(self.place([a, b]));
            }
        }
        sum * self.1 * self.1
    }

    fn unresolved(&self, jump: &impl Fn([f64; 2]) -> Jump) -> f64 {
        self.1 * self.1 * unresolved(&|at| jump(self.place(at)))
    }
}

impl Triangle {
    /// Twice its area: that of the unit square's image.
    fn double_area(&self) -> f64 {
        let [a, b, c] = self.0;
        (b - a).cross(c - a).length()
    }

    /// The image of a point of the unit square, collapsed towards the first corner.
    fn place(&self, [a, b]: [f64; 2]) -> DVec3 {
        let t = self.0;
        t[0] + a * (t[1].lerp(t[2], b) - t[0])
    }
}

impl Piece for Triangle {
    type Place = DVec3;

    fn quarters(&self) -> [Self; 4] {
        let t = self.0;
        let [ab, bc, ca] = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(p, q)| 0.5 * (p + q));
        [[t[0], ab, ca], [ab, t[1], bc], [ca, bc, t[2]], [ab, bc, ca]].map(Self)
    }

    fn sum(&self, rule: &Gauss, f: &impl Fn(DVec3) -> f64) -> f64 {
        let mut sum = 0.0;
        for (a, wa) in rule.points() {
            for (b, wb) in rule.points() {
                sum += wa * wb * a * f(self.place([a, b]));
            }
        }
        sum * self.double_area()
    }

    fn unresolved(&self, jump: &impl Fn(DVec3) -> Jump) -> f64 {
        let area = self.double_area();
        // Near the first corner there is little area.
        unresolved(&|[a, b]| jump(self.place([a, b])).map(|(within, size)| (within, area * a * size)))
    }
}

/// Integral over a convex flat polygon, by triangles that are quartered until rules agree; over a parallelogram as over a square, in
/// half the places.
fn integrate(
    polygon: &[DVec3],
    precision: Precision,
    f: &impl Fn(DVec3) -> f64,
    jump: &impl Fn(DVec3) -> Jump,
) -> Bounded {
    if let &[corner, b, opposite, d] = polygon {
        let [x, y] = [b - corner, d - corner];
        if (corner + x + y - opposite).length() <= SQUARE * x.length().min(y.length()) {
            let area = x.cross(y).length();
            return integrate_square(precision, &|[u, v]| area * f(corner + u * x + v * y), &|[u, v]| {
                jump(corner + u * x + v * y).map(|(within, size)| (within, area * size))
            });
        }
    }
    let parts = (2..polygon.len()).map(|k| Triangle([polygon[0], polygon[k - 1], polygon[k]])).collect();
    refined(parts, precision, f, jump)
}

/// Integral over the unit square, by squares that are quartered until rules agree.
fn integrate_square(precision: Precision, f: &impl Fn([f64; 2]) -> f64, jump: &impl Fn([f64; 2]) -> Jump) -> Bounded {
    refined(vec![Square([0.0, 0.0], 1.0)], precision, f, jump)
}

/// Cells along each side of a part in which a jump is looked for: as fine as the nodes of its quarters are.
const CELLS: usize = 8;

/// What a jump within a part may be worth: its size over the cells that it goes through, whose nodes lie on either side of it by chance.
/// Two rules that miss it alike agree.
fn unresolved(jump: &impl Fn([f64; 2]) -> Jump) -> f64 {
    let Some(mut below) = jumps_along(0, jump) else { return 0.0 };
    let mut sum = 0.0;
    for j in 1..=CELLS {
        let Some(above) = jumps_along(j, jump) else { return 0.0 };
        for k in 0..CELLS {
            let corners = [below[k], below[k + 1], above[k], above[k + 1]];
            if corners.iter().any(|(within, _)| *within != corners[0].0) {
                sum += corners.iter().map(|(_, size)| *size).fold(0.0, f64::max);
            }
        }
        below = above;
    }
    sum / (CELLS * CELLS) as f64
}

/// The jumps at the corners of a row of cells.
fn jumps_along(row: usize, jump: &impl Fn([f64; 2]) -> Jump) -> Option<Vec<(bool, f64)>> {
    (0..=CELLS).map(|k| jump([k, row].map(|k| k as f64 / CELLS as f64))).collect()
}

/// The sum of a rule over parts that are quartered until the rule agrees with itself and no jump is left in them, or the parts are too many.
///
/// Of a kink two values agree by chance once in as many times as they are asked to agree closely: a rule with other nodes confirms that,
/// and the larger difference counts.
fn refined<P: Piece>(
    parts: Vec<P>,
    precision: Precision,
    f: &impl Fn(P::Place) -> f64,
    jump: &impl Fn(P::Place) -> Jump,
) -> Bounded {
    let mut open: Vec<(P, f64, u32)> = parts.into_iter().map(|p| (p, 0.0, 0)).collect();
    for part in &mut open {
        part.1 = part.0.sum(&RULE, f);
    }
    let scale = open.iter().map(|(_, value, _)| value).sum::<f64>().abs();
    let asked = (precision.relative_error * scale).max(precision.error_lux);
    let mut sum = Bounded::default();
    let mut count = 0;
    while let Some((part, value, depth)) = open.pop() {
        let four = part.quarters();
        let values = [0, 1, 2, 3].map(|k| four[k].sum(&RULE, f));
        let better: f64 = values.iter().sum();
        count += 1;
        // Where there is a kink, twice as many parts hold it at every depth.
        let tolerance = 0.5 * asked * 0.5_f64.powi(depth as i32);
        let mut error = KINKED * (better - value).abs();
        if error <= tolerance {
            error = error.max(KINKED * (better - part.sum(&CONFIRMING, f)).abs());
        }
        let mut error = error.max(part.unresolved(jump));
        let is_smooth = error <= SMOOTH * tolerance;
        if !is_smooth {
            error = error.max(BY_CHANCE * tolerance);
        }
        let is_sure = error <= tolerance && (is_smooth || depth >= SURE_DEPTH);
        if is_sure || depth == DEEPEST || count > MOST_PARTS {
            sum = sum + Bounded { value: better, bound: error + 1e-14 * better.abs() };
        } else {
            open.extend(four.into_iter().zip(values).map(|(part, value)| (part, value, depth + 1)));
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DMat3;

    use super::*;
    use luxproof_photometry::{HorizontalAxis, LuminousOpening, Photometry};
    use luxproof_scene::LuminaireModel;

    const SIDE_M: f64 = 0.2;

    /// An opening about the origin that is not turned.
    fn upright(opening: LuminousOpening, table: &LuminousIntensityDistribution) -> Emitter {
        Emitter::new(&Luminaire {
            id: "l".into(),
            photometry: Arc::new(Photometry { opening, ..Photometry::of(table.clone()) }),
            position_m: DVec3::ZERO,
            orientation: DMat3::IDENTITY,
            flux_scale: 1.0,
            model: LuminaireModel::Area,
        })
    }

    #[test]
    fn a_parallelogram_is_integrated_as_its_triangles_are() {
        let corner = DVec3::new(20.0, -3.0, 7.0);
        let sides = [DVec3::new(0.3, 0.1, 0.0), DVec3::new(-0.1, 0.5, 0.2)];
        let corners = [corner, corner + sides[0], corner + sides[0] + sides[1], corner + sides[1]];
        // Smooth but for a kink, and a jump across all of it.
        let [whole, one, other] = [vec![0, 1, 2, 3], vec![0, 1, 2], vec![0, 2, 3]].map(|which| {
            let polygon: Vec<DVec3> = which.into_iter().map(|k: usize| corners[k]).collect();
            integrate(&polygon, Precision::relative(1e-6), &|p| (p.x - p.y).exp() + (p.y + 2.8).abs(), &|p| {
                Some((p.z < 7.1, 1e-3))
            })
        });
        let halves = one + other;
        assert!((whole.value - halves.value).abs() <= whole.bound + halves.bound, "{whole:?} {halves:?}");
        assert!(whole.bound <= 1e-5 * whole.value && halves.bound <= 1e-5 * whole.value, "{whole:?} {halves:?}");
    }

    /// LM-63-2002 has upright circles and ellipses; a simulator that saw none of one read 0 lx.
    #[test]
    fn an_ellipsoid_without_extent_along_an_axis_is_a_flat_ellipse_that_shines_to_both_sides() {
        let even = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![100.0, 100.0]).unwrap();
        // Over a disc of radius R at distance 1, the mean of (1 + r²)^(-3/2) is 2 / R² (1 - 1 / √(1 + R²)).
        let lux = 200.0 / 0.01 * (1.0 - 1.01_f64.sqrt().recip());
        for axis in DVec3::AXES {
            let [x_m, y_m, z_m] = (0.2 * (DVec3::ONE - axis)).to_array();
            let disc = upright(LuminousOpening::Ellipsoid { x_m, y_m, z_m }, &even);
            for towards in [axis, -axis] {
                let meter = Meter { position_m: towards, normal: -towards };
                let found = disc.illuminance(&meter, &[], Precision::relative(1e-9));
                assert!((found.value - lux).abs() <= found.bound.max(1e-9 * lux), "{axis}: {found:?} for {lux}");
            }
            let aside = axis.any_orthonormal_vector();
            let beside = Meter { position_m: 3.0 * axis + 4.0 * aside, normal: -(3.0 * axis + 4.0 * aside) / 5.0 };
            let found = disc.illuminance(&beside, &[], Precision::relative(1e-9)).value;
            assert!((found / 4.0 - 1.0).abs() < 1e-3, "{axis}: {found}");
        }
    }

    /// Meters beside openings of which a sliver alone sends light there: what is above the meter, by a table that is dark above.
    #[test]
    fn a_sliver_that_no_node_meets_is_within_the_bound() {
        let gamma_deg: Vec<f64> = (0..=180).map(f64::from).collect();
        let candela = gamma_deg.iter().map(|g| 1e3 * g.to_radians().cos().max(0.0).powi(3)).collect();
        let table = LuminousIntensityDistribution::axial(gamma_deg, candela).unwrap();
        let openings = [
            LuminousOpening::Box { x_m: SIDE_M, y_m: SIDE_M, height_m: SIDE_M },
            LuminousOpening::Ellipse { x_m: SIDE_M, y_m: SIDE_M, height_m: SIDE_M },
            LuminousOpening::Ellipsoid { x_m: SIDE_M, y_m: SIDE_M, z_m: SIDE_M },
        ];
        for opening in openings {
            for below_m in [1e-3, 1e-4, 1e-5] {
                let emitter = upright(opening, &table);
                let position_m = DVec3::new(1.0, 0.03, 0.5 * SIDE_M - below_m);
                let meter = Meter { position_m, normal: DVec3::NEG_X };
                let found = emitter.illuminance(&meter, &[], Precision::relative(1e-4));
                // All that is seen, so finely that the sliver is met.
                let own = LocalMeter::of(&emitter.luminaire, &meter);
                let mut truth = 0.0;
                for sheet in facing(&emitter.opening, own.position_m) {
                    let n = 3000;
                    for i in 0..n {
                        for j in 0..40 {
                            // Where the sliver is, along either coordinate, steps are fine.
                            let [fine, coarse] = [(f64::from(i) + 0.5) / f64::from(n), (f64::from(j) + 0.5) / 40.0];
                            let fine = 1.0 - (1.0 - fine).powi(3);
                            let weight = 3.0 * (1.0 - (f64::from(i) + 0.5) / f64::from(n)).powi(2);
                            let uv =
                                if matches!(sheet, OpeningPart::Cap { .. }) { [fine, coarse] } else { [coarse, fine] };
                            truth += weight * emitter.density(&own, &sheet.part(uv)) / f64::from(40 * n);
                        }
                    }
                }
                let Bounded { value, bound } = found;
                assert!((value - truth).abs() <= bound + 1e-2 * value, "{opening:?}, {below_m} m: {found:?}, {truth}");
            }
        }
    }

    struct Random(u64);

    impl Random {
        /// From 0 to 1.
        fn f64(&mut self) -> f64 {
            self.0 = crate::sampler::mix(self.0.wrapping_add(1));
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }

        fn direction(&mut self) -> DVec3 {
            DVec3::from_array([(); 3].map(|()| self.f64() - 0.5)).normalize_or(DVec3::X)
        }
    }

    /// Openings of every form, turned and looked at from anywhere by a meter whose horizon may cut what is lit: a kink that rules meet or miss
    /// by chance.
    #[test]
    fn rules_that_agree_by_chance_do_not_end_an_integral() {
        let mut random = Random(crate::seed_of_night(65));
        let (mut bounds, mut broken) = (0, vec![]);
        let chances = crate::by_night(5000, 800);
        for k in 0..chances {
            let [x_m, y_m, z_m] = [(); 3].map(|()| 0.05 + 0.4 * random.f64());
            let opening = match k % 5 {
                0 => LuminousOpening::Ellipsoid { x_m, y_m, z_m },
                1 => LuminousOpening::Ellipse { x_m, y_m, height_m: z_m },
                2 => LuminousOpening::Ellipse { x_m, y_m, height_m: 0.0 },
                3 => LuminousOpening::LyingCylinder { axis: HorizontalAxis::Y, length_m: x_m, diameter_m: y_m },
                _ => LuminousOpening::Box { x_m, y_m, height_m: z_m },
            };
            let planes = vec![0.0, 45.0, 90.0, 180.0, 270.0, 360.0];
            let gamma_deg: Vec<f64> = (0..=12).map(|g| 15.0 * f64::from(g)).collect();
            let mut candela: Vec<f64> = (0..5 * gamma_deg.len()).map(|_| 100.0 * random.f64()).collect();
            candela.extend_from_within(..gamma_deg.len());
            let table = LuminousIntensityDistribution::new(planes, gamma_deg, candela).unwrap();
            let (towards, tilt) = (random.direction(), random.direction());
            let away_m = 0.4 + 1.6 * random.f64();
            // Half of the meters look past the opening, so that their horizon cuts it.
            let across = (tilt - tilt.dot(towards) * towards).normalize_or(DVec3::Z);
            let lean = 0.3 * (random.f64() - 0.5);
            let normal = if k % 2 == 0 { (across - lean * towards).normalize() } else { -towards };
            let meter = Meter { position_m: away_m * towards, normal };
            let emitter = upright(opening, &table);
            let found = emitter.illuminance(&meter, &[], Precision::relative(1e-3));
            let truth = emitter.illuminance(&meter, &[], Precision::relative(1e-5));
            if truth.value > 0.0 {
                bounds += 1;
                if (found.value - truth.value).abs() > found.bound + truth.bound {
                    broken.push(format!("{k} {opening:?}: {found:?}, {truth:?}"));
                }
            }
        }
        assert!(bounds > chances / 3 && broken.is_empty(), "{} of {bounds}: {broken:#?}", broken.len());
    }

    /// What a fine grid of midpoints over an opening makes of its light, so many along a side.
    fn by_midpoints(emitter: &Emitter, meter: &Meter, side: i32) -> f64 {
        let own = LocalMeter::of(&emitter.luminaire, meter);
        let mut sum = 0.0;
        for sheet in facing(&emitter.opening, own.position_m) {
            for k in 0..side * side {
                let uv = [k / side, k % side].map(|k| (f64::from(k) + 0.5) / f64::from(side));
                sum += emitter.density(&own, &sheet.part(uv));
            }
        }
        sum / f64::from(side * side)
    }

    /// Sky and ground seen through an opening in a wall: planes a thousandth of a degree apart disagree.
    #[test]
    fn the_bound_holds_where_planes_disagree() {
        let (c_deg, gamma_deg) = (vec![0.0, 90.0, 90.001, 180.0], vec![0.0, 30.0, 60.0, 90.0]);
        let candela = [100.0, 90.0, 30.0, 30.0].map(|cd| [1.0, 0.9, 0.5, 0.0].map(|part| part * cd)).concat();
        let table = LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).unwrap();
        for (opening, x_m) in [
            (LuminousOpening::Box { x_m: 0.07, y_m: 0.05, height_m: 0.0 }, [0.0, 0.011, -0.02, 0.03]),
            (LuminousOpening::Ellipse { x_m: 0.07, y_m: 0.07, height_m: 0.0 }, [0.0, 0.011, -0.02, 0.03]),
        ]
        .into_iter()
        .flat_map(|(opening, all)| all.map(|x| (opening, x)))
        {
            let emitter = upright(opening, &table);
            let meter = Meter { position_m: DVec3::new(x_m, 0.05, -0.3), normal: DVec3::new(0.0, -0.6, 0.8) };
            // Where the planes meet, at 1/2, 3/14, 23/35 and 13/14 of the box, none of so many cells is cut.
            let side = if matches!(opening, LuminousOpening::Box { .. }) { 700 } else { 600 };
            let truth = by_midpoints(&emitter, &meter, side);
            for error in [1e-2, 3e-3, 1e-3] {
                let Bounded { value, bound } = emitter.illuminance(&meter, &[], Precision::relative(error));
                let blur = 6e-4 * truth;
                assert!((value - truth).abs() <= bound + blur, "{opening:?}, {x_m}: {value} +- {bound}, {truth}");
                assert!(bound <= 3.0 * error * value, "{opening:?}, {x_m}: {value} +- {bound} for {error}");
            }
        }
    }

    /// Tables that end in light, whose end runs across what is seen of an opening.
    #[test]
    fn the_bound_holds_where_a_table_ends_in_light() {
        const SIDE: i32 = 600;
        let table = LuminousIntensityDistribution::axial(vec![0.0, 10.0], vec![100.0, 60.0]).unwrap();
        let openings = [
            LuminousOpening::Box { x_m: 0.07, y_m: 0.05, height_m: 0.03 },
            LuminousOpening::Box { x_m: 0.07, y_m: 0.05, height_m: 0.0 },
            LuminousOpening::Ellipse { x_m: 0.07, y_m: 0.07, height_m: 0.0 },
            LuminousOpening::Ellipse { x_m: 0.07, y_m: 0.07, height_m: 0.05 },
            LuminousOpening::Ellipsoid { x_m: 0.07, y_m: 0.07, z_m: 0.07 },
        ];
        let gammas_deg = [8.6, 9.3, 9.7, 10.0, 10.6, 11.5];
        for (opening, gamma_deg) in openings.into_iter().flat_map(|o| gammas_deg.map(|g| (o, g))) {
            let emitter = upright(opening, &table);
            let (sin, cos) = f64::to_radians(gamma_deg).sin_cos();
            let meter = Meter { position_m: 0.8 * DVec3::new(0.8 * sin, 0.6 * sin, -cos), normal: DVec3::Z };
            let truth = by_midpoints(&emitter, &meter, SIDE);
            // What midpoints make of an edge.
            let blur = 100.0 / f64::from(SIDE);
            for error in [1e-2, 1e-3] {
                let Bounded { value, bound } = emitter.illuminance(&meter, &[], Precision::relative(error));
                assert!((value - truth).abs() <= bound + blur, "{opening:?}, {gamma_deg}: {value} +- {bound}, {truth}");
                assert!(bound <= 10.0 * error * value + blur, "{opening:?}, {gamma_deg}: {value} +- {bound}");
            }
        }
    }
}
