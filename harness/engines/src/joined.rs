//! Joins measurements of the same job at different meters. It is a pure function of the measurements.

use super::{Blocks, Measurement};
use luxproof_model::Estimate;

impl Measurement {
    /// Returns whether it has this many sensors, and so do its samples.
    pub fn is_of(&self, sensors: usize) -> bool {
        self.estimates.len() == sensors && self.samples.iter().all(|blocks| blocks.is_of(sensors))
    }

    /// Joins the readings of sensors, each given by its part and its place in that part.
    ///
    /// Parts have different seeds and are independent. The result lists all methods that differ. It has the work of the longest part,
    /// from which later stages are planned, so that stages at meters with cached readings stay the same.
    pub fn side_by_side(parts: &[Self], sensors: &[(usize, usize)]) -> Self {
        let [first, others @ ..] = parts else { return Self::default() };
        let mut all = Self { estimates: vec![], samples: samples(parts, sensors), ..first.clone() };
        for part in others {
            let number =
                (2..u32::MAX).find(|n| !all.effort.keys().any(|key| key.starts_with(&prefix(*n)))).unwrap_or(2);
            all.effort.extend(part.effort.iter().map(|(key, value)| (prefix(number) + key, value.clone())));
            for (key, value) in part.method.iter() {
                let methods = all.method.entry(key.clone()).or_default();
                if !methods.split("; ").any(|one| one == value) {
                    *methods = if methods.is_empty() { value.clone() } else { format!("{methods}; {value}") };
                }
            }
            let new: Vec<String> = part.notes.iter().filter(|note| !all.notes.contains(note)).cloned().collect();
            all.notes.extend(new);
            all.work_s = [all.work_s, part.work_s].into_iter().flatten().reduce(f64::max);
            all.cut_to = [all.cut_to, part.cut_to].into_iter().flatten().reduce(f64::min);
        }
        all.estimates = sensors.iter().map(|(part, k)| parts[*part].estimates[*k]).collect();
        // A part alone cannot mark a sensor without light as not seen, because no other sensor of it had light.
        Estimate::mark_unseen(&mut all.estimates);
        all
    }
}

/// Returns the prefix of a further part's keys of effort.
fn prefix(part: u32) -> String {
    format!("part{part}_")
}

/// Joins the blocks of parts, as many as the part with the fewest has.
///
/// There are none if a part was sampled without blocks. Then the errors of sensors count as fully correlated.
fn samples(parts: &[Measurement], sensors: &[(usize, usize)]) -> Vec<Blocks> {
    if parts.iter().any(lacks_blocks) {
        return vec![];
    }
    let kinds = parts.iter().map(|part| part.samples.len()).max().unwrap_or(0);
    (0..kinds).map(|kind| joined_blocks(parts, kind, sensors)).collect()
}

/// Returns whether a part was sampled but has no blocks.
fn lacks_blocks(part: &Measurement) -> bool {
    part.samples.is_empty() && part.estimates.iter().any(|e| e.uncertainty.is_sampled())
}

/// Joins the blocks of one kind of light.
fn joined_blocks(parts: &[Measurement], kind: usize, sensors: &[(usize, usize)]) -> Blocks {
    let sets: Vec<Option<&Blocks>> = parts.iter().map(|part| part.samples.get(kind)).collect();
    let count = sets.iter().flatten().map(|blocks| blocks.count()).min().unwrap_or(0);
    let grouped: Vec<Option<Blocks>> = sets.into_iter().map(|blocks| blocks.map(|b| b.in_groups(count))).collect();
    Blocks::side_by_side(&grouped, sensors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::Uncertainty;
    use luxproof_process::random::normal;

    fn blocks(count: usize, random: &mut fastrand::Rng) -> Measurement {
        let samples = Blocks::new((0..count).map(|_| vec![10.0 + normal(random)]).collect());
        Measurement {
            estimates: samples.estimates(),
            method: [("solver", "one")].into(),
            effort: [("blocks", count.to_string())].into(),
            notes: vec!["both".to_owned()],
            samples: vec![samples],
            work_s: Some(1.0),
            ..Measurement::default()
        }
    }

    const BOTH: [(usize, usize); 2] = [(0, 0), (1, 0)];

    #[test]
    fn readings_stay_what_they_are_and_all_that_was_done_is_listed() {
        let mut random = fastrand::Rng::with_seed(1);
        let [a, mut b, c] = [16, 8, 8].map(|count| blocks(count, &mut random));
        (b.method, b.work_s) = ([("solver", "another")].into(), Some(0.5));
        let ab = Measurement::side_by_side(&[a.clone(), b.clone()], &[(1, 0), (0, 0), (1, 0)]);
        assert_eq!(ab.estimates, [&b, &a, &b].map(|m| m.estimates[0]));
        assert!(ab.is_of(3) && !ab.is_of(2));
        assert_eq!((ab.work_s, ab.method["solver"].as_str(), ab.notes.len()), (Some(1.0), "one; another", 1));
        let abc = Measurement::side_by_side(&[ab, c], &BOTH);
        let effort = ["blocks", "part2_blocks", "part3_blocks"].map(|key| abc.effort[key].as_str());
        assert_eq!((effort, abc.method["solver"].as_str()), (["16", "8", "8"], "one; another"));
    }

    #[test]
    fn sums_over_parts_have_the_error_of_independent_samples() {
        // The counts are equal, a multiple, and any larger number.
        for counts in [[8, 8], [32, 8], [21, 8]] {
            let mut random = fastrand::Rng::with_seed(2);
            let (mut stated, mut seen) = (0.0, 0.0);
            for _ in 0..4000 {
                let both = Measurement::side_by_side(&counts.map(|count| blocks(count, &mut random)), &BOTH);
                let sum = both.weighted(&[(0, 1.0), (1, 1.0)]);
                stated += sum.uncertainty.standard_error().unwrap().powi(2);
                seen += (sum.value - 20.0).powi(2);
            }
            let ratio: f64 = stated / seen;
            assert!((0.93..1.1).contains(&ratio), "{counts:?}: {ratio}");
        }
    }

    #[test]
    fn what_nobody_says_how_it_was_sampled_may_err_alike() {
        let mut random = fastrand::Rng::with_seed(3);
        let [a, mut b] = [8, 8].map(|count| blocks(count, &mut random));
        b.samples.clear();
        let errors = [&a, &b].map(|m| m.estimates[0].uncertainty.standard_error().unwrap());
        let both = Measurement::side_by_side(&[a.clone(), b], &BOTH);
        let sum = both.weighted(&[(0, 1.0), (1, 1.0)]).uncertainty.standard_error().unwrap();
        assert!(both.samples.is_empty() && (sum - errors[0] - errors[1]).abs() < 1e-12);
        // What was not sampled has no error to share.
        let bounded = Estimate { value: 1.0, uncertainty: Uncertainty::Bound(0.1) };
        let exact = Measurement { estimates: vec![bounded], method: a.method.clone(), ..Measurement::default() };
        let both = Measurement::side_by_side(&[exact, a.clone()], &BOTH);
        let sum = both.weighted(&[(0, 1.0), (1, 1.0)]).uncertainty;
        assert!((sum.standard_error().unwrap() - errors[0]).abs() < 1e-12 && sum.bound() == 0.1, "{sum:?}");
    }

    #[test]
    fn a_part_that_met_nothing_by_itself_is_not_dark_beside_others() {
        let a = blocks(8, &mut fastrand::Rng::with_seed(4));
        let mut dark = a.clone();
        dark.samples = vec![Blocks::new(vec![vec![0.0]; 8])];
        dark.estimates = dark.samples[0].estimates();
        assert_eq!(dark.estimates[0].uncertainty.standard_error(), Some(0.0));
        let both = Measurement::side_by_side(&[a, dark], &BOTH);
        assert_eq!(both.estimates[1].uncertainty, Uncertainty::NotSeen);
    }
}
