//! Bisection: which of two neighbours is asked next, and what is known by then.

/// What a release that was looked at is like.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Like {
    /// The good end.
    Good,
    /// Changed against it.
    Bad,
    /// It says nothing, for a reason.
    Nothing(String),
}

/// Releases from the good end to the bad one, and what is known of each.
#[derive(Debug)]
pub(super) struct Search {
    known: Vec<Option<Like>>,
}

impl Search {
    /// Of so many releases, both ends among them, of which the first is good and the last bad.
    pub(super) fn between(releases: usize) -> Self {
        let mut known = vec![None; releases];
        if let [first, .., last] = &mut known[..] {
            (*first, *last) = (Some(Like::Good), Some(Like::Bad));
        }
        Self { known }
    }

    /// The last that is known to be good and the first that is known to be bad behind it.
    pub(super) fn bounds(&self) -> (usize, usize) {
        let bad = self.known.iter().position(|k| *k == Some(Like::Bad)).unwrap_or(self.known.len() - 1);
        let good = self.known[..bad].iter().rposition(|k| *k == Some(Like::Good)).unwrap_or(0);
        (good, bad)
    }

    /// The one whose answer parts the rest most evenly; `None` where nothing is left to be asked.
    pub(super) fn next(&self) -> Option<usize> {
        let (good, bad) = self.bounds();
        let open: Vec<usize> = (good + 1..bad).filter(|k| self.known[*k].is_none()).collect();
        open.get(open.len().saturating_sub(1) / 2).copied()
    }

    pub(super) fn told(&mut self, k: usize, like: Like) {
        self.known[k] = Some(like);
    }

    pub(super) fn known(&self, k: usize) -> Option<&Like> {
        self.known[k].as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bounds and questions where everything from `first` on is bad and what `silent` names says nothing.
    fn searched(releases: usize, first: usize, silent: &[usize]) -> ((usize, usize), usize) {
        let (mut search, mut asked) = (Search::between(releases), 0);
        while let Some(k) = search.next() {
            asked += 1;
            let like = if k >= first { Like::Bad } else { Like::Good };
            search.told(k, if silent.contains(&k) { Like::Nothing(String::new()) } else { like });
        }
        (search.bounds(), asked)
    }

    #[test]
    fn every_change_is_found_in_as_many_questions_as_halving_takes() {
        for releases in 2..40_usize {
            for first in 1..releases {
                let (bounds, asked) = searched(releases, first, &[]);
                assert_eq!(bounds, (first - 1, first));
                assert!(asked <= (releases - 1).next_power_of_two().ilog2() as usize, "{releases} {first}: {asked}");
            }
        }
    }

    #[test]
    fn what_says_nothing_is_passed_over_and_leaves_the_rest_of_the_range() {
        assert_eq!(searched(16, 9, &[7, 4]).0, (8, 9));
        assert_eq!(searched(16, 9, &[8]).0, (7, 9));
        assert_eq!(searched(16, 9, &(1..15).collect::<Vec<_>>()).0, (0, 15));
        assert_eq!(searched(2, 1, &[]), ((0, 1), 0));
    }
}
