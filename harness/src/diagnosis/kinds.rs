//! Faults beyond the list, with free parameters: how much a surface reflects, where a luminaire hangs and how it is
//! turned, how bright it is, where meters are.

use glam::{DMat3, DVec3};
use luminaire::geometry::Surface;
use luminaire::scene::{Luminaire, Transport};

use super::fault::{Fault, Parameter};
use super::faults::{
    CANDELA, LUMINAIRES, POWER, TURN, each_reflectance, name, names, of_specs, reflectances_raised, reflects,
};
use super::tables::{first_plane, is_axial, raised, shifted};
use super::wrong::Wrong;
use crate::procedures::Task;

/// A metre and less that things are out of place by.
const AWAY_M: (f64, f64) = (-3.0, 3.0);
/// A surface reflects so much at most.
const MOST: f64 = 0.995;

/// Every kind that cases may show.
pub fn kinds(cases: &[&[Task]]) -> Vec<Fault> {
    let mut all = of_engine();
    all.extend(of_tables());
    all.extend(of_specs(cases).flat_map(|(case, tasks)| of_case(case, tasks)));
    all
}

fn metres() -> Parameter {
    Parameter::new(" m", 0.0, 0.02, AWAY_M)
}

/// A rotation, from every side where it may be any.
fn degrees(anywhere: bool) -> Parameter {
    let starts = if anywhere { (-5..=6).map(|k| 30.0 * f64::from(k)).collect() } else { vec![0.0] };
    Parameter { unit: " degrees", starts, step: 1.0, range: (-200.0, 200.0), period: anywhere.then_some(360.0) }
}

fn of_engine() -> Vec<Fault> {
    vec![
        Fault::new("reflectances", "every surface of every room reflects {0} times what it should", scaled)
            .with([Parameter::new("", 1.0, 0.02, (0.0, 10.0))]),
        Fault::new("turned", "distributions are turned by {0} in C", |wrong, p| {
            let turn = DMat3::from_rotation_z(p[0].to_radians());
            wrong.luminaires(|l| {
                l.orientation *= turn;
                !is_axial(l)
            })
        })
        .about(TURN)
        .with([degrees(true)]),
        Fault::new("power", "reflectances are raised to the power of {0}", |wrong, p| reflectances_raised(wrong, p[0]))
            .about(POWER)
            .with([Parameter::new("", 1.0, 0.05, (0.1, 10.0))]),
        Fault::new("shifted", "meters are off by {0} in x, {1} in y, {2} in z", shift).with([
            metres(),
            metres(),
            metres(),
        ]),
        Fault::new("lifted", "meters are {0} in front of where they should be", |wrong, p| {
            let by = p[0];
            wrong.meters(|m| m.position_m += by * m.normal);
            true
        })
        .with([metres()]),
    ]
}

/// What becomes of a table that is kept as a texture: candela to a power, angles off by a part of a texel, planes lost, and all that at once.
fn of_tables() -> Vec<Fault> {
    let off = || Parameter::new(" degrees", 0.0, 0.05, (-20.0, 20.0));
    let power = || Parameter::new("", 1.0, 0.02, (0.1, 10.0));
    let plane =
        |is_first: bool, what: String| if is_first { format!("only the plane C 0 is read, {what}") } else { what };
    let mut all = vec![];
    for is_first in [false, true] {
        let lost = move |l: &mut Luminaire| is_first && first_plane(l);
        let shift = move |wrong: &mut Wrong, p: &[f64]| {
            let by = p[0];
            wrong.luminaires(|l| lost(l) | shifted(l, by))
        };
        let about = if is_first { "angles of one plane" } else { "angles" };
        let what = plane(is_first, "gamma is off by {0}".to_owned());
        all.push(Fault::new("gamma-off", what, shift).about(about).with([off()]));
        let what =
            plane(is_first, "the candela are raised to the power of {0}, each as a part of the largest".to_owned());
        let to_power = move |wrong: &mut Wrong, p: &[f64]| {
            let power = p[0];
            wrong.luminaires(|l| raised(l, power) | lost(l))
        };
        all.push(Fault::new("candela-power", what, to_power).about(CANDELA).with([power()]));
        let what = "the candela are squared, each as a part of the largest, and gamma is off by {0}".to_owned();
        let squared = move |wrong: &mut Wrong, p: &[f64]| {
            let by = p[0];
            wrong.luminaires(|l| raised(l, 2.0) | lost(l) | shifted(l, by))
        };
        all.push(Fault::new("squared-off", plane(is_first, what), squared).about(CANDELA).with([off()]));
    }
    all
}

fn shift(wrong: &mut Wrong, p: &[f64]) -> bool {
    let by = DVec3::new(p[0], p[1], p[2]);
    wrong.meters(|m| m.position_m += by);
    true
}

fn of_case(case: usize, tasks: &[Task]) -> Vec<Fault> {
    let mut all = of_surfaces(tasks);
    let ids = names(tasks);
    if ids.len() <= LUMINAIRES {
        all.extend(ids.iter().flat_map(|id| of_luminaire(Some(id), if ids.len() == 1 { "its" } else { id })));
    }
    if ids.len() > 1 {
        all.extend(of_luminaire(None, "all"));
        all.extend(ids.iter().take(LUMINAIRES).map(|id| flux(id)));
    }
    let moved = Fault::new("shifted-here", "meters are off by {0} in x, {1} in y, {2} in z, in this case alone", shift);
    all.push(moved.about("shifted").with([metres(), metres(), metres()]));
    all.into_iter().map(|fault| fault.within(case)).collect()
}

fn of_surfaces(tasks: &[Task]) -> Vec<Fault> {
    let lit = tasks.iter().find(|t| t.transport != Transport::Direct).and_then(|t| t.scene.room);
    let Some(room) = lit else { return vec![] };
    let mut all = vec![];
    for surface in Surface::ALL {
        let right = room.reflectance.of(surface);
        let what = format!("{} reflects {{0}} instead of {right}", name(surface));
        let fault = Fault::new("reflectance", what, move |wrong, p| reflects(wrong, surface, p[0]));
        all.push(fault.about(name(surface)).with([Parameter::new("", right, 0.02, (0.0, MOST))]));
    }
    let most = Surface::ALL.map(|s| room.reflectance.of(s)).into_iter().fold(0.01, f64::max);
    let here =
        Fault::new("reflectances", "every surface reflects {0} times what it should, in this case alone", scaled);
    all.push(here.with([Parameter::new("", 1.0, 0.02, (0.0, MOST / most))]));
    all
}

/// Every surface's reflectance, of bodies too, by a factor.
fn scaled(wrong: &mut Wrong, p: &[f64]) -> bool {
    let by = |r: f64| (p[0] * r).min(MOST.max(r));
    let is_lit = each_reflectance(wrong, by);
    if is_lit {
        wrong.scene().obstacles.iter_mut().for_each(|o| o.reflectance = by(o.reflectance));
    }
    is_lit
}

/// A change of one luminaire, or of all at once.
fn each(
    id: Option<&str>,
    change: impl Fn(&mut Luminaire, &[f64]) + Send + Sync + 'static,
) -> impl Fn(&mut Wrong, &[f64]) -> bool + Send + Sync + 'static {
    let id = id.map(str::to_owned);
    move |wrong, p| {
        wrong.luminaires(|l| {
            let is_it = id.as_ref().is_none_or(|id| *id == l.id);
            if is_it {
                change(l, p);
            }
            is_it
        })
    }
}

/// Its place and its rotation: of one luminaire, or of all at once.
fn of_luminaire(id: Option<&str>, who: &str) -> Vec<Fault> {
    let subject = match id {
        None => "all luminaires are".to_owned(),
        Some(_) if who == "its" => "the luminaire is".to_owned(),
        Some(id) => format!("{id} is"),
    };
    let moved = format!("{subject} off by {{0}} in x, {{1}} in y, {{2}} in z");
    let place = each(id, |l, p| l.position_m += DVec3::new(p[0], p[1], p[2]));
    let turned = format!("{subject} turned by {{0}} about the vertical");
    let turn = each(id, |l, p| l.orientation = DMat3::from_rotation_z(p[0].to_radians()) * l.orientation);
    let tilted = format!("{subject} tilted by {{0}} about x and {{1}} about y");
    let tilt = each(id, |l, p| {
        let by = DVec3::new(p[0].to_radians(), p[1].to_radians(), 0.0);
        if by != DVec3::ZERO {
            l.orientation = DMat3::from_axis_angle(by.normalize(), by.length()) * l.orientation;
        }
    });
    let about_turn = if who == "its" { TURN.to_owned() } else { format!("turn of {who}") };
    vec![
        Fault::new("place", moved, place).about(format!("place of {who}")).with([metres(), metres(), metres()]),
        Fault::new("turn", turned, turn).about(about_turn).with([degrees(true)]),
        Fault::new("tilt", tilted, tilt).about(format!("tilt of {who}")).with([degrees(false), degrees(false)]),
    ]
}

fn flux(id: &str) -> Fault {
    let fault =
        Fault::new("flux", format!("{id} gives {{0}} times its light"), each(Some(id), |l, p| l.flux_scale *= p[0]));
    fault.about(format!("flux of {id}")).with([Parameter::new("", 1.0, 0.05, (0.0, 1e4))])
}
