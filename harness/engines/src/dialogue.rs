//! Talks with a driver in a renderer's own interpreter: how large a block is, which blocks, and what their readings are.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use luxproof_scene::Transport;

use super::blocks::{Blocks, DIRECT_SHARE, MIN_BLOCKS, Sampling, WORST_OF_FEW, counted, longest_block_s};
use super::contract::same_meters;
use super::effort;
use super::frame::Frame;
use super::{EngineError, Job, JobDir, Measurement};
use luxproof_model::{EngineName, Estimate, Uncertainty};
use luxproof_process::process::Conversation;
use luxproof_spec::Budget;

/// What drivers share, beside theirs.
pub(super) const BLOCKS: &str = include_str!("../drivers/blocks.py");
/// What a driver reads of a scene's folder.
pub(super) const JOB_FILE: &str = "job.json";
/// For a standard error that is itself good to 18 %; the fewer, the larger they are, and the more strata gain (benchmarks/efficiency.md).
const ENOUGH_BLOCKS: usize = 2 * MIN_BLOCKS;
/// Strata along a side at least, so that blocks are many strata and their errors near normal; at most, to check often.
const MIN_SIDE: usize = 32;
const MAX_SIDE: usize = 256;
/// Seconds that a further look takes, whatever it samples: blocks that all take less are twice as fine, so that fewer meters need one.
const LOOK_S: f64 = 0.2;
/// Blocks of a trial, and strata along a side of each at most. Where they promise too much, further blocks make up for it.
const TRIAL_BLOCKS: usize = MIN_BLOCKS;
const TRIAL_SIDE: usize = 64;

/// What a ray takes, as its engine counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cost {
    /// Seconds for a ray.
    pub(super) ray_s: f64,
    /// Strata along a side of the trial where a path costs much.
    pub(super) trial_side: Option<usize>,
}

/// A meter, as drivers read it.
#[derive(Serialize)]
pub(super) struct MeterPlacement<'a> {
    id: &'a str,
    position: [f64; 3],
    normal: [f64; 3],
}

/// Returns a job's meters as drivers read them.
pub(super) fn placements<'a>(job: &'a Job, frame: &Frame) -> impl Iterator<Item = MeterPlacement<'a>> {
    job.sensors.iter().map(move |sensor| MeterPlacement {
        id: &sensor.id.0,
        position: frame.to_scene(sensor.meter.position_m).to_array(),
        normal: sensor.meter.normal.to_array(),
    })
}

/// Which light a driver is asked for.
pub(super) const fn transport(job: &Job) -> &'static str {
    match job.transport {
        Transport::Direct => "direct",
        Transport::Indirect(_) => "indirect",
        Transport::Total(_) => "total",
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Hello {
    versions: BTreeMap<String, String>,
    variant: String,
    /// Rays in flight at most.
    lanes: usize,
    sensors: Vec<String>,
    /// How far each meter's unit normal is from its own; nothing where that is a matter of rounding alone.
    #[serde(default)]
    normals_off: Vec<f64>,
    parts: Vec<Part>,
}

impl Hello {
    fn normal_off(&self, sensor: usize) -> f64 {
        self.normals_off.get(sensor).copied().unwrap_or(0.0)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Part {
    name: String,
    /// Rays of a block of one sample: meters, times emitters where each is sampled.
    rays: usize,
    sampled: bool,
}

/// A job, which requests follow.
#[derive(Serialize)]
struct Begin {
    job: PathBuf,
    threads: usize,
}

#[derive(Serialize)]
struct Request<'a> {
    part: &'a str,
    side: usize,
    seeds: Vec<Option<[u64; 3]>>,
}

#[derive(Clone, Copy)]
enum Stream {
    Reflected = 0,
    Direct = 1,
    Trial = 2,
}

/// A conversation with a driver, and what its engine knows of its readings.
pub(super) struct Dialogue<'a> {
    pub(super) engine: EngineName,
    pub(super) job: &'a Job,
    pub(super) workbench: &'a JobDir,
    pub(super) conversation: Conversation,
    /// How many blocks of how many samples along a side, whatever the budget.
    pub(super) fixed: Option<(usize, usize)>,
    /// When no more samples are begun.
    pub(super) until: Instant,
    /// Returns the cost of a ray of a variant.
    pub(super) cost: &'a dyn Fn(&str) -> Cost,
    /// Returns the bound of direct light at a sensor with a unit normal that is off by the given amount.
    pub(super) bound_lx: &'a dyn Fn(usize, f64) -> f64,
    /// Bound of sampled light, in parts of the reading.
    pub(super) relative_bound: f64,
    /// Further bound of reflected light: the share of the flux that goes elsewhere.
    pub(super) misled: f64,
}

impl Dialogue<'_> {
    pub(super) fn measurement(mut self) -> Result<Measurement, EngineError> {
        let begin = Begin { job: self.workbench.scene_dir.join(JOB_FILE), threads: self.workbench.jobs.max(1) };
        let greeting: Hello = self.exchange(&begin)?;
        same_meters(&self.engine, self.job, greeting.sensors.iter().map(String::as_str))?;
        let (found, wanted) = (greeting.normals_off.len(), greeting.sensors.len());
        if found != 0 && found != wanted {
            return Err(EngineError::output(self.engine.clone(), format!("gave {found} normals for {wanted} meters")));
        }
        let mut found =
            Measurement { estimates: vec![Estimate::DARK; self.job.sensors.len()], ..Measurement::default() };
        let versions = greeting.versions.iter().map(|(k, v)| (format!("version_{k}"), v.clone()));
        found.effort = [("seed", self.job.seed)].into();
        found.method = versions.chain([("variant".to_owned(), greeting.variant.clone())]).collect();
        for part in &greeting.parts {
            let of_part = if part.sampled {
                self.sampled(part, &greeting, &mut found)?
            } else {
                self.determined(part, &greeting)?
            };
            found.estimates.iter_mut().zip(of_part).for_each(|(sum, part)| *sum = sum.plus(&part));
        }
        self.conversation.end()?;
        Ok(found)
    }

    /// Reads direct light of points without sampling. Its only error is the rounding of 32-bit floats.
    fn determined(&mut self, part: &Part, greeting: &Hello) -> Result<Vec<Estimate>, EngineError> {
        let block = self.ask(&Request { part: &part.name, side: 1, seeds: vec![None] })?.concat();
        let values = block.into_iter().enumerate();
        let bounded = values.map(|(k, value)| {
            let uncertainty = Uncertainty::Bound((self.bound_lx)(k, greeting.normal_off(k)));
            Estimate { value, uncertainty }
        });
        Ok(bounded.collect())
    }

    /// Reads blocks of a sampled part of the light.
    fn sampled(
        &mut self,
        part: &Part,
        greeting: &Hello,
        found: &mut Measurement,
    ) -> Result<Vec<Estimate>, EngineError> {
        let stream = if part.name == "direct" { Stream::Direct } else { Stream::Reflected };
        let budget = counted(self.job.budget, share(part, greeting));
        let (side, rule) = match self.fixed {
            None => self.plan(part, greeting, budget)?,
            Some((blocks, side)) => {
                let block_s = self.sample_s(part, greeting) * (side * side) as f64;
                (side, Sampling::fixed(blocks, budget, block_s, self.until))
            }
        };
        let mut read = rule.run(|numbers| self.blocks(part, side, stream, numbers))?;
        read.remark = read.remark.map(|why| format!("{}: {why}", part.name));
        let samples = side * side * part.rays / self.job.sensors.len().max(1);
        let of_part = [("blocks", read.blocks.count()), ("samples_a_meter_and_block", samples)];
        found.effort.extend(of_part.map(|(key, value)| (format!("{}_{key}", part.name), value.to_string())));
        let mut estimates = found.take(read);
        for (k, estimate) in estimates.iter_mut().enumerate() {
            let (value, normal_off) = (estimate.value.abs(), greeting.normal_off(k));
            let bound_lx = match stream {
                Stream::Direct => (self.bound_lx)(k, normal_off) + self.relative_bound * value,
                // For light from all directions, a turned meter gains on one side what it loses on the other.
                Stream::Reflected | Stream::Trial => (self.relative_bound + self.misled + 2.0 * normal_off) * value,
            };
            estimate.uncertainty = estimate.uncertainty.within(bound_lx);
        }
        Ok(estimates)
    }

    /// Chooses the samples along a side of a block.
    ///
    /// A block has at most as many rays as the driver traces at once. About [`ENOUGH_BLOCKS`] blocks reach the error and fit in the time.
    fn plan(
        &mut self,
        part: &Part,
        greeting: &Hello,
        budget: Budget,
    ) -> Result<(usize, Sampling<'static>), EngineError> {
        let full = (greeting.lanes / part.rays.max(1)).isqrt().clamp(2, MAX_SIDE);
        let trial_side = (self.cost)(&greeting.variant).trial_side.unwrap_or(TRIAL_SIDE).min(full / 2).max(2);
        let begun = Instant::now();
        let trials = self.blocks(part, trial_side, Stream::Trial, 0..TRIAL_BLOCKS)?;
        let sample_s = self.sample_s(part, greeting);
        let counted_s = sample_s * (TRIAL_BLOCKS * trial_side * trial_side) as f64;
        let longest_s = longest_block_s(begun.elapsed(), counted_s, self.until);
        // Blocks as large as the trial's take no longer than the trial did, and smaller ones show too little of their error.
        let affordable = side_within(budget.seconds / ENOUGH_BLOCKS as f64, sample_s)
            .min(side_within(longest_s, sample_s).max(trial_side));
        // The error is that of the blocks' mean, and m x m strata are at least as good as m x m independent samples.
        let excess = Blocks::new(trials).worst_error(&[]) / budget.relative_error;
        let fewer = TRIAL_BLOCKS as f64 / ENOUGH_BLOCKS as f64;
        let needed = trial_side as f64 * excess * (fewer / WORST_OF_FEW).sqrt();
        // A luminaire that is off adds a ray of direct light, which must not change the side.
        let finest = if part.name == "direct" { MIN_SIDE } else { 2 * MIN_SIDE };
        let least = side_within(LOOK_S / ENOUGH_BLOCKS as f64, sample_s).clamp(MIN_SIDE, finest);
        let side = (needed.ceil() as usize).max(least).min(full).min(affordable).max(2);
        let within = Sampling::within(budget, sample_s * (side * side) as f64, self.until);
        Ok((side, Sampling { enough_blocks: ENOUGH_BLOCKS, ..within }))
    }

    /// Returns the counted seconds of one sample of a part at every meter.
    fn sample_s(&self, part: &Part, greeting: &Hello) -> f64 {
        let rays = if part.name == "direct" { 1.0 } else { 2.0 * effort::path_length(self.job).max(1.0) };
        (self.cost)(&greeting.variant).ray_s * part.rays as f64 * rays * effort::a_ray(self.job)
    }

    fn blocks(
        &mut self,
        part: &Part,
        side: usize,
        stream: Stream,
        numbers: std::ops::Range<usize>,
    ) -> Result<Vec<Vec<f64>>, EngineError> {
        let seeds = numbers.map(|k| Some([self.job.seed, stream as u64, k as u64])).collect();
        self.ask(&Request { part: &part.name, side, seeds })
    }

    /// Sends one line to the driver and returns its answer.
    fn exchange<T: DeserializeOwned>(&mut self, line: &impl Serialize) -> Result<T, EngineError> {
        let line = serde_json::to_string(line).map_err(|e| EngineError::output(self.engine.clone(), e.to_string()))?;
        let answer = self.conversation.ask(&line)?;
        serde_json::from_str(&answer).map_err(|e| EngineError::no_readings(self.engine.clone(), &answer, &e))
    }

    fn ask(&mut self, request: &Request<'_>) -> Result<Vec<Vec<f64>>, EngineError> {
        let blocks: Vec<Vec<f64>> = self.exchange(request)?;
        let (found, wanted) = (blocks.len(), request.seeds.len());
        if found != wanted {
            return Err(EngineError::output(self.engine.clone(), format!("gave {found} blocks of {wanted}")));
        }
        let wanted = self.job.sensors.len();
        match blocks.iter().find(|block| block.len() != wanted) {
            Some(block) => {
                let what = format!("gave {} readings for {wanted} meters", block.len());
                Err(EngineError::output(self.engine.clone(), what))
            }
            None => Ok(blocks),
        }
    }
}

/// Returns how many samples along a side of a block fit in its seconds.
fn side_within(block_s: f64, sample_s: f64) -> usize {
    ((block_s / sample_s) as usize).isqrt()
}

/// Returns a part's share of the seconds of the budget.
fn share(part: &Part, greeting: &Hello) -> f64 {
    let is_only_part = greeting.parts.iter().filter(|part| part.sampled).count() < 2;
    match (is_only_part, part.name.as_str()) {
        (true, _) => 1.0,
        (false, "direct") => DIRECT_SHARE,
        (false, _) => 1.0 - DIRECT_SHARE,
    }
}
