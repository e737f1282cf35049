//! What programs that are written anew get wrong: axes exchanged, angles composed otherwise, luminaires mixed up, tables looked up by
//! other rules, bodies and reflections forgotten. None has a parameter but a factor.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use itertools::Itertools;
use luminaire::geometry::Room;
use luminaire::scene::{Luminaire, LuminaireModel, Scene, Transport, orientation};

use super::fault::Fault;
use super::faults::{FACTOR, each_reflectance, in_room};
use super::tables::{Beyond, by_cubics, dark_at_last_gamma, even_angles, in_radians, is_axial, rounded_off};
use super::wrong::{Law, Wrong};
use crate::procedures::Task;

/// Below this a vector has no direction to speak of.
const SMALL: f64 = 1e-9;

/// All of them. Scenes of known answer are jobs of one batch, whose scenes may be taken for one another.
pub(super) fn slips(cases: &[&[Task]]) -> Vec<Fault> {
    let mut all = of_axes();
    all.extend(of_angles());
    all.extend(of_tables());
    all.extend(of_several());
    all.extend(of_laws());
    all.extend(of_bodies());
    all.extend(of_reflected());
    let known = cases.iter().flat_map(|tasks| tasks.iter()).filter(|t| t.procedure.is_known());
    all.extend(known.map(scene_of));
    all
}

/// Every way to exchange and to mirror three axes, but for leaving them.
fn exchanges() -> Vec<(String, DMat3)> {
    let signs = [[1.0, -1.0]; 3].into_iter().multi_cartesian_product();
    let all = (0..3_usize).permutations(3).cartesian_product(signs.collect_vec());
    let exchange = |(axes, signs): (Vec<usize>, Vec<f64>)| {
        let name =
            |(axis, sign): (&usize, &f64)| format!("{}{}", if *sign < 0.0 { "-" } else { "" }, ["x", "y", "z"][*axis]);
        let row = |k: usize| DVec3::AXES[axes[k]] * signs[k];
        let matrix = DMat3::from_cols(row(0), row(1), row(2)).transpose();
        (axes.iter().zip(&signs).map(name).join(", "), matrix)
    };
    all.map(exchange).filter(|(_, matrix)| *matrix != DMat3::IDENTITY).collect()
}

fn of_axes() -> Vec<Fault> {
    let mut all = vec![];
    for (taken, by) in exchanges() {
        let of = |what: &str| format!("x, y, z of {what} are taken as {taken}");
        all.push(Fault::new("frame", of("a luminaire's own frame"), move |wrong, _| {
            wrong.luminaires(|l| {
                l.orientation *= by;
                true
            })
        }));
        all.push(Fault::new("axes", of("a luminaire's axes"), move |wrong, _| {
            wrong.luminaires(|l| {
                l.orientation = by * l.orientation;
                true
            })
        }));
        all.push(Fault::new("coordinates", of("meters and their normals"), move |wrong, _| {
            wrong.meters(|m| (m.position_m, m.normal) = (by * m.position_m, by * m.normal));
            true
        }));
        all.push(Fault::new("normals", of("normals"), move |wrong, _| {
            wrong.meters(|m| m.normal = by * m.normal);
            true
        }));
        all.push(Fault::new("places", of("luminaires' places"), move |wrong, _| {
            wrong.luminaires(|l| {
                l.position_m = by * l.position_m;
                true
            })
        }));
    }
    all.push(Fault::new("places", "luminaires are taken to be at the origin, wherever they are", |wrong, _| {
        wrong.luminaires(|l| std::mem::replace(&mut l.position_m, DVec3::ZERO) != DVec3::ZERO)
    }));
    all
}

/// Azimuth, tilt and roll of an orientation, in degrees.
fn angles(of: DMat3) -> [f64; 3] {
    let (up, nadir) = (of.z_axis, of.transpose().z_axis);
    let tilt = up.x.hypot(up.y).atan2(up.z);
    if up.x.hypot(up.y) < SMALL {
        return [of.x_axis.y.atan2(of.x_axis.x).to_degrees(), tilt.to_degrees(), 0.0];
    }
    [up.y.atan2(up.x), tilt, nadir.y.atan2(-nadir.x)].map(f64::to_degrees)
}

fn of_angles() -> Vec<Fault> {
    let others: [(&str, Composed); 12] = [
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
    let other = |(what, of): (&str, Composed)| {
        let change = move |wrong: &mut Wrong, _: &[f64]| {
            wrong.luminaires(|l| {
                l.orientation = of(angles(l.orientation));
                true
            })
        };
        Fault::new("angles", what, change)
    };
    let mut all: Vec<Fault> = others.into_iter().map(other).collect();
    let what = "of a luminaire's rotation only where its x axis points in plan counts";
    all.push(Fault::new("angles", what, |wrong, _| {
        wrong.luminaires(|l| {
            let before = l.orientation;
            l.orientation = DMat3::from_rotation_z(before.x_axis.y.atan2(before.x_axis.x));
            l.orientation != before
        })
    }));
    all
}

/// From 0 to 1 between two angles.
type Curve = fn(f64) -> f64;
/// Another orientation by azimuth, tilt and roll.
type Composed = fn([f64; 3]) -> DMat3;
/// Other reflectances.
type Refitted = fn(&mut Room);
/// Whether the k-th of so many gives light.
type Kept = fn(usize, usize) -> bool;

fn of_tables() -> Vec<Fault> {
    let lookup = |what: &str, change: fn(&mut Luminaire) -> bool| {
        Fault::new("lookup", what, move |wrong, _| wrong.luminaires(change))
    };
    let mut all = vec![
        lookup("the table's gamma angles are taken to be evenly spaced", |l| even_angles(l, false, true)),
        lookup("the table's C angles are taken to be evenly spaced", |l| !is_axial(l) && even_angles(l, true, false)),
        lookup("the table's C and gamma angles are taken to be evenly spaced", |l| even_angles(l, true, true)),
        lookup("directions in radians are looked up in a table in degrees", in_radians),
        lookup("the table is dark at its last gamma itself", dark_at_last_gamma),
    ];
    let cubics = [("goes round", Beyond::Closed), ("is dark", Beyond::Dark), ("is as at its end", Beyond::Nearest)];
    all.extend(cubics.map(|(goes_on, beyond)| {
        let what = "between the table's angles a cubic through four neighbours, by their numbers, is drawn, not a straight line";
        let change = move |l: &mut Luminaire| by_cubics(l, beyond);
        Fault::new("lookup", format!("{what}; beyond its ends it {goes_on}"), move |wrong, _| wrong.luminaires(change))
    }));
    let curves: [(&str, Curve); 2] = [
        ("half a wave of a cosine", |v| 0.5 - 0.5 * (std::f64::consts::PI * v).cos()),
        ("a smoothstep", |v| v * v * (3.0 - 2.0 * v)),
    ];
    let angles = [("gamma", [false, true]), ("C", [true, false]), ("C and gamma", [true, true])];
    all.extend(curves.into_iter().cartesian_product(angles).map(|((drawn, curve), (name, which))| {
        let what = format!("between the table's angles in {name} {drawn} is drawn, not a straight line");
        Fault::new("lookup", what, move |wrong, _| wrong.luminaires(|l| rounded_off(l, which, curve)))
    }));
    all
}

/// What a luminaire may take of another.
type Take = fn(&mut Luminaire, &Luminaire);
/// Which of so many another is to the k-th.
type Whose = fn(usize, usize) -> usize;

fn of_several() -> Vec<Fault> {
    let taken: [(&str, Take); 5] = [
        ("table", |l, of| l.photometry = Arc::clone(&of.photometry)),
        ("table and flux_scale", |l, of| {
            l.photometry = Arc::clone(&of.photometry);
            l.flux_scale = of.flux_scale;
        }),
        ("rotation", |l, of| l.orientation = of.orientation),
        ("place", |l, of| l.position_m = of.position_m),
        ("flux_scale", |l, of| l.flux_scale = of.flux_scale),
    ];
    let whose: [(&str, Whose); 5] = [
        ("the first", |_, _| 0),
        ("the last", |_, n| n - 1),
        ("the next", |k, n| (k + 1) % n),
        ("the one before", |k, n| (k + n - 1) % n),
        ("that as far from the end of the list", |k, n| n - 1 - k),
    ];
    let mut all = vec![];
    for ((what, take), (other, whose)) in taken.into_iter().cartesian_product(whose) {
        let said = format!("of several luminaires each has the {what} of {other}");
        all.push(Fault::new("mixed-up", said, move |wrong, _| {
            several(wrong, |scene| {
                let right = scene.luminaires.clone();
                for (k, l) in scene.luminaires.iter_mut().enumerate() {
                    take(l, &right[whose(k, right.len())]);
                }
            })
        }));
    }
    let kept: [(&str, Kept); 5] = [
        ("of several luminaires the last alone gives light", |k, n| k == n - 1),
        ("of several luminaires the first gives no light", |k, _| k > 0),
        ("of several luminaires the last gives no light", |k, n| k < n - 1),
        ("of several luminaires the second alone gives light", |k, _| k == 1),
        ("of several luminaires the second gives no light", |k, _| k != 1),
    ];
    all.extend(kept.map(|(what, is_kept)| {
        Fault::new("some-lit", what, move |wrong, _| {
            several(wrong, |scene| {
                let (mut k, count) = (0, scene.luminaires.len());
                scene.luminaires.retain(|_| {
                    k += 1;
                    is_kept(k - 1, count)
                });
            })
        })
    }));
    all.push(Fault::new("mean", "the light of several luminaires is averaged, not added up", |wrong, _| {
        let count = wrong.task().scene.luminaires.len();
        wrong.factor /= count as f64;
        count > 1
    }));
    all.push(Fault::new("brightest", "of several luminaires the brightest alone counts at each meter", |wrong, _| {
        wrong.law = Law { is_of_brightest: true, ..Law::RIGHT };
        wrong.task().scene.luminaires.len() > 1
    }));
    all
}

/// Changes a scene of several luminaires; says whether it is one.
fn several(wrong: &mut Wrong, change: impl Fn(&mut Scene)) -> bool {
    let are_several = wrong.task().scene.luminaires.len() > 1;
    if are_several {
        change(wrong.scene());
    }
    are_several
}

fn of_laws() -> Vec<Fault> {
    let law = |id, what, change: fn(&mut Law)| {
        Fault::new(id, what, move |wrong, _| {
            change(&mut wrong.law);
            wrong.task().scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point)
        })
    };
    vec![
        law("distance", "light falls with the third power of distance, not with its square", |l| l.distance = 3),
        law("distance", "light does not fall with distance", |l| l.distance = 0),
        law("emission", "the cosine at the luminaire is applied, too: candela are taken for luminance", |l| {
            l.emission = 1;
        }),
        law("emission", "the cosine at the luminaire is applied in place of that at the meter", |l| {
            (l.emission, l.cosine, l.is_two_sided) = (1, 0, true);
        }),
    ]
}

fn of_bodies() -> Vec<Fault> {
    vec![
        Fault::new("bodies-lost", "bodies hide nothing: light goes through obstacles", |wrong, _| {
            let is_there = !wrong.task().scene.obstacles.is_empty();
            if is_there {
                wrong.scene().obstacles.clear();
            }
            is_there
        }),
        Fault::new(
            "bodies-too-large",
            "where there are bodies no light arrives: they hide more than they should",
            |wrong, _| {
                let is_there = !wrong.task().scene.obstacles.is_empty();
                if is_there {
                    wrong.factor = 0.0;
                }
                is_there
            },
        ),
    ]
}

fn of_reflected() -> Vec<Fault> {
    use std::f64::consts::PI;
    let times = |factor: f64| {
        move |wrong: &mut Wrong, _: &[f64]| {
            wrong.factor *= factor;
            matches!(wrong.task().transport, Transport::Indirect(_))
        }
    };
    let mut all = [
        ("factor pi in reflected light alone: exitance taken for luminance", PI),
        ("factor 1/pi in reflected light alone: luminance taken for exitance", 1.0 / PI),
        ("factor 2 in reflected light alone", 2.0),
        ("factor 1/2 in reflected light alone", 0.5),
        ("reflected light is missing: every reading of it is zero", 0.0),
    ]
    .map(|(what, factor)| Fault::new("reflected", what, times(factor)).about(FACTOR))
    .to_vec();
    all.push(
        Fault::new("reflected", "factor {0:} in reflected light alone", times(1.0))
            .about(FACTOR)
            .as_bright_as_you_like(),
    );
    all.push(Fault::new(
        "first-reflection-lost",
        "the first reflection is missing: light counts from the second on",
        |wrong, _| {
            let Transport::Indirect(_) = wrong.task().transport else { return false };
            wrong.without_first();
            true
        },
    ));
    let lost: [(&str, Refitted); 3] = [
        ("the floor reflects nothing", |room| room.reflectance.floor = 0.0),
        ("the ceiling reflects nothing", |room| room.reflectance.ceiling = 0.0),
        ("the walls reflect nothing", |room| each_wall(room, |_| 0.0)),
    ];
    all.extend(lost.map(|(what, change)| Fault::new("surfaces", what, move |wrong, _| in_room(wrong, change))));
    all.push(Fault::new("surfaces", "every surface reflects what all do on average", |wrong, _| {
        let Some(room) = wrong.task().scene.room else { return false };
        let mean = luminaire::geometry::Surface::ALL.map(|s| room.reflectance.of(s)).into_iter().sum::<f64>() / 6.0;
        each_reflectance(wrong, |_| mean)
    }));
    for (what, of) in [("floor", 0), ("ceiling", 1), ("walls", 2)] {
        let said = format!("every surface reflects what the {what} should");
        all.push(Fault::new("surfaces", said, move |wrong, _| {
            let Some(room) = wrong.task().scene.room else { return false };
            let r = room.reflectance;
            let reflectance = [r.floor, r.ceiling, r.wall_x_min][of];
            each_reflectance(wrong, |_| reflectance)
        }));
    }
    all
}

fn each_wall(room: &mut Room, of: fn(f64) -> f64) {
    let r = &mut room.reflectance;
    for wall in [&mut r.wall_x_min, &mut r.wall_x_max, &mut r.wall_y_min, &mut r.wall_y_max] {
        *wall = of(*wall);
    }
}

/// The scene of one job for those of all.
fn scene_of(task: &Task) -> Fault {
    let (scene, what) =
        (task.scene.clone(), format!("every job is read with the luminaires of the job `{}`", task.procedure));
    Fault::new("scene-of", what, move |wrong, _| {
        let luminaires = scene.luminaires.clone();
        wrong.scene().luminaires = luminaires;
        true
    })
}
