//! Leaves out meters that no luminaire lights directly: their direct illuminance is 0 without a ray.

use glam::DVec3;
use luxproof_photometry::{Goniometer, angles_deg};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Transport};

use super::{Fill, Shortcut};
use luxproof_engines::Job;
use luxproof_model::Scope;

/// Renderers compute directions within this margin of a table's lit part: their tables may have other nodes.
const MARGIN_DEG: f64 = 1.0;

/// Leaves out meters without direct light.
pub(super) fn shorten(shortcut: &mut Shortcut, asked: &Job) {
    if shortcut.job.transport != Transport::Direct {
        return;
    }
    let lights: Vec<LitRegion> = asked.scene.luminaires.iter().map(LitRegion::from_luminaire).collect();
    let lit: Vec<bool> = shortcut.job.sensors.iter().map(|s| lights.iter().any(|l| l.may_reach(&s.meter))).collect();
    let dark = lit.iter().filter(|l| !**l).count();
    if dark > 0 {
        let all = lit.len();
        shortcut.render_only(&lit, |_| Fill::Dark);
        let reason = format!("no luminaire sends light straight to {dark} of {all} meters: 0 without a ray");
        shortcut.omit(Scope::LightPath, dark as f64 / all as f64, reason);
    }
}

/// The corners of a luminaire's opening, and the angles between which it emits.
struct LitRegion<'a> {
    luminaire: &'a Luminaire,
    corners_m: Vec<DVec3>,
    /// The lit part of the table; `None` where it emits nothing.
    gamma_deg: Option<(f64, f64)>,
}

impl<'a> LitRegion<'a> {
    /// Finds the lit part of a luminaire's table.
    fn from_luminaire(luminaire: &'a Luminaire) -> Self {
        let table = &luminaire.photometry.distribution;
        let gamma = table.gamma_deg();
        let is_lit = |g: usize| (0..table.c_deg().len()).any(|c| table.plane(c)[g] > 0.0);
        let first = (0..gamma.len()).find(|g| is_lit(*g));
        let last = (0..gamma.len()).rev().find(|g| is_lit(*g));
        let gamma_deg = match first.zip(last).filter(|_| luminaire.flux_scale > 0.0) {
            None => None,
            // A band about the axis of type B is no band about the vertical.
            Some(_) if table.goniometer() == Goniometer::B => Some((0.0, 180.0)),
            // Intensity does not jump at a node, it falls to zero up to the next one.
            Some((first, last)) => {
                let (below, above) = (first.saturating_sub(1), (last + 1).min(gamma.len() - 1));
                Some((gamma[below] - MARGIN_DEG, gamma[above] + MARGIN_DEG))
            }
        };
        Self { luminaire, corners_m: corners(luminaire), gamma_deg }
    }

    /// Whether any of its light may reach the front of a meter.
    fn may_reach(&self, meter: &Meter) -> bool {
        let Some((low, high)) = self.gamma_deg else { return false };
        let in_front = self.corners_m.iter().any(|c| (*c - meter.position_m).dot(meter.normal) > 0.0);
        // An extended source is dark between its corners, too, where the dark part of the table is a convex cone.
        let is_point = self.corners_m.len() == 1;
        let below = (is_point || low <= 90.0) && self.corners_m.iter().all(|c| self.gamma_deg_at(c, meter) < low);
        let above = (is_point || high >= 90.0) && self.corners_m.iter().all(|c| self.gamma_deg_at(c, meter) > high);
        in_front && !below && !above
    }

    /// The angle from the luminaire's axis at which a corner sees a meter.
    fn gamma_deg_at(&self, corner_m: &DVec3, meter: &Meter) -> f64 {
        angles_deg(self.luminaire.orientation.transpose() * (meter.position_m - *corner_m)).1
    }
}

/// The center of a point, or the corners of the box around an opening. Impostors are higher by their box.
fn corners(luminaire: &Luminaire) -> Vec<DVec3> {
    if luminaire.model == LuminaireModel::Point {
        return vec![luminaire.position_m];
    }
    let [y, x, z] = luminaire.photometry.opening.bounding_box_m();
    let half =
        0.5 * DVec3::new(x, y, z + if luminaire.model == LuminaireModel::Impostor { IMPOSTOR_HEIGHT_M } else { 0.0 });
    let signs = (0..8).map(|k| DVec3::new(corner_sign(k, 0), corner_sign(k, 1), corner_sign(k, 2)));
    signs.map(|sign| luminaire.position_m + luminaire.orientation * (half * sign)).collect()
}

/// The side of a box on which its corner lies along an axis.
const fn corner_sign(corner: usize, axis: usize) -> f64 {
    if corner >> axis & 1 == 1 { 1.0 } else { -1.0 }
}

/// The height of the boxes that renderers put around a flat impostor.
const IMPOSTOR_HEIGHT_M: f64 = 0.2;
