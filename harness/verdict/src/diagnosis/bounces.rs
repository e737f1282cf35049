//! Kinds of wrong reflections: single ones that are lost or counted otherwise, and light that survives too often.

use luxproof_scene::Transport;

use super::fault::{Fault, Parameter};

/// Reflections that are counted one by one: later ones give too little light.
const COUNTED_REFLECTIONS: u32 = 3;

/// Lists the kinds of reflections.
pub(super) fn bounce_kinds() -> Vec<Fault> {
    let mut all = vec![];
    for bounce in 1..=COUNTED_REFLECTIONS {
        for (weight, what) in [(0.0, "is lost"), (2.0, "is counted twice"), (0.5, "counts half")] {
            // The loss of the first reflection is a separate fault.
            if bounce > 1 || weight != 0.0 {
                let what = format!("reflection {bounce} {what}");
                all.push(bounce_fault(what, bounce, move |_| weight));
            }
        }
        let free = bounce_fault(format!("reflection {bounce} counts {{0}} times"), bounce, |p| p[0]);
        all.push(free.about(format!("weight of reflection {bounce}")).with_parameters([Parameter::new(
            "",
            1.0,
            0.05,
            (0.0, 20.0),
        )]));
    }
    let later = Fault::new(
        "bounces",
        "each reflection after the first gives {0} times its light, as by a survival that is not weighted",
        |faulty, p| faulty.weight_later_reflections(p[0]),
    );
    all.push(later.about("weight of later reflections").with_parameters([Parameter::new("", 1.0, 0.02, (0.0, 3.0))]));
    all
}

fn bounce_fault(what: String, bounce: u32, weight: impl Fn(&[f64]) -> f64 + Send + Sync + 'static) -> Fault {
    Fault::new("bounces", what, move |faulty, p| {
        let reflects = matches!(faulty.task().transport, Transport::Indirect(_) | Transport::Total(_));
        reflects && faulty.weight_reflection(bounce, weight(p))
    })
}
