//! A monitor of one group of series: it predicts each night from those before, and reports steps, drifts and outlying nights.
//!
//! A night that goes far waits for the next. If that departs likewise, both belong to a step. Otherwise the night does not count
//! in the sums and in the level, and where chance does not go so far it is reported as an outlier. After a step the new level is that of the nights
//! since its date, and the noise is what it was; so a return is found as soon as the step.

use std::ops::Range;

use super::change::{Course, Part};
use super::drift::{Kink, Trend};
use super::innovation::{Innovation, Noise, RunningMean};
use super::limits::{Limits, REFERENCE_VALUE, WINDOW_NIGHTS};
use super::series::Series;

/// So many nights after it is noticed, a step may still turn out to be the beginning of a drift.
const SETTLING_NIGHTS: usize = 14;
/// Until so many nights are known, the level after a step is uncertain, as it rests on nights that were chosen for being unusual. A
/// further change then needs so many times the sum.
const FIRM_NIGHTS: usize = 14;
const UNFIRM_FACTOR: f64 = 1.25;
/// A night with a deviate beyond this waits for the next: seven of ten thousand nights by chance.
const MIN_WAITING_DEVIATE: f64 = 3.4;
/// The night after such a night confirms a step if its deviate is at least so large.
const MIN_CONFIRMING_DEVIATE: f64 = 2.0;
/// It must also have at least this part of the outlying night's innovation.
const MIN_CONFIRMING_PART: f64 = 1.0 / 3.0;

/// A change of one group.
pub(super) struct Alarm {
    pub(super) night: usize,
    pub(super) noticed: usize,
    pub(super) course: Course,
    /// The cases that show a drift independently.
    pub(super) seen_in: Vec<Part>,
}

/// An exceeded limit: the estimated night of the change, and the night on which it is noticed.
#[derive(Clone, Copy)]
struct Signal {
    night: usize,
    noticed: usize,
}

/// A drift with the trend that shows it.
struct FoundDrift<'t> {
    trend: &'t Trend,
    noticed: usize,
    kink: Kink,
}

/// A night with its normal deviate.
type Deviate = (usize, f64);

/// Watches one group of series.
pub(super) struct GroupMonitor<'a> {
    pub(super) limits: Limits,
    /// The noise that is expected before each night, by similar comparisons or by stated errors.
    pub(super) expected: &'a [Noise],
}

impl GroupMonitor<'_> {
    /// The changes of the group.
    pub(super) fn alarms(&self, members: &[&Series], nights: usize) -> Vec<Alarm> {
        let mut found: Vec<Alarm> = vec![];
        let (mut start, mut watched, mut earlier_step) = (0, 0, None);
        let mut noise = Noise::default();
        loop {
            let firm = if watched > start { start + FIRM_NIGHTS } else { 0 };
            let mut segment = Segment::new(self, members, noise, Sums::new(self.limits, firm));
            let signal = segment.first_signal(start..nights, watched);
            for night in &segment.outliers {
                let course = step_course(&Trend::new(members, start, *night, nights), *night..*night + 1);
                let Course::Step { standard_errors, relative } = course else { continue };
                let course = Course::Outlier { standard_errors, relative };
                found.push(Alarm { night: *night, noticed: *night, course, seen_in: vec![] });
            }
            noise = segment.noise;
            let Some(Signal { night, noticed }) = signal else { break };
            let trend = Trend::new(members, start, night, nights);
            // Two steps in a row may be one drift that is too slow to be found from either step.
            let longer = earlier_step.map(|(start, night)| Trend::new(members, start, night, nights));
            let settling = noticed..nights.min(noticed + SETTLING_NIGHTS);
            if let Some(drift) = find_drift(&trend, longer.as_ref(), settling) {
                // A drift in the longer trend replaces the step before.
                if drift.trend.start < start {
                    remove_last_step(&mut found);
                }
                let mut sums = Sums::new(self.limits, 0);
                let mut deviates = drift.trend.line_deviates(&drift.kink, drift.noticed + 1);
                let end = deviates.find_map(|(night, deviate)| sums.add(night, deviate));
                (start, watched) = end.map_or((nights, nights), |end| (end.night, end.noticed + 1));
                earlier_step = None;
                found.push(drift_alarm(members, &drift, end.map(|end| end.night), nights));
            } else {
                let course = step_course(&trend, night..noticed + 1);
                found.push(Alarm { night, noticed, course, seen_in: vec![] });
                earlier_step = Some((start, night));
                (start, watched) = (night, noticed + 1);
            }
        }
        found
    }
}

/// The nights since the last change: what they have shown, and the sums of what they did not predict.
struct Segment<'a> {
    monitor: &'a GroupMonitor<'a>,
    members: &'a [&'a Series],
    means: Vec<RunningMean>,
    noise: Noise,
    /// The innovations since the sums were last zero. They may belong to a change, so the noise does not count them yet.
    unsettled: Vec<(usize, Innovation)>,
    sums: Sums,
    outliers: Vec<usize>,
}

impl<'a> Segment<'a> {
    fn new(monitor: &'a GroupMonitor<'a>, members: &'a [&'a Series], noise: Noise, sums: Sums) -> Self {
        let means = vec![RunningMean::default(); members.len()];
        Self { monitor, members, means, noise, unsettled: vec![], sums, outliers: vec![] }
    }

    /// The first change on the watched nights; the nights before them only give the level.
    fn first_signal(&mut self, nights: Range<usize>, watched: usize) -> Option<Signal> {
        let mut waiting: Option<(usize, Innovation)> = None;
        for night in nights {
            let innovation = self.innovation(night);
            // A night that waits is not part of the noise that judges the next.
            let known = waiting.map_or(night, |(outlying, _)| outlying);
            let deviate = innovation.and_then(|i| self.noise.deviate(self.monitor.expected.get(known), i));
            let (Some(innovation), Some(deviate), true) = (innovation, deviate, night >= watched) else {
                self.learn_level(night);
                if let Some(innovation) = innovation {
                    self.noise.update(self.monitor.expected.get(night), innovation);
                }
                continue;
            };
            if let Some((outlying, its_innovation)) = waiting.take() {
                let part = innovation.0 / its_innovation.0;
                if deviate.abs() >= MIN_CONFIRMING_DEVIATE && part >= MIN_CONFIRMING_PART {
                    let limit = MIN_WAITING_DEVIATE.copysign(its_innovation.0);
                    if let Some(signal) = self.watch(outlying, its_innovation, limit) {
                        return Some(signal);
                    }
                } else {
                    self.set_aside(outlying, its_innovation);
                }
            } else if deviate.abs() > MIN_WAITING_DEVIATE {
                waiting = Some((night, innovation));
                continue;
            }
            if let Some(signal) = self.watch(night, innovation, deviate) {
                return Some(signal);
            }
        }
        if let Some((night, innovation)) = waiting {
            self.set_aside(night, innovation);
        }
        None
    }

    /// Reports a night as an outlier where chance does not go so far; else only the noise counts it.
    fn set_aside(&mut self, night: usize, innovation: Innovation) {
        let expected = self.monitor.expected.get(night);
        let deviate = self.noise.deviate(expected, innovation);
        if deviate.is_some_and(|deviate| deviate.abs() > self.monitor.limits.night) {
            self.outliers.push(night);
        } else {
            self.noise.update(expected, innovation);
        }
    }

    /// The innovation of the group on a night.
    fn innovation(&self, night: usize) -> Option<Innovation> {
        let of_members = self.members.iter().zip(&self.means);
        Innovation::of_group(of_members.filter_map(|(series, mean)| mean.innovation(series, night)))
    }

    /// Adds a night to the means of the members.
    fn learn_level(&mut self, night: usize) {
        for (series, mean) in self.members.iter().zip(&mut self.means) {
            mean.update(series, night);
        }
    }

    /// Adds a night to the sums and, when nothing is suspected any more, to what is known of the noise.
    fn watch(&mut self, night: usize, innovation: Innovation, deviate: f64) -> Option<Signal> {
        self.learn_level(night);
        self.unsettled.push((night, innovation));
        let signal = self.sums.add(night, deviate);
        // Without a change all nights are noise; with one, those before its date.
        let end = signal.map_or(if self.sums.are_zero() { night + 1 } else { 0 }, |signal| signal.night);
        self.unsettled.retain(|(night, innovation)| {
            if *night < end {
                self.noise.update(self.monitor.expected.get(*night), *innovation);
            }
            *night >= end
        });
        signal
    }
}

/// The cumulative sums of deviates upwards and downwards, and those of the last nights.
struct Sums {
    limits: Limits,
    deviates: Vec<Deviate>,
    totals: [f64; 2],
    /// The number of nights when each sum was last zero.
    zero: [usize; 2],
    /// The first night on which the level is certain.
    firm: usize,
}

impl Sums {
    const fn new(limits: Limits, firm: usize) -> Self {
        Self { limits, deviates: vec![], totals: [0.0; 2], zero: [0; 2], firm }
    }

    /// Adds a night; a signal where a limit is exceeded.
    fn add(&mut self, night: usize, deviate: f64) -> Option<Signal> {
        // One night is no change.
        let deviate = deviate.clamp(-MIN_WAITING_DEVIATE, MIN_WAITING_DEVIATE);
        self.deviates.push((night, deviate));
        let is_firm = night >= self.firm;
        let limit = if is_firm { self.limits.sum } else { UNFIRM_FACTOR * self.limits.sum };
        for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
            self.totals[side] += sign * deviate - REFERENCE_VALUE;
            if self.totals[side] <= 0.0 {
                (self.totals[side], self.zero[side]) = (0.0, self.deviates.len());
            } else if self.totals[side] > limit {
                return Some(Signal { night: likeliest_night(&self.deviates[self.zero[side]..]), noticed: night });
            }
        }
        let last = &self.deviates[self.deviates.len().saturating_sub(WINDOW_NIGHTS)..];
        let is_exceeded = self.limits.are_exceeded_by(last.iter().map(|(_, deviate)| *deviate));
        (is_firm && is_exceeded).then(|| Signal { night: likeliest_night(last), noticed: night })
    }

    fn are_zero(&self) -> bool {
        self.totals == [0.0; 2]
    }
}

/// How far the level of these nights is from that before.
fn step_course(trend: &Trend, nights: Range<usize>) -> Course {
    let moved = trend.step(nights);
    Course::Step { standard_errors: moved * trend.standard_errors, relative: moved * trend.relative }
}

/// Takes the last step off the list; outliers since then stay.
fn remove_last_step(found: &mut Vec<Alarm>) {
    if let Some(last) = found.iter().rposition(|alarm| matches!(alarm.course, Course::Step { .. })) {
        found.remove(last);
    }
}

/// Looks for a drift on each of these nights, in the trend since the last change and in the longer one.
fn find_drift<'t>(trend: &'t Trend, longer: Option<&'t Trend>, nights: Range<usize>) -> Option<FoundDrift<'t>> {
    for night in nights {
        if let Some(kink) = trend.drift(night + 1, 1) {
            return Some(FoundDrift { trend, noticed: night, kink });
        }
        let of_longer = longer.and_then(|longer| Some((longer, longer.drift(night + 1, 2)?)));
        if let Some((trend, kink)) = of_longer {
            return Some(FoundDrift { trend, noticed: night, kink });
        }
    }
    None
}

/// A drift with its slope over all its nights, and the cases that show it independently.
fn drift_alarm(members: &[&Series], drift: &FoundDrift<'_>, until: Option<usize>, nights: usize) -> Alarm {
    let end = until.unwrap_or(nights);
    // More nights fix the line better, unless they no longer lie on it.
    let longer = drift.trend.line(end).filter(|line| line.slope.abs() > line.half_width && line.night <= drift.noticed);
    let line = longer.unwrap_or(drift.kink);
    let night = line.night + 1;
    let [a_night, half_width] = [line.slope, line.half_width].map(|v| v * drift.trend.relative);
    let mut seen_in = vec![];
    for case in members.chunk_by(|a, b| a.key.reading.case == b.key.reading.case) {
        if case.len() == members.len() {
            continue;
        }
        let of_case = Trend::new(case, drift.trend.start, night, nights).drift(end, 1);
        if of_case.is_some_and(|of_case| of_case.slope * line.slope > 0.0) {
            seen_in.push(Part { case: Some(case[0].key.reading.case.clone()), meter: None });
        }
    }
    Alarm { night, noticed: drift.noticed, course: Course::Drift { a_night, half_width, until }, seen_in }
}

/// The night from which the deviates are least likely to have a mean of zero.
fn likeliest_night(deviates: &[Deviate]) -> usize {
    let (mut best, mut sum) = ((0.0, 0), 0.0);
    for (count, (night, deviate)) in (1..).zip(deviates.iter().rev()) {
        sum += deviate;
        let evidence = sum * sum / f64::from(count);
        if evidence > best.0 {
            best = (evidence, *night);
        }
    }
    best.1
}

#[cfg(test)]
mod tests;
