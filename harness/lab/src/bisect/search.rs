//! Bisection: which release is run next, and which states are known.

/// The state of a release that was run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum ReleaseState {
    /// As the good end.
    Good,
    /// A comparison changed.
    Bad,
    /// The release decides nothing, for a reason.
    Undecided(String),
}

/// The known states of all releases, from the good end to the bad one.
#[derive(Debug)]
pub(super) struct Search {
    known: Vec<Option<ReleaseState>>,
}

impl Search {
    /// Starts with a number of releases, of which the first is good and the last is bad.
    pub(super) fn between(releases: usize) -> Self {
        let mut known = vec![None; releases];
        if let [first, .., last] = &mut known[..] {
            (*first, *last) = (Some(ReleaseState::Good), Some(ReleaseState::Bad));
        }
        Self { known }
    }

    /// The first release that is known to be bad, and the last before it that is known to be good,
    /// in the order (good, bad).
    pub(super) fn bounds(&self) -> (usize, usize) {
        let bad = self.known.iter().position(|k| *k == Some(ReleaseState::Bad)).unwrap_or(self.known.len() - 1);
        let good = self.known[..bad].iter().rposition(|k| *k == Some(ReleaseState::Good)).unwrap_or(0);
        (good, bad)
    }

    /// The release whose state halves the rest; `None` where no release is left to run.
    pub(super) fn next(&self) -> Option<usize> {
        let (good, bad) = self.bounds();
        let open: Vec<usize> = (good + 1..bad).filter(|k| self.known[*k].is_none()).collect();
        open.get(open.len().saturating_sub(1) / 2).copied()
    }

    /// Records the state of a release.
    pub(super) fn record(&mut self, k: usize, state: ReleaseState) {
        self.known[k] = Some(state);
    }

    /// The state of a release, where it is known.
    pub(super) fn state(&self, k: usize) -> Option<&ReleaseState> {
        self.known[k].as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bounds and the number of runs where all releases from `first` on are bad and those in
    /// `silent` decide nothing.
    fn search_releases(releases: usize, first: usize, silent: &[usize]) -> ((usize, usize), usize) {
        let (mut search, mut asked) = (Search::between(releases), 0);
        while let Some(k) = search.next() {
            asked += 1;
            let state = if k >= first { ReleaseState::Bad } else { ReleaseState::Good };
            search.record(k, if silent.contains(&k) { ReleaseState::Undecided(String::new()) } else { state });
        }
        (search.bounds(), asked)
    }

    #[test]
    fn every_change_is_found_in_as_many_questions_as_halving_takes() {
        for releases in 2..40_usize {
            for first in 1..releases {
                let (bounds, asked) = search_releases(releases, first, &[]);
                assert_eq!(bounds, (first - 1, first));
                assert!(asked <= (releases - 1).next_power_of_two().ilog2() as usize, "{releases} {first}: {asked}");
            }
        }
    }

    #[test]
    fn undecided_releases_are_skipped_and_leave_the_rest_of_the_range() {
        assert_eq!(search_releases(16, 9, &[7, 4]).0, (8, 9));
        assert_eq!(search_releases(16, 9, &[8]).0, (7, 9));
        assert_eq!(search_releases(16, 9, &(1..15).collect::<Vec<_>>()).0, (0, 15));
        assert_eq!(search_releases(2, 1, &[]), ((0, 1), 0));
    }
}
