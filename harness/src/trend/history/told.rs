//! What the nights before have told of a series: its mean, its standard error, and how far residuals spread.

use super::series::Series;

/// So many residuals estimate the spread before any is judged by it.
pub(super) const LEARNING: usize = 6;

/// A residual moves the estimates by no more than so many times the spread.
pub(super) const MOST: f64 = 4.0;

/// The smallest standard error, relative to the reference: for engines that state none. A change far below any tolerance is one still.
pub(super) const SMALLEST_ERROR: f64 = 1e-6;

/// The smallest spread of a group's residuals, in standard errors: for what repeats exactly.
const SMALLEST_SPREAD: f64 = 0.1;

/// The spread of all comparisons of a case counts for so many nights in that of each.
const PEERS: usize = 50;

/// A standard error so many times the usual is believed; one below may be chance, being estimated from few blocks.
const UNUSUAL: f64 = 2.0;

/// The spread of residuals, which single wild nights do not widen.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    squares: f64,
    pub(super) count: usize,
}

impl Spread {
    fn value(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt().max(SMALLEST_SPREAD)
    }

    /// The most that a residual may move an estimate by; there is no telling at first.
    fn most(&self) -> f64 {
        if self.count < LEARNING { f64::INFINITY } else { MOST * self.value() }
    }

    pub(super) fn hear(&mut self, residual: f64) {
        self.squares += residual.clamp(-self.most(), self.most()).powi(2);
        self.count += 1;
    }

    /// This spread together with that of its peers, as far as they know more.
    pub(super) fn moderated_by(mut self, peers: Self) -> Self {
        let weight = PEERS.min(peers.count.saturating_sub(self.count));
        if weight > 0 {
            self.squares += peers.squares * weight as f64 / peers.count as f64;
            self.count += weight;
        }
        self
    }

    /// The standard normal deviate as likely as a residual.
    pub(super) fn deviate(&self, residual: f64) -> f64 {
        normal_deviate(residual / self.value(), self.count)
    }
}

/// What the nights of a segment have told of one series so far.
#[derive(Clone, Copy, Default)]
pub(super) struct Told {
    nights: f64,
    mean: f64,
    square_of_errors: f64,
    spread: Spread,
}

impl Told {
    /// Takes in a night; its residual in standard errors, where there is a night before to foretell it.
    pub(super) fn hear(&mut self, series: &Series, night: usize) -> Option<f64> {
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
        let error = error.max(SMALLEST_ERROR * series.reference[night].abs()).max(f64::MIN_POSITIVE);
        if n == 0.0 {
            self.mean = deviation;
            return None;
        }
        let residual = (deviation - self.mean) * (n / (n + 1.0)).sqrt() / error;
        let most = self.spread.most() * error;
        self.mean += (deviation - self.mean).clamp(-most, most) / self.nights;
        self.spread.hear(residual);
        Some(residual)
    }
}

/// The spread of the residuals of all members together before each night.
pub(super) fn spread_of_all(members: &[&Series], nights: usize) -> Vec<Spread> {
    let mut told = vec![Told::default(); members.len()];
    let mut all = Spread::default();
    let mut before = vec![];
    for night in 0..nights {
        before.push(all);
        for (told, series) in told.iter_mut().zip(members) {
            if let Some(residual) = told.hear(series, night) {
                all.hear(residual);
            }
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
