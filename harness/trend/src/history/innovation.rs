//! Innovations: the deviations of a night from the prediction of the nights before, and the noise that they show.

use std::rc::Rc;

use statrs::distribution::{ContinuousCDF, Normal};

use super::series::Series;

/// An innovation moves an estimate without limit until so many are known.
const MIN_LEARNED_NIGHTS: usize = 6;
/// An innovation is judged once so many are known, of the group or of its peers. Student's t takes account of how few they are.
const MIN_KNOWN_NIGHTS: usize = 2;
/// An innovation moves the estimates by at most so many times the spread.
pub(super) const MAX_SPREADS: f64 = 4.0;
/// The least standard error relative to reference or reading, for engines that state none. It is far below any tolerance.
const MIN_RELATIVE_ERROR: f64 = 1e-6;
/// The least spread of a group's innovations, in standard errors, for engines that repeat exactly.
pub(super) const MIN_SPREAD: f64 = 0.1;
/// The spread of all comparisons of a case counts for at most so many nights in that of each.
const MAX_PEER_NIGHTS: usize = 50;
/// What the stated errors and the scatter among meters let expect of a group's spread counts for so many nights.
const STATED_NIGHTS: usize = 10;
/// The largest sample of a distribution.
const MAX_SAMPLE: usize = 2048;
/// A scatter among meters below this part of the stated errors does not show their distribution.
const MIN_SCATTER: f64 = 0.5;
/// A group's own nights show heavy tails once there are so many.
const MIN_OWN_SAMPLE: usize = 20;
/// Tails are heavier than normal ones where the largest innovation is so much farther out than that of normal noise, in spreads.
const HEAVIER: f64 = 0.8;
/// Beyond the largest innovation so far probabilities fall with this power of the distance, as those of heavy tails do.
const TAIL_POWER: i32 = 3;
/// A standard error more than so many times the usual counts as stated. A smaller excess may be chance of few blocks.
const UNUSUAL_ERROR_RATIO: f64 = 2.0;

/// A night's deviation less the predicted one, in standard errors of the difference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Innovation(pub(super) f64);

impl Innovation {
    /// The innovation of a group: the sum over the square root of its number; `None` of an empty group.
    pub(super) fn of_group(members: impl Iterator<Item = Self>) -> Option<Self> {
        let (mut sum, mut count) = (0.0, 0.0_f64);
        for Self(innovation) in members {
            sum += innovation;
            count += 1.0;
        }
        (count > 0.0).then(|| Self(sum / count.sqrt()))
    }
}

/// The spread of innovations; single outliers do not widen it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    squares: f64,
    pub(super) count: usize,
}

impl Spread {
    /// A spread of so many earlier innovations, given by the sum of their squares.
    pub(super) const fn known(squares: f64, count: usize) -> Self {
        Self { squares, count }
    }

    fn value(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt().max(MIN_SPREAD)
    }

    /// The most that an innovation may move an estimate by; unlimited until the spread is known.
    fn max_step(&self) -> f64 {
        if self.count < MIN_LEARNED_NIGHTS { f64::INFINITY } else { MAX_SPREADS * self.value() }
    }

    pub(super) fn update(&mut self, Innovation(innovation): Innovation) {
        self.squares += innovation.clamp(-self.max_step(), self.max_step()).powi(2);
        self.count += 1;
    }

    /// This spread combined with that of its peers, as far as they have more innovations.
    fn moderated_by(mut self, peers: Self) -> Self {
        let weight = MAX_PEER_NIGHTS.min(peers.count.saturating_sub(self.count));
        if weight > 0 {
            self.squares += peers.squares * weight as f64 / peers.count as f64;
            self.count += weight;
        }
        self
    }

    /// The standard normal deviate that is as likely as an innovation.
    pub(super) fn deviate(&self, Innovation(innovation): Innovation) -> f64 {
        normal_deviate(innovation / self.value(), self.count)
    }
}

/// The standardised innovations so far in ascending order; of many every second, every fourth and so on.
///
/// They show how often a skewed or heavy-tailed noise goes so far, whatever its distribution.
#[derive(Clone, Debug)]
struct Sample {
    sorted: Vec<f64>,
    count: usize,
    /// One of so many innovations is in the sample.
    stride: usize,
}

impl Default for Sample {
    fn default() -> Self {
        Self { sorted: vec![], count: 0, stride: 1 }
    }
}

impl Sample {
    fn insert(&mut self, standardised: f64) {
        self.count += 1;
        if !self.count.is_multiple_of(self.stride) {
            return;
        }
        let place = self.sorted.partition_point(|known| *known < standardised);
        self.sorted.insert(place, standardised);
        if self.sorted.len() > MAX_SAMPLE {
            let mut keep = false;
            self.sorted.retain(|_| {
                keep = !keep;
                keep
            });
            self.stride *= 2;
        }
    }

    /// The largest normal deviate that a standardised innovation may have, by its rank among those before.
    fn max_deviate(&self, standardised: f64) -> f64 {
        let (size, count) = (standardised.abs(), self.sorted.len());
        let rank = if standardised > 0.0 {
            count - self.sorted.partition_point(|known| *known < standardised)
        } else {
            self.sorted.partition_point(|known| *known <= standardised)
        };
        let beyond = (self.largest(standardised).max(1.0) / size).min(1.0).powi(TAIL_POWER);
        let probability = (rank as f64 + 1.0) / (count as f64 + 1.0) * beyond;
        Normal::standard().inverse_cdf(1.0 - probability.clamp(f64::EPSILON, 0.5))
    }

    /// The size of the largest innovation with the sign of a number.
    fn largest(&self, sign: f64) -> f64 {
        let largest = if sign > 0.0 { self.sorted.last() } else { self.sorted.first() };
        largest.map_or(0.0, |largest| largest * sign.signum())
    }

    /// Whether the tail with the sign of a number has shown itself heavier than a normal one; an empty sample counts as heavy.
    ///
    /// So a group without stated errors is limited by its own nights: without that limit skewed noise gives twice as many
    /// false alarms.
    fn is_heavy(&self, sign: f64) -> bool {
        let of_normal = Normal::standard().inverse_cdf(1.0 - 0.5 / (self.sorted.len() as f64 + 1.0));
        self.largest(sign).max(1.0) > of_normal + HEAVIER
    }
}

/// The noise of innovations: their spread and their distribution.
#[derive(Clone, Debug, Default)]
pub(super) struct Noise {
    spread: Spread,
    sample: Rc<Sample>,
    /// Whether members of a group have heavy tails, which their sum then has too.
    has_heavy_members: bool,
}

impl Noise {
    /// The standard normal deviate that is as likely as an innovation; `None` where too little is known.
    ///
    /// `peers` is what is known of similar innovations. Their distribution counts instead of the group's own, if they have one.
    pub(super) fn deviate(&self, peers: Option<&Self>, innovation: Innovation) -> Option<f64> {
        let spread = peers.map_or(self.spread, |peers| self.spread.moderated_by(peers.spread));
        if spread.count < MIN_KNOWN_NIGHTS {
            return None;
        }
        let deviate = spread.deviate(innovation);
        let of_peers = peers.map(|peers| &peers.sample).filter(|sample| sample.count > 0);
        let is_limited = match of_peers {
            // With heavy tails the level of a series is certain only after some nights.
            Some(sample)
                if self.spread.count < MIN_LEARNED_NIGHTS && (sample.is_heavy(1.0) || sample.is_heavy(-1.0)) =>
            {
                return None;
            }
            Some(_) => true,
            None if self.sample.count >= MIN_OWN_SAMPLE && self.sample.is_heavy(innovation.0) => true,
            None => peers.is_some_and(|peers| peers.has_heavy_members),
        };
        if !is_limited {
            return Some(deviate);
        }
        let most = of_peers.unwrap_or(&self.sample).max_deviate(innovation.0 / spread.value());
        Some(deviate.clamp(-most, most))
    }

    /// Learns an innovation.
    pub(super) fn update(&mut self, peers: Option<&Self>, innovation: Innovation) {
        self.spread.update(innovation);
        let spread = peers.map_or(self.spread, |peers| self.spread.moderated_by(peers.spread));
        Rc::make_mut(&mut self.sample).insert(innovation.0 / spread.value());
    }
}

/// The mean deviation of a series over the nights of a segment so far, which predicts the next night.
#[derive(Clone, Copy, Default)]
pub(super) struct RunningMean {
    nights: f64,
    mean: f64,
    square_of_errors: f64,
    spread: Spread,
}

impl RunningMean {
    /// A night's deviation from the prediction; `None` without a reading, or without an earlier night.
    pub(super) fn innovation(&self, series: &Series, night: usize) -> Option<Innovation> {
        let (n, deviation) = (self.nights, series.deviation[night]);
        let is_predicted = deviation.is_finite() && n > 0.0;
        is_predicted.then(|| Innovation((deviation - self.mean) * (n / (n + 1.0)).sqrt() / self.error(series, night)))
    }

    /// The standard error of a night.
    ///
    /// It is uncertain itself, so the root mean square of all nights counts, unless tonight's is unusual.
    fn error(&self, series: &Series, night: usize) -> f64 {
        let tonight = series.std_error[night];
        let usual = ((self.square_of_errors + tonight.powi(2)) / (self.nights + 1.0)).sqrt();
        let error = if tonight > UNUSUAL_ERROR_RATIO * usual { tonight } else { usual };
        error.max(least_error(series, night))
    }

    /// Adds a night, and returns its innovation.
    pub(super) fn update(&mut self, series: &Series, night: usize) -> Option<Innovation> {
        let deviation = series.deviation[night];
        if !deviation.is_finite() {
            return None;
        }
        let (innovation, error) = (self.innovation(series, night), self.error(series, night));
        self.nights += 1.0;
        self.square_of_errors += series.std_error[night].powi(2);
        match innovation {
            None => self.mean = deviation,
            Some(innovation) => {
                let most = self.spread.max_step() * error;
                self.mean += (deviation - self.mean).clamp(-most, most) / self.nights;
                self.spread.update(innovation);
            }
        }
        innovation
    }
}

/// The least standard error of a reading, for engines that state none: a part of the reference or of the reading.
///
/// A reference of zero alone would make every deviation infinite.
pub(super) fn least_error(series: &Series, night: usize) -> f64 {
    let reference = series.reference[night];
    let size = reference.abs().max((reference + series.deviation[night]).abs());
    (MIN_RELATIVE_ERROR * size).max(f64::MIN_POSITIVE)
}

/// The noise of all comparisons of a case together before each night.
pub(super) fn noise_of_comparisons(members: &[&Series], nights: usize) -> Vec<Noise> {
    let mut means = vec![RunningMean::default(); members.len()];
    let mut spreads = vec![Spread::default(); members.len()];
    let (mut noise, mut sample) = (Noise::default(), Sample::default());
    let mut before = vec![];
    for night in 0..nights {
        before.push(noise.clone());
        let updates = members.iter().zip(&mut means).map(|(series, mean)| mean.update(series, night));
        let innovations: Vec<Option<Innovation>> = updates.collect();
        innovations.iter().flatten().for_each(|innovation| noise.spread.update(*innovation));
        for (innovation, spread) in innovations.iter().zip(&mut spreads) {
            if let Some(innovation) = innovation {
                spread.update(*innovation);
                sample.insert(innovation.0 / spread.moderated_by(noise.spread).value());
            }
        }
        // A copy for each night would be large, and a tenth more innovations change little.
        if 10 * sample.count > 11 * noise.sample.count {
            noise.sample = Rc::new(sample.clone());
        }
    }
    before
}

/// What the stated errors of a group's members and the scatter among them let expect of its noise before each night.
///
/// Of a variance of 1, in stated errors, the scatter among members shows one part. The rest, where it is certain, is noise that the
/// members share: it does not average out. Of a single member, or without stated errors, nothing is expected, unless all members have
/// repeated exactly so far: then they are expected to go on.
pub(super) fn expected_noise(members: &[&Series], nights: usize) -> Vec<Noise> {
    let mut means = vec![RunningMean::default(); members.len()];
    let (mut squares, mut freedom, mut sample) = (0.0, 0.0_f64, Sample::default());
    let (mut exact_means, mut repeats_exactly, mut repetitions) = (means.clone(), true, 0);
    let mut before = vec![];
    for night in 0..nights {
        let has_heavy_members = sample.is_heavy(1.0) || sample.is_heavy(-1.0);
        let mut noise = Noise { has_heavy_members, ..Noise::default() };
        if freedom > 0.0 {
            let scatter = squares / freedom;
            let shared = (1.0 - scatter * (1.0 + 2.0 * (2.0 / freedom).sqrt())).max(0.0);
            let expected = scatter + members.len() as f64 * shared;
            noise.spread = Spread::known(expected * STATED_NIGHTS as f64, STATED_NIGHTS);
        } else if repeats_exactly && repetitions > 0 {
            noise.spread = Spread::known(0.0, STATED_NIGHTS);
        }
        before.push(noise);
        let all = members.iter().zip(&mut exact_means);
        let innovations: Vec<Innovation> = all.filter_map(|(series, mean)| mean.update(series, night)).collect();
        repetitions += innovations.len();
        repeats_exactly &= innovations.iter().all(|Innovation(innovation)| innovation.abs() < MIN_SPREAD)
            && members.iter().all(|series| series.std_error[night].is_nan() || series.std_error[night] == 0.0);
        let stated = members.iter().zip(&mut means).filter(|(series, _)| series.std_error[night] > 0.0);
        let updates: Vec<f64> = stated.filter_map(|(series, mean)| Some(mean.update(series, night)?.0)).collect();
        if updates.len() > 1 {
            let mean = updates.iter().sum::<f64>() / updates.len() as f64;
            squares += updates.iter().map(|innovation| (innovation - mean).powi(2)).sum::<f64>();
            freedom += updates.len() as f64 - 1.0;
            // Where most noise is shared, the rest does not show a distribution.
            let spread = Spread::known(squares, freedom as usize).value().max(MIN_SCATTER);
            for innovation in updates {
                sample.insert((innovation - mean) / spread);
            }
        }
    }
    before
}

/// The standard normal deviate that is as likely as Student's t (Wallace's approximation).
fn normal_deviate(t: f64, degrees_of_freedom: usize) -> f64 {
    let n = degrees_of_freedom as f64;
    (8.0 * n + 1.0) / (8.0 * n + 3.0) * (n * (t * t / n.max(1.0)).ln_1p()).sqrt() * t.signum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::synthetic::{is_near, series};

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
        let moderated = Spread::known(40.0, 10).moderated_by(Spread::known(1000.0, 1000));
        assert_eq!((moderated.squares, moderated.count), (90.0, 60));
        let unchanged = Spread::known(40.0, 10).moderated_by(Spread::known(40.0, 10));
        assert_eq!((unchanged.squares, unchanged.count), (40.0, 10));
    }

    #[test]
    fn the_innovation_of_a_group_is_the_sum_over_the_root_of_its_number() {
        let of_group = Innovation::of_group([3.0, -1.0, 4.0, 2.0].map(Innovation).into_iter()).unwrap();
        assert_eq!(of_group.0, 4.0);
        assert!(Innovation::of_group(std::iter::empty()).is_none());
    }

    #[test]
    fn a_spread_is_the_root_of_the_mean_square_and_an_outlier_counts_as_four_of_it() {
        let mut spread = Spread::default();
        assert_eq!((spread.value(), spread.max_step()), (MIN_SPREAD, f64::INFINITY));
        for innovation in [100.0, 1.0, -1.0, 1.0, -1.0, 0.0] {
            spread.update(Innovation(innovation));
        }
        // The first six count in full.
        assert_eq!((spread.squares, spread.count), (10_004.0, 6));
        let mut calm = Spread::known(24.0, 6);
        assert_eq!((calm.value(), calm.max_step()), (2.0, 8.0));
        calm.update(Innovation(-50.0));
        assert_eq!((calm.squares, calm.count), (24.0 + 64.0, 7));
        calm.update(Innovation(3.0));
        assert_eq!((calm.squares, calm.count), (24.0 + 64.0 + 9.0, 8));
        // 2.571 spreads of two with five degrees of freedom: 5 % on either side of t, 1.96 of a normal distribution.
        assert!((Spread::known(20.0, 5).deviate(Innovation(5.142)) - 1.960).abs() < 0.02);
        let none = Spread::known(5.0, 5).moderated_by(Spread::known(100.0, 4));
        assert_eq!((none.squares, none.count), (5.0, 5));
        // Two nights more count with the mean of the peers.
        let two = Spread::known(5.0, 5).moderated_by(Spread::known(70.0, 7));
        assert_eq!((two.squares, two.count), (25.0, 7));
    }

    /// The sample of these numbers.
    fn sample(numbers: impl IntoIterator<Item = f64>) -> Sample {
        let mut sample = Sample::default();
        numbers.into_iter().for_each(|number| sample.insert(number));
        sample
    }

    #[test]
    fn a_deviate_is_limited_by_its_rank_and_by_a_cubic_tail() {
        let known = sample([3.0, 1.0, 9.0, 2.0, 8.0, 7.0, 4.0, 6.0, 5.0]);
        assert_eq!(known.sorted, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        // Quantiles of the normal distribution: .0729 = .9^3 / 10 beyond 1.45449, .1 beyond 1.28155, .2 beyond .84162.
        for (standardised, deviate) in
            [(10.0, 1.45449), (9.5, 1.37203), (8.5, 0.84162), (9.0, 0.84162), (5.5, 0.0), (0.5, 0.0), (-1.0, 1.28155)]
        {
            let found = known.max_deviate(standardised);
            assert!((found - deviate).abs() < 1e-4, "{standardised}: {found}");
        }
        // Likewise on the other side, where what is equal has a rank too.
        let mirrored = sample(known.sorted.iter().map(|x| -x));
        assert!((mirrored.max_deviate(-10.0) - 1.45449).abs() < 1e-4);
        assert!((mirrored.max_deviate(-9.0) - 0.84162).abs() < 1e-4);
        assert_eq!((known.largest(1.0), known.largest(-1.0), mirrored.largest(-1.0)), (9.0, -1.0, 9.0));
        // Nothing is known: an even chance for what is small, and a tail beyond one.
        assert_eq!((Sample::default().largest(1.0), Sample::default().max_deviate(0.5)), (0.0, 0.0));
        // (1 / 2)^3 beyond 1.15035.
        assert!((Sample::default().max_deviate(2.0) - 1.15035).abs() < 1e-4);
    }

    #[test]
    fn a_tail_is_heavy_where_it_goes_farther_than_a_normal_one() {
        // The largest of 19 normal numbers is about 1.96: .5 / 20 beyond it.
        for (largest, is_heavy) in [(2.75, false), (2.77, true)] {
            let upwards = sample((0..18).map(f64::from).map(|n| n / 18.0).chain([largest]));
            assert_eq!((upwards.is_heavy(1.0), upwards.is_heavy(-1.0)), (is_heavy, false), "{largest}");
            let downwards = sample(upwards.sorted.iter().map(|x| -x));
            assert_eq!((downwards.is_heavy(1.0), downwards.is_heavy(-1.0)), (false, is_heavy), "{largest}");
        }
        assert!(Sample::default().is_heavy(1.0) && Sample::default().is_heavy(-1.0));
        assert!(!sample([1.0]).is_heavy(1.0));
    }

    #[test]
    fn a_long_sample_is_thinned_evenly() {
        let mut long = sample((0..MAX_SAMPLE).map(|n| n as f64));
        assert_eq!((long.sorted.len(), long.stride), (2048, 1));
        long.insert(2048.0);
        assert_eq!((long.sorted.len(), long.stride, long.count), (1025, 2, 2049));
        assert!(long.sorted.iter().enumerate().all(|(k, x)| *x == 2.0 * k as f64));
        long.insert(7.0);
        long.insert(9.0);
        assert_eq!((long.sorted.len(), long.count, long.sorted[4]), (1026, 2051, 7.0));
    }

    #[test]
    fn a_night_is_judged_by_its_own_noise_and_that_of_its_peers() {
        let mut own = Noise::default();
        assert_eq!(own.deviate(None, Innovation(1.0)), None);
        own.update(None, Innovation(2.0));
        assert_eq!(own.deviate(None, Innovation(1.0)), None);
        own.update(None, Innovation(-2.0));
        assert_eq!(own.deviate(None, Innovation(3.0)), Some(normal_deviate(1.5, 2)));
        assert_eq!(own.sample.sorted, [-1.0, 1.0]);
        // Peers with more nights count, and limit by their distribution.
        let peers = Noise {
            spread: Spread::known(100.0, 100),
            sample: Rc::new(sample((0..100).map(|n| f64::from(n) / 50.0 - 1.0))),
            has_heavy_members: false,
        };
        let spread = Spread::known(8.0 + 50.0, 52);
        let innovation = Innovation(5.0);
        let found = own.deviate(Some(&peers), innovation).unwrap();
        let most = peers.sample.max_deviate(5.0 / spread.value());
        assert!(spread.deviate(innovation) > most && found == most, "{found} {most}");
        assert_eq!(own.deviate(Some(&peers), Innovation(-5.0)), Some(-peers.sample.max_deviate(-5.0 / spread.value())));
        // Of peers with heavy tails nothing is judged in the first nights.
        let heavy = Noise { sample: Rc::new(sample([-9.0, 1.0, -1.0])), ..peers.clone() };
        assert_eq!(own.deviate(Some(&heavy), innovation), None);
        let heavy = Noise { sample: Rc::new(sample([9.0, 1.0, -1.0])), ..peers };
        assert_eq!(own.deviate(Some(&heavy), innovation), None);
        let mut later = own.clone();
        (0..4).for_each(|_| later.update(None, Innovation(1.0)));
        assert!(later.deviate(Some(&heavy), innovation).is_some());
        // Heavy members limit their sum by its own nights.
        let members = Noise { has_heavy_members: true, sample: Rc::default(), ..heavy };
        let most = own.sample.max_deviate(5.0 / spread.value());
        assert_eq!(own.deviate(Some(&members), innovation), Some(spread.deviate(innovation).min(most)));
    }

    #[test]
    fn heavy_tails_of_twenty_nights_of_its_own_limit_a_group() {
        let quiet = (0..18).map(|n| if n % 2 == 0 { 0.5 } else { -0.5 });
        for (count, is_limited) in [(18, false), (19, true)] {
            let mut own = Noise::default();
            quiet.clone().chain([0.5]).take(count).for_each(|x| own.update(None, Innovation(x)));
            own.update(None, Innovation(9.0));
            let (innovation, spread) = (Innovation(3.0), own.spread);
            let free = spread.deviate(innovation);
            assert_eq!(own.deviate(None, innovation).unwrap() < free, is_limited, "{count}");
            // The other tail is not heavy.
            assert_eq!(own.deviate(None, Innovation(-3.0)), Some(-free));
        }
    }

    #[test]
    fn a_mean_predicts_the_next_night_with_the_error_of_both() {
        let read = series(100.0, &[1.0, 3.0, 0.0, 9.0], &[1.0, 5.0, f64::NAN, 3.0]);
        let mut mean = RunningMean::default();
        assert!(mean.innovation(&read, 0).is_none() && mean.update(&read, 0).is_none());
        assert_eq!((mean.nights, mean.mean, mean.square_of_errors), (1.0, 1.0, 1.0));
        // A difference of 4, with the error sqrt((1 + 9) / 2) of either night: 4 / sqrt(2) / sqrt(5).
        let innovation = mean.update(&read, 1).unwrap().0;
        assert!(is_near(innovation, 4.0 / 10f64.sqrt()), "{innovation}");
        assert_eq!((mean.nights, mean.mean, mean.square_of_errors), (2.0, 3.0, 10.0));
        assert!(mean.update(&read, 2).is_none() && mean.nights == 2.0);
        // An error of 9 is less than twice sqrt((10 + 81) / 3) = 5.5.
        assert!(is_near(mean.error(&read, 3), (91.0_f64 / 3.0).sqrt()));
        assert_eq!(mean.innovation(&read, 3).map(|i| i.0), Some(0.0));
    }

    /// Lets a mean learn the first nights of a series.
    fn learn(mean: &mut RunningMean, series: &Series, nights: usize) {
        for night in 0..nights {
            mean.update(series, night);
        }
    }

    #[test]
    fn an_unusual_error_counts_as_stated_and_a_least_one_is_a_millionth() {
        // After 24 nights of 1, an error of 3 is more than twice sqrt((24 + 9) / 25) = 1.149, one of 2 less than 2 * 1.058.
        let mut errors = vec![1.0; 24];
        errors.extend([3.0, 2.0]);
        let read = series(100.0, &errors, &[0.0; 26]);
        let mut mean = RunningMean::default();
        learn(&mut mean, &read, 24);
        assert_eq!(mean.error(&read, 24), 3.0);
        assert!(is_near(mean.error(&read, 25), (28.0_f64 / 25.0).sqrt()));
        let exact = series(100.0, &[0.0; 3], &[50.0, -300.0, -100.0]);
        let least = [0, 1, 2].map(|night| least_error(&exact, night));
        assert!(is_near(least[0] / 1e-6, 150.0) && is_near(least[1] / 1e-6, 200.0), "{least:?}");
        assert!(is_near(least[2] / 1e-6, 100.0) && RunningMean::default().error(&exact, 1) == least[1]);
    }

    #[test]
    fn a_mean_follows_an_outlier_by_four_spreads_at_most() {
        // Innovations of (1 - mean) sqrt(n / (n + 1)): the spread of the first seven nights is known.
        let deviations = [0.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1000.0];
        let read = series(100.0, &[1.0; 8], &deviations);
        let mut mean = RunningMean::default();
        learn(&mut mean, &read, 7);
        assert!(is_near(mean.mean, 0.0) && mean.spread.count == 6);
        let most = 4.0 * (mean.spread.squares / 6.0).sqrt();
        mean.update(&read, 7);
        assert!(is_near(mean.mean, most / 8.0), "{} {most}", mean.mean);
    }

    #[test]
    fn comparisons_of_a_case_pool_their_innovations() {
        let [one, other] = [[0.0, 2.0, 1.0], [0.0, -2.0, 0.0]].map(|deviation| series(100.0, &[1.0; 3], &deviation));
        let before = noise_of_comparisons(&[&one, &other], 3);
        // The second night has innovations of 2 / sqrt(2) and -2 / sqrt(2).
        assert_eq!([0, 1, 2].map(|night| before[night].spread.count), [0, 0, 2]);
        assert!(is_near(before[2].spread.squares, 4.0));
        // Each has a spread of sqrt(2): both pooled with one night more.
        assert!(before[2].sample.sorted.iter().zip([-1.0, 1.0]).all(|(x, e)| is_near(*x, e)), "{:?}", before[2].sample);
    }

    #[test]
    fn members_that_share_noise_let_their_sum_scatter_by_their_number() {
        // Four members with the errors 1 on many nights: the same noise for all, or opposite noise for half.
        let mut random = fastrand::Rng::with_seed(1);
        let nights = 400;
        let common: Vec<f64> = (0..nights).map(|_| luxproof_process::random::normal(&mut random)).collect();
        let all: Vec<Series> = (0..4).map(|_| series(100.0, &vec![1.0; nights], &common)).collect();
        let shared = expected_noise(&all.iter().collect::<Vec<_>>(), nights);
        // No scatter about the mean of members: the whole variance of 1 is shared, and four add up to 4 * 1.
        let last = shared[nights - 1].spread;
        assert!(last.count == STATED_NIGHTS && is_near(last.squares, 40.0), "{last:?}");
        let mut own = vec![];
        for _ in 0..4 {
            let deviation: Vec<f64> = (0..nights).map(|_| luxproof_process::random::normal(&mut random)).collect();
            own.push(series(100.0, &vec![1.0; nights], &deviation));
        }
        let independent = expected_noise(&own.iter().collect::<Vec<_>>(), nights);
        let last = independent[nights - 1].spread;
        assert!(last.count == STATED_NIGHTS && (last.squares / 10.0 - 1.0).abs() < 0.15, "{last:?}");
        assert!(!independent[nights - 1].has_heavy_members);
        // Nothing is expected of a single member.
        assert_eq!(expected_noise(&[&own[0]], nights)[nights - 1].spread.count, 0);
    }

    #[test]
    fn members_that_repeat_exactly_are_expected_to_go_on() {
        let mut deviation = vec![3.0; 8];
        deviation[5] = 4.0;
        let exact = series(100.0, &[0.0; 8], &deviation);
        let counts: Vec<usize> = expected_noise(&[&exact], 8).iter().map(|noise| noise.spread.count).collect();
        // Two nights show a repetition, and the sixth ends it.
        assert_eq!(counts, [0, 0, 10, 10, 10, 10, 0, 0]);
        assert_eq!(expected_noise(&[&exact], 8)[3].spread.squares, 0.0);
    }
}
