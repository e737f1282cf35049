//! Innovations: what a night brings that the nights before it did not predict, and how far these spread.

use super::series::Series;

/// So many innovations estimate the spread before any is judged by it.
pub(super) const MIN_LEARNED: usize = 6;
/// An innovation moves the estimates by no more than so many times the spread.
pub(super) const MAX_SPREADS: f64 = 4.0;
/// Of a standard error, relative to the reference: for engines that state none. A change far below any tolerance is one still.
pub(super) const MIN_ERROR: f64 = 1e-6;
/// Of a group's innovations, in standard errors: for what repeats exactly.
pub(super) const MIN_SPREAD: f64 = 0.1;
/// The spread of all comparisons of a case counts for so many nights in that of each.
const MAX_PEER_NIGHTS: usize = 50;
/// A standard error so many times the usual is believed; one below may be chance, being estimated from few blocks.
const UNUSUAL: f64 = 2.0;

/// A night's deviation less the one predicted, in standard errors of their difference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Innovation(pub(super) f64);

impl Innovation {
    /// That of a group: the sum over the square root of their number; `None` without any.
    pub(super) fn of_group(members: impl Iterator<Item = Self>) -> Option<Self> {
        let (sum, count) = members.fold((0.0, 0.0_f64), |(sum, count), one| (sum + one.0, count + 1.0));
        (count > 0.0).then(|| Self(sum / count.sqrt()))
    }
}

/// The spread of innovations, which single wild nights do not widen.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    squares: f64,
    pub(super) count: usize,
}

impl Spread {
    /// One that so many innovations told before, by the sum of their squares.
    pub(super) const fn known(squares: f64, count: usize) -> Self {
        Self { squares, count }
    }

    fn value(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt().max(MIN_SPREAD)
    }

    /// The most that an innovation may move an estimate by; there is no telling at first.
    fn max_step(&self) -> f64 {
        if self.count < MIN_LEARNED { f64::INFINITY } else { MAX_SPREADS * self.value() }
    }

    pub(super) fn update(&mut self, Innovation(innovation): Innovation) {
        self.squares += innovation.clamp(-self.max_step(), self.max_step()).powi(2);
        self.count += 1;
    }

    /// This spread together with that of its peers, as far as they know more.
    pub(super) fn moderated_by(mut self, peers: Self) -> Self {
        let weight = MAX_PEER_NIGHTS.min(peers.count.saturating_sub(self.count));
        if weight > 0 {
            self.squares += peers.squares * weight as f64 / peers.count as f64;
            self.count += weight;
        }
        self
    }

    /// The standard normal deviate as likely as an innovation.
    pub(super) fn deviate(&self, Innovation(innovation): Innovation) -> f64 {
        normal_deviate(innovation / self.value(), self.count)
    }
}

/// The mean deviation of a series over the nights of a segment so far, which predicts the next.
#[derive(Clone, Copy, Default)]
pub(super) struct RunningMean {
    nights: f64,
    mean: f64,
    square_of_errors: f64,
    spread: Spread,
}

impl RunningMean {
    /// Takes in a night; `None` without a reading, or without a night before that predicts it.
    pub(super) fn update(&mut self, series: &Series, night: usize) -> Option<Innovation> {
        let deviation = series.deviation[night];
        if !deviation.is_finite() {
            return None;
        }
        let (n, tonight) = (self.nights, series.std_error[night]);
        self.nights += 1.0;
        // A night's standard error is itself uncertain: the root mean square of all nights counts, unless tonight's is unusual.
        self.square_of_errors += tonight.powi(2);
        let usual = (self.square_of_errors / self.nights).sqrt();
        let error = if tonight > UNUSUAL * usual { tonight } else { usual };
        let error = error.max(MIN_ERROR * series.reference[night].abs()).max(f64::MIN_POSITIVE);
        if n == 0.0 {
            self.mean = deviation;
            return None;
        }
        let innovation = Innovation((deviation - self.mean) * (n / (n + 1.0)).sqrt() / error);
        let most = self.spread.max_step() * error;
        self.mean += (deviation - self.mean).clamp(-most, most) / self.nights;
        self.spread.update(innovation);
        Some(innovation)
    }
}

/// The spread of the innovations of all members together before each night.
pub(super) fn spread_of_all(members: &[&Series], nights: usize) -> Vec<Spread> {
    let mut means = vec![RunningMean::default(); members.len()];
    let mut all = Spread::default();
    let mut before = vec![];
    for night in 0..nights {
        before.push(all);
        for innovation in members.iter().zip(&mut means).filter_map(|(series, mean)| mean.update(series, night)) {
            all.update(innovation);
        }
    }
    before
}

/// The standard normal deviate as likely as Student's t.
fn normal_deviate(t: f64, degrees_of_freedom: usize) -> f64 {
    let n = degrees_of_freedom as f64;
    (8.0 * n + 1.0) / (8.0 * n + 3.0) * (n * (t * t / n.max(1.0)).ln_1p()).sqrt() * t.signum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deviate_is_as_likely_as_students_t() {
        // Two-sided 5 %, 1 % and 0.1 % points of t.
        for (t, n, u) in [(2.571, 5, 1.960), (3.169, 10, 2.576), (3.659, 29, 3.291)] {
            assert!((normal_deviate(t, n) - u).abs() < 0.02, "{t} {n}: {}", normal_deviate(t, n));
            assert_eq!(normal_deviate(-t, n), -normal_deviate(t, n));
        }
    }

    #[test]
    fn peers_count_for_fifty_nights_and_not_where_they_know_no_more() {
        let of = |squares, count| Spread { squares, count };
        let moderated = of(40.0, 10).moderated_by(of(1000.0, 1000));
        assert_eq!((moderated.squares, moderated.count), (90.0, 60));
        let alone = of(40.0, 10).moderated_by(of(40.0, 10));
        assert_eq!((alone.squares, alone.count), (40.0, 10));
    }
}
