//! Tables of types A and B in their native angles: planes that cover a sector of the circle about a native axis.
//!
//! The intensity beyond the sector is zero.

use glam::{DMat3, DVec3};

use super::{
    DistributionError, LuminousIntensityDistribution, ROUNDED_DEG, Symmetry, angles_deg, bracket, check_rising,
    direction, tabulate,
};
use crate::goniometer::{self, Goniometer, SAME_DEG};
use crate::units::Candela;

impl LuminousIntensityDistribution {
    /// A table of type A or B in native angles: at least two planes over at most a circle, dark beyond the first and the last.
    pub(crate) fn native(
        goniometer: Goniometer,
        c_deg: Vec<f64>,
        gamma_deg: Vec<f64>,
        candela: Vec<f64>,
    ) -> Result<Self, DistributionError> {
        check_rising("horizontal or vertical", &c_deg)?;
        let (planes, gammas) = (c_deg.len(), gamma_deg.len());
        let [first, .., last] = c_deg[..] else {
            return Err(DistributionError::Count { found: candela.len(), planes, gammas });
        };
        if last - first > 360.0 {
            let (axis, expected) = ("horizontal or vertical", "they cover no more than a circle");
            return Err(DistributionError::Range { axis, first, last, expected });
        }
        // Even planes over the circle pass the checks of `new`, which also validates angles and intensities.
        let steps = (planes - 1) as f64;
        let even = (0..planes).map(|k| 360.0 * k as f64 / steps).collect();
        let Self { gamma_deg, candela, .. } = Self::new(even, gamma_deg, candela)?;
        let symmetry = detect_mirrors(goniometer, &c_deg, &gamma_deg, &candela);
        Ok(Self { goniometer, symmetry, c_deg, gamma_deg, candela })
    }

    /// A table of the same type with other angles and intensities.
    pub fn with_table(
        &self,
        c_deg: Vec<f64>,
        gamma_deg: Vec<f64>,
        candela: Vec<f64>,
    ) -> Result<Self, DistributionError> {
        match self.goniometer {
            Goniometer::C => Self::new(c_deg, gamma_deg, candela),
            kind => Self::native(kind, c_deg, gamma_deg, candela),
        }
    }

    /// The type of the table's angles.
    pub fn goniometer(&self) -> Goniometer {
        self.goniometer
    }

    /// Whether this is a table of type A or B: then `c_deg`, `gamma_deg` and `plane` are in native angles and cover a sector.
    pub fn is_native(&self) -> bool {
        self.goniometer != Goniometer::C
    }

    /// Whether the planes cover less than the circle.
    pub(super) fn is_sector(&self) -> bool {
        self.is_native() && self.c_deg[self.c_deg.len() - 1] - self.c_deg[0] < 360.0
    }

    /// The native angles of a direction in the luminaire's frame; [`angles_deg`] gives those of type C.
    pub fn own_angles_deg(&self, direction: DVec3) -> (f64, f64) {
        angles_deg(if self.goniometer == Goniometer::B { goniometer::to_lying_frame(direction) } else { direction })
    }

    /// The unit direction of native angles, in the luminaire's frame.
    pub fn own_direction(&self, c_deg: f64, gamma_deg: f64) -> DVec3 {
        self.own_frame() * direction(c_deg, gamma_deg)
    }

    /// The frame in which the planes are vertical, as axes in the luminaire's frame. The frame of type B is horizontal.
    pub fn own_frame(&self) -> DMat3 {
        if self.goniometer == Goniometer::B { goniometer::LYING } else { DMat3::IDENTITY }
    }

    /// The angle within the stored planes that has the intensities of `c_deg`; `None` beyond a sector.
    pub(super) fn stored_c_deg(&self, c_deg: f64) -> Option<f64> {
        if self.is_native() { goniometer::within_sector(&self.c_deg, c_deg) } else { Some(self.symmetry.fold(c_deg)) }
    }

    /// At least two planes about the native axis: the full circle of type C, the sector of types A and B.
    #[must_use]
    pub fn own_planes(&self) -> Self {
        if self.is_native() { self.clone() } else { self.full_circle() }
    }

    /// Whether a direction in the luminaire's frame, of any length, is within the table.
    pub fn covers(&self, direction: DVec3) -> bool {
        let (c, gamma) = self.own_angles_deg(direction);
        let is_within = (self.gamma_deg[0]..=self.gamma_deg[self.gamma_deg.len() - 1]).contains(&gamma);
        is_within && self.stored_c_deg(c).is_some()
    }

    /// The largest intensity at the edge of the table: where it ends before a pole, or at the end of its sector.
    pub fn edge_intensity(&self) -> Candela {
        let (planes, gammas) = (self.c_deg.len(), self.gamma_deg.len());
        let mut edge = 0.0_f64;
        if self.gamma_deg[0] > 0.0 {
            edge = edge.max(self.max_at_gamma(0));
        }
        if self.gamma_deg[gammas - 1] < 180.0 {
            edge = edge.max(self.max_at_gamma(gammas - 1));
        }
        if self.is_sector() {
            let ends = self.plane(0).iter().chain(self.plane(planes - 1));
            edge = edge.max(ends.copied().fold(0.0, f64::max));
        }
        Candela(edge)
    }

    /// The largest intensity over all planes at the gamma angle of this index.
    fn max_at_gamma(&self, g: usize) -> f64 {
        (0..self.c_deg.len()).map(|c| self.plane(c)[g]).fold(0.0, f64::max)
    }

    /// Whether no node that contributes light above the horizon is brighter than `candela`.
    pub fn is_dark_above(&self, candela: Candela) -> bool {
        let nodes = (0..self.c_deg.len()).flat_map(|p| (0..self.gamma_deg.len()).map(move |g| (p, g)));
        nodes.filter(|(p, g)| self.reaches_above(*p, *g)).all(|(p, g)| self.plane(p)[g] <= candela.value())
    }

    /// Whether a cell at this node extends above the horizon.
    fn reaches_above(&self, plane: usize, gamma: usize) -> bool {
        if self.goniometer != Goniometer::B {
            return self.gamma_deg[(gamma + 1).min(self.gamma_deg.len() - 1)] > 90.0;
        }
        // The horizon of type B is V -90 and 90.
        let neighbours = [plane.saturating_sub(1), (plane + 1).min(self.c_deg.len() - 1)];
        neighbours.iter().any(|k| self.c_deg[*k].abs() > 90.0)
    }

    /// The same planes and intensities about the vertical.
    ///
    /// A luminaire with this table and an orientation turned by [`Self::own_frame`] emits the same light.
    #[must_use]
    pub fn upright(&self) -> Self {
        if self.goniometer != Goniometer::B {
            return self.clone();
        }
        let symmetry = detect_mirrors(Goniometer::A, &self.c_deg, &self.gamma_deg, &self.candela);
        Self { goniometer: Goniometer::A, symmetry, ..self.clone() }
    }

    /// The same planes about the vertical, and the frame of that table.
    ///
    /// A sector is centred on C 180, so that the circle closes at C 0 in the dark.
    pub fn about_the_vertical(&self) -> (Self, DMat3) {
        let (table, frame) = (self.upright(), self.own_frame());
        if !table.is_sector() || table.symmetry != Symmetry::None {
            return (table, frame);
        }
        let middle = 0.5 * (table.c_deg[0] + table.c_deg[table.c_deg.len() - 1]);
        let turn = (180.0 - middle).round();
        let c_deg = table.c_deg.iter().map(|c| c + turn).collect();
        (Self { c_deg, ..table }, frame * DMat3::from_rotation_z(-turn.to_radians()))
    }

    /// The mirror image in the plane of C 90 and C 270: light along x becomes light along -x.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let gammas = self.gamma_deg.len();
        let own = self.own_planes();
        let candela: Vec<f64> = own.candela.chunks(gammas).rev().flatten().copied().collect();
        match self.goniometer {
            Goniometer::A | Goniometer::B => {
                let about = if self.goniometer == Goniometer::A { 180.0 } else { 0.0 };
                let c_deg: Vec<f64> = own.c_deg.iter().rev().map(|c| about - c).collect();
                let symmetry = detect_mirrors(self.goniometer, &c_deg, &self.gamma_deg, &candela);
                Self { symmetry, c_deg, candela, ..own }
            }
            Goniometer::C => {
                let images = own.c_deg.iter().map(|c| (180.0 - c).rem_euclid(360.0)).chain([0.0, 360.0]);
                let mut c_deg: Vec<f64> = images.collect();
                c_deg.sort_by(f64::total_cmp);
                c_deg.dedup();
                let candela = tabulate(&c_deg, &own.gamma_deg, |c, g| own.own_intensity(180.0 - c % 360.0, g).value());
                Self::full_table(c_deg, own.gamma_deg, candela)
            }
        }
    }

    /// Directions in the luminaire's frame of all nodes and of the centres of all cells.
    pub fn node_directions(&self) -> impl Iterator<Item = DVec3> + use<'_> {
        self.own_planes().nodes_and_centres().map(|(c, gamma)| self.own_direction(c, gamma))
    }

    /// (C, gamma) of type C of all nodes, plane by plane.
    pub fn nodes_deg(&self) -> Vec<(f64, f64)> {
        let all = self.c_deg.iter().flat_map(|c| self.gamma_deg.iter().map(move |gamma| (*c, *gamma)));
        match self.goniometer {
            Goniometer::B => all.map(|(c, gamma)| snap_to_pole(angles_deg(self.own_direction(c, gamma)))).collect(),
            Goniometer::A => all.map(|(c, gamma)| (c.rem_euclid(360.0), gamma)).collect(),
            Goniometer::C => all.collect(),
        }
    }

    /// Gamma angles of type C for drawing a half plane: those of the table, or whole degrees for type B, which has no such nodes.
    pub fn gammas_of_half_planes(&self) -> Vec<f64> {
        if self.goniometer == Goniometer::B { (0..=180).map(f64::from).collect() } else { self.gamma_deg.clone() }
    }

    /// The jump at the ends of a sector of planes: the light there, or the difference of both ends of a full circle.
    pub(super) fn jump_of_sector(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        let [first, last] = [self.c_deg[0], self.c_deg[self.c_deg.len() - 1]];
        let is_at_first = is_same_plane(c_deg, first);
        if !self.is_native() || !is_at_first && !is_same_plane(c_deg, last) {
            return 0.0;
        }
        let [low, high] = [0, self.c_deg.len() - 1].map(|plane| self.end_plane_intensity(plane, gamma_deg));
        if last - first >= 360.0 {
            return (low - high).abs();
        }
        if is_at_first { low } else { high }
    }

    /// The intensity on the first or last plane; zero where the table is dark at that plane and gamma.
    fn end_plane_intensity(&self, plane: usize, gamma_deg: f64) -> f64 {
        let is_lit = self.own_intensity(self.c_deg[plane], gamma_deg).value() > 0.0;
        if is_lit { self.interpolate_plane(plane, bracket(&self.gamma_deg, gamma_deg)) } else { 0.0 }
    }
}

/// Whether two C angles are the same plane to rounding, up to whole turns.
fn is_same_plane(a_deg: f64, b_deg: f64) -> bool {
    ((a_deg - b_deg + 180.0).rem_euclid(360.0) - 180.0).abs() <= ROUNDED_DEG
}

/// Replaces angles that are at a pole to rounding by those of the pole.
fn snap_to_pole((c, gamma): (f64, f64)) -> (f64, f64) {
    match gamma {
        ..SAME_DEG => (0.0, 0.0),
        _ if gamma > 180.0 - SAME_DEG => (0.0, 180.0),
        _ => (c, gamma),
    }
}

/// Whether angles are symmetric about a centre.
fn is_centred(angles: &[f64], centre: f64) -> bool {
    angles.iter().zip(angles.iter().rev()).all(|(a, b)| (a + b - 2.0 * centre).abs() < SAME_DEG)
}

/// Detects the type C mirrors of a type A or B table. Mirrors of the nodes are mirrors of the interpolated table.
fn detect_mirrors(goniometer: Goniometer, c_deg: &[f64], gamma_deg: &[f64], candela: &[f64]) -> Symmetry {
    let gammas = gamma_deg.len();
    let across = is_centred(c_deg, 0.0) && candela.chunks(gammas).eq(candela.chunks(gammas).rev());
    let along = is_centred(gamma_deg, 90.0) && candela.chunks(gammas).all(|row| row.iter().eq(row.iter().rev()));
    match (goniometer, across, along) {
        (Goniometer::B, true, true) => Symmetry::Quadrant,
        (Goniometer::A, true, _) | (Goniometer::B, false, true) => Symmetry::BilateralC0,
        (Goniometer::B, true, false) => Symmetry::BilateralC90,
        _ => Symmetry::None,
    }
}
