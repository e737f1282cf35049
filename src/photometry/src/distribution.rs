//! The luminous intensity distribution: a table over (C, gamma), bilinear in degrees, zero outside its gamma range.
//!
//! Tables of types A and B stay in their native angles: planes about another axis that cover a sector of the circle.
//! See [`goniometer`](super::goniometer). For them, C and gamma below mean the native angles.
//!
//! Conventions (IES LM-63 Type C, CIE 121): gamma 0 is the nadir, -z, and 180 the zenith. C 0 is +x and C 90 is +y,
//! counted from +x towards +y seen from above. Bilinear interpolation in degrees *defines* the luminaire for every
//! engine: an engine that interpolates differently deviates, and the report shows it.

mod native;
mod type_c;
mod zones;

use std::iter::repeat_n;

use glam::DVec3;

use super::goniometer::{Goniometer, SAME_DEG};
use crate::units::{Candela, Lumen};

pub use type_c::{TypeC, TypeCLimits};

/// Intensity over all directions of one luminaire, in the luminaire's own frame.
#[derive(Clone, Debug, PartialEq)]
pub struct LuminousIntensityDistribution {
    goniometer: Goniometer,
    symmetry: Symmetry,
    c_deg: Vec<f64>,
    gamma_deg: Vec<f64>,
    /// `candela[c][gamma]`: all gamma angles of a C plane are adjacent.
    candela: Vec<f64>,
}

/// How the stored C planes represent the full circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// One plane, the same for every C.
    Axial,
    /// C 0 to 90, mirrored in both vertical planes.
    Quadrant,
    /// C 0 to 180, mirrored in the C0-C180 plane.
    BilateralC0,
    /// C 90 to 270, mirrored in the C90-C270 plane.
    BilateralC90,
    /// C 0 to 360, the last plane equal to the first.
    None,
}

/// Why a table is not a luminous intensity distribution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DistributionError {
    /// Wrong number of values.
    #[error("the table holds {found} values where {planes} C planes of {gammas} angles need {}", planes * gammas)]
    Count {
        /// Values given.
        found: usize,
        /// C planes given.
        planes: usize,
        /// Gamma angles given.
        gammas: usize,
    },
    /// Angles that do not rise strictly.
    #[error("the {axis} angles must rise strictly: {after} follows {before}")]
    NotRising {
        /// `C` or `gamma`.
        axis: &'static str,
        /// The earlier angle.
        before: f64,
        /// The angle after it.
        after: f64,
    },
    /// Angles outside what the symmetry or the sphere allows.
    #[error("{axis} angles run from {first} to {last}; {expected}")]
    Range {
        /// `C` or `gamma`.
        axis: &'static str,
        /// First angle.
        first: f64,
        /// Last angle.
        last: f64,
        /// What was expected.
        expected: &'static str,
    },
    /// A value that is no intensity.
    #[error("the intensity at C {c_deg} gamma {gamma_deg} is {value}; it must be finite and not negative")]
    Intensity {
        /// C angle.
        c_deg: f64,
        /// Gamma angle.
        gamma_deg: f64,
        /// The offending value.
        value: f64,
    },
}

impl LuminousIntensityDistribution {
    /// Builds a distribution from C planes, gamma angles (degrees) and intensities `candela[c * gammas + gamma]`.
    ///
    /// `c_deg` is `[0]` for axial symmetry and otherwise spans exactly the range of its [`Symmetry`]; the symmetry
    /// is deduced from that range. `gamma_deg` may be any rising part of 0..=180; outside it the intensity is 0.
    pub fn new(c_deg: Vec<f64>, gamma_deg: Vec<f64>, candela: Vec<f64>) -> Result<Self, DistributionError> {
        check_rising("C", &c_deg)?;
        check_rising("gamma", &gamma_deg)?;
        let (planes, gammas) = (c_deg.len(), gamma_deg.len());
        if planes == 0 || gammas < 2 || candela.len() != planes * gammas {
            return Err(DistributionError::Count { found: candela.len(), planes, gammas });
        }
        let (first, last) = (gamma_deg[0], gamma_deg[gammas - 1]);
        if first < 0.0 || last > 180.0 {
            let expected = "gamma lies within 0 (nadir) and 180 (zenith)";
            return Err(DistributionError::Range { axis: "gamma", first, last, expected });
        }
        let symmetry = Symmetry::from_planes(&c_deg)?;
        for (k, &value) in candela.iter().enumerate() {
            if !value.is_finite() || value < 0.0 {
                let (c_deg, gamma_deg) = (c_deg[k / gammas], gamma_deg[k % gammas]);
                return Err(DistributionError::Intensity { c_deg, gamma_deg, value });
            }
        }
        Ok(Self { goniometer: Goniometer::C, symmetry, c_deg, gamma_deg, candela })
    }

    /// A distribution with axial symmetry.
    pub fn axial(gamma_deg: Vec<f64>, candela: Vec<f64>) -> Result<Self, DistributionError> {
        Self::new(vec![0.0], gamma_deg, candela)
    }

    /// Intensity at (C, gamma) in degrees for any real C; zero where gamma is outside the table.
    pub fn intensity(&self, c_deg: f64, gamma_deg: f64) -> Candela {
        match self.goniometer {
            Goniometer::A | Goniometer::C => self.own_intensity(c_deg, gamma_deg),
            Goniometer::B if (0.0..=180.0).contains(&gamma_deg) => self.intensity_towards(direction(c_deg, gamma_deg)),
            Goniometer::B => Candela(0.0),
        }
    }

    /// Intensity at the table's native angles in degrees.
    pub(super) fn own_intensity(&self, c_deg: f64, gamma_deg: f64) -> Candela {
        let last = self.gamma_deg.len() - 1;
        // The angles of a native table are computed: rounding moves the edge of the table to either side.
        let slack = if self.is_native() { SAME_DEG } else { 0.0 };
        if !(gamma_deg >= self.gamma_deg[0] - slack && gamma_deg <= self.gamma_deg[last] + slack) {
            return Candela(0.0);
        }
        let place = bracket(&self.gamma_deg, gamma_deg);
        if self.c_deg.len() == 1 {
            return Candela(self.interpolate_plane(0, place));
        }
        let Some(own_c_deg) = self.stored_c_deg(c_deg) else { return Candela(0.0) };
        let (c, s) = bracket(&self.c_deg, own_c_deg);
        let (low, high) = (self.interpolate_plane(c, place), self.interpolate_plane(c + 1, place));
        Candela(lerp(low, high, s))
    }

    /// The intensity on a stored plane, at the fraction `t` of its gamma interval `g`.
    fn interpolate_plane(&self, plane: usize, (g, t): (usize, f64)) -> f64 {
        let row = self.plane(plane);
        lerp(row[g], row[g + 1], t)
    }

    /// Intensities in cd at all pairs of these angles in degrees, gamma by gamma.
    ///
    /// The values are those of [`Self::intensity`]; one call for many directions is faster.
    pub fn intensities(&self, c_deg: &[f64], gamma_deg: &[f64]) -> Vec<f64> {
        if self.is_native() {
            let rows = gamma_deg.iter().flat_map(|g| c_deg.iter().map(move |c| self.intensity(*c, *g).value()));
            return rows.collect();
        }
        let count = self.gamma_deg.len();
        let range = self.gamma_deg[0]..=self.gamma_deg[count - 1];
        let is_axial = self.c_deg.len() == 1;
        let places: Vec<(usize, f64)> = if is_axial {
            vec![(0, 0.0); c_deg.len()]
        } else {
            c_deg.iter().map(|c| bracket(&self.c_deg, self.symmetry.fold(*c))).collect()
        };
        let mut candela = Vec::with_capacity(c_deg.len() * gamma_deg.len());
        // An axial table gets a second plane, so that every place has two planes to interpolate between.
        let mut planes = vec![0.0; self.c_deg.len() + usize::from(is_axial)];
        for gamma in gamma_deg {
            if !range.contains(gamma) {
                candela.resize(candela.len() + c_deg.len(), 0.0);
                continue;
            }
            let (g, t) = bracket(&self.gamma_deg, *gamma);
            let rows = self.candela.chunks_exact(count);
            planes.iter_mut().zip(rows).for_each(|(value, row)| *value = lerp(row[g], row[g + 1], t));
            candela.extend(places.iter().map(|(c, s)| lerp(planes[*c], planes[c + 1], *s)));
        }
        candela
    }

    /// Intensity towards `direction` in the luminaire's frame, of any length but zero.
    ///
    /// Angles come from `atan2`, which keeps full precision at both poles.
    pub fn intensity_towards(&self, direction: DVec3) -> Candela {
        let (c, gamma) = self.own_angles_deg(direction);
        self.own_intensity(c, gamma)
    }

    /// The difference of the intensities between which rounding in `f64` decides towards `direction`, in the luminaire's frame.
    ///
    /// The table jumps where it ends with light before a pole, and at a pole on which its planes disagree. Elsewhere it is zero.
    pub fn jump_towards(&self, direction: DVec3) -> Candela {
        let (c, gamma) = self.own_angles_deg(direction);
        let (first, last) = (self.gamma_deg[0], self.gamma_deg[self.gamma_deg.len() - 1]);
        let at_first = self.jump_at_end((c, gamma), first, 0.0);
        let at_last = self.jump_at_end((c, gamma), last, 180.0);
        Candela(at_first.max(at_last).max(self.jump_of_sector(c, gamma)))
    }

    /// The jump of the table at the end `edge_deg` of its gamma range, where `pole_deg` is the pole beyond.
    fn jump_at_end(&self, (c_deg, gamma_deg): (f64, f64), edge_deg: f64, pole_deg: f64) -> f64 {
        let is_at_edge = (gamma_deg - edge_deg).abs() <= ROUNDED_DEG;
        if !is_at_edge {
            return 0.0;
        }
        if edge_deg != pole_deg {
            return self.own_intensity(c_deg, edge_deg).value();
        }
        let values = self.c_deg.iter().map(|c| self.own_intensity(*c, pole_deg).value());
        // Around the pole of a sector, the directions beyond the sector are dark.
        let darkest = if self.is_sector() { 0.0 } else { f64::INFINITY };
        let (low, high) = values.fold((darkest, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        high - low
    }

    /// Total flux, exact for the bilinear interpolation (closed form per cell).
    pub fn flux(&self) -> Lumen {
        self.own_flux_between(0.0, 180.0)
    }

    /// Flux within `from_deg <= gamma <= to_deg`, exact for the bilinear interpolation.
    pub fn flux_between(&self, from_deg: f64, to_deg: f64) -> Lumen {
        match self.goniometer {
            Goniometer::A | Goniometer::C => self.own_flux_between(from_deg, to_deg),
            Goniometer::B => Lumen(self.flux_of_zone([from_deg, to_deg], [-180.0, 180.0], [0.0, 180.0])),
        }
    }

    /// Flux between two of the table's native gamma angles.
    ///
    /// For a gamma interval from a to b, with its middle g and half its width w in radians, ∫ I sin g dg is
    /// (I(a) + I(b)) sin g sin w + (I(b) - I(a)) cos g (sin w / w - cos w). No term cancels, even where a is close to b.
    /// Over C the trapezoid rule is exact.
    pub(super) fn own_flux_between(&self, from_deg: f64, to_deg: f64) -> Lumen {
        let average = self.azimuth_average();
        let mut sum = 0.0;
        for (g, i) in self.gamma_deg.windows(2).zip(average.windows(2)) {
            let (a, b) = (g[0].max(from_deg), g[1].min(to_deg));
            if b <= a {
                continue;
            }
            let [ia, ib] = [a, b].map(|at| lerp(i[0], i[1], (at - g[0]) / (g[1] - g[0])));
            let (middle, half) = ((0.5 * (a + b)).to_radians(), (0.5 * (b - a)).to_radians());
            sum += (ia + ib) * middle.sin() * half.sin() + (ib - ia) * middle.cos() * sinc_minus_cosine(half);
        }
        Lumen(std::f64::consts::TAU * sum)
    }

    /// Mean intensity over C at each tabulated gamma, in candela; of type B about the native axis.
    pub fn azimuth_average(&self) -> Vec<f64> {
        let gammas = self.gamma_deg.len();
        if self.c_deg.len() == 1 {
            return self.candela.clone();
        }
        let span = if self.is_native() { 360.0 } else { self.c_deg[self.c_deg.len() - 1] - self.c_deg[0] };
        let mut average = vec![0.0; gammas];
        for (p, c) in self.c_deg.windows(2).enumerate() {
            let weight = 0.5 * (c[1] - c[0]) / span;
            for (g, mean) in average.iter_mut().enumerate() {
                *mean += weight * (self.candela[p * gammas + g] + self.candela[(p + 1) * gammas + g]);
            }
        }
        average
    }

    /// The same distribution with its planes written out over the full circle, C 0 to 360.
    ///
    /// Axial distributions get two equal planes (0 and 360), so that every consumer can interpolate in C. Types A and B
    /// become their type C approximation, [`Self::in_type_c`].
    #[must_use]
    pub fn full_circle(&self) -> Self {
        if self.is_native() {
            return self.in_type_c().distribution.full_circle();
        }
        let mut c_deg = match self.symmetry {
            Symmetry::Axial => vec![0.0, 360.0],
            Symmetry::None => self.c_deg.clone(),
            Symmetry::BilateralC0 => self.c_deg.iter().copied().chain(self.c_deg.iter().map(|c| 360.0 - c)).collect(),
            Symmetry::BilateralC90 => {
                let mirrored = self.c_deg.iter().map(|c| (540.0 - c).rem_euclid(360.0));
                self.c_deg.iter().copied().chain(mirrored).chain([0.0, 360.0]).collect()
            }
            Symmetry::Quadrant => self.c_deg.iter().flat_map(|c| [*c, 180.0 - c, 180.0 + c, 360.0 - c]).collect(),
        };
        c_deg.sort_by(f64::total_cmp);
        c_deg.dedup();
        let candela = tabulate(&c_deg, &self.gamma_deg, |c, g| self.intensity(c, g).value());
        Self::full_table(c_deg, self.gamma_deg.clone(), candela)
    }

    /// The same distribution with a table over the whole of gamma 0 to 180, for renderers that extrapolate.
    ///
    /// Where the table ends with light before a pole, it falls to zero within `step_deg`. Types A and B become their
    /// type C approximation, [`Self::in_type_c`].
    #[must_use]
    pub fn padded(&self, step_deg: f64) -> Self {
        if self.is_native() {
            return self.in_type_c().distribution.padded(step_deg);
        }
        let gammas = self.gamma_deg.len();
        let (first, last) = (self.gamma_deg[0], self.gamma_deg[gammas - 1]);
        let mut below = vec![];
        let mut above = vec![];
        if first > 0.0 {
            below.extend([0.0, first - step_deg].into_iter().filter(|g| *g >= 0.0 && *g < first));
            below.dedup();
        }
        if last < 180.0 {
            above.extend([last + step_deg, 180.0].into_iter().filter(|g| *g <= 180.0 && *g > last));
            above.dedup();
        }
        let mut gamma_deg = below.clone();
        gamma_deg.extend(&self.gamma_deg);
        gamma_deg.extend(&above);
        let candela = self
            .candela
            .chunks(gammas)
            .flat_map(|row| repeat_n(0.0, below.len()).chain(row.iter().copied()).chain(repeat_n(0.0, above.len())))
            .collect();
        Self { gamma_deg, candela, ..self.clone() }
    }

    /// A table over the full circle. The caller guarantees rising angles.
    pub(super) fn full_table(c_deg: Vec<f64>, gamma_deg: Vec<f64>, candela: Vec<f64>) -> Self {
        Self { goniometer: Goniometer::C, symmetry: Symmetry::None, c_deg, gamma_deg, candela }
    }

    /// An axial table. The caller takes angles and values from another table, so that they are valid.
    pub(super) fn from_average(gamma_deg: Vec<f64>, candela: Vec<f64>) -> Self {
        Self { goniometer: Goniometer::C, symmetry: Symmetry::Axial, c_deg: vec![0.0], gamma_deg, candela }
    }

    /// The same distribution with every intensity multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let candela = self.candela.iter().map(|i| i * factor).collect();
        Self { candela, ..self.clone() }
    }

    /// The symmetry of the stored planes; for types A and B the type C mirrors that hold exactly.
    pub fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    /// The stored planes in degrees about the native axis: C of type C, -H of type A, V of type B.
    pub fn c_deg(&self) -> &[f64] {
        &self.c_deg
    }

    /// The angles along a plane in degrees from the native axis: gamma of type C, 90 + V of type A, 90 + H of type B.
    pub fn gamma_deg(&self) -> &[f64] {
        &self.gamma_deg
    }

    /// The stored intensities of plane `c`, one a gamma angle, in candela.
    pub fn plane(&self, c: usize) -> &[f64] {
        let gammas = self.gamma_deg.len();
        &self.candela[c * gammas..][..gammas]
    }

    /// The largest intensity of the table, which bilinear interpolation never exceeds.
    pub fn max_intensity(&self) -> Candela {
        Candela(self.candela.iter().copied().fold(0.0, f64::max))
    }
}

impl Symmetry {
    /// Deduces the symmetry from the range of the planes.
    fn from_planes(c_deg: &[f64]) -> Result<Self, DistributionError> {
        let (first, last) = (c_deg[0], c_deg[c_deg.len() - 1]);
        match (first, last) {
            _ if c_deg == [0.0] => Ok(Self::Axial),
            (0.0, 90.0) => Ok(Self::Quadrant),
            (0.0, 180.0) => Ok(Self::BilateralC0),
            (90.0, 270.0) => Ok(Self::BilateralC90),
            (0.0, 360.0) => Ok(Self::None),
            _ => {
                let expected = "they must be 0 alone, 0-90, 0-180, 90-270 or 0-360";
                Err(DistributionError::Range { axis: "C", first, last, expected })
            }
        }
    }

    /// The angle within the stored planes that has the intensities of `c_deg`.
    fn fold(self, c_deg: f64) -> f64 {
        let c = c_deg.rem_euclid(360.0);
        match self {
            Self::Axial => 0.0,
            Self::None => c,
            Self::BilateralC0 => c.min(360.0 - c),
            Self::BilateralC90 => {
                if (90.0..=270.0).contains(&c) {
                    c
                } else {
                    (540.0 - c).rem_euclid(360.0)
                }
            }
            Self::Quadrant => {
                let half = c.min(360.0 - c);
                half.min(180.0 - half)
            }
        }
    }
}

/// (C, gamma) in degrees of a direction in the luminaire's frame; C in 0..360.
pub fn angles_deg(direction: DVec3) -> (f64, f64) {
    let c = direction.y.atan2(direction.x).to_degrees();
    let gamma = direction.x.hypot(direction.y).atan2(-direction.z).to_degrees();
    (if c < 0.0 { c + 360.0 } else { c }, gamma)
}

/// The unit direction of (C, gamma) in degrees, in the luminaire's frame.
pub fn direction(c_deg: f64, gamma_deg: f64) -> DVec3 {
    let (sin_c, cos_c) = c_deg.to_radians().sin_cos();
    let (sin_g, cos_g) = gamma_deg.to_radians().sin_cos();
    DVec3::new(sin_g * cos_c, sin_g * sin_c, -cos_g)
}

/// The values of a function at all pairs of angles, plane by plane.
pub(super) fn tabulate(c_deg: &[f64], gamma_deg: &[f64], value: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let mut values = Vec::with_capacity(c_deg.len() * gamma_deg.len());
    for &c in c_deg {
        values.extend(gamma_deg.iter().map(|&gamma| value(c, gamma)));
    }
    values
}

/// Bound of the rounding error of an angle computed in `f64`, in degrees.
const ROUNDED_DEG: f64 = 1e-9;

/// Up to this number of nodes, a linear scan is faster than a binary search.
const MAX_SCANNED_NODES: usize = 48;

/// The interval of `nodes` that contains `x`, and the position of `x` as a fraction of that interval.
fn bracket(nodes: &[f64], x: f64) -> (usize, f64) {
    let below = if nodes.len() <= MAX_SCANNED_NODES {
        nodes.iter().map(|n| usize::from(*n <= x)).sum()
    } else {
        nodes.partition_point(|n| *n <= x)
    };
    let k = below.clamp(1, nodes.len() - 1) - 1;
    let t = (x - nodes[k]) / (nodes[k + 1] - nodes[k]);
    (k, t.clamp(0.0, 1.0))
}

/// sin w / w - cos w. Small angles use the series; its first omitted term is 6e-17.
fn sinc_minus_cosine(w: f64) -> f64 {
    let square = w * w;
    if w < 0.01 { square / 3.0 * (1.0 - square / 10.0 * (1.0 - square / 28.0)) } else { w.sin() / w - w.cos() }
}

/// Linear interpolation that returns both end values exactly.
fn lerp(a: f64, b: f64, t: f64) -> f64 {
    if t < 0.5 { a + t * (b - a) } else { b - (1.0 - t) * (b - a) }
}

/// Checks that angles rise strictly.
fn check_rising(axis: &'static str, angles: &[f64]) -> Result<(), DistributionError> {
    for w in angles.windows(2) {
        // `partial_cmp` rejects NaN too.
        if !matches!(w[0].partial_cmp(&w[1]), Some(std::cmp::Ordering::Less)) {
            return Err(DistributionError::NotRising { axis, before: w[0], after: w[1] });
        }
    }
    match angles {
        [one] if !one.is_finite() => Err(DistributionError::NotRising { axis, before: *one, after: *one }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
