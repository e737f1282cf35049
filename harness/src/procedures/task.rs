//! What one procedure measures in one scene: targets, each a weighted sum of illuminances.

use std::collections::BTreeMap;

use itertools::Itertools;
use luminaire::photometry::direction;
use luminaire::scene::{Luminaire, Meter, Scene, Transport};

use super::form::{Angles, AtAngles, Names};
use super::reads::{Aimed, Aspect, Made, Parts, Reads, Seen};
use crate::record::{Estimate, Light, MeterId, ProcedureId, Quantity};

/// What one procedure measures in one case.
#[derive(Clone, Debug)]
pub struct Task {
    pub procedure: ProcedureId,
    /// The scene with only what this procedure needs.
    pub scene: Scene,
    /// Which light counts.
    pub transport: Transport,
    pub quantity: Quantity,
    /// Where readings are taken.
    pub targets: Vec<Target>,
}

/// One reading: the weighted sum of illuminances at one place.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    pub id: MeterId,
    /// Where it is, for reports.
    pub meter: Meter,
    /// The direction seen from the luminaire, for intensities.
    pub direction: Option<Direction>,
    /// What is added up; most readings are one illuminance.
    pub aspects: Vec<Aspect>,
    /// How far off the weighted sum may be of what it stands for, relative: 0 but for a quadrature.
    pub quadrature: f64,
    /// What the sum becomes.
    pub made: Made,
}

/// A direction in a luminaire's own frame, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// C plane.
    pub c_deg: f64,
    /// From the nadir.
    pub gamma_deg: f64,
}

impl Task {
    /// The luminaire model of the scene: point, area, impostor, or mixed.
    pub fn model(&self) -> String {
        let mut models: Vec<&str> = self.scene.luminaires.iter().map(|l| l.model.name()).collect();
        models.sort_unstable();
        models.dedup();
        if let [one] = models[..] { one.to_owned() } else { "mixed".to_owned() }
    }

    /// The procedure that an engine is asked for: of a scene of the calibration, the one of its light.
    pub fn as_asked(&self) -> ProcedureId {
        match (self.procedure.is_known(), self.transport) {
            (false, _) => self.procedure,
            (true, Transport::Direct) => ProcedureId::DirectIlluminance,
            (true, _) => ProcedureId::IndirectIlluminance,
        }
    }

    /// Which light counts.
    pub const fn light(&self) -> Light {
        Light(self.transport)
    }

    /// Every illuminance that is needed, target by target, with its name.
    pub fn stations(&self) -> impl Iterator<Item = (MeterId, Meter)> {
        self.targets.iter().flat_map(Target::stations)
    }

    /// The part of [`Self::stations`] that one target needs.
    pub fn stations_of(&self, target: usize) -> std::ops::Range<usize> {
        let first = self.targets[..target].iter().map(|t| t.aspects.len()).sum();
        first..first + self.targets[target].aspects.len()
    }
}

impl Target {
    /// One illuminance, times a weight.
    pub fn of_one(id: MeterId, meter: Meter, weight: f64) -> Self {
        Self { id, meter, direction: None, aspects: vec![Aspect { meter, weight }], quadrature: 0.0, made: Made::Sum }
    }

    /// What is read, of the weighted sum of illuminances.
    pub fn reading(&self, sum: Estimate) -> Estimate {
        self.made.of(match self.quadrature {
            0.0 => sum,
            relative => Estimate { uncertainty: sum.uncertainty.within(relative * sum.value.abs()), ..sum },
        })
    }

    /// The illuminances that it needs, with their names: its own, or one a meter.
    pub fn stations(&self) -> impl Iterator<Item = (MeterId, Meter)> {
        let name = |k: usize| match self.aspects.len() {
            1 => self.id.clone(),
            _ => MeterId::new(&self.id.0, k),
        };
        self.aspects.iter().enumerate().map(move |(k, aspect)| (name(k), aspect.meter))
    }
}

/// Meters on a sphere that face the photometric centre: I = E d² (IES LM-41, CIE 121: inverse-square goniophotometry).
pub(super) fn around(luminaire: &Luminaire, asked: &AtAngles) -> Vec<Target> {
    let distribution = &luminaire.photometry.distribution;
    let angles: Vec<(f64, f64)> = match &asked.angles {
        Angles::Photometry => distribution.nodes_deg(),
        Angles::Listed(lists) => {
            lists.c_deg.iter().copied().cartesian_product(lists.gamma_deg.iter().copied()).collect()
        }
    };
    let target = |(k, (c_deg, gamma_deg)): (usize, (f64, f64))| {
        let outward = luminaire.orientation * direction(c_deg, gamma_deg);
        let meter = Meter { position_m: luminaire.position_m + outward * asked.distance_m, normal: -outward };
        let id = MeterId::new(&luminaire.id, k);
        let target = Target::of_one(id, meter, asked.distance_m * asked.distance_m);
        Target { direction: Some(Direction { c_deg, gamma_deg }), ..target }
    };
    angles.into_iter().enumerate().map(target).collect()
}

/// The meter sets of a spec.
#[derive(Clone, Copy, Debug)]
pub struct Sets<'a> {
    pub meters: &'a BTreeMap<String, Vec<Meter>>,
    /// Diffuse reflectance of the surface on which each meter lies, of the sets that luminance is asked of.
    pub reflectances: &'a BTreeMap<String, Vec<f64>>,
    /// Sum of L^2 w / p^2 over the openings that each meter's eye sees, of the sets that glare is asked of.
    pub glares: &'a BTreeMap<String, Vec<f64>>,
    /// What each meter's eye sees of the luminous opening whose luminance is asked for, of the sets where that is.
    pub openings: &'a BTreeMap<String, Vec<Aimed>>,
}

fn known<T: Copy>(of: &BTreeMap<String, Vec<T>>, name: &str, k: usize) -> Option<T> {
    of.get(name).and_then(|set| set.get(k)).copied()
}

/// The meters of named sets, each with what is added up there.
pub(super) fn of_sets(sets: &Sets<'_>, names: &Names, reads: Reads) -> Vec<Target> {
    let target = |name: &str, k: usize, meter: Meter| {
        let reflectance = known(sets.reflectances, name, k);
        let (glare, opening) = (known(sets.glares, name, k), known(sets.openings, name, k));
        let Parts { aspects, quadrature, made } = reads.parts(meter, Seen { reflectance, glare, opening })?;
        // Of one illuminance alone it is the place and the direction of that.
        let meter = if let [aspect] = aspects[..] { aspect.meter } else { meter };
        Some(Target { id: MeterId::new(name, k), meter, direction: None, aspects, quadrature, made })
    };
    let of_set = |name: &str| {
        let meters = sets.meters.get(name).into_iter().flatten().enumerate();
        meters.filter_map(|(k, meter)| target(name, k, *meter)).collect::<Vec<_>>()
    };
    names.iter().flat_map(of_set).collect()
}
