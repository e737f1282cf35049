//! Talks with the driver in Mitsuba's interpreter: how large a block is, which blocks, and what their readings are.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::ID;
use super::precision::FloatError;
use super::settings::{FIXED_BLOCKS, FIXED_SIDE, Settings};
use crate::engines::blocks::{Blocks, Sampling};
use crate::engines::contract::same_meters;
use crate::engines::effort;
use crate::engines::settings::Preset;
use crate::engines::{EngineError, Job, Measurement};
use crate::record::{Estimate, Uncertainty};
use crate::system::process::Conversation;

/// For a standard error that is itself good to 13 %.
const ENOUGH_BLOCKS: usize = 32;
/// Strata along a side at least, so that blocks are many strata and their errors near normal; at most, to check often.
const MIN_SIDE: usize = 64;
const MAX_SIDE: usize = 256;
/// The same of the trial where no kernels are compiled and a path costs much.
const SCALAR_TRIAL_SIDE: usize = 2;
/// The spread of two blocks is a rough guess of the error of one.
const PLAN_MARGIN: f64 = 2.0;

/// Seconds that are counted for a ray: on two cores of a usual server, half as much again as was measured there.
const RAY_S: f64 = 2e-7;
const SCALAR_RAY_S: f64 = 1e-4;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Greeting {
    versions: BTreeMap<String, String>,
    variant: String,
    /// Rays in flight at most.
    lanes: usize,
    stations: Vec<String>,
    parts: Vec<Part>,
}

impl Greeting {
    /// Whether no kernels are compiled, and a path costs much.
    fn is_scalar(&self) -> bool {
        self.variant.starts_with("scalar")
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

pub(super) struct Driver<'a> {
    pub(super) job: &'a Job,
    pub(super) settings: &'a Settings,
    pub(super) conversation: Conversation,
}

impl Driver<'_> {
    pub(super) fn measurement(mut self) -> Result<Measurement, EngineError> {
        let greeting: Greeting = parse(&self.conversation.listen()?)?;
        same_meters(&ID, self.job, greeting.stations.iter().map(String::as_str))?;
        let mut found =
            Measurement { estimates: vec![Estimate::DARK; self.job.stations.len()], ..Measurement::default() };
        let versions = greeting.versions.iter().map(|(k, v)| (format!("version_{k}"), v.clone()));
        found.effort = [("seed", self.job.seed)].into();
        found.method = versions.chain([("variant".to_owned(), greeting.variant.clone())]).collect();
        for part in &greeting.parts {
            let of_part =
                if part.sampled { self.sampled(part, &greeting, &mut found)? } else { self.determined(part)? };
            found.estimates.iter_mut().zip(of_part).for_each(|(sum, part)| *sum = sum.plus(&part));
        }
        self.conversation.end()?;
        Ok(found)
    }

    /// Direct light of points: what is left is the rounding of 32-bit floats.
    fn determined(&mut self, part: &Part) -> Result<Vec<Estimate>, EngineError> {
        let block = self.ask(&Request { part: &part.name, side: 1, seeds: vec![None] })?.concat();
        let error = FloatError::of(self.job, self.settings);
        let bound = |k| Uncertainty::Bound(error.at_lx(k));
        Ok(block.into_iter().enumerate().map(|(k, value)| Estimate { value, uncertainty: bound(k) }).collect())
    }

    fn sampled(
        &mut self,
        part: &Part,
        greeting: &Greeting,
        found: &mut Measurement,
    ) -> Result<Vec<Estimate>, EngineError> {
        let stream = if part.name == "direct" { Stream::Direct } else { Stream::Reflected };
        let (side, rule) = match self.settings.preset {
            Preset::Audit => self.plan(part, greeting)?,
            Preset::Fast | Preset::Default => {
                let block_s = self.sample_s(part, greeting) * (FIXED_SIDE * FIXED_SIDE) as f64;
                (FIXED_SIDE, Sampling::fixed(FIXED_BLOCKS, self.job.budget, block_s))
            }
        };
        let mut read = rule.run(|numbers| self.blocks(part, side, stream, numbers))?;
        read.remark = read.remark.map(|why| format!("{}: {why}", part.name));
        let samples = side * side * part.rays / self.job.stations.len().max(1);
        let of_part = [("blocks", read.blocks.count()), ("samples_a_meter_and_block", samples)];
        found.effort.extend(of_part.map(|(key, value)| (format!("{}_{key}", part.name), value.to_string())));
        Ok(found.take(read))
    }

    /// Samples along a side of a block so that a block fills the rays in flight at most, and enough blocks about reach the
    /// error and fit in the time.
    fn plan(&mut self, part: &Part, greeting: &Greeting) -> Result<(usize, Sampling<'static>), EngineError> {
        let full = (greeting.lanes / part.rays.max(1)).isqrt().clamp(2, MAX_SIDE);
        let trial_side = if greeting.is_scalar() { SCALAR_TRIAL_SIDE } else { full };
        let trials = self.blocks(part, trial_side, Stream::Trial, 0..2)?;
        let (sample_s, budget) = (self.sample_s(part, greeting), self.job.budget);
        let affordable = ((budget.seconds / ENOUGH_BLOCKS as f64 / sample_s) as usize).isqrt();
        // The error is that of the mean of two; m x m samples are at least as good as m x m independent ones.
        let excess = Blocks::new(trials).worst_error(&[]) / budget.relative_error;
        let needed = trial_side as f64 * PLAN_MARGIN * excess * (2.0 / ENOUGH_BLOCKS as f64).sqrt();
        let side = (needed.ceil() as usize).max(MIN_SIDE).min(full).min(affordable).max(2);
        let within = Sampling::within(budget, sample_s * (side * side) as f64);
        Ok((side, Sampling { enough_blocks: ENOUGH_BLOCKS, ..within }))
    }

    /// Seconds that are counted for one sample of a part at every meter.
    fn sample_s(&self, part: &Part, greeting: &Greeting) -> f64 {
        let rays = if part.name == "direct" { 1.0 } else { 2.0 * effort::path_length(self.job).max(1.0) };
        let ray_s = if greeting.is_scalar() { SCALAR_RAY_S } else { RAY_S };
        ray_s * part.rays as f64 * rays * effort::a_ray(self.job)
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

    fn ask(&mut self, request: &Request<'_>) -> Result<Vec<Vec<f64>>, EngineError> {
        let line = serde_json::to_string(request).map_err(|e| EngineError::output(ID, e.to_string()))?;
        let blocks: Vec<Vec<f64>> = parse(&self.conversation.ask(&line)?)?;
        let (found, wanted) = (blocks.len(), request.seeds.len());
        if found != wanted {
            return Err(EngineError::output(ID, format!("gave {found} blocks of {wanted}")));
        }
        let wanted = self.job.stations.len();
        match blocks.iter().find(|block| block.len() != wanted) {
            Some(block) => Err(EngineError::output(ID, format!("gave {} readings for {wanted} meters", block.len()))),
            None => Ok(blocks),
        }
    }
}

fn parse<'de, T: Deserialize<'de>>(line: &'de str) -> Result<T, EngineError> {
    serde_json::from_str(line).map_err(|e| EngineError::no_readings(ID, line, &e))
}
