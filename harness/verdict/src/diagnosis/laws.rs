//! Kinds of wrong laws: how direct light falls with distance and with the angles at luminaire and meter.
//!
//! They hold for direct light alone: a renderer that computes reflected light by the same law is named by its direct light.

use itertools::Itertools;
use luxproof_scene::Transport;

use super::distance_law::DistanceLaw;
use super::fault::{Fault, Parameter};
use super::faults::are_all_points;
use super::faulty_task::Law;
use luxproof_spec::procedures::Task;

/// Distances at which light may be cut off that are tried at most.
const MAX_CUT_OFFS: usize = 400;

/// A law of a parameter.
type LawOf = fn(f64) -> Law;

/// One row: a name, words, a law of the parameter, and the parameter.
struct LawKind {
    about: &'static str,
    what: &'static str,
    law: LawOf,
    unit: &'static str,
    /// Where fits start; the first is where nothing is wrong, or where the fault shows.
    starts: &'static [f64],
    step: f64,
    range: (f64, f64),
}

/// A law that only falls otherwise with distance.
const fn falling(distance: DistanceLaw) -> Law {
    Law { distance, ..Law::RIGHT }
}

const LAW_KINDS: [LawKind; 11] = [
    LawKind {
        about: "power of distance",
        what: "light falls with distance to the power of {0}, not with its square",
        law: |p| falling(DistanceLaw::Power(p)),
        unit: "",
        starts: &[2.0],
        step: 0.02,
        range: (0.0, 6.0),
    },
    LawKind {
        about: "window",
        what: "light fades out towards a range of {0}: factor 1 - (d/range)^4",
        law: |p| falling(DistanceLaw::Window { range_m: p, steepness: 4, power: 1 }),
        unit: " m",
        starts: &[4.0, 8.0, 15.0, 30.0],
        step: 0.1,
        range: (0.5, 200.0),
    },
    LawKind {
        about: "window",
        what: "light fades out towards a range of {0}: factor (1 - (d/range)^4)^2",
        law: |p| falling(DistanceLaw::Window { range_m: p, steepness: 4, power: 2 }),
        unit: " m",
        starts: &[4.0, 8.0, 15.0, 30.0],
        step: 0.1,
        range: (0.5, 200.0),
    },
    LawKind {
        about: "window",
        what: "light fades out towards a range of {0}: factor (1 - (d/range)^2)^2",
        law: |p| falling(DistanceLaw::Window { range_m: p, steepness: 2, power: 2 }),
        unit: " m",
        starts: &[5.0, 10.0, 20.0, 50.0],
        step: 0.1,
        range: (0.5, 500.0),
    },
    LawKind {
        about: "window",
        what: "light fades out towards a range of {0}: factor 1 - (d/range)^2",
        law: |p| falling(DistanceLaw::Window { range_m: p, steepness: 2, power: 1 }),
        unit: " m",
        starts: &[5.0, 10.0, 20.0, 50.0],
        step: 0.1,
        range: (0.5, 500.0),
    },
    LawKind {
        about: "window",
        what: "light fades out towards a range of {0}: factor 1 - d/range",
        law: |p| falling(DistanceLaw::Window { range_m: p, steepness: 1, power: 1 }),
        unit: " m",
        starts: &[8.0, 20.0, 60.0, 200.0],
        step: 0.2,
        range: (0.5, 2000.0),
    },
    LawKind {
        about: "softened",
        what: "light falls with d^2 + r^2, not with d^2, where r is {0}",
        law: |p| falling(DistanceLaw::Softened(p)),
        unit: " m",
        starts: &[0.2, 0.6, 1.5],
        step: 0.02,
        range: (0.0, 20.0),
    },
    LawKind {
        about: "least distance",
        what: "distances count as {0} at least",
        law: |p| falling(DistanceLaw::AtLeast(p)),
        unit: " m",
        starts: &[0.6, 1.2, 2.0, 3.5],
        step: 0.02,
        range: (0.0, 50.0),
    },
    LawKind {
        about: "shifted distance",
        what: "light falls with the square of r + d, not of d, where r is {0}",
        law: |p| falling(DistanceLaw::Shifted { by_m: p, power: 2.0 }),
        unit: " m",
        starts: &[0.0],
        step: 0.02,
        range: (-0.9, 20.0),
    },
    LawKind {
        about: "shifted distance",
        what: "light falls with 1 + d to the power of {0}, not with the square of d",
        law: |p| falling(DistanceLaw::Shifted { by_m: 1.0, power: p }),
        unit: "",
        starts: &[2.0, 1.0],
        step: 0.02,
        range: (0.0, 6.0),
    },
    LawKind {
        about: "power of the cosine",
        what: "the cosine at the meter counts to the power of {0}",
        law: |p| Law { cosine: p, ..Law::RIGHT },
        unit: "",
        starts: &[1.0],
        step: 0.02,
        range: (0.0, 8.0),
    },
];

/// Lists the kinds of laws, and light that is cut off between two distances of the cases.
pub(super) fn law_kinds(cases: &[&[Task]]) -> Vec<Fault> {
    let mut all = vec![];
    for kind in LAW_KINDS {
        let LawKind { about, what, law, unit, starts, step, range } = kind;
        let parameter = Parameter { unit, starts: starts.to_vec(), step, range, period: None };
        all.push(law_fault(what, move |p| law(p[0])).about(about).with_parameters([parameter]));
    }
    all.push(
        law_fault("the cosine at the luminaire is applied, too, to the power of {0}", |p| Law {
            emission: p[0],
            ..Law::RIGHT
        })
        .about("power of emission")
        .with_parameters([Parameter::new("", 0.0, 0.02, (-3.0, 8.0))]),
    );
    all.extend(cut_offs(cases));
    all
}

fn law_fault(what: impl Into<String>, law: impl Fn(&[f64]) -> Law + Send + Sync + 'static) -> Fault {
    Fault::new("law", what, move |faulty, p| {
        faulty.law = law(p);
        are_all_points(faulty.task())
    })
}

/// Light that ends at a distance: its only effect is on which meters are beyond, so that no fit finds it.
fn cut_offs(cases: &[&[Task]]) -> Vec<Fault> {
    let tasks = cases.iter().flat_map(|tasks| tasks.iter()).filter(|t| t.transport == Transport::Direct);
    let mut distances_m: Vec<f64> = tasks.flat_map(distances_m).collect();
    distances_m.sort_by(f64::total_cmp);
    distances_m.dedup_by(|a, b| *a - *b < 1e-3);
    let gaps: Vec<(f64, f64)> = distances_m.into_iter().tuple_windows().collect();
    let count = gaps.len().min(MAX_CUT_OFFS);
    let chosen = (0..count).map(|k| gaps[k * gaps.len() / count]);
    let describe = |(near, far): (f64, f64)| format!("no light arrives from beyond {near:.2} to {far:.2} m");
    chosen
        .map(|gap| {
            law_fault(describe(gap), move |_| falling(DistanceLaw::CutOff(0.5 * (gap.0 + gap.1)))).about("cut-off")
        })
        .collect()
}

/// The distances of all meters from all luminaires.
fn distances_m(task: &Task) -> Vec<f64> {
    let meters = task.targets.iter().flat_map(|t| &t.aspects).map(|a| a.meter.position_m);
    let luminaires = &task.scene.luminaires;
    meters.flat_map(|at| luminaires.iter().map(move |l| l.position_m.distance(at))).collect()
}
