//! What is named, and what is better left unsaid.

use luminaire::scene::{Bounces, Transport};

use super::*;
use crate::engines::fixtures;
use crate::procedures::Target;
use crate::record::{MeterId, Quantity};

fn task(transport: Transport) -> (Task, Vec<f64>) {
    let job = fixtures::s1(transport);
    let target = |(k, s): (usize, &crate::engines::Station)| Target::of_one(MeterId::new("m", k), s.meter, 1.0);
    let targets = job.stations.iter().enumerate().map(target).collect();
    let task = Task { procedure: job.procedure, scene: job.scene, transport, quantity: Quantity::Illuminance, targets };
    let right = truth(&task).unwrap();
    (task, right)
}

fn found(task: &Task, right: &[f64], read: Vec<f64>) -> Vec<Cause> {
    let uncertainty = read.iter().map(|r| 1e-4 * r).collect();
    causes(&faults(task, right), &Readings { read, right: right.to_vec(), uncertainty })
}

#[test]
fn a_factor_is_named_with_its_evidence_and_what_nothing_explains_is_left_unsaid() {
    let (task, right) = task(Transport::Direct);
    let found = |factors: [f64; 4]| found(&task, &right, right.iter().zip(factors).map(|(r, f)| r * f).collect());
    let causes = found([std::f64::consts::PI; 4]);
    assert_eq!(causes[0].id, "factor-pi");
    assert!(causes[0].text.contains(": all 4 readings are 3.1416 ± "), "{}", causes[0].text);
    let unknown = found([1.37; 4]);
    assert_eq!((unknown.len(), unknown[0].id), (1, "factor"));
    assert_eq!(found([1.1, 0.8, 1.3, 0.95]), []);
    assert_eq!(found([1.0; 4]), [], "right readings need no cause");
}

#[test]
fn light_that_stops_early_is_told_by_the_number_of_its_reflections() {
    let (task, right) = task(Transport::Indirect(Bounces::Converged));
    // Case S1 cut at five reflections, as solved by two other methods.
    let read = vec![0.91170, 1.12222, 1.12222, 1.38492];
    let causes = found(&task, &right, read);
    assert_eq!(causes[0].what, "light stops after 5 reflections");
}

#[test]
fn meters_that_face_the_other_way_are_named() {
    let (task, right) = task(Transport::Indirect(Bounces::Converged));
    let flipped = faults(&task, &right).into_iter().find(|f| f.id == "meter-flipped").unwrap();
    let causes = found(&task, &right, flipped.readings(&right).unwrap());
    assert_eq!(causes[0].id, "meter-flipped");
}
