//! What one procedure measures in one scene: targets, each a weighted sum of illuminances.

use std::collections::BTreeMap;

use itertools::Itertools;
use luxproof_photometry::direction;
use luxproof_scene::{Luminaire, Meter, Scene, Transport};

use super::form::{Angles, AtAngles, Names};
use super::reads::{Aimed, Aspect, MeterContext, Parts, ReadingKind, Reads};
use luxproof_model::{Estimate, Light, MeterId, ProcedureId, Quantity};

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
    /// How far off the weighted sum may be of what it stands for, relative to the sum of absolute terms: 0 but for a quadrature.
    pub quadrature: f64,
    /// What the sum becomes.
    pub made: ReadingKind,
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
        match (self.procedure.is_calibration(), self.transport) {
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
    pub fn sensors(&self) -> impl Iterator<Item = (MeterId, Meter)> {
        self.targets.iter().flat_map(Target::sensors)
    }

    /// The part of [`Self::sensors`] that one target needs.
    pub fn stations_of(&self, target: usize) -> std::ops::Range<usize> {
        let first = self.targets[..target].iter().map(|t| t.aspects.len()).sum();
        first..first + self.targets[target].aspects.len()
    }
}

impl Target {
    /// One illuminance, times a weight.
    pub fn of_one(id: MeterId, meter: Meter, weight: f64) -> Self {
        Self {
            id,
            meter,
            direction: None,
            aspects: vec![Aspect { meter, weight }],
            quadrature: 0.0,
            made: ReadingKind::Sum,
        }
    }

    /// What is read, of the weighted sum of illuminances.
    pub fn reading(&self, sum: Estimate) -> Estimate {
        self.made.of(sum)
    }

    /// The illuminances that it needs, with their names: its own, or one a meter.
    pub fn sensors(&self) -> impl Iterator<Item = (MeterId, Meter)> {
        self.aspects.iter().enumerate().map(|(k, aspect)| (self.station_id(k), aspect.meter))
    }

    /// The name of an illuminance: the target's own where it needs one only.
    fn station_id(&self, k: usize) -> MeterId {
        match self.aspects.len() {
            1 => self.id.clone(),
            _ => MeterId::new(&self.id.0, k),
        }
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
    let targets = angles.into_iter().enumerate().map(|(k, (c_deg, gamma_deg))| {
        let outward = luminaire.orientation * direction(c_deg, gamma_deg);
        let meter = Meter { position_m: luminaire.position_m + outward * asked.distance_m, normal: -outward };
        let id = MeterId::new(&luminaire.id, k);
        let target = Target::of_one(id, meter, asked.distance_m * asked.distance_m);
        Target { direction: Some(Direction { c_deg, gamma_deg }), ..target }
    });
    targets.collect()
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
    let mut targets = vec![];
    for name in names.iter() {
        let meters = sets.meters.get(name).into_iter().flatten().enumerate();
        targets.extend(meters.filter_map(|(k, meter)| target_in_set(sets, reads, name, k, *meter)));
    }
    targets
}

/// A meter of a named set with what is added up there; `None` where nothing can be read.
fn target_in_set(sets: &Sets<'_>, reads: Reads, name: &str, k: usize, meter: Meter) -> Option<Target> {
    let reflectance = known(sets.reflectances, name, k);
    let (glare, opening) = (known(sets.glares, name, k), known(sets.openings, name, k));
    let Parts { aspects, quadrature, made } = reads.parts(meter, MeterContext { reflectance, glare, opening })?;
    // A target of a single illuminance takes that one's place and direction.
    let meter = if let [aspect] = aspects[..] { aspect.meter } else { meter };
    Some(Target { id: MeterId::new(name, k), meter, direction: None, aspects, quadrature, made })
}
