//! Reflected light in a moment: radiosity of a few patches a surface. It is good to percents, and far better as the
//! ratio of one scene to one that is like it; what it lets through is solved for by the simulator.

use glam::DVec3;
use luminaire::calculators::inverse_square::from_luminaire;
use luminaire::geometry::configuration_factor::element_to_polygon;
use luminaire::geometry::{Room, Surface};
use luminaire::scene::{Bounces, Luminaire, Meter};

/// Patches of a surface, each way.
const PATCHES: usize = 5;
/// Points of a patch, each way, at which its light is looked at.
const POINTS: usize = 2;
/// Reflections that stand for all.
const ENDLESS: u32 = 60;
/// Light that is left when no more is followed, as a share.
const NEGLIGIBLE: f64 = 1e-4;

struct Patch {
    surface: Surface,
    corners_m: [DVec3; 4],
}

/// The patches of an empty room, and what each and the meters that are asked for see of every other.
pub(super) struct Rough {
    patches: Vec<Patch>,
    /// Configuration factors of one patch after the other.
    seen: Vec<Vec<f64>>,
    meters: Vec<Meter>,
    /// Likewise of one meter after the other.
    read: Vec<Vec<f64>>,
}

impl Rough {
    pub(super) fn new(room: &Room, meters: &[Meter]) -> Self {
        let patches: Vec<Patch> = Surface::ALL.into_iter().flat_map(|s| patches_of(room, s)).collect();
        let of_one = |patch: &Patch| {
            let (centre, normal) = (patch.at(0.5, 0.5), patch.surface.inward_normal());
            let sees = |other: &Patch| {
                let faces = other.surface != patch.surface;
                if faces { element_to_polygon(centre, normal, &other.corners_m) } else { 0.0 }
            };
            let seen: Vec<f64> = patches.iter().map(sees).collect();
            let all: f64 = seen.iter().sum();
            seen.into_iter().map(|s| s / all).collect()
        };
        let seen = patches.iter().map(of_one).collect();
        let read = meters.iter().map(|m| seen_by(m, &patches)).collect();
        Self { patches, seen, meters: meters.to_vec(), read }
    }

    /// What it costs, in luminaires seen from a meter; meters count that are not those asked for.
    pub(super) const fn work(luminaires: u64, meters: u64) -> u64 {
        let patches = (Surface::ALL.len() * PATCHES * PATCHES) as u64;
        // Light that goes on from patch to patch takes half a millisecond.
        patches * ((POINTS * POINTS) as u64 * luminaires + meters + patches / 5)
    }

    /// Reflected illuminance in lux at meters.
    pub(super) fn lux(&self, room: &Room, luminaires: &[Luminaire], meters: &[Meter], bounces: Bounces) -> Vec<f64> {
        let most = if let Bounces::AtMost(most) = bounces { most.min(ENDLESS) } else { ENDLESS };
        let reflectances: Vec<f64> = self.patches.iter().map(|p| room.reflectance.of(p.surface)).collect();
        let first: Vec<f64> = self.patches.iter().map(|p| p.straight(luminaires)).collect();
        let (mut lit, mut exitance) = (first.clone(), vec![0.0; first.len()]);
        let brightest = first.iter().copied().fold(0.0, f64::max);
        for _ in 0..most {
            let leaving: Vec<f64> = lit.iter().zip(&reflectances).map(|(e, r)| e * r).collect();
            exitance.iter_mut().zip(&leaving).for_each(|(all, one)| *all += one);
            lit = self.seen.iter().map(|seen| seen.iter().zip(&leaving).map(|(f, m)| f * m).sum()).collect();
            if lit.iter().all(|e| *e <= NEGLIGIBLE * brightest) {
                break;
            }
        }
        let lux = |seen: &[f64]| seen.iter().zip(&exitance).map(|(f, m)| f * m).sum();
        if meters == self.meters {
            return self.read.iter().map(|seen| lux(seen)).collect();
        }
        meters.iter().map(|m| lux(&seen_by(m, &self.patches))).collect()
    }
}

fn seen_by(meter: &Meter, patches: &[Patch]) -> Vec<f64> {
    patches.iter().map(|p| element_to_polygon(meter.position_m, meter.normal, &p.corners_m)).collect()
}

impl Patch {
    fn at(&self, u: f64, v: f64) -> DVec3 {
        let [origin, along, _, across] = self.corners_m;
        origin + u * (along - origin) + v * (across - origin)
    }

    /// The mean of what comes straight from luminaires.
    fn straight(&self, luminaires: &[Luminaire]) -> f64 {
        let normal = self.surface.inward_normal();
        let place = |k: usize| (k as f64 + 0.5) / POINTS as f64;
        let points = (0..POINTS * POINTS).map(|k| self.at(place(k % POINTS), place(k / POINTS)));
        let lux = |meter: Meter| luminaires.iter().map(|l| from_luminaire(l, &meter).value()).sum::<f64>();
        points.map(|position_m| lux(Meter { position_m, normal })).sum::<f64>() / (POINTS * POINTS) as f64
    }
}

fn patches_of(room: &Room, surface: Surface) -> Vec<Patch> {
    let whole = Patch { surface, corners_m: room.corners(surface) };
    let corner = |i: usize, j: usize| whole.at(i as f64 / PATCHES as f64, j as f64 / PATCHES as f64);
    let patch = |k: usize| {
        let (i, j) = (k % PATCHES, k / PATCHES);
        Patch { surface, corners_m: [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)] }
    };
    (0..PATCHES * PATCHES).map(patch).collect()
}
