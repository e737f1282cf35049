//! Tables of types A and B: planes about an axis of their own that cover a sector of the circle, dark beyond it.

use glam::{DMat3, DVec3};

use super::{
    DistributionError, LuminousIntensityDistribution, ROUNDED_DEG, Symmetry, angles_deg, bracket, direction, lerp,
    rising,
};
use crate::photometry::goniometer::{self, Goniometer, SAME_DEG};
use crate::units::Candela;

impl LuminousIntensityDistribution {
    /// A table of type A or B in its own angles, at least two planes over no more than a circle; dark beyond the first and the last.
    pub(in crate::photometry) fn native(
        goniometer: Goniometer,
        c_deg: Vec<f64>,
        gamma_deg: Vec<f64>,
        candela: Vec<f64>,
    ) -> Result<Self, DistributionError> {
        rising("horizontal or vertical", &c_deg)?;
        let (planes, gammas) = (c_deg.len(), gamma_deg.len());
        let [first, .., last] = c_deg[..] else {
            return Err(DistributionError::Count { found: candela.len(), planes, gammas });
        };
        if last - first > 360.0 {
            let (axis, expected) = ("horizontal or vertical", "they cover no more than a circle");
            return Err(DistributionError::Range { axis, first, last, expected });
        }
        // What else any table must be does not depend on its planes.
        let steps = (planes - 1) as f64;
        let even = (0..planes).map(|k| 360.0 * k as f64 / steps).collect();
        let Self { gamma_deg, candela, .. } = Self::new(even, gamma_deg, candela)?;
        let symmetry = mirrors(goniometer, &c_deg, &gamma_deg, &candela);
        Ok(Self { goniometer, symmetry, c_deg, gamma_deg, candela })
    }

    /// A table of other angles and intensities on the same goniometer.
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

    /// In whose angles the table is kept.
    pub fn goniometer(&self) -> Goniometer {
        self.goniometer
    }

    /// Whether it is a table of type A or B: `c_deg`, `gamma_deg` and `plane` are in its own angles and cover a sector of the circle.
    pub fn is_native(&self) -> bool {
        self.goniometer != Goniometer::C
    }

    /// Whether its planes cover a part of the circle alone.
    pub(super) fn is_sector(&self) -> bool {
        self.is_native() && self.c_deg[self.c_deg.len() - 1] - self.c_deg[0] < 360.0
    }

    /// The table's own angles of a direction in the luminaire's frame, as [`angles_deg`] gives those of type C.
    pub fn own_angles_deg(&self, direction: DVec3) -> (f64, f64) {
        angles_deg(if self.goniometer == Goniometer::B { goniometer::to_own(direction) } else { direction })
    }

    /// The unit direction of the table's own angles in the luminaire's frame.
    pub fn own_direction(&self, c_deg: f64, gamma_deg: f64) -> DVec3 {
        self.own_frame() * direction(c_deg, gamma_deg)
    }

    /// The frame in which the table's planes stand about the vertical, by its axes in the luminaire's frame: of type B a lying one.
    pub fn own_frame(&self) -> DMat3 {
        if self.goniometer == Goniometer::B { goniometer::LYING } else { DMat3::IDENTITY }
    }

    /// The angle among the stored planes that stands for this one; `None` beyond the planes of a sector.
    pub(super) fn stored_c_deg(&self, c_deg: f64) -> Option<f64> {
        if self.is_native() { goniometer::within_sector(&self.c_deg, c_deg) } else { Some(self.symmetry.fold(c_deg)) }
    }

    /// Planes about the table's own axis over all that they cover, two at least: the full circle of type C, the sector of types A and B.
    #[must_use]
    pub fn own_planes(&self) -> Self {
        if self.is_native() { self.clone() } else { self.full_circle() }
    }

    /// Whether a direction in the luminaire's own frame, of any length, is within the table.
    pub fn covers(&self, direction: DVec3) -> bool {
        let (c, gamma) = self.own_angles_deg(direction);
        let is_within = (self.gamma_deg[0]..=self.gamma_deg[self.gamma_deg.len() - 1]).contains(&gamma);
        is_within && self.stored_c_deg(c).is_some()
    }

    /// The largest intensity with which the table ends short of a pole or at the end of its sector; zero where it ends in the dark.
    pub fn edge_intensity(&self) -> Candela {
        let (planes, gammas) = (self.c_deg.len(), self.gamma_deg.len());
        let brightest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let row = |g: usize| brightest(&mut (0..planes).map(|c| self.plane(c)[g]));
        let mut edge = 0.0_f64;
        if self.gamma_deg[0] > 0.0 {
            edge = edge.max(row(0));
        }
        if self.gamma_deg[gammas - 1] < 180.0 {
            edge = edge.max(row(gammas - 1));
        }
        if self.is_sector() {
            edge = edge.max(brightest(&mut [0, planes - 1].iter().flat_map(|c| self.plane(*c).iter().copied())));
        }
        Candela(edge)
    }

    /// Whether no node above the horizon, nor any whose light is interpolated to above it, is brighter than this.
    pub fn is_dark_above(&self, candela: Candela) -> bool {
        // Of type B the horizon is V -90 and 90, of the others gamma 90.
        let (lying, c, gamma) = (self.goniometer == Goniometer::B, &self.c_deg, &self.gamma_deg);
        let neighbours = |angles: &[f64], k: usize| [k.saturating_sub(1), (k + 1).min(angles.len() - 1)];
        let reaches = |p: usize, g: usize| {
            if lying {
                neighbours(c, p).iter().any(|k| c[*k].abs() > 90.0)
            } else {
                gamma[neighbours(gamma, g)[1]] > 90.0
            }
        };
        let nodes = (0..c.len()).flat_map(|p| (0..gamma.len()).map(move |g| (p, g)));
        nodes.filter(|(p, g)| reaches(*p, *g)).all(|(p, g)| self.plane(p)[g] <= candela.value())
    }

    /// The same planes and intensities about the vertical: what a luminaire shines whose orientation is turned by
    /// [`Self::own_frame`] instead.
    #[must_use]
    pub fn upright(&self) -> Self {
        if self.goniometer != Goniometer::B {
            return self.clone();
        }
        let symmetry = mirrors(Goniometer::A, &self.c_deg, &self.gamma_deg, &self.candela);
        Self { goniometer: Goniometer::A, symmetry, ..self.clone() }
    }

    /// The same planes about the vertical, and the frame in which they stand so; a sector lies about C 180 in it, so that what closes the circle
    /// at C 0 is dark, and the ends of the sector are none of the table's.
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

    /// The mirror image in the plane of C 90 and C 270: what went along x goes along -x.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let gammas = self.gamma_deg.len();
        let own = self.own_planes();
        let candela: Vec<f64> = own.candela.chunks(gammas).rev().flatten().copied().collect();
        match self.goniometer {
            Goniometer::A | Goniometer::B => {
                let about = if self.goniometer == Goniometer::A { 180.0 } else { 0.0 };
                let c_deg: Vec<f64> = own.c_deg.iter().rev().map(|c| about - c).collect();
                let symmetry = mirrors(self.goniometer, &c_deg, &self.gamma_deg, &candela);
                Self { symmetry, c_deg, candela, ..own }
            }
            Goniometer::C => {
                let images = own.c_deg.iter().map(|c| (180.0 - c).rem_euclid(360.0)).chain([0.0, 360.0]);
                let mut c_deg: Vec<f64> = images.collect();
                c_deg.sort_by(f64::total_cmp);
                c_deg.dedup();
                let along = |c: &f64| {
                    let plane = 180.0 - c % 360.0;
                    own.gamma_deg.iter().map(move |g| (plane, *g)).collect::<Vec<_>>()
                };
                let candela = c_deg.iter().flat_map(along).map(|(c, g)| own.at(c, g).value()).collect();
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
            Goniometer::B => all.map(|(c, gamma)| at_pole(angles_deg(self.own_direction(c, gamma)))).collect(),
            Goniometer::A => all.map(|(c, gamma)| (c.rem_euclid(360.0), gamma)).collect(),
            Goniometer::C => all.collect(),
        }
    }

    /// Gamma angles of type C at which a half plane of C is drawn: those of the table or, of type B, whose nodes lie elsewhere, whole degrees.
    pub fn gammas_of_half_planes(&self) -> Vec<f64> {
        if self.goniometer == Goniometer::B { (0..=180).map(f64::from).collect() } else { self.gamma_deg.clone() }
    }

    /// The same at the ends of a sector of planes, where those are lit or, where it is the whole circle, differ.
    pub(super) fn jump_of_sector(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        let [first, last] = [self.c_deg[0], self.c_deg[self.c_deg.len() - 1]];
        let is_at = |edge: f64| ((c_deg - edge + 180.0).rem_euclid(360.0) - 180.0).abs() <= ROUNDED_DEG;
        if !self.is_native() || !is_at(first) && !is_at(last) {
            return 0.0;
        }
        let of_plane = |c: usize| {
            let (g, t) = bracket(&self.gamma_deg, gamma_deg);
            let is_there = self.at(self.c_deg[c], gamma_deg).value() > 0.0;
            if is_there { lerp(self.plane(c)[g], self.plane(c)[g + 1], t) } else { 0.0 }
        };
        let [low, high] = [of_plane(0), of_plane(self.c_deg.len() - 1)];
        if last - first < 360.0 { if is_at(first) { low } else { high } } else { (low - high).abs() }
    }
}

/// The same angles, exactly those of a pole where rounding alone parts them from it.
fn at_pole((c, gamma): (f64, f64)) -> (f64, f64) {
    match gamma {
        ..SAME_DEG => (0.0, 0.0),
        _ if gamma > 180.0 - SAME_DEG => (0.0, 180.0),
        _ => (c, gamma),
    }
}

/// The mirrors of type C that a table of type A or B has at all its nodes, and so everywhere.
fn mirrors(goniometer: Goniometer, c_deg: &[f64], gamma_deg: &[f64], candela: &[f64]) -> Symmetry {
    let gammas = gamma_deg.len();
    let is_centred = |angles: &[f64], centre: f64| {
        angles.iter().zip(angles.iter().rev()).all(|(a, b)| (a + b - 2.0 * centre).abs() < SAME_DEG)
    };
    let across = is_centred(c_deg, 0.0) && candela.chunks(gammas).eq(candela.chunks(gammas).rev());
    let along = is_centred(gamma_deg, 90.0) && candela.chunks(gammas).all(|row| row.iter().eq(row.iter().rev()));
    match (goniometer, across, along) {
        (Goniometer::B, true, true) => Symmetry::Quadrant,
        (Goniometer::A, true, _) | (Goniometer::B, false, true) => Symmetry::BilateralC0,
        (Goniometer::B, true, false) => Symmetry::BilateralC90,
        _ => Symmetry::None,
    }
}
