//! Rows of the transport operator: the irradiance at a point from each nodal polynomial of exitance 1 on the surfaces.
//!
//! Far elements use their own nodes as a quadrature rule. Near ones are halved until each part is small against its
//! distance, and integrated in the graded parameter, where the integrand is smooth. Elements that the receiver's
//! horizon crosses are cut along it, because a kink would cost every digit past the third.

#![expect(clippy::inline_always, reason = "compiled for what the processor has")]

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use super::grid::{Element, Face, Grid, MOST, dyadic};

/// Elements at least this many half-widths away are far.
///
/// No whole number, here and below: grids make distances that are whole multiples, and rounding would decide.
const FAR: f64 = 4.0123;
/// Parts of near elements are halved until they lie at least this many half-widths away.
const NEAR: f64 = 2.0123;
/// How much longer one side must be than the other to be halved first.
const TIE: f64 = 1.000_123;
/// Parts smaller than this fraction of the room are not halved further.
const SMALLEST: f64 = 1e-13;

/// A receiving element: where it is, where it faces, and on which surface it lies, if any.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Receiver {
    pub(super) position_m: DVec3,
    pub(super) normal: DVec3,
    pub(super) face: Option<Face>,
}

/// One element of one face as a receiver sees it.
struct Panel<'a> {
    grid: &'a Grid,
    along_u: &'a Element,
    along_v: &'a Element,
    view: View,
}

/// The kernel on the plane of one face: cos cos / (π r²) at offsets (u, v) from the foot of the receiver.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    foot_u: f64,
    foot_v: f64,
    /// Squared distance to the plane.
    depth2: f64,
    /// Distance to the plane over π.
    scale: f64,
    /// The receiver's cosine numerator is `level + tilt_u u + tilt_v v`.
    level: f64,
    tilt_u: f64,
    tilt_v: f64,
}

/// Terms that are summed side by side, the same on every machine; points come in as many.
pub(super) const LANES: usize = 4;

enum Horizon {
    Above,
    Crosses,
    Below,
}

/// A part of a cut element: from s0 to s1 along u, from t0 to t1 of the lit range along v.
#[derive(Clone, Copy)]
struct Part {
    s: (f64, f64),
    t: (f64, f64),
    lit: LitRange,
}

/// An interval of an element's parameter, and the nodal polynomials `[point][node]` at the near rule's points in it.
struct Span<'a> {
    start: f64,
    length: f64,
    basis: &'a [f64],
}

/// How much of the face a part covers, in metres.
struct Extent {
    u: (f64, f64),
    v: (f64, f64),
    length_s: f64,
    length_t: f64,
}

/// Which v of a strip lie above the horizon; judged once, mid-strip, because at its ends rounding would decide.
#[derive(Clone, Copy)]
enum LitRange {
    All,
    BelowCrossing,
    AboveCrossing,
}

impl Grid {
    /// Adds to `row` the irradiance at the receiver from every nodal polynomial, exitance 1.
    pub(super) fn add_row(&self, receiver: &Receiver, row: &mut [f64]) {
        for face in Face::ALL {
            if receiver.face == Some(face) {
                continue;
            }
            let view = View::new(self.size_m, receiver, face);
            let (_, u, v) = face.axes();
            let (_, stride) = self.counts(face);
            for (eu, along_u) in self.axes[u].elements.iter().enumerate() {
                for (ev, along_v) in self.axes[v].elements.iter().enumerate() {
                    let block = &mut row[self.offsets[face.0] + eu * self.order * stride + ev * self.order..];
                    let panel = Panel { grid: self, along_u, along_v, view };
                    match panel.horizon() {
                        Horizon::Below => {}
                        Horizon::Crosses => panel.add_cut(block, stride),
                        Horizon::Above if panel.is_far() => {
                            let (u, v) = (self.axes[u].of(eu), self.axes[v].of(ev));
                            Arch::new().dispatch(FarShare { view, u, v, block, stride });
                        }
                        Horizon::Above => panel.add_near(block, stride),
                    }
                }
            }
        }
    }
}

impl View {
    pub(super) fn new(size_m: DVec3, receiver: &Receiver, face: Face) -> Self {
        let (n, u, v) = face.axes();
        let depth = face.plane(size_m) - receiver.position_m[n];
        Self {
            foot_u: receiver.position_m[u],
            foot_v: receiver.position_m[v],
            depth2: depth * depth,
            scale: -depth * face.sign() / std::f64::consts::PI,
            level: receiver.normal[n] * depth,
            tilt_u: receiver.normal[u],
            tilt_v: receiver.normal[v],
        }
    }

    /// What points above the receiver's horizon send there: their places along u and v and the flux that each reflects, as many of each.
    pub(super) fn irradiance(&self, points: &[f64]) -> f64 {
        Arch::new().dispatch(PointSum { view: *self, points })
    }
}

/// A far element, for its share of a row.
struct FarShare<'a> {
    view: View,
    u: (&'a [f64], &'a [f64]),
    v: (&'a [f64], &'a [f64]),
    block: &'a mut [f64],
    stride: usize,
}

impl WithSimd for FarShare<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { view, u: (us, wu), v: (vs, wv), block, stride } = self;
        let order = us.len();
        let (mut cosine, mut squared) = ([0.0; MOST], [0.0; MOST]);
        for b in 0..order {
            let dv = vs[b] - view.foot_v;
            cosine[b] = wv[b] * (view.level + view.tilt_v * dv);
            squared[b] = view.depth2 + dv * dv;
        }
        for a in 0..order {
            let du = us[a] - view.foot_u;
            let (w, u2, cu) = (wu[a] * view.scale, du * du, view.tilt_u * du);
            let out = &mut block[a * stride..][..order];
            for b in 0..order {
                let r2 = u2 + squared[b];
                out[b] += w * (cosine[b] + cu * wv[b]) / (r2 * r2);
            }
        }
    }
}

struct PointSum<'a> {
    view: View,
    points: &'a [f64],
}

impl WithSimd for PointSum<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let view = self.view;
        let (us, rest) = self.points.split_at(self.points.len() / 3);
        let (vs, fluxes) = rest.split_at(us.len());
        let (us, vs, fluxes) = (us.as_chunks::<LANES>().0, vs.as_chunks::<LANES>().0, fluxes.as_chunks::<LANES>().0);
        let mut lanes = [0.0; LANES];
        for ((u, v), flux) in us.iter().zip(vs).zip(fluxes) {
            for k in 0..LANES {
                let (du, dv) = (u[k] - view.foot_u, v[k] - view.foot_v);
                let r2 = du * du + dv * dv + view.depth2;
                let height = view.level + view.tilt_u * du + view.tilt_v * dv;
                lanes[k] += flux[k] * height.max(0.0) / (r2 * r2);
            }
        }
        view.scale * ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3]))
    }
}

/// A part of an element, for its share of a row.
struct Share<'a> {
    panel: &'a Panel<'a>,
    u: &'a Span<'a>,
    v: &'a Span<'a>,
    block: &'a mut [f64],
    stride: usize,
}

impl WithSimd for Share<'_> {
    type Output = ();

    /// The same code, compiled for the sizes of each effort: loops of known length take a third of the time.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { panel, u, v, block, stride } = self;
        match (panel.grid.order, panel.grid.near.nodes.len()) {
            (2, 4) => panel.add_part_of((2, 4), u, v, block, stride),
            (4, 4) => panel.add_part_of((4, 4), u, v, block, stride),
            (5, 6) => panel.add_part_of((5, 6), u, v, block, stride),
            (6, 8) => panel.add_part_of((6, 8), u, v, block, stride),
            (8, 8) => panel.add_part_of((8, 8), u, v, block, stride),
            (10, 10) => panel.add_part_of((10, 10), u, v, block, stride),
            (12, 12) => panel.add_part_of((12, 12), u, v, block, stride),
            sizes => panel.add_part_of(sizes, u, v, block, stride),
        }
    }
}

impl Panel<'_> {
    fn horizon(&self) -> Horizon {
        // Corners on the horizon, but for rounding, belong to either side.
        let rounding = 1e-14 * self.grid.size_m.max_element();
        let (mut above, mut below) = (false, false);
        for u in [self.along_u.start_m, self.along_u.end_m] {
            for v in [self.along_v.start_m, self.along_v.end_m] {
                let height = self.height(u, v);
                above |= height > rounding;
                below |= height < -rounding;
            }
        }
        match (above, below) {
            (true, true) => Horizon::Crosses,
            (true, false) => Horizon::Above,
            (false, _) => Horizon::Below,
        }
    }

    fn height(&self, u: f64, v: f64) -> f64 {
        let view = &self.view;
        view.level + view.tilt_u * (u - view.foot_u) + view.tilt_v * (v - view.foot_v)
    }

    fn distance2(&self, u: (f64, f64), v: (f64, f64)) -> f64 {
        let du = (self.view.foot_u - u.1).max(u.0 - self.view.foot_u).max(0.0);
        let dv = (self.view.foot_v - v.1).max(v.0 - self.view.foot_v).max(0.0);
        du * du + dv * dv + self.view.depth2
    }

    fn is_far(&self) -> bool {
        let (u, v) = ((self.along_u.start_m, self.along_u.end_m), (self.along_v.start_m, self.along_v.end_m));
        let reach = FAR * 0.5 * (u.1 - u.0).max(v.1 - v.0);
        reach * reach <= self.distance2(u, v)
    }

    /// Whether a patch must be halved before a product rule sees it as smooth.
    fn is_too_near(&self, u: (f64, f64), v: (f64, f64)) -> bool {
        let widest = 0.5 * (u.1 - u.0).max(v.1 - v.0);
        let reach = NEAR * widest;
        reach * reach > self.distance2(u, v) && widest > SMALLEST * self.grid.size_m.max_element()
    }

    fn add_near(&self, block: &mut [f64], stride: usize) {
        let mut parts = vec![(1_usize, 1_usize)];
        while let Some((iu, iv)) = parts.pop() {
            let ((s0, ds), (t0, dt)) = (dyadic(iu), dyadic(iv));
            let u = (self.along_u.at(s0).0, self.along_u.at(s0 + ds).0);
            let v = (self.along_v.at(t0).0, self.along_v.at(t0 + dt).0);
            if self.is_too_near(u, v) {
                if u.1 - u.0 >= TIE * (v.1 - v.0) {
                    parts.extend([(2 * iu, iv), (2 * iu + 1, iv)]);
                } else {
                    parts.extend([(iu, 2 * iv), (iu, 2 * iv + 1)]);
                }
                continue;
            }
            let (mut own_u, mut own_v) = (vec![], vec![]);
            let matrix_u = self.matrix(iu, &mut own_u);
            let matrix_v = self.matrix(iv, &mut own_v);
            self.add_part(
                &Span { start: s0, length: ds, basis: matrix_u },
                &Span { start: t0, length: dt, basis: matrix_v },
                block,
                stride,
            );
        }
    }

    fn matrix<'b>(&'b self, interval: usize, own: &'b mut Vec<f64>) -> &'b [f64] {
        if let Some(kept) = self.grid.cached(interval) {
            return kept;
        }
        let (start, length) = dyadic(interval);
        self.grid.interpolation(start, length, own);
        own
    }

    fn add_part(&self, u: &Span, v: &Span, block: &mut [f64], stride: usize) {
        Arch::new().dispatch(Share { panel: self, u, v, block, stride });
    }

    #[inline(always)]
    fn add_part_of(&self, (order, points): (usize, usize), u: &Span, v: &Span, block: &mut [f64], stride: usize) {
        let (view, rule) = (&self.view, &self.grid.near);
        let (nodes, weights) = (&rule.nodes[..points], &rule.weights[..points]);
        let (basis_u, basis_v) = (&u.basis[..points * order], &v.basis[..points * order]);
        let (mut squared, mut cosine, mut weight) = ([0.0; MOST], [0.0; MOST], [0.0; MOST]);
        for q in 0..points {
            let (y, dy) = self.along_v.at(v.start + v.length * nodes[q]);
            let dv = y - view.foot_v;
            squared[q] = view.depth2 + dv * dv;
            cosine[q] = view.level + view.tilt_v * dv;
            weight[q] = weights[q] * dy * v.length * u.length * view.scale;
        }
        let mut sums = [[0.0; MOST]; MOST];
        for p in 0..points {
            let (x, dx) = self.along_u.at(u.start + u.length * nodes[p]);
            let du = x - view.foot_u;
            let (w, u2, cu) = (weights[p] * dx, du * du, view.tilt_u * du);
            let mut kernel = [0.0; MOST];
            for q in 0..points {
                let r2 = u2 + squared[q];
                kernel[q] = w * weight[q] * (cosine[q] + cu) / (r2 * r2);
            }
            let mut inner = [0.0; MOST];
            for q in 0..points {
                for b in 0..order {
                    inner[b] += kernel[q] * basis_v[q * order + b];
                }
            }
            for a in 0..order {
                for b in 0..order {
                    sums[a][b] += basis_u[p * order + a] * inner[b];
                }
            }
        }
        for (a, sums) in sums[..order].iter().enumerate() {
            for (out, sum) in block[a * stride..][..order].iter_mut().zip(sums) {
                *out += sum;
            }
        }
    }

    /// Integrates the part of the element above the receiver's horizon, in strips along u between the horizon's kinks.
    fn add_cut(&self, block: &mut [f64], stride: usize) {
        let mut breaks = vec![self.along_u.start_m, self.along_u.end_m];
        for v in [self.along_v.start_m, self.along_v.end_m] {
            breaks.push(self.view.foot_u - self.height(self.view.foot_u, v) / self.view.tilt_u);
        }
        breaks.retain(|u| *u >= self.along_u.start_m && *u <= self.along_u.end_m);
        breaks.sort_by(f64::total_cmp);
        for strip in breaks.windows(2) {
            if strip[1] - strip[0] <= SMALLEST * self.grid.size_m.max_element() {
                continue;
            }
            let s = (self.along_u.parameter(strip[0]), self.along_u.parameter(strip[1]));
            let Some(lit) = self.lit(0.5 * (strip[0] + strip[1])) else { continue };
            let mut parts = vec![Part { s, t: (0.0, 1.0), lit }];
            while let Some(part) = parts.pop() {
                let extent = self.extent(&part);
                if self.is_too_near(extent.u, extent.v) {
                    parts.extend(part.halves(&extent));
                } else {
                    self.add_cut_part(&part, block, stride);
                }
            }
        }
    }

    /// Which v at a given u lie above the horizon, if any.
    fn lit(&self, u: f64) -> Option<LitRange> {
        match (self.height(u, self.along_v.start_m) > 0.0, self.height(u, self.along_v.end_m) > 0.0) {
            (true, true) => Some(LitRange::All),
            (true, false) => Some(LitRange::BelowCrossing),
            (false, true) => Some(LitRange::AboveCrossing),
            (false, false) => None,
        }
    }

    /// Start and length, as parameters, of the v range above the horizon at a given u.
    fn lit_range(&self, u: f64, lit: LitRange) -> (f64, f64) {
        let (v0, v1) = (self.along_v.start_m, self.along_v.end_m);
        let crossing = || self.along_v.parameter((v0 - self.height(u, v0) / self.view.tilt_v).clamp(v0, v1));
        match lit {
            LitRange::All => (0.0, 1.0),
            LitRange::BelowCrossing => (0.0, crossing()),
            LitRange::AboveCrossing => {
                let start = crossing();
                (start, 1.0 - start)
            }
        }
    }

    /// The ranges of u and v in metres that a part covers, and its lengths along s and along t.
    fn extent(&self, part: &Part) -> Extent {
        let u = (self.along_u.at(part.s.0).0, self.along_u.at(part.s.1).0);
        let rows = [part.s.0, 0.5 * (part.s.0 + part.s.1), part.s.1].map(|s| {
            let (start, length) = self.lit_range(self.along_u.at(s).0, part.lit);
            [part.t.0, part.t.1].map(|t| self.along_v.at(start + t * length).0)
        });
        let all = || rows.iter().flatten().copied();
        let v = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        let drift = |t: usize| (rows[0][t] - rows[2][t]).abs();
        let length_s = (u.1 - u.0).max(drift(0)).max(drift(1));
        let length_t = rows.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
        Extent { u, v, length_s, length_t }
    }

    fn add_cut_part(&self, part: &Part, block: &mut [f64], stride: usize) {
        if matches!(part.lit, LitRange::All) || self.view.tilt_u == 0.0 {
            return self.add_straight_part(part, block, stride);
        }
        let (rule, order) = (&self.grid.near, self.grid.order);
        let (mut basis_u, mut basis_v) = ([0.0; MOST], [0.0; MOST]);
        let (ds, dt) = (part.s.1 - part.s.0, part.t.1 - part.t.0);
        for (x, wx) in rule.nodes.iter().zip(&rule.weights) {
            let s = part.s.0 + ds * x;
            let (u, du) = self.along_u.at(s);
            let (start, length) = self.lit_range(u, part.lit);
            self.grid.basis(s, &mut basis_u[..order]);
            let mut sums = [0.0; MOST];
            for (y, wy) in rule.nodes.iter().zip(&rule.weights) {
                let t = start + length * (part.t.0 + dt * y);
                let (v, dv) = self.along_v.at(t);
                self.grid.basis(t, &mut basis_v[..order]);
                let (x, y) = (u - self.view.foot_u, v - self.view.foot_v);
                let r2 = x * x + y * y + self.view.depth2;
                let weight = wx * wy * du * dv * ds * dt * length;
                let kernel = weight * self.view.scale * self.height(u, v).max(0.0) / (r2 * r2);
                for b in 0..order {
                    sums[b] += kernel * basis_v[b];
                }
            }
            for a in 0..order {
                for b in 0..order {
                    block[a * stride + b] += basis_u[a] * sums[b];
                }
            }
        }
    }

    /// A part whose lit range is the same at every u: a product like any other.
    fn add_straight_part(&self, part: &Part, block: &mut [f64], stride: usize) {
        let (start, length) = self.lit_range(self.along_u.at(0.5 * (part.s.0 + part.s.1)).0, part.lit);
        let (start_t, length_t) = (start + length * part.t.0, length * (part.t.1 - part.t.0));
        let (start_s, length_s) = (part.s.0, part.s.1 - part.s.0);
        let (mut basis_u, mut basis_v) = (vec![], vec![]);
        self.grid.interpolation(start_s, length_s, &mut basis_u);
        self.grid.interpolation(start_t, length_t, &mut basis_v);
        let u = Span { start: start_s, length: length_s, basis: &basis_u };
        let v = Span { start: start_t, length: length_t, basis: &basis_v };
        self.add_part(&u, &v, block, stride);
    }
}

impl Part {
    fn halves(self, extent: &Extent) -> [Self; 2] {
        let middle = |(a, b): (f64, f64)| 0.5 * (a + b);
        if extent.length_s >= TIE * extent.length_t {
            let m = middle(self.s);
            [Self { s: (self.s.0, m), ..self }, Self { s: (m, self.s.1), ..self }]
        } else {
            let m = middle(self.t);
            [Self { t: (self.t.0, m), ..self }, Self { t: (m, self.t.1), ..self }]
        }
    }
}
