//! Faults that renderers and exporters are known to have. The diagnosis looks for them in readings that failed, the
//! self-test puts them in.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use itertools::Itertools;
use luminaire::geometry::{Room, Surface};
use luminaire::scene::{Bounces, LuminaireModel, Transport};

use super::fault::{Fault, Parameter};
use super::tables::{averaged, extrapolated, first_plane, is_axial, isotropic, raised, remap, replace, turned_behind};
use super::wrong::{Law, Order, Readout, Wrong};
use crate::procedures::Task;

/// Reflections after which truncation is looked for no more: it hardly shows then.
const MAX_BOUNCES: u32 = 8;
const HALF_MAX: f64 = 65504.0;
/// Luminaires of a scene that are looked at one by one.
pub(super) const LUMINAIRES: usize = 8;

/// Every fault on the list that cases may show; what is of one case alone names what is in it.
pub fn faults(cases: &[&[Task]]) -> Vec<Fault> {
    let mut all = factors();
    all.extend(readouts());
    all.extend(laws());
    all.extend(of_luminaires());
    all.extend(of_rooms());
    all.extend(of_light());
    all.extend(of_specs(cases).flat_map(|(case, tasks)| of_case(case, tasks)));
    all
}

/// Scenes of known answer are no case: each is a room of its own.
pub(super) fn of_specs<'a>(cases: &[&'a [Task]]) -> impl Iterator<Item = (usize, &'a [Task])> {
    let is_a_spec = |tasks: &[Task]| !tasks.iter().all(|t| t.procedure.is_known());
    cases.iter().copied().enumerate().filter(move |(_, tasks)| is_a_spec(tasks))
}

/// Without parameters.
fn factors() -> Vec<Fault> {
    use std::f64::consts::PI;
    let constant = [
        ("factor-pi", "factor pi: exitance taken for luminance", PI),
        ("factor-1/pi", "factor 1/pi: luminance taken for exitance", 1.0 / PI),
        ("factor-4pi", "factor 4 pi: intensity taken for flux", 4.0 * PI),
        ("factor-1/4pi", "factor 1/(4 pi): flux taken for intensity", 1.0 / (4.0 * PI)),
        ("factor-2pi", "factor 2 pi: intensity taken for the flux of half a sphere", 2.0 * PI),
        ("factor-1/2pi", "factor 1/(2 pi): the flux of half a sphere taken for intensity", 0.5 / PI),
        ("factor-2", "factor 2: something counted twice, or half a sphere for a whole one", 2.0),
        ("factor-1/2", "factor 1/2: half of something lost, or a whole sphere for half a one", 0.5),
        ("factor-179", "factor 179: Radiance's lumens a watt applied once too often", 179.0),
        ("factor-1/179", "factor 1/179: Radiance's lumens a watt left out", 1.0 / 179.0),
        ("factor-683", "factor 683: lumens a watt applied once too often", 683.0),
        ("factor-1/683", "factor 1/683: lumens a watt left out", 1.0 / 683.0),
        ("factor-177.83", "factor 177.83: the lumens a watt of equal-energy white", 177.83),
        ("factor-1/177.83", "factor 1/177.83: the lumens a watt of equal-energy white left out", 1.0 / 177.83),
        ("feet", "factor 10.764: feet taken for metres, or lux for footcandles", 1.0 / (0.3048 * 0.3048)),
        ("metres", "factor 0.0929: metres taken for feet, or footcandles for lux", 0.3048 * 0.3048),
        ("millimetres", "factor 1000000: millimetres taken for metres", 1e6),
        ("centimetres", "factor 10000: centimetres taken for metres, or lux for phot", 1e4),
        ("to-centimetres", "factor 1/10000: metres taken for centimetres, or phot for lux", 1e-4),
        ("to-millimetres", "factor 1/1000000: metres taken for millimetres", 1e-6),
        ("inches", "factor 1550: inches taken for metres", 1.0 / (0.0254 * 0.0254)),
        ("to-inches", "factor 1/1550: metres taken for inches", 0.0254 * 0.0254),
        ("kilo", "factor 1000: candela a kilolumen taken for candela, or lux for kilolux", 1000.0),
        ("milli", "factor 1/1000: candela taken for candela a kilolumen", 1e-3),
    ];
    let factor = |(id, what, factor): (&'static str, &str, f64)| {
        let times = move |wrong: &mut Wrong, _: &[f64]| {
            wrong.factor *= factor;
            true
        };
        Fault::new(id, what, times).about(FACTOR)
    };
    let mut faults: Vec<Fault> = constant.into_iter().map(factor).collect();
    let unnamed = "factor {0:}, none of those known";
    faults.push(Fault::new(FACTOR, unnamed, |_, _| true).as_bright_as_you_like());
    let scaled = "the spec's flux_scale is left out";
    faults.push(Fault::new("flux-scale", scaled, |wrong, _| {
        wrong.dimmed(|l| (l.flux_scale > 0.0 && l.flux_scale != 1.0).then(|| 1.0 / l.flux_scale))
    }));
    let twice = "the spec's flux_scale is applied twice";
    faults.push(Fault::new("flux-scale-twice", twice, |wrong, _| {
        wrong.dimmed(|l| (l.flux_scale > 0.0 && l.flux_scale != 1.0).then_some(l.flux_scale))
    }));
    let lumens = |l: &luminaire::scene::Luminaire| l.photometry.lamp_lumens.filter(|lumens| *lumens > 0.0);
    let per = "factor 1000/lamp lumens: scaled to a kilolumen";
    faults.push(Fault::new("per-kilolumen", per, move |wrong, _| wrong.dimmed(|l| Some(1000.0 / lumens(l)?))));
    let twice = "factor lamp lumens/1000: the lamp's lumens applied once too often";
    faults.push(Fault::new("lumens-twice", twice, move |wrong, _| wrong.dimmed(|l| Some(lumens(l)? / 1000.0))));
    faults
}

/// The id of a factor that is no fault's.
pub(super) const FACTOR: &str = "factor";

fn readouts() -> Vec<Fault> {
    let readout = |id, what, readout: fn(&[f64]) -> Readout| {
        Fault::new(id, what, move |wrong, p| {
            wrong.readouts.push(readout(p));
            true
        })
    };
    let level = Parameter { unit: " lx", starts: vec![], step: 1e-3, range: (0.0, f64::MAX), period: None };
    let more = Parameter { unit: " lx", starts: vec![0.0], step: 1e-3, range: (0.0, f64::MAX), period: None };
    vec![
        readout("clamp", "highlights are cut off at {0}", |p| Readout::AtMost(p[0])).with([level]),
        readout("offset", "{0} are added to every reading", |p| Readout::Plus(p[0])).with([more]),
        readout("half-float", "half-precision numbers: what is above 65504 is lost", |_| Readout::AtMost(HALF_MAX)),
        readout("dark", "no light at all: every reading is zero", |_| Readout::AtMost(0.0)),
        readout("reversed", "the meters of a set are read in the reverse order", |_| Readout::Order(Order::Reversed)),
        readout("next", "every meter reads what the next of its set should", |_| Readout::Order(Order::Next)),
        readout("previous", "every meter reads what the one before it should", |_| Readout::Order(Order::Previous)),
        readout("exchanged", "rows and columns of grids of meters are exchanged", |_| Readout::Order(Order::Exchanged)),
    ]
}

fn laws() -> Vec<Fault> {
    let law = |id, what, law: Law| {
        Fault::new(id, what, move |wrong, _| {
            // Where the light is even, the wrong law is a factor like any other.
            wrong.law = law;
            wrong.task().scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point)
        })
    };
    let wrong = |change: fn(&mut Law)| {
        let mut law = Law::RIGHT;
        change(&mut law);
        law
    };
    vec![
        law("cosine-missing", "the cosine at the meter is left out", wrong(|l| l.cosine = 0)),
        law("cosine-doubled", "the cosine at the meter is applied twice", wrong(|l| l.cosine = 2)),
        law("two-sided", "light from behind a meter counts, too", wrong(|l| l.is_two_sided = true)),
        law("normals-ignored", "the normals of meters are left out", wrong(|l| (l.cosine, l.is_two_sided) = (0, true))),
        law("distance", "light falls with distance, not with its square", wrong(|l| l.distance = 1))
            .as_bright_as_you_like(),
        law("candela-squared", "the candela are squared: the filter is applied to itself", wrong(|l| l.intensity = 2))
            .as_bright_as_you_like(),
    ]
}

fn of_luminaires() -> Vec<Fault> {
    let of_each = |id, what: &str, change: fn(&mut luminaire::scene::Luminaire) -> bool| {
        Fault::new(id, what, move |wrong, _| wrong.luminaires(change))
    };
    let turned = |(id, deg): (&'static str, f64)| {
        let what = format!("the distribution is turned by {deg} degrees in C");
        let turn = move |l: &mut luminaire::scene::Luminaire| {
            !is_axial(l) && replace(l, Some(l.photometry.distribution.turned(deg)))
        };
        Fault::new(id, what, move |wrong, _| wrong.luminaires(turn)).about(TURN)
    };
    let mut faults = [("c-turned-90", 90.0), ("c-turned-180", 180.0), ("c-turned-270", 270.0)].map(turned).to_vec();
    faults.extend([
        of_each("c-mirrored", "C runs the other way round: 90 and 270 degrees are exchanged", |l| {
            !is_axial(l) && remap(l, |c, g| (-c, g))
        }),
        of_each("c-mirrored-90", "C 0 and C 180 are exchanged", |l| !is_axial(l) && remap(l, |c, g| (180.0 - c, g))),
        of_each("c-turned-behind", "beyond a gamma of 90 degrees C is turned by 180 degrees", turned_behind),
        of_each("gamma-flipped", "gamma is counted from the zenith: up and down are exchanged", |l| {
            remap(l, |c, g| (c, 180.0 - g))
        }),
        of_each("isotropic", "the distribution is replaced by the same intensity everywhere", isotropic),
        of_each("one-plane", "only the plane C 0 is read", first_plane).about("planes"),
        of_each("nodes-squared", "the candela are squared, each as a part of the largest", |l| raised(l, 2.0))
            .about(CANDELA),
        of_each(
            "one-plane-squared",
            "only the plane C 0 is read, and the candela are squared, each as a part of the largest",
            |l| raised(l, 2.0) | first_plane(l),
        )
        .about(CANDELA),
        of_each("averaged", "the distribution is averaged over C", |l| !is_axial(l) && averaged(l)),
        of_each("extrapolated", "the table goes on beyond its last angle", extrapolated),
        of_each("unrotated", "the luminaire's rotation is left out", |l| {
            let before = std::mem::replace(&mut l.orientation, DMat3::IDENTITY);
            before != DMat3::IDENTITY
        }),
        of_each("rotated-back", "the luminaire's rotation is applied the wrong way round", |l| {
            let back = l.orientation.transpose();
            let before = std::mem::replace(&mut l.orientation, back);
            before != l.orientation
        }),
        Fault::new("one-lit", "of several luminaires the first alone gives light", |wrong, _| {
            let are_several = wrong.task().scene.luminaires.len() > 1;
            if are_several {
                wrong.scene().luminaires.truncate(1);
            }
            are_several
        }),
        Fault::new("one-table", "all luminaires have the table of the first", |wrong, _| {
            table_of_the_first(wrong, false)
        }),
        Fault::new("one-table-scaled", "all luminaires have the table and the flux_scale of the first", |wrong, _| {
            table_of_the_first(wrong, true)
        }),
        of_each("area-as-point", "the luminous opening is shrunk to a point", |l| {
            let before = std::mem::replace(&mut l.model, LuminaireModel::Point);
            before != LuminaireModel::Point
        }),
    ]);
    faults
}

fn table_of_the_first(wrong: &mut Wrong, with_its_scale: bool) -> bool {
    let Some(first) = wrong.task().scene.luminaires.first().cloned() else { return false };
    wrong.luminaires(|l| {
        let before = std::mem::replace(&mut l.photometry, Arc::clone(&first.photometry));
        if with_its_scale {
            l.flux_scale = first.flux_scale;
        }
        !Arc::ptr_eq(&before, &first.photometry)
    })
}

/// What powers of candela are about.
pub(super) const CANDELA: &str = "power of candela";
/// What rotations in C are about.
pub(super) const TURN: &str = "turn";
/// What powers of reflectances are about.
pub(super) const POWER: &str = "power of reflectances";

fn of_rooms() -> Vec<Fault> {
    let mut faults = vec![Fault::new("upside-down", "ceiling and floor are exchanged", |wrong, _| {
        in_room(wrong, |r| std::mem::swap(&mut r.reflectance.floor, &mut r.reflectance.ceiling))
    })];
    // The exponent of display gamma, as an RGB colour would be decoded.
    for (id, what, power) in [
        ("gamma-decoded", "reflectances are decoded as colours, to the power of 2.2", 2.2),
        ("gamma-encoded", "reflectances are encoded as colours, to the power of 1/2.2", 1.0 / 2.2),
    ] {
        faults.push(Fault::new(id, what, move |wrong, _| reflectances_raised(wrong, power)).about(POWER));
    }
    faults
}

fn of_light() -> Vec<Fault> {
    let mut faults: Vec<Fault> = (0..MAX_BOUNCES).map(bounces_cut).collect();
    faults.extend([
        Fault::new("bounces-uncut", "light is followed beyond the reflections asked for", |wrong, _| {
            let asked = wrong.task().transport;
            bounces(asked).is_some_and(|b| b != Bounces::Converged) && {
                wrong.transport(with_bounces(asked, Bounces::Converged));
                true
            }
        }),
        Fault::new("direct-lost", "direct light is missing", |wrong, _| {
            let Transport::Total(bounces) = wrong.task().transport else { return false };
            wrong.transport(Transport::Indirect(bounces));
            true
        }),
        Fault::new("direct-added", "direct light is counted too", |wrong, _| {
            let Transport::Indirect(bounces) = wrong.task().transport else { return false };
            wrong.transport(Transport::Total(bounces));
            true
        }),
        Fault::new("indirect-added", "reflected light is counted too", |wrong, _| {
            let is_there = wrong.task().transport == Transport::Direct && wrong.task().scene.room.is_some();
            if is_there {
                wrong.transport(Transport::Total(Bounces::Converged));
            }
            is_there
        })
        .that_reflects(),
        Fault::new("meter-flipped", "meters face the other way", |wrong, _| {
            wrong.meters(|m| m.normal = -m.normal);
            true
        }),
        Fault::new("meters-up", "all meters face up, whatever their normals are", |wrong, _| {
            wrong.meters(|m| m.normal = DVec3::Z);
            true
        }),
    ]);
    faults
}

fn bounces_cut(n: u32) -> Fault {
    let what = format!("light stops after {n} reflection{}", if n == 1 { "" } else { "s" });
    Fault::new("bounces-cut", what, move |wrong, _| {
        let asked = wrong.task().transport;
        let cuts = bounces(asked).is_some_and(|b| if let Bounces::AtMost(most) = b { n < most } else { true });
        if cuts {
            wrong.transport(with_bounces(asked, Bounces::AtMost(n)));
        }
        cuts
    })
}

const fn bounces(transport: Transport) -> Option<Bounces> {
    match transport {
        Transport::Direct => None,
        Transport::Indirect(bounces) | Transport::Total(bounces) => Some(bounces),
    }
}

const fn with_bounces(transport: Transport, bounces: Bounces) -> Transport {
    match transport {
        Transport::Direct => Transport::Direct,
        Transport::Indirect(_) => Transport::Indirect(bounces),
        Transport::Total(_) => Transport::Total(bounces),
    }
}

fn of_case(case: usize, tasks: &[Task]) -> Vec<Fault> {
    let mut faults = vec![];
    if tasks.iter().any(|t| t.scene.room.is_some() && t.transport != Transport::Direct) {
        faults.extend(Surface::ALL.map(|surface| {
            let what = format!("{} reflects nothing: dropped, or its normal points outwards", name(surface));
            let fault = Fault::new("surface-lost", what, move |wrong, _| reflects(wrong, surface, 0.0));
            fault.about(name(surface)).within(case)
        }));
    }
    let ids = names(tasks);
    for id in ids.iter().filter(|_| ids.len() > 1).take(LUMINAIRES) {
        let lost = id.clone();
        let fault = Fault::new("luminaire-lost", format!("{id} gives no light"), move |wrong, _| {
            let before = wrong.task().scene.luminaires.len();
            // A scene that loses its only one is dark.
            if before == 1 && wrong.task().scene.luminaires[0].id == lost {
                wrong.factor = 0.0;
                return true;
            }
            wrong.scene().luminaires.retain(|l| l.id != lost);
            wrong.task().scene.luminaires.len() < before
        });
        faults.push(fault.about(format!("flux of {id}")).within(case));
    }
    faults
}

/// The luminaires of a case.
pub(super) fn names(tasks: &[Task]) -> Vec<String> {
    tasks.iter().flat_map(|t| &t.scene.luminaires).map(|l| l.id.clone()).unique().collect()
}

pub(super) fn in_room(wrong: &mut Wrong, change: impl Fn(&mut Room)) -> bool {
    if wrong.task().transport == Transport::Direct || wrong.task().scene.room.is_none() {
        return false;
    }
    wrong.scene().room.as_mut().map(change).is_some()
}

pub(super) fn reflects(wrong: &mut Wrong, surface: Surface, value: f64) -> bool {
    in_room(wrong, |room| *reflectance(room, surface) = value)
}

/// Every reflectance to a power.
pub(super) fn reflectances_raised(wrong: &mut Wrong, power: f64) -> bool {
    each_reflectance(wrong, |r| r.powf(power))
}

/// Another reflectance of every surface of the room.
pub(super) fn each_reflectance(wrong: &mut Wrong, of: impl Fn(f64) -> f64) -> bool {
    in_room(wrong, |room| {
        for surface in Surface::ALL {
            let r = reflectance(room, surface);
            *r = of(*r);
        }
    })
}

fn reflectance(room: &mut Room, surface: Surface) -> &mut f64 {
    let r = &mut room.reflectance;
    match surface {
        Surface::Floor => &mut r.floor,
        Surface::Ceiling => &mut r.ceiling,
        Surface::WallXMin => &mut r.wall_x_min,
        Surface::WallXMax => &mut r.wall_x_max,
        Surface::WallYMin => &mut r.wall_y_min,
        Surface::WallYMax => &mut r.wall_y_max,
    }
}

pub(super) const fn name(surface: Surface) -> &'static str {
    match surface {
        Surface::Floor => "the floor",
        Surface::Ceiling => "the ceiling",
        Surface::WallXMin => "the wall at x = 0",
        Surface::WallXMax => "the wall at the largest x",
        Surface::WallYMin => "the wall at y = 0",
        Surface::WallYMax => "the wall at the largest y",
    }
}
