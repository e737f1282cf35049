//! A reader of tables that makes a chosen set of mistakes: where fingerprints come from.

use glam::DVec3;
use luxproof_photometry::{Goniometer, angles_deg, direction};

use crate::mistake::{Mistake, Variant};
use crate::pack_file::PackFile;
use crate::table::{PlaneLayout, SAME_DEG, Table, own_angles_deg};

/// A reader with mistakes and with the choice of a variant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ModelReader<'a> {
    pub(crate) mistakes: &'a [Mistake],
    pub(crate) variant: Option<Variant>,
}

/// What a reader answers in one direction, in candela.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prediction {
    /// The least of the nodes around it.
    pub(crate) least: f64,
    /// By linear interpolation in both angles.
    pub(crate) linear: f64,
    /// The most of the nodes around it.
    pub(crate) most: f64,
}

impl Prediction {
    const DARK: Self = Self { least: 0.0, linear: 0.0, most: 0.0 };
    /// Nothing follows from the mistake here.
    const UNKNOWN: Self = Self { least: f64::NEG_INFINITY, linear: f64::NAN, most: f64::INFINITY };

    /// The answer where it is the same for every interpolation.
    pub(crate) fn exact(self) -> Option<f64> {
        // Rounding of equal nodes.
        (self.most - self.least <= 1e-9 * self.most.abs()).then_some(self.linear)
    }

    fn scaled(self, factor: f64) -> Self {
        let (a, b) = (self.least * factor, self.most * factor);
        Self { least: a.min(b), linear: self.linear * factor, most: a.max(b) }
    }
}

/// Where a reader looks in the table along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lookup {
    At(f64),
    /// The reader knows that there is no light.
    Dark,
    /// What the reader does does not follow from its mistake.
    Unknown,
}

/// A place between two indices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bracket {
    pub(crate) below: usize,
    pub(crate) above: usize,
    pub(crate) fraction: f64,
}

impl ModelReader<'_> {
    /// A reader that does all right.
    pub(crate) const RIGHT: ModelReader<'static> = ModelReader { mistakes: &[], variant: None };

    fn makes(&self, mistake: Mistake) -> bool {
        self.mistakes.contains(&mistake)
    }

    /// The answers in all directions of a file.
    pub(crate) fn predict(&self, file: &PackFile) -> Vec<Prediction> {
        self.predictions(file).collect()
    }

    /// The same, one after the other.
    pub(crate) fn predictions<'f>(&'f self, file: &'f PackFile) -> impl Iterator<Item = Prediction> + 'f {
        let factor = file.document.factor(&file.table, self.mistakes, self.variant);
        file.directions.iter().map(move |asked| self.predict_towards(&file.table, asked.vector()).scaled(factor))
    }

    /// The number that the reader takes from the table towards a unit vector.
    fn predict_towards(&self, table: &Table, towards: DVec3) -> Prediction {
        let (h, v) = self.own_angles(table, self.turn(towards));
        match (self.fold(table, h), self.fit(table, v)) {
            (Lookup::Dark, _) | (_, Lookup::Dark) => Prediction::DARK,
            (Lookup::Unknown, _) | (_, Lookup::Unknown) => Prediction::UNKNOWN,
            (Lookup::At(h), Lookup::At(v)) => {
                self.interpolate(table, self.bracket(&table.horizontal_deg, h), self.bracket(&table.vertical_deg, v))
            }
        }
    }

    /// The direction that the reader takes for this one.
    fn turn(&self, towards: DVec3) -> DVec3 {
        let DVec3 { x, y, z } = towards;
        // The horizon at C 0 becomes the nadir, and the zenith V 90.
        let towards = if self.variant == Some(Variant::AimedAtHorizon) { DVec3::new(z, y, -x) } else { towards };
        let (mut c, mut gamma) = angles_deg(towards);
        if self.makes(Mistake::AzimuthReversed) {
            c = -c;
        }
        for (mistake, turn) in
            [(Mistake::TurnedBy90, 90.0), (Mistake::TurnedBy180, 180.0), (Mistake::TurnedBy270, 270.0)]
        {
            if self.makes(mistake) {
                c += turn;
            }
        }
        if self.makes(Mistake::UpDownSwapped) {
            gamma = 180.0 - gamma;
        }
        if self.variant == Some(Variant::UsdLuxAngleScale) {
            gamma *= 2.0;
            if gamma > 180.0 + SAME_DEG {
                // Beyond the end of the profile; `fit` finds nothing there.
                return DVec3::NAN;
            }
        }
        direction(c, gamma)
    }

    /// The horizontal and vertical angle that the reader looks up.
    fn own_angles(&self, table: &Table, towards: DVec3) -> (f64, f64) {
        let goniometer = match table.goniometer {
            _ if self.makes(Mistake::TypeAsC) => Goniometer::C,
            Goniometer::B if self.makes(Mistake::TypeBAsA) => Goniometer::A,
            own => own,
        };
        let (h, v) = own_angles_deg(goniometer, towards);
        let is_swapped = self.makes(Mistake::AxesSwapped) && table.goniometer != Goniometer::C;
        if is_swapped { (v, h) } else { (h, v) }
    }

    /// The stored horizontal angle that stands for one.
    fn fold(&self, table: &Table, h: f64) -> Lookup {
        let planes = &table.horizontal_deg;
        let (first, last) = (planes[0], planes[planes.len() - 1]);
        if h.is_nan() {
            return Lookup::Dark;
        }
        if self.makes(Mistake::FirstPlaneOnly) {
            return Lookup::At(first);
        }
        let is_foreign = table.goniometer != Goniometer::C && self.makes(Mistake::TypeAsC);
        if table.goniometer != Goniometer::C && !is_foreign {
            let is_half = table.layout() == PlaneLayout::MirroredSector;
            let folded = if is_half && !self.makes(Mistake::MirrorMissing) { h.abs() } else { h };
            let is_within = (first - SAME_DEG..=last + SAME_DEG).contains(&folded);
            if is_within {
                return Lookup::At(folded);
            }
            if !self.makes(Mistake::ClampedBeyondEnd) {
                return Lookup::Dark;
            }
            // Opposite to H 0 both ends are equally near.
            let is_opposite = folded.abs() > 180.0 - SAME_DEG;
            return if is_opposite { Lookup::Unknown } else { Lookup::At(folded.clamp(first, last)) };
        }
        let c = h.rem_euclid(360.0);
        let c = if 360.0 - c < SAME_DEG { 0.0 } else { c };
        let layout = Table::layout_of_type_c(first, last);
        if is_foreign && layout == PlaneLayout::HalfAboutC90 {
            // Readers of type C do many things with negative planes.
            let signed = if c > 180.0 { c - 360.0 } else { c };
            return if signed.abs() <= 90.0 + SAME_DEG { Lookup::At(signed) } else { Lookup::Unknown };
        }
        self.fold_type_c(layout, first, c)
    }

    /// The stored plane that stands for C from 0 to 360.
    fn fold_type_c(&self, layout: PlaneLayout, first: f64, c: f64) -> Lookup {
        let (repeats, omits) = (self.makes(Mistake::MirrorRepeated), self.makes(Mistake::MirrorMissing));
        match layout {
            PlaneLayout::Single if self.makes(Mistake::SinglePlaneOnly) && c > SAME_DEG => Lookup::Dark,
            PlaneLayout::Single => Lookup::At(first),
            PlaneLayout::Quadrant | PlaneLayout::Half => {
                let span = if layout == PlaneLayout::Half { 180.0 } else { 90.0 };
                if c <= span + SAME_DEG {
                    return Lookup::At(c);
                }
                if omits {
                    return Lookup::Dark;
                }
                if repeats {
                    return Lookup::At(c.rem_euclid(span));
                }
                let half = c.min(360.0 - c);
                Lookup::At(if layout == PlaneLayout::Half { half } else { half.min(180.0 - half) })
            }
            PlaneLayout::HalfAboutC90 if self.makes(Mistake::PlanesAbout90From0) => {
                Lookup::At(first + c.min(360.0 - c))
            }
            PlaneLayout::HalfAboutC90 => {
                let c = if self.makes(Mistake::HalfOnOtherSide) { c + 180.0 } else { c };
                let along = (c - first).rem_euclid(360.0);
                let along = if 360.0 - along < SAME_DEG { 0.0 } else { along };
                if along <= 180.0 + SAME_DEG {
                    return Lookup::At(first + along);
                }
                if omits {
                    return Lookup::Dark;
                }
                Lookup::At(first + if repeats { along - 180.0 } else { 360.0 - along })
            }
            PlaneLayout::Full | PlaneLayout::Sector | PlaneLayout::MirroredSector => Lookup::At(c),
        }
    }

    /// The stored vertical angle that the reader takes for one.
    fn fit(&self, table: &Table, v: f64) -> Lookup {
        let (first, last) = (table.vertical_deg[0], table.vertical_deg[table.vertical_deg.len() - 1]);
        if v.is_nan() {
            return Lookup::Dark;
        }
        let is_type_c = table.goniometer == Goniometer::C;
        let mut v = v;
        if is_type_c && self.makes(Mistake::AnglesStretched) {
            v = first + (last - first) * v / 180.0;
        }
        if is_type_c && self.makes(Mistake::FirstAngleIgnored) {
            v += first;
        }
        let is_beyond = v < first - SAME_DEG || v > last + SAME_DEG;
        if is_beyond && is_type_c && self.makes(Mistake::MirroredBeyondEnd) && (first == 90.0 || last == 90.0) {
            v = 180.0 - v;
        }
        if self.makes(Mistake::ClampedBeyondEnd) {
            v = v.clamp(first, last);
        }
        let is_within = (first - SAME_DEG..=last + SAME_DEG).contains(&v);
        if is_within { Lookup::At(v) } else { Lookup::Dark }
    }

    /// The place of an angle among the stored ones.
    fn bracket(&self, angles: &[f64], at: f64) -> Bracket {
        if self.makes(Mistake::EvenStepsAssumed) && angles.len() > 1 {
            let (first, last) = (angles[0], angles[angles.len() - 1]);
            let even: Vec<f64> =
                (0..angles.len()).map(|k| first + (last - first) * k as f64 / (angles.len() - 1) as f64).collect();
            return bracket(&even, at);
        }
        bracket(angles, at)
    }

    /// The numbers at and around a place of the table.
    fn interpolate(&self, table: &Table, h: Bracket, v: Bracket) -> Prediction {
        let (planes, verticals) = (table.horizontal_deg.len(), table.vertical_deg.len());
        let number = |h: usize, v: usize| {
            let k = if self.makes(Mistake::TableTransposed) { v * planes + h } else { h * verticals + v };
            table.numbers[k]
        };
        let corners = [(h.below, v.below), (h.below, v.above), (h.above, v.below), (h.above, v.above)];
        let corners = corners.map(|(h, v)| number(h, v));
        let along = |k: usize| corners[k] + v.fraction * (corners[k + 1] - corners[k]);
        Prediction {
            least: corners.into_iter().fold(f64::INFINITY, f64::min),
            linear: along(0) + h.fraction * (along(2) - along(0)),
            most: corners.into_iter().fold(f64::NEG_INFINITY, f64::max),
        }
    }
}

/// The place of an angle among rising ones; on a node both indices are that node.
pub(crate) fn bracket(angles: &[f64], at: f64) -> Bracket {
    if let Some(node) = angles.iter().position(|angle| (angle - at).abs() <= SAME_DEG) {
        return Bracket { below: node, above: node, fraction: 0.0 };
    }
    let above = angles.partition_point(|angle| *angle <= at).clamp(1, angles.len().max(2) - 1);
    let below = above - 1;
    Bracket { below, above, fraction: (at - angles[below]) / (angles[above] - angles[below]) }
}
