//! Kinds of faults with free parameters: reflectances, places and orientations of luminaires, flux, and meters.

use glam::{DMat3, DVec3};
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Luminaire, Transport};

use super::bounces::bounce_kinds;
use super::fault::{Fault, Parameter};
use super::faults::{
    CANDELA, MAX_LUMINAIRES, POWER, TURN, change_reflectances, luminaire_ids, raise_reflectances, set_reflectance,
    spec_cases, surface_name,
};
use super::faulty_task::FaultyTask;
use super::laws::law_kinds;
use super::lookups::{GAMMA_OFF, gamma_shift, lookup_kinds};
use super::readouts::readout_kinds;
use super::tables::{is_axial, keep_first_plane, raise_candela, shift_gamma};
use luxproof_spec::procedures::Task;

/// The largest displacement that a fit tries, in meters, either way.
const DISPLACEMENT_RANGE_M: (f64, f64) = (-3.0, 3.0);
/// The largest reflectance that a fit tries.
const MAX_REFLECTANCE: f64 = 0.995;

/// Lists every kind that the cases may show.
pub fn kinds(cases: &[&[Task]]) -> Vec<Fault> {
    let mut all = engine_kinds();
    let one_parameter = [lookup_kinds(), law_kinds(cases), bounce_kinds(), readout_kinds()];
    all.extend(one_parameter.concat().into_iter().filter(|fault| !fault.parameters.is_empty()));
    all.extend(texture_kinds());
    all.extend(spec_cases(cases).flat_map(|(case, tasks)| case_kinds(case, tasks)));
    all
}

fn displacement() -> Parameter {
    Parameter::new(" m", 0.0, 0.02, DISPLACEMENT_RANGE_M)
}

/// A small rotation.
fn tilt_angle() -> Parameter {
    Parameter { unit: " degrees", starts: vec![0.0], step: 1.0, range: (-200.0, 200.0), period: None }
}

/// A rotation of any size; fits start all round the circle.
fn turn_angle() -> Parameter {
    let starts = (-5..=6).map(|k| 30.0 * f64::from(k)).collect();
    Parameter { starts, period: Some(360.0), ..tilt_angle() }
}

fn candela_power() -> Parameter {
    Parameter::new("", 1.0, 0.02, (0.1, 10.0))
}

/// Kinds that an engine shows in every case.
fn engine_kinds() -> Vec<Fault> {
    vec![
        Fault::new("reflectances", "every surface of every room reflects {0} times what it should", scale_reflectances)
            .with_parameters([Parameter::new("", 1.0, 0.02, (0.0, 10.0))]),
        Fault::new("turned", "distributions are turned by {0} in C", |faulty, p| {
            let turn = DMat3::from_rotation_z(p[0].to_radians());
            faulty.change_luminaires(|l| {
                l.orientation *= turn;
                !is_axial(l)
            })
        })
        .about(TURN)
        .with_parameters([turn_angle()]),
        Fault::new("power", "reflectances are raised to the power of {0}", |faulty, p| {
            raise_reflectances(faulty, p[0])
        })
        .about(POWER)
        .with_parameters([Parameter::new("", 1.0, 0.05, (0.1, 10.0))]),
        Fault::new("shifted", "meters are off by {0} in x, {1} in y, {2} in z", shift_meters).with_parameters([
            displacement(),
            displacement(),
            displacement(),
        ]),
        Fault::new("place", "luminaires are off by {0} in x, {1} in y, {2} in z", |faulty, p| {
            let by = DVec3::new(p[0], p[1], p[2]);
            faulty.change_luminaires(|l| {
                l.position_m += by;
                true
            })
        })
        .about("place of luminaires")
        .with_parameters([displacement(), displacement(), displacement()]),
        Fault::new("place", "luminaires are off by {0} along their axes", |faulty, p| {
            let by = p[0];
            faulty.change_luminaires(|l| {
                l.position_m += by * l.orientation.z_axis;
                true
            })
        })
        .about("place of luminaires")
        .with_parameters([displacement()]),
        Fault::new("lifted", "meters are {0} in front of where they should be", |faulty, p| {
            let by = p[0];
            faulty.change_meters(|m| m.position_m += by * m.normal);
            true
        })
        .with_parameters([displacement()]),
    ]
}

/// Faults of a table stored as a texture: powers of candela, angles off by a part of a texel, lost planes, or all three.
fn texture_kinds() -> Vec<Fault> {
    let mut all = vec![];
    for loses_planes in [false, true] {
        let prefix = if loses_planes { "only the plane C 0 is read, " } else { "" };
        let about = if loses_planes { "angles of one plane" } else { "angles" };
        let off = Fault::new("gamma-off", format!("{prefix}{GAMMA_OFF}"), move |faulty, p| {
            let by = p[0];
            faulty.change_luminaires(|l| (loses_planes && keep_first_plane(l)) | shift_gamma(l, by))
        });
        all.push(off.about(about).with_parameters([gamma_shift()]));
        let what = format!("{prefix}the candela are raised to the power of {{0}}, each as a part of the largest");
        let raised = Fault::new("candela-power", what, move |faulty, p| {
            let power = p[0];
            faulty.change_luminaires(|l| raise_candela(l, power) | (loses_planes && keep_first_plane(l)))
        });
        all.push(raised.about(CANDELA).with_parameters([candela_power()]));
        let what = format!("{prefix}the candela are squared, each as a part of the largest, and gamma is off by {{0}}");
        let squared = Fault::new("squared-off", what, move |faulty, p| {
            let by = p[0];
            faulty.change_luminaires(|l| {
                raise_candela(l, 2.0) | (loses_planes && keep_first_plane(l)) | shift_gamma(l, by)
            })
        });
        all.push(squared.about(CANDELA).with_parameters([gamma_shift()]));
    }
    all
}

fn shift_meters(faulty: &mut FaultyTask, p: &[f64]) -> bool {
    let by = DVec3::new(p[0], p[1], p[2]);
    faulty.change_meters(|m| m.position_m += by);
    true
}

/// Kinds within one case.
fn case_kinds(case: usize, tasks: &[Task]) -> Vec<Fault> {
    let mut all = surface_kinds(tasks);
    let ids = luminaire_ids(tasks);
    if ids.len() <= MAX_LUMINAIRES {
        for id in &ids {
            all.extend(luminaire_kinds(Some(id), if ids.len() == 1 { "its" } else { id }));
        }
    }
    if ids.len() > 1 {
        all.extend(luminaire_kinds(None, "all"));
    }
    all.extend(ids.iter().take(MAX_LUMINAIRES).map(|id| flux_kind(id)));
    let what = "meters are off by {0} in x, {1} in y, {2} in z, in this case alone";
    let shifted = Fault::new("shifted-here", what, shift_meters);
    all.push(shifted.about("shifted").with_parameters([displacement(), displacement(), displacement()]));
    all.into_iter().map(|fault| fault.in_case(case)).collect()
}

fn surface_kinds(tasks: &[Task]) -> Vec<Fault> {
    let reflecting = tasks.iter().find(|t| t.transport != Transport::Direct);
    let Some(room) = reflecting.and_then(|t| t.scene.room) else { return vec![] };
    let mut all = vec![];
    for surface in Surface::ALL {
        let right = room.reflectance.of(surface);
        let what = format!("{} reflects {{0}} instead of {right}", surface_name(surface));
        let fault = Fault::new("reflectance", what, move |faulty, p| set_reflectance(faulty, surface, p[0]));
        let parameter = Parameter::new("", right, 0.02, (0.0, MAX_REFLECTANCE));
        all.push(fault.about(surface_name(surface)).with_parameters([parameter]));
    }
    let largest = Surface::ALL.map(|s| room.reflectance.of(s)).into_iter().fold(0.01, f64::max);
    let what = "every surface reflects {0} times what it should, in this case alone";
    let parameter = Parameter::new("", 1.0, 0.02, (0.0, MAX_REFLECTANCE / largest));
    all.push(Fault::new("reflectances", what, scale_reflectances).with_parameters([parameter]));
    all
}

/// Scales the reflectance of every surface, of bodies too.
fn scale_reflectances(faulty: &mut FaultyTask, p: &[f64]) -> bool {
    let factor = p[0];
    let has_changed = change_reflectances(faulty, |r| scale_reflectance(r, factor));
    if has_changed {
        for obstacle in &mut faulty.scene_mut().obstacles {
            obstacle.reflectance = scale_reflectance(obstacle.reflectance, factor);
        }
    }
    has_changed
}

fn scale_reflectance(reflectance: f64, factor: f64) -> f64 {
    (factor * reflectance).min(MAX_REFLECTANCE.max(reflectance))
}

/// A change of one luminaire, or of all at once.
fn luminaire_change(
    id: Option<&str>,
    change: impl Fn(&mut Luminaire, &[f64]) + Send + Sync + 'static,
) -> impl Fn(&mut FaultyTask, &[f64]) -> bool + Send + Sync + 'static {
    let id = id.map(str::to_owned);
    move |faulty, p| {
        faulty.change_luminaires(|l| {
            let is_selected = id.as_ref().is_none_or(|id| *id == l.id);
            if is_selected {
                change(l, p);
            }
            is_selected
        })
    }
}

/// Place and rotation of one luminaire, or of all at once.
fn luminaire_kinds(id: Option<&str>, owner: &str) -> Vec<Fault> {
    let subject = match id {
        None => "all luminaires are".to_owned(),
        Some(_) if owner == "its" => "the luminaire is".to_owned(),
        Some(id) => format!("{id} is"),
    };
    let about_turn = if owner == "its" { TURN.to_owned() } else { format!("turn of {owner}") };
    let place = luminaire_change(id, |l, p| l.position_m += DVec3::new(p[0], p[1], p[2]));
    let turn = luminaire_change(id, |l, p| l.orientation = DMat3::from_rotation_z(p[0].to_radians()) * l.orientation);
    vec![
        Fault::new("place", format!("{subject} off by {{0}} in x, {{1}} in y, {{2}} in z"), place)
            .about(format!("place of {owner}"))
            .with_parameters([displacement(), displacement(), displacement()]),
        Fault::new("turn", format!("{subject} turned by {{0}} about the vertical"), turn)
            .about(about_turn)
            .with_parameters([turn_angle()]),
        Fault::new(
            "tilt",
            format!("{subject} tilted by {{0}} about x and {{1}} about y"),
            luminaire_change(id, tilt_luminaire),
        )
        .about(format!("tilt of {owner}"))
        .with_parameters([tilt_angle(), tilt_angle()]),
    ]
}

/// Tilts a luminaire by angles about x and y, in degrees.
fn tilt_luminaire(luminaire: &mut Luminaire, p: &[f64]) {
    let by = DVec3::new(p[0].to_radians(), p[1].to_radians(), 0.0);
    if by != DVec3::ZERO {
        luminaire.orientation = DMat3::from_axis_angle(by.normalize(), by.length()) * luminaire.orientation;
    }
}

fn flux_kind(id: &str) -> Fault {
    let change = luminaire_change(Some(id), |l, p| l.flux_scale *= p[0]);
    Fault::new("flux", format!("{id} gives {{0}} times its light"), change)
        .about(format!("flux of {id}"))
        .with_parameters([Parameter::new("", 1.0, 0.05, (0.0, 1e4))])
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_engines::fixtures;

    #[test]
    fn a_scaled_reflectance_is_limited_unless_it_was_larger_before() {
        for (reflectance, factor, expected) in
            [(0.5, 1.5, 0.75), (0.5, 3.0, 0.995), (0.999, 3.0, 0.999), (0.999, 0.5, 0.4995), (0.4, 0.0, 0.0)]
        {
            let found = scale_reflectance(reflectance, factor);
            assert!((found - expected).abs() < 1e-12, "{reflectance} {factor}: {found}");
        }
    }

    /// Where the axes x, y and z of a luminaire point after a tilt.
    fn axes_after_tilt(angles_deg: [f64; 2]) -> [DVec3; 3] {
        let mut lamp = fixtures::luminaire("lamp", DVec3::ZERO, fixtures::axial_uplight());
        lamp.orientation = DMat3::IDENTITY;
        tilt_luminaire(&mut lamp, &angles_deg);
        [lamp.orientation.x_axis, lamp.orientation.y_axis, lamp.orientation.z_axis]
    }

    #[test]
    fn a_tilt_turns_about_x_and_y_and_none_leaves_the_luminaire() {
        let half = 0.5 * 2f64.sqrt();
        for (angles_deg, axes) in [
            ([0.0, 0.0], [DVec3::X, DVec3::Y, DVec3::Z]),
            ([90.0, 0.0], [DVec3::X, DVec3::Z, -DVec3::Y]),
            ([0.0, 90.0], [-DVec3::Z, DVec3::Y, DVec3::X]),
            ([-45.0, 0.0], [DVec3::X, DVec3::new(0.0, half, -half), DVec3::new(0.0, half, half)]),
        ] {
            let found = axes_after_tilt(angles_deg);
            assert!(found.iter().zip(axes).all(|(f, e)| (*f - e).length() < 1e-12), "{angles_deg:?}: {found:?}");
        }
    }

    #[test]
    fn fits_of_a_turn_start_all_round_the_circle() {
        let starts = turn_angle().starts;
        assert_eq!((starts.len(), starts[0], starts[5], starts[11]), (12, -150.0, 0.0, 180.0));
        assert_eq!((turn_angle().period, tilt_angle().period), (Some(360.0), None));
    }
}
