//! Faults of newly written renderers and adapters: axes, angles, luminaires, tables, laws, bodies and reflections.
//!
//! None has a parameter except a free factor.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use itertools::Itertools;
use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Luminaire, Scene, Transport, orientation};

use super::bounces::bounce_kinds;
use super::distance_law::DistanceLaw;
use super::fault::Fault;
use super::faults::{FACTOR, are_all_points, change_reflectances, change_room, luminaire_fault};
use super::faulty_task::{FaultyTask, Law};
use super::file_factors::luminaire_factors;
use super::laws::law_kinds;
use super::lookups::lookup_kinds;
use super::readouts::readout_kinds;
use super::tables::{
    Beyond, darken_last_gamma, draw_cubics, draw_curve, is_axial, look_up_radians, space_angles_evenly,
};
use luxproof_spec::procedures::Task;

/// A horizontal component below this has no direction.
const MIN_HORIZONTAL: f64 = 1e-9;

/// A curve from 0 to 1 between two angles.
type Curve = fn(f64) -> f64;
/// Another orientation by azimuth, tilt and roll.
type ComposeAngles = fn([f64; 3]) -> DMat3;
/// A change of a room's reflectances.
type ChangeRoom = fn(&mut Room);
/// Whether the k-th of n luminaires gives light.
type IsLit = fn(usize, usize) -> bool;
/// What a luminaire takes from another.
type TakeProperty = fn(&mut Luminaire, &Luminaire);
/// The index of the luminaire that the k-th of n takes a property from.
type SourceIndex = fn(usize, usize) -> usize;

/// Lists all of them.
pub(super) fn implementation_faults(cases: &[&[Task]]) -> Vec<Fault> {
    let mut all = axis_faults();
    all.extend(angle_faults());
    all.extend(lookup_faults());
    all.extend(several_luminaire_faults());
    all.extend(law_faults());
    all.extend(body_faults());
    all.extend(reflection_faults());
    all.extend(luminaire_factors(cases));
    let one_parameter = [lookup_kinds(), law_kinds(cases), bounce_kinds(), readout_kinds()];
    all.extend(one_parameter.concat().into_iter().filter(|fault| fault.parameters.is_empty()));
    // Scenes of known answer are jobs of one batch, in which an adapter may exchange scenes.
    let known = cases.iter().flat_map(|tasks| tasks.iter()).filter(|t| t.procedure.is_calibration());
    all.extend(known.map(exchanged_scene_fault));
    all
}

/// All ways to permute and mirror three axes, except the identity.
fn axis_permutations() -> Vec<(String, DMat3)> {
    let all_signs = [[1.0, -1.0]; 3].into_iter().multi_cartesian_product().collect_vec();
    let mut all = vec![];
    for (axes, signs) in (0..3_usize).permutations(3).cartesian_product(all_signs) {
        let [x, y, z] = [0, 1, 2].map(|k| DVec3::AXES[axes[k]] * signs[k]);
        let matrix = DMat3::from_cols(x, y, z).transpose();
        if matrix != DMat3::IDENTITY {
            let names = axes.iter().zip(&signs).map(|(axis, sign)| axis_name(*axis, *sign));
            all.push((names.collect_vec().join(", "), matrix));
        }
    }
    all
}

fn axis_name(axis: usize, sign: f64) -> String {
    format!("{}{}", if sign < 0.0 { "-" } else { "" }, ["x", "y", "z"][axis])
}

fn axis_faults() -> Vec<Fault> {
    let mut all = vec![];
    for (taken, by) in axis_permutations() {
        all.extend([
            Fault::new(
                "frame",
                format!("x, y, z of a luminaire's own frame are taken as {taken}"),
                move |faulty, _| {
                    faulty.change_luminaires(|l| {
                        l.orientation *= by;
                        true
                    })
                },
            ),
            Fault::new("axes", format!("x, y, z of a luminaire's axes are taken as {taken}"), move |faulty, _| {
                faulty.change_luminaires(|l| {
                    l.orientation = by * l.orientation;
                    true
                })
            }),
            Fault::new(
                "coordinates",
                format!("x, y, z of meters and their normals are taken as {taken}"),
                move |faulty, _| {
                    faulty.change_meters(|m| (m.position_m, m.normal) = (by * m.position_m, by * m.normal));
                    true
                },
            ),
            Fault::new("normals", format!("x, y, z of normals are taken as {taken}"), move |faulty, _| {
                faulty.change_meters(|m| m.normal = by * m.normal);
                true
            }),
            Fault::new("places", format!("x, y, z of luminaires' places are taken as {taken}"), move |faulty, _| {
                faulty.change_luminaires(|l| {
                    l.position_m = by * l.position_m;
                    true
                })
            }),
        ]);
    }
    all.push(luminaire_fault("places", "luminaires are taken to be at the origin, wherever they are", |l| {
        std::mem::replace(&mut l.position_m, DVec3::ZERO) != DVec3::ZERO
    }));
    all
}

/// Azimuth, tilt and roll of an orientation, in degrees.
fn angles(orientation: DMat3) -> [f64; 3] {
    let (up, nadir) = (orientation.z_axis, orientation.transpose().z_axis);
    let horizontal = up.x.hypot(up.y);
    let tilt = horizontal.atan2(up.z);
    // Without tilt, azimuth and roll are one rotation about the vertical.
    if horizontal < MIN_HORIZONTAL {
        return [orientation.x_axis.y.atan2(orientation.x_axis.x).to_degrees(), tilt.to_degrees(), 0.0];
    }
    [up.y.atan2(up.x), tilt, nadir.y.atan2(-nadir.x)].map(f64::to_degrees)
}

fn angle_faults() -> Vec<Fault> {
    let compositions: [(&str, ComposeAngles); 12] = [
        ("azimuth of luminaires is left out", |[_, t, r]| orientation(0.0, t, r)),
        ("tilt of luminaires is left out", |[a, _, r]| orientation(a, 0.0, r)),
        ("roll of luminaires is left out", |[a, t, _]| orientation(a, t, 0.0)),
        ("azimuth of luminaires turns the wrong way round", |[a, t, r]| orientation(-a, t, r)),
        ("tilt of luminaires goes to the other side", |[a, t, r]| orientation(a, -t, r)),
        ("roll of luminaires turns the wrong way round", |[a, t, r]| orientation(a, t, -r)),
        ("azimuth and roll of luminaires are exchanged: the rotations come in the reverse order", |[a, t, r]| {
            orientation(r, t, a)
        }),
        ("azimuth and roll of luminaires turn the wrong way round", |[a, t, r]| orientation(-a, t, -r)),
        ("roll of luminaires is about the vertical, not about their own axis", |[a, t, r]| orientation(a + r, t, 0.0)),
        ("tilt of luminaires is about y of the room, not about their turned y axis", |[a, t, r]| {
            orientation(0.0, t, a + r)
        }),
        ("tilt of luminaires is about their x axis, not about y", |[a, t, r]| orientation(a + 90.0, t, r - 90.0)),
        ("tilt of luminaires is about their x axis, to the other side, not about y", |[a, t, r]| {
            orientation(a - 90.0, t, r + 90.0)
        }),
    ];
    let mut all = vec![];
    for (what, compose) in compositions {
        all.push(Fault::new("angles", what, move |faulty, _| {
            faulty.change_luminaires(|l| {
                l.orientation = compose(angles(l.orientation));
                true
            })
        }));
    }
    let what = "of a luminaire's rotation only where its x axis points in plan counts";
    all.push(luminaire_fault("angles", what, |l| {
        let before = l.orientation;
        l.orientation = DMat3::from_rotation_z(before.x_axis.y.atan2(before.x_axis.x));
        l.orientation != before
    }));
    all
}

/// Faults in looking up a table.
fn lookup_faults() -> Vec<Fault> {
    let mut all = vec![
        luminaire_fault("lookup", "the table's gamma angles are taken to be evenly spaced", |l| {
            space_angles_evenly(l, false, true)
        }),
        luminaire_fault("lookup", "the table's C angles are taken to be evenly spaced", |l| {
            !is_axial(l) && space_angles_evenly(l, true, false)
        }),
        luminaire_fault("lookup", "the table's C and gamma angles are taken to be evenly spaced", |l| {
            space_angles_evenly(l, true, true)
        }),
        luminaire_fault("lookup", "directions in radians are looked up in a table in degrees", look_up_radians),
        luminaire_fault("lookup", "the table is dark at its last gamma itself", darken_last_gamma),
    ];
    for (drawn, in_c) in [("", true), (" in gamma", false)] {
        for (goes_on, beyond) in
            [("goes round", Beyond::Closed), ("is dark", Beyond::Dark), ("is as at its end", Beyond::Nearest)]
        {
            let what = format!(
                "between the table's angles{drawn} a cubic through four neighbours, by their numbers, is drawn, not a \
                 straight line; beyond its ends it {goes_on}"
            );
            all.push(Fault::new("lookup", what, move |faulty, _| {
                faulty.change_luminaires(|l| draw_cubics(l, in_c, beyond))
            }));
        }
    }
    let curves: [(&str, Curve); 2] = [
        ("half a wave of a cosine", |v| 0.5 - 0.5 * (std::f64::consts::PI * v).cos()),
        ("a smoothstep", |v| v * v * (3.0 - 2.0 * v)),
    ];
    for (drawn, curve) in curves {
        for (name, which) in [("gamma", [false, true]), ("C", [true, false]), ("C and gamma", [true, true])] {
            let what = format!("between the table's angles in {name} {drawn} is drawn, not a straight line");
            all.push(Fault::new("lookup", what, move |faulty, _| {
                faulty.change_luminaires(|l| draw_curve(l, which, curve))
            }));
        }
    }
    all
}

/// Faults that show only where there are several luminaires.
fn several_luminaire_faults() -> Vec<Fault> {
    let mut all = mixed_up_faults();
    all.extend(lost_luminaire_faults());
    all.push(Fault::new("mean", "the light of several luminaires is averaged, not added up", |faulty, _| {
        let count = faulty.task().scene.luminaires.len();
        faulty.factor /= count as f64;
        count > 1
    }));
    all.push(Fault::new("brightest", "of several luminaires the brightest alone counts at each meter", |faulty, _| {
        faulty.law = Law { counts_brightest_only: true, ..Law::RIGHT };
        faulty.task().scene.luminaires.len() > 1
    }));
    all
}

/// Each luminaire takes a property of another.
fn mixed_up_faults() -> Vec<Fault> {
    let properties: [(&str, TakeProperty); 5] = [
        ("table", |l, other| l.photometry = Arc::clone(&other.photometry)),
        ("table and flux_scale", |l, other| {
            l.photometry = Arc::clone(&other.photometry);
            l.flux_scale = other.flux_scale;
        }),
        ("rotation", |l, other| l.orientation = other.orientation),
        ("place", |l, other| l.position_m = other.position_m),
        ("flux_scale", |l, other| l.flux_scale = other.flux_scale),
    ];
    let sources: [(&str, SourceIndex); 5] = [
        ("the first", |_, _| 0),
        ("the last", |_, n| n - 1),
        ("the next", |k, n| (k + 1) % n),
        ("the one before", |k, n| (k + n - 1) % n),
        ("that as far from the end of the list", |k, n| n - 1 - k),
    ];
    let mut all = vec![];
    for (property, take) in properties {
        for (other, source) in sources {
            let what = format!("of several luminaires each has the {property} of {other}");
            all.push(Fault::new("mixed-up", what, move |faulty, _| {
                change_several(faulty, |scene| {
                    let right = scene.luminaires.clone();
                    for (k, l) in scene.luminaires.iter_mut().enumerate() {
                        take(l, &right[source(k, right.len())]);
                    }
                })
            }));
        }
    }
    all
}

/// Some of several luminaires give no light.
fn lost_luminaire_faults() -> Vec<Fault> {
    let rules: [(&str, IsLit); 5] = [
        ("of several luminaires the last alone gives light", |k, n| k == n - 1),
        ("of several luminaires the first gives no light", |k, _| k > 0),
        ("of several luminaires the last gives no light", |k, n| k < n - 1),
        ("of several luminaires the second alone gives light", |k, _| k == 1),
        ("of several luminaires the second gives no light", |k, _| k != 1),
    ];
    let mut all = vec![];
    for (what, is_lit) in rules {
        all.push(Fault::new("some-lit", what, move |faulty, _| {
            change_several(faulty, |scene| {
                let count = scene.luminaires.len();
                let mut k = 0;
                scene.luminaires.retain(|_| {
                    k += 1;
                    is_lit(k - 1, count)
                });
            })
        }));
    }
    all
}

/// Changes a scene of several luminaires; returns whether it is one.
fn change_several(faulty: &mut FaultyTask, change: impl Fn(&mut Scene)) -> bool {
    let are_several = faulty.task().scene.luminaires.len() > 1;
    if are_several {
        change(faulty.scene_mut());
    }
    are_several
}

fn law_faults() -> Vec<Fault> {
    vec![
        law_fault("distance", "light falls with the third power of distance, not with its square", |l| {
            l.distance = DistanceLaw::Power(3.0);
        }),
        law_fault("distance", "light does not fall with distance", |l| l.distance = DistanceLaw::Power(0.0)),
        law_fault("emission", "the cosine at the luminaire is applied, too: candela are taken for luminance", |l| {
            l.emission = 1.0;
        }),
        law_fault("emission", "the cosine at the luminaire is applied in place of that at the meter", |l| {
            (l.emission, l.cosine, l.is_two_sided) = (1.0, 0.0, true);
        }),
    ]
}

/// A fault that computes direct light by another law.
fn law_fault(id: &'static str, what: &str, change: fn(&mut Law)) -> Fault {
    Fault::new(id, what, move |faulty, _| {
        change(&mut faulty.law);
        are_all_points(faulty.task())
    })
}

fn body_faults() -> Vec<Fault> {
    vec![
        Fault::new("bodies-lost", "bodies hide nothing: light goes through obstacles", |faulty, _| {
            let has_bodies = !faulty.task().scene.obstacles.is_empty();
            if has_bodies {
                faulty.scene_mut().obstacles.clear();
            }
            has_bodies
        }),
        Fault::new(
            "bodies-too-large",
            "where there are bodies no light arrives: they hide more than they should",
            |faulty, _| {
                let has_bodies = !faulty.task().scene.obstacles.is_empty();
                if has_bodies {
                    faulty.factor = 0.0;
                }
                has_bodies
            },
        ),
    ]
}

/// Faults in reflected light alone.
fn reflection_faults() -> Vec<Fault> {
    use std::f64::consts::PI;
    let mut all = vec![];
    for (what, factor) in [
        ("factor pi in reflected light alone: exitance taken for luminance", PI),
        ("factor 1/pi in reflected light alone: luminance taken for exitance", 1.0 / PI),
        ("factor 2 in reflected light alone", 2.0),
        ("factor 1/2 in reflected light alone", 0.5),
        ("reflected light is missing: every reading of it is zero", 0.0),
    ] {
        all.push(reflected_factor_fault(what, factor));
    }
    all.push(reflected_factor_fault("factor {0:} in reflected light alone", 1.0).with_free_factor());
    all.push(Fault::new(
        "first-reflection-lost",
        "the first reflection is missing: light counts from the second on",
        |faulty, _| {
            let Transport::Indirect(_) = faulty.task().transport else { return false };
            faulty.weight_reflection(1, 0.0)
        },
    ));
    all.extend(surface_faults());
    all
}

/// A factor on every reading of reflected light.
fn reflected_factor_fault(what: &str, factor: f64) -> Fault {
    Fault::new("reflected", what, move |faulty, _| {
        faulty.factor *= factor;
        matches!(faulty.task().transport, Transport::Indirect(_))
    })
    .about(FACTOR)
}

/// Surfaces that reflect nothing, or what others should.
fn surface_faults() -> Vec<Fault> {
    let dark: [(&str, ChangeRoom); 3] = [
        ("the floor reflects nothing", |room| room.reflectance.floor = 0.0),
        ("the ceiling reflects nothing", |room| room.reflectance.ceiling = 0.0),
        ("the walls reflect nothing", darken_walls),
    ];
    let mut all = vec![];
    for (what, change) in dark {
        all.push(Fault::new("surfaces", what, move |faulty, _| change_room(faulty, change)));
    }
    all.push(Fault::new("surfaces", "every surface reflects what all do on average", |faulty, _| {
        let Some(room) = faulty.task().scene.room else { return false };
        let mean = Surface::ALL.map(|s| room.reflectance.of(s)).into_iter().sum::<f64>() / 6.0;
        change_reflectances(faulty, |_| mean)
    }));
    for (what, surface) in [("floor", Surface::Floor), ("ceiling", Surface::Ceiling), ("walls", Surface::WallXMin)] {
        let what = format!("every surface reflects what the {what} should");
        all.push(Fault::new("surfaces", what, move |faulty, _| {
            let Some(room) = faulty.task().scene.room else { return false };
            let reflectance = room.reflectance.of(surface);
            change_reflectances(faulty, |_| reflectance)
        }));
    }
    all
}

fn darken_walls(room: &mut Room) {
    let r = &mut room.reflectance;
    for wall in [&mut r.wall_x_min, &mut r.wall_x_max, &mut r.wall_y_min, &mut r.wall_y_max] {
        *wall = 0.0;
    }
}

/// Every job is read with the luminaires of this task.
fn exchanged_scene_fault(task: &Task) -> Fault {
    let luminaires = task.scene.luminaires.clone();
    let what = format!("every job is read with the luminaires of the job `{}`", task.procedure);
    Fault::new("scene-of", what, move |faulty, _| {
        faulty.scene_mut().luminaires.clone_from(&luminaires);
        true
    })
}
