//! Meters that no luminaire sends light to: their direct illuminance is 0 without a ray; pure.

use glam::DVec3;
use luminaire::photometry::{Goniometer, angles_deg};
use luminaire::scene::{Luminaire, LuminaireModel, Meter, Transport};

use super::{Fill, Shortcut};
use crate::engines::Job;
use crate::plan::Scope;

/// Light within this much of the lit part of a table is left to the renderers: their tables may have other nodes.
const MARGIN_DEG: f64 = 1.0;

/// Leaves out meters without direct light.
pub(super) fn shorten(shortcut: &mut Shortcut, asked: &Job) {
    if shortcut.job.transport != Transport::Direct {
        return;
    }
    let lights: Vec<Lit> = asked.scene.luminaires.iter().map(Lit::of).collect();
    let lit: Vec<bool> = shortcut.job.stations.iter().map(|s| lights.iter().any(|l| l.may_reach(&s.meter))).collect();
    let dark = lit.iter().filter(|l| !**l).count();
    if dark > 0 {
        let all = lit.len();
        shortcut.render_only(&lit, |_| Fill::Dark);
        let reason = format!("no luminaire sends light straight to {dark} of {all} meters: 0 without a ray");
        shortcut.omit(Scope::LightPath, dark as f64 / all as f64, reason);
    }
}

/// Where a luminaire's light comes from and between which angles it goes.
struct Lit<'a> {
    luminaire: &'a Luminaire,
    corners_m: Vec<DVec3>,
    /// The lit part of the table; `None`: it sends out nothing.
    gamma_deg: Option<(f64, f64)>,
}

impl<'a> Lit<'a> {
    fn of(luminaire: &'a Luminaire) -> Self {
        let table = &luminaire.photometry.distribution;
        let gamma = table.gamma_deg();
        let is_lit = |g: usize| (0..table.c_deg().len()).any(|c| table.plane(c)[g] > 0.0);
        let first = (0..gamma.len()).find(|g| is_lit(*g));
        let last = (0..gamma.len()).rev().find(|g| is_lit(*g));
        // Up to the next node intensity falls to zero, it does not jump.
        let band = |(first, last): (usize, usize)| {
            (gamma[first.saturating_sub(1)] - MARGIN_DEG, gamma[(last + 1).min(gamma.len() - 1)] + MARGIN_DEG)
        };
        // Bands about another axis are none about the vertical.
        let band = |rows| if table.goniometer() == Goniometer::B { (0.0, 180.0) } else { band(rows) };
        let gamma_deg = first.zip(last).filter(|_| luminaire.flux_scale > 0.0).map(band);
        Self { luminaire, corners_m: corners(luminaire), gamma_deg }
    }

    /// Whether any of its light may arrive at a meter's front.
    fn may_reach(&self, meter: &Meter) -> bool {
        let Some((low, high)) = self.gamma_deg else { return false };
        let in_front = self.corners_m.iter().any(|c| (*c - meter.position_m).dot(meter.normal) > 0.0);
        let gamma =
            |corner: &DVec3| angles_deg(self.luminaire.orientation.transpose() * (meter.position_m - *corner)).1;
        // Of an extended source the directions in between are no darker, where the dark part is a convex cone.
        let is_point = self.corners_m.len() == 1;
        let below = (is_point || low <= 90.0) && self.corners_m.iter().all(|c| gamma(c) < low);
        let above = (is_point || high >= 90.0) && self.corners_m.iter().all(|c| gamma(c) > high);
        in_front && !below && !above
    }
}

/// The centre of a point, the corners of the box around an opening; impostors are up to their box's height larger.
fn corners(luminaire: &Luminaire) -> Vec<DVec3> {
    if luminaire.model == LuminaireModel::Point {
        return vec![luminaire.position_m];
    }
    let [y, x, z] = luminaire.photometry.opening.bounding_box_m();
    let half = 0.5 * DVec3::new(x, y, z + if luminaire.model == LuminaireModel::Impostor { IMPOSTOR_M } else { 0.0 });
    let sign = |bit: usize, k: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
    let corner = |k: usize| half * DVec3::new(sign(0, k), sign(1, k), sign(2, k));
    (0..8).map(|k| luminaire.position_m + luminaire.orientation * corner(k)).collect()
}

/// Room for the boxes that renderers put around a flat impostor.
const IMPOSTOR_M: f64 = 0.2;
