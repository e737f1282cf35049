//! Faults that renderers and exporters are known to have.
//!
//! The diagnosis searches for them in readings that failed; the self-test injects them.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use itertools::Itertools;
use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Transport};

use super::distance_law::DistanceLaw;
use super::fault::{Fault, Parameter};
use super::faulty_task::{FaultyTask, Law, Order, Readout, Sequence};
use super::tables::{
    average_over_c, extrapolate, is_axial, keep_first_plane, make_isotropic, raise_candela, remap,
    replace_distribution, turn_behind,
};
use luxproof_spec::procedures::Task;

/// Truncation after more reflections than this is not searched for, because it does not show.
const MAX_BOUNCES: u32 = 8;
/// The largest number of half precision.
const HALF_PRECISION_MAX: f64 = 65504.0;
/// Luminaires of a scene that are examined one by one.
pub(super) const MAX_LUMINAIRES: usize = 8;

/// The id of a factor that no fault is known for.
pub(super) const FACTOR: &str = "factor";
/// What powers of candela are about.
pub(super) const CANDELA: &str = "power of candela";
/// What rotations in C are about.
pub(super) const TURN: &str = "turn";
/// What powers of reflectances are about.
pub(super) const POWER: &str = "power of reflectances";

/// Lists every fault that the cases may show; a fault within one case names what is in that case.
pub fn faults(cases: &[&[Task]]) -> Vec<Fault> {
    let mut all = factor_faults();
    all.extend(readout_faults());
    all.extend(law_faults());
    all.extend(luminaire_faults());
    all.extend(room_faults());
    all.extend(transport_faults());
    all.extend(spec_cases(cases).flat_map(|(case, tasks)| case_faults(case, tasks)));
    all
}

/// The cases that come from specs. Scenes of known answer form no case, because each is a room by itself.
pub(super) fn spec_cases<'a>(cases: &[&'a [Task]]) -> impl Iterator<Item = (usize, &'a [Task])> {
    cases.iter().copied().enumerate().filter(|(_, tasks)| !tasks.iter().all(|t| t.procedure.is_calibration()))
}

/// Factors on every reading.
fn factor_faults() -> Vec<Fault> {
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
        ("constant", "factor 683/(4 pi): the lumens a watt, and flux taken for intensity", 683.0 / (4.0 * PI)),
        ("constant", "factor 4 pi/683: lumens a watt left out, and intensity taken for flux", 4.0 * PI / 683.0),
        ("constant", "factor 683/pi: the lumens a watt, and luminance taken for exitance", 683.0 / PI),
        ("constant", "factor pi/683: lumens a watt left out, and exitance taken for luminance", PI / 683.0),
        ("constant", "factor 179/pi: Radiance's lumens a watt, and luminance taken for exitance", 179.0 / PI),
        ("constant", "factor pi/179: Radiance's lumens a watt left out, and exitance taken for luminance", PI / 179.0),
        ("constant", "factor 179/(4 pi): Radiance's lumens a watt, and flux taken for intensity", 179.0 / (4.0 * PI)),
        (
            "constant",
            "factor 4 pi/179: Radiance's lumens a watt left out, and intensity taken for flux",
            4.0 * PI / 179.0,
        ),
        ("constant", "factor 683/179: one number of lumens a watt taken for another", 683.0 / 179.0),
        ("constant", "factor 179/683: one number of lumens a watt taken for another", 179.0 / 683.0),
        ("constant", "factor 179/177.83: one number of lumens a watt taken for another", 179.0 / 177.83),
        ("constant", "factor 177.83/179: one number of lumens a watt taken for another", 177.83 / 179.0),
        ("constant", "factor 683/177.83: one number of lumens a watt taken for another", 683.0 / 177.83),
        ("constant", "factor pi^2: pi applied twice", PI * PI),
        ("constant", "factor 1/pi^2: pi divided by twice", 1.0 / (PI * PI)),
        ("constant", "factor pi/2: a half circle taken for a diameter", PI / 2.0),
        ("constant", "factor 2/pi: a diameter taken for a half circle", 2.0 / PI),
        ("constant", "factor 4: a radius taken for a diameter, or the other way round", 4.0),
        ("constant", "factor 1/4: a diameter taken for a radius, or the other way round", 0.25),
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
    let mut faults = vec![];
    for (id, what, factor) in constant {
        faults.push(
            Fault::new(id, what, move |faulty, _| {
                faulty.factor *= factor;
                true
            })
            .about(FACTOR),
        );
    }
    // Any other factor is named by its value.
    faults.push(Fault::new(FACTOR, "factor {0:}, none of those known", |_, _| true).with_free_factor());
    faults.extend([
        Fault::new("flux-scale", "the spec's flux_scale is left out", |faulty, _| {
            faulty.scale_luminaires(|l| Some(1.0 / effective_flux_scale(l)?))
        }),
        Fault::new("flux-scale-twice", "the spec's flux_scale is applied twice", |faulty, _| {
            faulty.scale_luminaires(effective_flux_scale)
        }),
        Fault::new("per-kilolumen", "factor 1000/lamp lumens: scaled to a kilolumen", |faulty, _| {
            faulty.scale_luminaires(|l| Some(1000.0 / lamp_lumens(l)?))
        }),
        Fault::new("lumens-twice", "factor lamp lumens/1000: the lamp's lumens applied once too often", |faulty, _| {
            faulty.scale_luminaires(|l| Some(lamp_lumens(l)? / 1000.0))
        }),
    ]);
    faults
}

/// The flux scale of a luminaire, where it changes the light.
fn effective_flux_scale(luminaire: &Luminaire) -> Option<f64> {
    Some(luminaire.flux_scale).filter(|scale| *scale > 0.0 && *scale != 1.0)
}

fn lamp_lumens(luminaire: &Luminaire) -> Option<f64> {
    luminaire.photometry.lamp_lumens.filter(|lumens| *lumens > 0.0)
}

fn readout_faults() -> Vec<Fault> {
    // A clamp starts at the brightest reading, so it has no start here.
    let level = Parameter { unit: " lx", starts: vec![], step: 1e-3, range: (0.0, f64::MAX), period: None };
    let offset = Parameter { unit: " lx", starts: vec![0.0], step: 1e-3, range: (0.0, f64::MAX), period: None };
    let mut all = vec![
        readout_fault("clamp", "highlights are cut off at {0}", |p| Readout::AtMost(p[0])).with_parameters([level]),
        readout_fault("offset", "{0} are added to every reading", |p| Readout::Plus(p[0])).with_parameters([offset]),
        readout_fault("half-float", "half-precision numbers: what is above 65504 is lost", |_| {
            Readout::AtMost(HALF_PRECISION_MAX)
        }),
        readout_fault("dark", "no light at all: every reading is zero", |_| Readout::AtMost(0.0)),
    ];
    all.extend(order_faults());
    all
}

/// Meters that are read in another order: within each set, or within a job of several sets, which an adapter gets as one list.
fn order_faults() -> Vec<Fault> {
    let orders = [
        ("reversed", "meters are read in the reverse order", Order::Reversed),
        ("next", "every meter reads what the next should", Order::Next),
        ("previous", "every meter reads what the one before it should", Order::Previous),
    ];
    let mut all = vec![];
    for (id, what, order) in orders {
        for of in [Sequence::Set, Sequence::Job] {
            all.push(order_fault(id, what, order, of));
        }
    }
    all.push(order_fault(
        "exchanged",
        "rows and columns of grids of meters are exchanged",
        Order::Exchanged,
        Sequence::Set,
    ));
    all
}

fn order_fault(id: &'static str, what: &str, order: Order, of: Sequence) -> Fault {
    Fault::new(id, what, move |faulty, _| {
        faulty.readouts.push(Readout::Order(order, of));
        true
    })
}

/// A fault that changes readings after they are computed.
fn readout_fault(id: &'static str, what: &str, readout: fn(&[f64]) -> Readout) -> Fault {
    Fault::new(id, what, move |faulty, p| {
        faulty.readouts.push(readout(p));
        true
    })
}

fn law_faults() -> Vec<Fault> {
    let right = Law::RIGHT;
    vec![
        law_fault("cosine-missing", "the cosine at the meter is left out", Law { cosine: 0.0, ..right }),
        law_fault("cosine-doubled", "the cosine at the meter is applied twice", Law { cosine: 2.0, ..right }),
        law_fault("two-sided", "light from behind a meter counts, too", Law { is_two_sided: true, ..right }),
        law_fault(
            "normals-ignored",
            "the normals of meters are left out",
            Law { cosine: 0.0, is_two_sided: true, ..right },
        ),
        law_fault(
            "distance",
            "light falls with distance, not with its square",
            Law { distance: DistanceLaw::Power(1.0), ..right },
        )
        .with_free_factor(),
        law_fault(
            "candela-squared",
            "the candela are squared: the filter is applied to itself",
            Law { intensity: 2, ..right },
        )
        .with_free_factor(),
    ]
}

/// A fault that computes direct light by another law.
fn law_fault(id: &'static str, what: &str, law: Law) -> Fault {
    Fault::new(id, what, move |faulty, _| {
        faulty.law = law;
        are_all_points(faulty.task())
    })
}

/// Whether all luminaires are points: a luminous opening has no single distance that a law could be wrong about.
pub(super) fn are_all_points(task: &Task) -> bool {
    task.scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point)
}

/// A fault that changes every luminaire where it can.
pub(super) fn luminaire_fault(id: &'static str, what: &str, change: fn(&mut Luminaire) -> bool) -> Fault {
    Fault::new(id, what, move |faulty, _| faulty.change_luminaires(change))
}

fn luminaire_faults() -> Vec<Fault> {
    let mut faults = vec![];
    for (id, deg) in [("c-turned-90", 90.0), ("c-turned-180", 180.0), ("c-turned-270", 270.0)] {
        let what = format!("the distribution is turned by {deg} degrees in C");
        let fault = Fault::new(id, what, move |faulty, _| {
            faulty.change_luminaires(|l| {
                !is_axial(l) && replace_distribution(l, Some(l.photometry.distribution.turned(deg)))
            })
        });
        faults.push(fault.about(TURN));
    }
    faults.extend(table_faults());
    faults.extend(orientation_faults());
    faults.extend(several_luminaire_faults());
    faults.push(luminaire_fault("area-as-point", "the luminous opening is shrunk to a point", |l| {
        let before = std::mem::replace(&mut l.model, LuminaireModel::Point);
        before != LuminaireModel::Point
    }));
    faults
}

/// Faults in reading a luminaire's table.
fn table_faults() -> Vec<Fault> {
    vec![
        luminaire_fault("c-mirrored", "C runs the other way round: 90 and 270 degrees are exchanged", |l| {
            !is_axial(l) && remap(l, |c, g| (-c, g))
        }),
        luminaire_fault("c-mirrored-90", "C 0 and C 180 are exchanged", |l| {
            !is_axial(l) && remap(l, |c, g| (180.0 - c, g))
        }),
        luminaire_fault("c-turned-behind", "beyond a gamma of 90 degrees C is turned by 180 degrees", turn_behind),
        luminaire_fault("gamma-flipped", "gamma is counted from the zenith: up and down are exchanged", |l| {
            remap(l, |c, g| (c, 180.0 - g))
        }),
        luminaire_fault("isotropic", "the distribution is replaced by the same intensity everywhere", make_isotropic),
        luminaire_fault("one-plane", "only the plane C 0 is read", keep_first_plane).about("planes"),
        luminaire_fault("nodes-squared", "the candela are squared, each as a part of the largest", |l| {
            raise_candela(l, 2.0)
        })
        .about(CANDELA),
        luminaire_fault(
            "one-plane-squared",
            "only the plane C 0 is read, and the candela are squared, each as a part of the largest",
            |l| raise_candela(l, 2.0) | keep_first_plane(l),
        )
        .about(CANDELA),
        luminaire_fault("averaged", "the distribution is averaged over C", |l| !is_axial(l) && average_over_c(l)),
        luminaire_fault("extrapolated", "the table goes on beyond its last angle", extrapolate),
    ]
}

fn orientation_faults() -> Vec<Fault> {
    vec![
        luminaire_fault("unrotated", "the luminaire's rotation is left out", |l| {
            let before = std::mem::replace(&mut l.orientation, DMat3::IDENTITY);
            before != DMat3::IDENTITY
        }),
        luminaire_fault("rotated-back", "the luminaire's rotation is applied the wrong way round", |l| {
            let back = l.orientation.transpose();
            let before = std::mem::replace(&mut l.orientation, back);
            before != l.orientation
        }),
    ]
}

/// Faults that show only where there are several luminaires.
fn several_luminaire_faults() -> Vec<Fault> {
    vec![
        Fault::new("one-lit", "of several luminaires the first alone gives light", |faulty, _| {
            let are_several = faulty.task().scene.luminaires.len() > 1;
            if are_several {
                faulty.scene_mut().luminaires.truncate(1);
            }
            are_several
        }),
        Fault::new("one-table", "all luminaires have the table of the first", |faulty, _| {
            copy_first_table(faulty, false)
        }),
        Fault::new("one-table-scaled", "all luminaires have the table and the flux_scale of the first", |faulty, _| {
            copy_first_table(faulty, true)
        }),
    ]
}

/// Gives every luminaire the table of the first; returns whether any had another.
fn copy_first_table(faulty: &mut FaultyTask, copies_scale: bool) -> bool {
    let Some(first) = faulty.task().scene.luminaires.first().cloned() else { return false };
    faulty.change_luminaires(|l| {
        let before = std::mem::replace(&mut l.photometry, Arc::clone(&first.photometry));
        if copies_scale {
            l.flux_scale = first.flux_scale;
        }
        !Arc::ptr_eq(&before, &first.photometry)
    })
}

fn room_faults() -> Vec<Fault> {
    let mut faults = vec![Fault::new("upside-down", "ceiling and floor are exchanged", |faulty, _| {
        change_room(faulty, |r| std::mem::swap(&mut r.reflectance.floor, &mut r.reflectance.ceiling))
    })];
    // The exponent of display gamma, as an RGB colour would be decoded.
    for (id, what, power) in [
        ("gamma-decoded", "reflectances are decoded as colours, to the power of 2.2", 2.2),
        ("gamma-encoded", "reflectances are encoded as colours, to the power of 1/2.2", 1.0 / 2.2),
    ] {
        faults.push(Fault::new(id, what, move |faulty, _| raise_reflectances(faulty, power)).about(POWER));
    }
    faults
}

/// Faults in which light counts, and in where meters face.
fn transport_faults() -> Vec<Fault> {
    let mut faults: Vec<Fault> = (0..MAX_BOUNCES).map(truncation_fault).collect();
    faults.extend([
        Fault::new("bounces-uncut", "light is followed beyond the reflections asked for", |faulty, _| {
            let asked = faulty.task().transport;
            let is_cut = bounces(asked).is_some_and(|b| b != Bounces::Converged);
            if is_cut {
                faulty.set_transport(with_bounces(asked, Bounces::Converged));
            }
            is_cut
        }),
        Fault::new("direct-lost", "direct light is missing", |faulty, _| {
            let Transport::Total(bounces) = faulty.task().transport else { return false };
            faulty.set_transport(Transport::Indirect(bounces));
            true
        }),
        Fault::new("direct-added", "direct light is counted too", |faulty, _| {
            let Transport::Indirect(bounces) = faulty.task().transport else { return false };
            faulty.set_transport(Transport::Total(bounces));
            true
        }),
        Fault::new("indirect-added", "reflected light is counted too", |faulty, _| {
            let is_possible = faulty.task().transport == Transport::Direct && faulty.task().scene.room.is_some();
            if is_possible {
                faulty.set_transport(Transport::Total(Bounces::Converged));
            }
            is_possible
        })
        .with_reflections(),
        Fault::new("meter-flipped", "meters face the other way", |faulty, _| {
            faulty.change_meters(|m| m.normal = -m.normal);
            true
        }),
        Fault::new("meters-up", "all meters face up, whatever their normals are", |faulty, _| {
            faulty.change_meters(|m| m.normal = DVec3::Z);
            true
        }),
    ]);
    faults
}

/// A fault that follows light for `n` reflections only.
fn truncation_fault(n: u32) -> Fault {
    let what = format!("light stops after {n} reflection{}", if n == 1 { "" } else { "s" });
    Fault::new("bounces-cut", what, move |faulty, _| {
        let asked = faulty.task().transport;
        let is_cut = match bounces(asked) {
            Some(Bounces::AtMost(most)) => n < most,
            Some(_) => true,
            None => false,
        };
        if is_cut {
            faulty.set_transport(with_bounces(asked, Bounces::AtMost(n)));
        }
        is_cut
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

/// Faults that name a surface or a luminaire of one case.
fn case_faults(case: usize, tasks: &[Task]) -> Vec<Fault> {
    let mut faults = vec![];
    if tasks.iter().any(|t| t.scene.room.is_some() && t.transport != Transport::Direct) {
        for surface in Surface::ALL {
            let name = surface_name(surface);
            let what = format!("{name} reflects nothing: dropped, or its normal points outwards");
            let fault = Fault::new("surface-lost", what, move |faulty, _| set_reflectance(faulty, surface, 0.0));
            faults.push(fault.about(name).in_case(case));
        }
    }
    let ids = luminaire_ids(tasks);
    if ids.len() > 1 {
        faults.extend(ids.iter().take(MAX_LUMINAIRES).map(|id| lost_luminaire_fault(id).in_case(case)));
    }
    faults
}

fn lost_luminaire_fault(id: &str) -> Fault {
    let lost = id.to_owned();
    let fault = Fault::new("luminaire-lost", format!("{id} gives no light"), move |faulty, _| {
        let luminaires = &faulty.task().scene.luminaires;
        // A scene that loses its only luminaire is dark; the simulator needs at least one.
        if luminaires.len() == 1 && luminaires[0].id == lost {
            faulty.factor = 0.0;
            return true;
        }
        let before = luminaires.len();
        faulty.scene_mut().luminaires.retain(|l| l.id != lost);
        faulty.task().scene.luminaires.len() < before
    });
    fault.about(format!("flux of {id}"))
}

/// The luminaires of a case.
pub(super) fn luminaire_ids(tasks: &[Task]) -> Vec<String> {
    tasks.iter().flat_map(|t| &t.scene.luminaires).map(|l| l.id.clone()).unique().collect()
}

/// Changes the room of a task of reflected light; returns whether there is one.
pub(super) fn change_room(faulty: &mut FaultyTask, change: impl Fn(&mut Room)) -> bool {
    if faulty.task().transport == Transport::Direct || faulty.task().scene.room.is_none() {
        return false;
    }
    faulty.scene_mut().room.as_mut().map(change).is_some()
}

pub(super) fn set_reflectance(faulty: &mut FaultyTask, surface: Surface, value: f64) -> bool {
    change_room(faulty, |room| *room.reflectance.of_mut(surface) = value)
}

/// Raises every reflectance to a power.
pub(super) fn raise_reflectances(faulty: &mut FaultyTask, power: f64) -> bool {
    change_reflectances(faulty, |r| r.powf(power))
}

/// Changes the reflectance of every surface of the room.
pub(super) fn change_reflectances(faulty: &mut FaultyTask, change: impl Fn(f64) -> f64) -> bool {
    change_room(faulty, |room| {
        for surface in Surface::ALL {
            let r = room.reflectance.of_mut(surface);
            *r = change(*r);
        }
    })
}

pub(super) const fn surface_name(surface: Surface) -> &'static str {
    match surface {
        Surface::Floor => "the floor",
        Surface::Ceiling => "the ceiling",
        Surface::WallXMin => "the wall at x = 0",
        Surface::WallXMax => "the wall at the largest x",
        Surface::WallYMin => "the wall at y = 0",
        Surface::WallYMax => "the wall at the largest y",
    }
}
