//! What was read of one question at some of its meters each, put side by side; pure.

use super::{Blocks, Measurement};
use crate::record::Estimate;

impl Measurement {
    /// Whether it is of so many stations, its samples too.
    pub fn is_of(&self, stations: usize) -> bool {
        self.estimates.len() == stations && self.samples.iter().all(|blocks| blocks.is_of(stations))
    }

    /// The readings of stations that lie each in one of several parts, which have seeds of their own and are independent of one another: by
    /// part, and by place in it. Methods that differ are all told. By what the longest part took further looks
    /// are reckoned, so that those at meters that were read before are the ones that were taken then.
    pub fn side_by_side(parts: &[Self], stations: &[(usize, usize)]) -> Self {
        let [first, others @ ..] = parts else { return Self::default() };
        let mut all = Self { estimates: vec![], samples: samples(parts, stations), ..first.clone() };
        for part in others {
            let number =
                (2..u32::MAX).find(|n| !all.effort.keys().any(|key| key.starts_with(&prefix(*n)))).unwrap_or(2);
            all.effort.extend(part.effort.iter().map(|(key, value)| (prefix(number) + key, value.clone())));
            for (key, value) in part.method.iter() {
                let told = all.method.entry(key.clone()).or_default();
                if !told.split("; ").any(|one| one == value) {
                    *told = if told.is_empty() { value.clone() } else { format!("{told}; {value}") };
                }
            }
            let new: Vec<String> = part.notes.iter().filter(|note| !all.notes.contains(note)).cloned().collect();
            all.notes.extend(new);
            all.work_s = [all.work_s, part.work_s].into_iter().flatten().reduce(f64::max);
            all.cut_to = [all.cut_to, part.cut_to].into_iter().flatten().reduce(f64::min);
        }
        all.estimates = stations.iter().map(|(part, k)| parts[*part].estimates[*k]).collect();
        // What met nothing may have had nobody beside it that did.
        Estimate::mark_unseen(&mut all.estimates);
        all
    }
}

/// How the effort of a further part is named.
fn prefix(part: u32) -> String {
    format!("part{part}_")
}

/// Blocks side by side, as many as the part with the fewest has. Where a part was sampled and nobody says how, there are none: then errors of
/// stations may be all one.
fn samples(parts: &[Measurement], stations: &[(usize, usize)]) -> Vec<Blocks> {
    let is_sampled = |part: &Measurement| part.estimates.iter().any(|e| e.uncertainty.is_sampled());
    if parts.iter().any(|part| part.samples.is_empty() && is_sampled(part)) {
        return vec![];
    }
    let kinds = parts.iter().map(|part| part.samples.len()).max().unwrap_or(0);
    let of = |kind: usize| {
        let given = || parts.iter().map(|part| part.samples.get(kind));
        let count = given().flatten().map(Blocks::count).min().unwrap_or(0);
        let sets: Vec<Option<Blocks>> = given().map(|blocks| blocks.map(|b| b.in_groups(count))).collect();
        Blocks::side_by_side(&sets, stations)
    };
    (0..kinds).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Uncertainty;
    use crate::system::random::normal;

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
    fn readings_stay_what_they_are_and_all_that_was_done_is_told() {
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
        // Of as many blocks, of a multiple, of any number more.
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
