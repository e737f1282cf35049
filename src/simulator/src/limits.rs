//! The most light that a meter can have, before anything is solved: what is still known of it where a solution was stopped.
//!
//! A luminaire gives I / d² at most, of its peak and from its nearest place. Irradiance is a mean of what surfaces send out over the half
//! space, π L: so that E ≤ max M, and M = ρ (E₀ + E) makes max M ≤ max (ρ E₀) / (1 - max ρ) (the Neumann series of Kajiya's
//! equation, SIGGRAPH 1986, each of its terms at its largest).

use glam::DVec3;

use super::Bounded;
use super::emission::Emitter;
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Bounces, Meter, Scene, Shape};

/// What luminaires give at most.
pub(super) struct Limits<'a> {
    scene: &'a Scene,
    emitters: Vec<Emitter>,
}

impl<'a> Limits<'a> {
    pub(super) fn new(scene: &'a Scene) -> Self {
        Self { scene, emitters: scene.luminaires.iter().map(Emitter::new).collect() }
    }

    /// Light straight from the luminaires at a meter, whatever hides them.
    pub(super) fn direct(&self, meter: &Meter) -> Bounded {
        up_to(self.most_lux([meter.position_m; 2]))
    }

    /// Reflected light anywhere.
    pub(super) fn indirect(&self, bounces: Bounces) -> Bounded {
        let surfaces = self.surfaces();
        let once = surfaces.iter().map(|(rho, corners_m)| rho * self.most_lux(*corners_m)).fold(0.0, f64::max);
        let rho = surfaces.iter().map(|(rho, _)| *rho).fold(0.0, f64::max);
        // 1 + ρ + ρ² + ...
        let more = match bounces {
            Bounces::AtMost(0) => 0.0,
            Bounces::AtMost(count) if rho == 1.0 => f64::from(count),
            Bounces::AtMost(count) => (1.0 - rho.powf(f64::from(count))) / (1.0 - rho),
            Bounces::Converged => 1.0 / (1.0 - rho),
        };
        up_to(if once == 0.0 { 0.0 } else { once * more })
    }

    fn most_lux(&self, corners_m: [DVec3; 2]) -> f64 {
        self.emitters.iter().map(|emitter| emitter.most_lux(corners_m)).sum()
    }

    /// The reflectance of all that reflects, and the lower and upper corner of a box that holds it.
    fn surfaces(&self) -> Vec<(f64, [DVec3; 2])> {
        let walls = self.scene.room.iter().flat_map(|room| {
            Surface::ALL.map(|surface| (room.reflectance.of(surface), extent(&room.corners(surface))))
        });
        let body = |shape: &Shape| match shape {
            Shape::Box { min_m, max_m } => [*min_m, *max_m],
            Shape::Mesh { vertices_m, .. } => extent(vertices_m),
        };
        let bodies = self.scene.obstacles.iter().map(|o| (o.reflectance, body(&o.shape)));
        walls.chain(bodies).filter(|(rho, _)| *rho > 0.0).collect()
    }
}

fn extent(places_m: &[DVec3]) -> [DVec3; 2] {
    places_m.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(*p), high.max(*p)])
}

/// Something between nothing and the most.
fn up_to(most_lux: f64) -> Bounded {
    Bounded { value: 0.5 * most_lux, bound: 0.5 * most_lux }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path_tracing::test_scenes::{s1, s1_meters, s2, s2_meters};
    use crate::{Accuracy, illuminance};
    use luxproof_scene::Transport;

    #[test]
    fn no_reading_is_beyond_what_luminaires_can_give() {
        for (scene, meters) in [(s1(), s1_meters()), (s2(), s2_meters())] {
            let limits = Limits::new(&scene);
            let accuracy = Accuracy { relative_error: 0.05, seed: 3 };
            for bounces in [Bounces::AtMost(1), Bounces::AtMost(3), Bounces::Converged] {
                let most = 2.0 * limits.indirect(bounces).value;
                assert!(most.is_finite());
                let found = illuminance(&scene, &meters, Transport::Indirect(bounces), &accuracy).unwrap();
                assert!(found.estimates.iter().all(|e| e.illuminance.value() < most), "{found:?} {most}");
            }
            let found = illuminance(&scene, &meters, Transport::Direct, &accuracy).unwrap();
            for (meter, estimate) in meters.iter().zip(&found.estimates) {
                assert!(estimate.illuminance.value() <= 2.0 * limits.direct(meter).value * (1.0 + 1e-9));
            }
        }
    }
}
