//! Faults beyond the list, with free parameters: how much a surface reflects, where a luminaire hangs and how it is
//! turned, how bright it is, where meters are.

use glam::{DMat3, DVec3};
use luminaire::geometry::Surface;
use luminaire::scene::{Luminaire, Transport};

use super::fault::{Fault, Parameter};
use super::faults::{FACTOR, LUMINAIRES, POWER, TURN, in_room, name, names, raised, reflectance, reflects};
use super::wrong::Wrong;
use crate::procedures::Task;

/// A metre and less that things are out of place by.
const AWAY_M: (f64, f64) = (-3.0, 3.0);

/// Every kind that cases may show.
pub fn kinds(cases: &[&[Task]]) -> Vec<Fault> {
    let mut all = of_engine();
    // Scenes of known answer are no case: each is a room of its own.
    let of_a_spec = |(_, tasks): &(usize, &&[Task])| !tasks.iter().all(|t| t.procedure.is_known());
    for (case, tasks) in cases.iter().enumerate().filter(of_a_spec) {
        all.extend(of_case(case, tasks));
    }
    all
}

fn metres() -> Parameter {
    Parameter::new(" m", 0.0, 0.02, AWAY_M)
}

/// A rotation, from every side where it may be any.
fn degrees(anywhere: bool) -> Parameter {
    let starts = if anywhere { (-5..=6).map(|k| 30.0 * f64::from(k)).collect() } else { vec![0.0] };
    Parameter { unit: " degrees", starts, step: 1.0, range: (-200.0, 200.0) }
}

fn of_engine() -> Vec<Fault> {
    vec![
        Fault::new("turned", "distributions are turned by {0} in C", |wrong, p| {
            let turn = DMat3::from_rotation_z(p[0].to_radians());
            wrong.luminaires(|l| {
                l.orientation *= turn;
                l.photometry.distribution.c_deg().len() > 1
            })
        })
        .about(TURN)
        .with([degrees(true)]),
        Fault::new("power", "reflectances are raised to the power of {0}", |wrong, p| raised(wrong, p[0]))
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
    let alone = "factor {0:} in this case alone, none of those known";
    all.push(Fault::new("factor-here", alone, |_, _| true).about(FACTOR).as_bright_as_you_like());
    let moved = Fault::new("shifted-here", "meters are off by {0} in x, {1} in y, {2} in z, in this case alone", shift);
    all.push(moved.about("shifted").with([metres(), metres(), metres()]));
    all.into_iter().map(|fault| fault.within(case)).collect()
}

fn of_surfaces(tasks: &[Task]) -> Vec<Fault> {
    let lit = tasks.iter().find(|t| t.transport != Transport::Direct).and_then(|t| t.scene.room);
    let Some(mut room) = lit else { return vec![] };
    let mut all = vec![];
    for surface in Surface::ALL {
        let right = *reflectance(&mut room, surface);
        let what = format!("{} reflects {{0}} instead of {right}", name(surface));
        let fault = Fault::new("reflectance", what, move |wrong, p| reflects(wrong, surface, p[0]));
        all.push(fault.about(name(surface)).with([Parameter::new("", right, 0.02, (0.0, 0.995))]));
    }
    let most = Surface::ALL.map(|s| *reflectance(&mut room, s)).into_iter().fold(0.01, f64::max);
    let scaled = Fault::new("reflectances", "every surface reflects {0} times what it should", |wrong, p| {
        let by = p[0];
        in_room(wrong, |room| Surface::ALL.into_iter().for_each(|s| *reflectance(room, s) *= by))
    });
    all.push(scaled.with([Parameter::new("", 1.0, 0.02, (0.0, 0.995 / most))]));
    all
}

/// Its place and its rotation: of one luminaire, or of all at once.
fn of_luminaire(id: Option<&String>, who: &str) -> Vec<Fault> {
    let only = |id: Option<&String>| {
        let id = id.cloned();
        move |l: &Luminaire| id.as_ref().is_none_or(|id| *id == l.id)
    };
    let subject = match id {
        None => "all luminaires are".to_owned(),
        Some(_) if who == "its" => "the luminaire is".to_owned(),
        Some(id) => format!("{id} is"),
    };
    let (is_moved, is_turned, is_tilted) = (only(id), only(id), only(id));
    let moved = format!("{subject} off by {{0}} in x, {{1}} in y, {{2}} in z");
    let place = Fault::new("place", moved, move |wrong, p| {
        let by = DVec3::new(p[0], p[1], p[2]);
        wrong.luminaires(|l| {
            is_moved(l) && {
                l.position_m += by;
                true
            }
        })
    });
    let turned = format!("{subject} turned by {{0}} about the vertical");
    let turn = Fault::new("turn", turned, move |wrong, p| {
        let turn = DMat3::from_rotation_z(p[0].to_radians());
        wrong.luminaires(|l| {
            is_turned(l) && {
                l.orientation = turn * l.orientation;
                true
            }
        })
    });
    let tilted = format!("{subject} tilted by {{0}} about x and {{1}} about y");
    let tilt = Fault::new("tilt", tilted, move |wrong, p| {
        let by = DVec3::new(p[0].to_radians(), p[1].to_radians(), 0.0);
        let tilt =
            if by == DVec3::ZERO { DMat3::IDENTITY } else { DMat3::from_axis_angle(by.normalize(), by.length()) };
        wrong.luminaires(|l| {
            is_tilted(l) && {
                l.orientation = tilt * l.orientation;
                true
            }
        })
    });
    vec![
        place.about(format!("place of {who}")).with([metres(), metres(), metres()]),
        turn.about(if who == "its" { TURN.to_owned() } else { format!("turn of {who}") }).with([degrees(true)]),
        tilt.about(format!("tilt of {who}")).with([degrees(false), degrees(false)]),
    ]
}

fn flux(id: &str) -> Fault {
    let name = id.to_owned();
    let what = format!("{id} gives {{0}} times its light");
    let fault = Fault::new("flux", what, move |wrong, p| {
        wrong.luminaires(|l| {
            l.id == name && {
                l.flux_scale *= p[0];
                true
            }
        })
    });
    fault.about(format!("flux of {id}")).with([Parameter::new("", 1.0, 0.05, (0.0, 1e4))])
}
