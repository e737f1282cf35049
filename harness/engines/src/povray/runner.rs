//! Runs POV-Ray: direct light in a few looks of rising magnification, reflected light in blocks until the budget is met.

use std::collections::BTreeMap;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use parking_lot::Mutex;

use crate::blocks::{BELIEVED_BLOCKS, MIN_BLOCKS, Sampling, counted, longest_block_s};
use crate::image::read_rgb;
use crate::libraries::with_unpacked;
use crate::settings::Preset;
use crate::{EngineError, EngineRoot, Job, JobDir, Measurement, SceneFile, geometry_mib, recess};
use luxproof_model::{Effort, Estimate, Method, Uncertainty};
use luxproof_process::process::Invocation;
use luxproof_process::random::seed;
use luxproof_process::slots::side_by_side;

use super::ID;
use super::direct_error::DirectError;
use super::export::{self, Light};
use super::frame::{self, Frame};
use super::pixels::{self, PixelValue, Readout};
use super::settings::{Settings, Term, own_term, pool};
use super::shared_precompute::Ground;
use super::work::Work;

/// Rays a sample at least, where the budget is short.
const MIN_RAYS: f64 = 25.0;
/// Seconds that are counted for the test of a ray against a shape, and how many times what was measured on two cores of a usual server they are.
const TEST_S: f64 = 1.1e-7;
const COUNTED: f64 = 1.5;
/// Rays a sample of the block that is looked at first, at most: the fewest of the audit preset.
const PILOT_RAYS: u32 = 35;
/// What a pilot's frames resolve, relative, so that it is as good as any block.
const RESOLVED: f64 = 5e-4;
/// The part of the time that the fewest blocks may take.
const FIRST_BLOCKS: f64 = 0.9;
/// Processes for each thread at most: one that is started alone sleeps most of .7 s, waiting for its own threads in steps of 50 ms. Of those that
/// hold large meshes, no more than take as much memory as so many without, and as many as sleep little all the same.
const SIDE_BY_SIDE: u64 = 12;
const LARGE_SIDE_BY_SIDE: u64 = 3;
/// Of some 60 MiB without bodies.
const PROCESS_MIB: u64 = 86;
/// What a process sleeps, once and for each further frame, and what it computes before its rays, in seconds.
pub(super) const SLEEP_S: f64 = 0.6;
const FRAME_SLEEP_S: f64 = 0.27;
const START_S: f64 = 0.05;
/// So many times as many processes as would compute on the mean, since the last ones of a wave run alone.
const SPARE: f64 = 2.0;
/// Looks at direct light at most: each narrows a reading by 1e3 at least.
const MAX_RUNS: usize = 10;
/// Below this share of its upper bound a reading is darkness.
const DARK: f64 = 1e-12;

pub(super) struct PovrayRunner<'a> {
    job: &'a Job,
    workbench: &'a JobDir,
    settings: &'a Settings,
    /// Point lights along each side of an opening.
    points: usize,
    /// The terms of a block.
    terms: Vec<Term>,
    program: PathBuf,
    /// When no more samples are begun.
    until: Instant,
}

pub(super) fn program(site: &EngineRoot) -> Result<PathBuf, EngineError> {
    let what = "povray is not installed".to_owned();
    site.program("povray").ok_or(EngineError::Solver { engine: ID, what })
}

/// An invocation that finds the libraries of an unpacked Debian package.
pub(super) fn hermetic(invocation: Invocation, site: &EngineRoot) -> Invocation {
    if invocation.program.starts_with(site.debian()) { with_unpacked(invocation, site) } else { invocation }
}

/// What a process takes at most.
pub(super) fn process_mib(job: &Job) -> u64 {
    PROCESS_MIB + geometry_mib(job)
}

/// Processes for each thread at most.
pub(super) fn side_by_side_at_most(job: &Job) -> usize {
    (SIDE_BY_SIDE * PROCESS_MIB / process_mib(job)).max(LARGE_SIDE_BY_SIDE) as usize
}

#[derive(Clone, Copy)]
struct Run {
    light: Light,
    seed: u32,
    count: u32,
    what: What,
}

/// The scene as it is, or terms of a block, each a frame of an animation.
#[derive(Clone, Copy, PartialEq)]
enum What {
    Scene,
    Block,
    Term(usize),
}

impl Run {
    fn blanks(self) -> usize {
        if self.light == Light::Direct || self.seed == 0 {
            0
        } else {
            export::blanks(self.seed, pool(self.count) / self.count)
        }
    }
}

impl<'a> PovrayRunner<'a> {
    pub(super) fn new(
        job: &'a Job,
        workbench: &'a JobDir,
        settings: &'a Settings,
        points: usize,
    ) -> Result<Self, EngineError> {
        let (program, until) = (program(&workbench.site)?, workbench.until());
        let terms = job.reflections().map_or_else(Vec::new, |bounces| settings.terms(bounces));
        Ok(Self { job, workbench, settings, points, terms, program, until })
    }

    /// Direct light: deterministic, read at rising magnification until the read-out no longer matters.
    pub(super) fn direct(&self) -> Result<Measurement, EngineError> {
        let run = Run { light: Light::Direct, seed: 0, count: self.settings.count, what: What::Scene };
        let first = export::first_readouts(self.job, Light::Direct);
        let mut looks: Vec<PixelState> = first.iter().map(|r| PixelState::Again(*r)).collect();
        let mut taken = 0;
        while let Some(k) = looks.iter().position(|l| matches!(l, PixelState::Again(_))) {
            if taken == MAX_RUNS {
                let id = &self.job.sensors[k].id;
                return Err(output(format!("direct light at {id} was not read after {MAX_RUNS} looks")));
            }
            taken += 1;
            let readouts: Vec<Readout> = looks.iter().map(PixelState::readout).collect();
            let seen = self.look(run, &readouts)?.frames.concat();
            for (k, look) in looks.iter_mut().enumerate() {
                if let PixelState::Again(readout) = *look {
                    if seen[k] == PixelValue::Missed {
                        return Err(self.missed(k));
                    }
                    *look = next_look(readout, seen[k], scale_of(first[k]));
                }
            }
        }
        let frame = Frame::of(self.job, self.settings.coordinates);
        let apart = recess::points_apart(self.job);
        let error = DirectError::of(self.job, &apart, frame, self.points)?;
        let disc_positions = frame::disc_positions(&apart, frame);
        let mut estimates = vec![];
        for ((look, sensor), disc) in looks.iter().zip(&self.job.sensors).zip(disc_positions) {
            let PixelState::Done { lx, resolution_lx } = *look else { continue };
            let bound = resolution_lx + error.at_lx(&sensor.meter, disc, lx);
            estimates.push(Estimate { value: lx, uncertainty: Uncertainty::Bound(bound) });
        }
        let effort = Effort::from([("passes", taken.to_string()), ("arguments", self.printed_arguments(run))]);
        Ok(Measurement { estimates, method: self.method(), effort, ..Measurement::default() })
    }

    pub(super) fn indirect(&self) -> Result<Measurement, EngineError> {
        let count = self.settings.count;
        let mut run = Run { light: Light::Indirect, seed: self.seed(0), count, what: What::Block };
        let mut pilot = self.pilot(Run { count: count.min(PILOT_RAYS), ..run })?;
        let longest_s = longest_block_s(pilot.wall, pilot.rendered_s, self.until);
        let budget = counted(self.job.budget, 1.0);
        let affordable_s = (FIRST_BLOCKS * budget.seconds / MIN_BLOCKS as f64).min(longest_s);
        let affordable = f64::from(pilot.rays) * pilot.work.times_in(affordable_s);
        let mut measurement = Measurement { method: self.method(), ..Measurement::default() };
        if affordable < f64::from(count) && self.settings.preset == Preset::Audit {
            run.count = affordable.max(MIN_RAYS) as u32;
            measurement.notes.push(format!("{} rays a sample instead of {count}: the budget is short", run.count));
        }
        let block_s = pilot.work.seconds(f64::from(run.count) / f64::from(pilot.rays));
        pilot.block = pilot.block.filter(|_| run.count == pilot.rays);
        if let Some(SeparateTerm { ground, .. }) = &mut pilot.separate_term
            && ground.blocks.is_empty()
        {
            ground.rays = run.count;
        }
        self.keep_readouts(&pilot.readouts)?;
        let rule = Sampling { enough_blocks: BELIEVED_BLOCKS, ..Sampling::within(budget, block_s, self.until) };
        let blocks = rule.run(|numbers| self.wave(run, numbers, &pilot, block_s))?;
        let made = blocks.blocks.count();
        measurement.estimates = measurement.take(blocks);
        let mut effort = Effort::from([
            ("arguments", self.printed_arguments(run)),
            ("blocks", made.to_string()),
            ("seeds", (0..made).map(|k| self.seed(pilot.place(k)).to_string()).collect::<Vec<_>>().join(" ")),
            ("count", run.count.to_string()),
        ]);
        if self.terms.len() > 1 {
            let counts: Vec<String> = self.terms.iter().map(|term| (term.times * run.count).to_string()).collect();
            effort.insert("counts_of_terms".into(), counts.join(" "));
        }
        measurement.effort = effort;
        let method = &mut measurement.method;
        method.insert("error_bound".into(), self.settings.error_bound.to_string());
        if self.settings.is_finer_for_rest() {
            method.insert("error_bound_of_rest".into(), self.settings.error_bound_of_rest.to_string());
        }
        method.insert("recursion_limit".into(), self.settings.recursion_limit.to_string());
        *self.workbench.shared_precompute.precomputed.lock() = pilot.precomputed();
        Ok(measurement)
    }

    /// A block that finds each meter's scale and how much work blocks are; the first of them, where it has as many rays as they.
    fn pilot(&self, run: Run) -> Result<Pilot, EngineError> {
        if let Some(own) = own_term(&self.terms)
            && let Some(pilot) = self.pilot_separate_term(run, own)?
        {
            return Ok(pilot);
        }
        let Survey { frames, works, wall, scales, .. } = self.survey(run, None)?;
        let terms: Vec<usize> = (0..self.terms.len()).collect();
        let (block, work) = (self.fine_sum(run, &terms, &frames)?, works.into_iter().sum::<Work>());
        let (readouts, rendered_s) = (coarse(&scales), work.seconds(1.0));
        Ok(Pilot { readouts, rays: run.count, work, rendered_s, wall, block, separate_term: None })
    }

    /// The same with scales that are those of all other terms, which other numbers of reflections share; nothing where they do not do for
    /// the term of its own. Whether the others are found here or were before makes no difference to what is read.
    fn pilot_separate_term(&self, run: Run, own: usize) -> Result<Option<Pilot>, EngineError> {
        let others: Vec<usize> = (0..self.terms.len()).filter(|k| *k != own).collect();
        let earlier = self.workbench.shared_precompute.earlier.as_ref();
        let earlier = earlier.and_then(|numbers| Ground::of_numbers(numbers, self.job.sensors.len()));
        let (ground, seen, own_work, rendered_s, wall) = if let Some(ground) = earlier {
            let (begun, readouts) = (Instant::now(), coarse(&ground.first_scales));
            self.keep_readouts(&readouts)?;
            let (frames, works) = self.separate_terms(run, &readouts, &[own])?;
            let work: Work = works.into_iter().sum();
            (ground, frames.concat(), work, work.seconds(1.0), begun.elapsed())
        } else {
            let Survey { mut frames, mut works, wall, first_scales, scales } = self.survey(run, Some(own))?;
            let (seen, own_work) = (frames.remove(own), works.remove(own));
            let work: Work = works.into_iter().sum();
            let first = self.fine_sum(run, &others, &frames)?;
            let ground = Ground { first_scales, scales, work, first, rays: run.count, blocks: vec![] };
            (ground, seen, own_work, (own_work + work).seconds(1.0), wall)
        };
        if !ground.has_room_for(&seen) {
            return Ok(None);
        }
        let block = match &ground.first {
            Some(first) if seen.iter().all(is_fine) => Some(self.added(run, first.clone(), &[own], &[seen])?),
            _ => None,
        };
        let (readouts, work) = (coarse(&ground.scales), ground.work + own_work);
        let separate_term = Some(SeparateTerm { own, own_work, ground, new: Mutex::default() });
        Ok(Some(Pilot { readouts, rays: run.count, work, rendered_s, wall, block, separate_term }))
    }

    /// All terms at scales that do for all but the one of its own.
    fn survey(&self, run: Run, own: Option<usize>) -> Result<Survey, EngineError> {
        let mut readouts = export::first_readouts(self.job, Light::Indirect);
        let upper: Vec<f64> = readouts.iter().map(|r| scale_of(*r)).collect();
        let terms: Vec<usize> = (0..self.terms.len()).collect();
        for _ in 0..MAX_RUNS {
            self.keep_readouts(&readouts)?;
            let (begun, first_scales) = (Instant::now(), readouts.iter().map(|r| scale_of(*r)).collect());
            let (frames, works) = self.separate_terms(run, &readouts, &terms)?;
            let wall = begun.elapsed();
            let (mut settled, mut brightest_lx) = (true, 0.0_f64);
            for k in 0..readouts.len() {
                let deciding = frames.iter().enumerate().filter(|(term, _)| Some(*term) != own);
                let scale = match PixelValue::brightest(deciding.map(|(_, frame)| frame[k])) {
                    // The blue channel holds a 1.5 times larger reading yet.
                    PixelValue::Value { lx, .. } => {
                        brightest_lx = brightest_lx.max(lx);
                        400.0 * lx
                    }
                    PixelValue::Below(limit) if limit < 1e-6 * upper[k] => scale_of(readouts[k]),
                    PixelValue::Below(limit) => {
                        settled = false;
                        4.0 * limit
                    }
                    PixelValue::Above => {
                        settled = false;
                        1e3 * scale_of(readouts[k])
                    }
                    PixelValue::Missed => return Err(self.missed(k)),
                };
                readouts[k] = Readout::Coarse(scale);
            }
            if settled {
                // A meter that one block sees in near darkness may be brighter by far in the next.
                let least = 0.4 * brightest_lx;
                let scales = readouts.iter().map(|r| scale_of(*r).max(least)).collect();
                return Ok(Survey { frames, works, wall, first_scales, scales });
            }
        }
        Err(output(format!("reflected light was not read after {MAX_RUNS} looks")))
    }

    /// Blocks, each a process of one thread.
    fn wave(&self, run: Run, numbers: Range<usize>, pilot: &Pilot, block_s: f64) -> Result<Vec<Vec<f64>>, EngineError> {
        let numbers: Vec<usize> = numbers.collect();
        let are_begun = numbers.iter().all(|k| *k == 0 && pilot.block.is_some() || pilot.others(run, *k).is_some());
        let (frames, part) = if are_begun { (1, pilot.own_part(run)) } else { (self.terms.len(), 1.0) };
        let run_s = part * block_s / COUNTED;
        let sleep_s = SLEEP_S + FRAME_SLEEP_S * frames.saturating_sub(1) as f64;
        // As many as compute while others sleep.
        let for_each_thread = (1.0 + SPARE * sleep_s / (START_S + run_s)).ceil() as usize;
        let side = for_each_thread.min(side_by_side_at_most(self.job)) * self.workbench.jobs.max(1);
        side_by_side(side, &numbers, |k| self.block(run, *k, pilot)).into_iter().collect()
    }

    /// What a block reads at each meter; the pilot may have rendered the first.
    fn block(&self, run: Run, number: usize, pilot: &Pilot) -> Result<Vec<f64>, EngineError> {
        if let Some(first) = pilot.block.as_ref().filter(|_| number == 0) {
            return Ok(first.clone());
        }
        let run = Run { seed: self.seed(pilot.place(number)), ..run };
        let terms: Vec<usize> = (0..self.terms.len()).collect();
        let dark = vec![0.0; self.job.sensors.len()];
        let Some(SeparateTerm { own, ground, new, .. }) = &pilot.separate_term else {
            return self.added(run, dark, &terms, &self.render(run, &pilot.readouts)?.frames);
        };
        if let Some(others) = pilot.others(run, number) {
            let run = Run { what: What::Term(*own), ..run };
            return self.added(run, others.to_vec(), &[*own], &self.render(run, &pilot.readouts)?.frames);
        }
        let mut frames = self.render(run, &pilot.readouts)?.frames;
        let seen = frames.remove(*own);
        let rest: Vec<usize> = terms.into_iter().filter(|k| k != own).collect();
        let others = self.added(run, dark, &rest, &frames)?;
        if ground.rays == run.count {
            new.lock().insert(pilot.place(number), others.clone());
        }
        self.added(run, others, &[*own], &[seen])
    }

    /// What is known of a block, and further terms of it.
    fn added(
        &self,
        run: Run,
        known: Vec<f64>,
        terms: &[usize],
        frames: &[Vec<PixelValue>],
    ) -> Result<Vec<f64>, EngineError> {
        let mut sum = known;
        for (term, seen) in terms.iter().zip(frames) {
            for (k, (sum, seen)) in sum.iter_mut().zip(seen).enumerate() {
                *sum += self.terms[*term].sign * self.value(k, *seen, run)?;
            }
        }
        Ok(sum)
    }

    /// The sum of terms where all of it is resolved as well as that of any block.
    fn fine_sum(&self, run: Run, terms: &[usize], frames: &[Vec<PixelValue>]) -> Result<Option<Vec<f64>>, EngineError> {
        let dark = vec![0.0; self.job.sensors.len()];
        frames.iter().flatten().all(is_fine).then(|| self.added(run, dark, terms, frames)).transpose()
    }

    fn value(&self, k: usize, seen: PixelValue, run: Run) -> Result<f64, EngineError> {
        match seen {
            PixelValue::Value { lx, .. } => Ok(lx),
            // None of a block's few rays met what little light there is; the spread of the blocks tells.
            PixelValue::Below(_) => Ok(0.0),
            PixelValue::Missed => Err(self.missed(k)),
            PixelValue::Above => {
                let id = &self.job.sensors[k].id;
                Err(output(format!("block {} reads {id} hundreds of times off the first block", run.seed)))
            }
        }
    }

    fn look(&self, run: Run, readouts: &[Readout]) -> Result<Rendered, EngineError> {
        self.keep_readouts(readouts)?;
        self.render(run, readouts)
    }

    fn keep_readouts(&self, readouts: &[Readout]) -> Result<(), EngineError> {
        let light = Frame::of(self.job, self.settings.coordinates).light;
        self.workbench.write(&[SceneFile::text("readouts.inc", export::readouts(readouts, light))])
    }

    fn render(&self, run: Run, readouts: &[Readout]) -> Result<Rendered, EngineError> {
        // Frames get their numbers before the ending.
        let seed = run.seed;
        let (image, images) = match self.frames(run.what) {
            Some(frames) => (format!("seed{seed}-.ppm"), frames.map(|k| format!("seed{seed}-{k}.ppm")).collect()),
            None => (format!("seed{seed}.ppm"), vec![format!("seed{seed}.ppm")]),
        };
        let invocation = self.workbench.invoke(&self.program).args(self.arguments(run, &image));
        let finished = hermetic(invocation, &self.workbench.site).run()?;
        let frames = images.iter().map(|image| Self::seen(run, &self.workbench.scene_dir.join(image), readouts));
        let frames = frames.collect::<Result<_, _>>()?;
        Ok(Rendered { frames, work_s: TEST_S * intersection_tests(&finished.stderr) })
    }

    /// The numbers of the frames of an animation, where there is one.
    fn frames(&self, what: What) -> Option<RangeInclusive<usize>> {
        match what {
            What::Scene => None,
            _ if self.terms.len() < 2 => None,
            What::Block => Some(1..=self.terms.len()),
            What::Term(k) => Some(k + 1..=k + 1),
        }
    }

    /// Terms of a block in as many processes, since frames that follow each other sleep after each other.
    fn separate_terms(
        &self,
        run: Run,
        readouts: &[Readout],
        terms: &[usize],
    ) -> Result<(Vec<Vec<PixelValue>>, Vec<Work>), EngineError> {
        let side = side_by_side_at_most(self.job) * self.workbench.jobs.max(1);
        let is_whole = self.terms.len() < 2;
        let whats = terms.iter().map(|k| if is_whole { What::Block } else { What::Term(*k) });
        let runs: Vec<Run> = whats.map(|what| Run { what, ..run }).collect();
        let all = side_by_side(side, &runs, |run| self.render(*run, readouts));
        let all: Vec<Rendered> = all.into_iter().collect::<Result<_, _>>()?;
        let works = terms.iter().zip(&all).map(|(k, rendered)| self.work(&self.terms[*k], rendered.work_s)).collect();
        Ok((all.into_iter().flat_map(|term| term.frames).collect(), works))
    }

    /// The work of a term, by whether it is one reflection.
    fn work(&self, term: &Term, seconds: f64) -> Work {
        let [first_s, further_s] = if self.reflections(term) == 1 { [seconds, 0.0] } else { [0.0, seconds] };
        Work { first_s, further_s }
    }

    fn reflections(&self, term: &Term) -> u32 {
        let most = self.job.reflections().map_or(1, |bounces| self.settings.recursion_limit(bounces));
        term.limit.map_or(most, |limit| limit.min(most))
    }

    fn seen(run: Run, image: &Path, readouts: &[Readout]) -> Result<Vec<PixelValue>, EngineError> {
        let pixels = read_rgb(&ID, image)?;
        std::fs::remove_file(image).map_err(|e| EngineError::io(image, e))?;
        let blanks = run.blanks();
        if pixels.len() != blanks + readouts.len() {
            let (found, wanted) = (pixels.len(), readouts.len());
            return Err(output(format!("gave {found} pixels for {wanted} meters and {blanks} blanks")));
        }
        Ok(readouts.iter().zip(pixels.into_iter().skip(blanks)).map(|(r, p)| pixels::decode(*r, p)).collect())
    }

    fn arguments(&self, run: Run, image: &str) -> Vec<String> {
        let mut arguments = export::arguments(self.job, run.light, run.seed, run.blanks(), image);
        arguments.extend([format!("Declare=Count={}", run.count), "Declare=Readouts=1".to_owned()]);
        if run.what != What::Scene {
            arguments.push("Declare=Block=1".to_owned());
        }
        if let Some(frames) = self.frames(run.what) {
            arguments.extend(["+KFI1".to_owned(), format!("+KFF{}", self.terms.len())]);
            if let What::Term(_) = run.what {
                arguments.extend([format!("+SF{}", frames.start()), format!("+EF{}", frames.end())]);
            }
        }
        arguments
    }

    /// The seed of a block; 0 would leave the scene unturned.
    ///
    /// Successive seeds would not do: the second number of POV-Ray's generator, the tilt of the scene, then moves by 1812433253^2 / 2^32 = .0206
    /// from block to block, so that the blocks of a run share most of their error and state too little of it.
    fn seed(&self, block: usize) -> u32 {
        seed(&[self.job.seed, block as u64])
    }

    fn printed_arguments(&self, run: Run) -> String {
        self.arguments(run, "image.ppm").join(" ")
    }

    fn method(&self) -> Method {
        [("preset", self.settings.preset.name())].into()
    }

    fn missed(&self, k: usize) -> EngineError {
        let id = &self.job.sensors[k].id;
        output(format!("the disc of {id} was not seen: something hides it from 2 mm away"))
    }
}

/// What POV-Ray's statistics count: tests of rays against shapes and the boxes around them, in rows that end in a share of successes.
fn intersection_tests(said: &str) -> f64 {
    said.lines().filter_map(tests_of_row).sum()
}

fn tests_of_row(line: &str) -> Option<f64> {
    let mut words = line.split_whitespace().rev();
    let [share, succeeded, tests] = [(); 3].map(|()| words.next().and_then(|w| w.parse::<f64>().ok()));
    (share? <= 100.0 && succeeded? <= tests?).then_some(tests?)
}

fn output(what: String) -> EngineError {
    EngineError::output(ID, what)
}

/// What a look at all terms shows.
struct Survey {
    frames: Vec<Vec<PixelValue>>,
    works: Vec<Work>,
    wall: Duration,
    /// Of this look, by meter, and of all that follow.
    first_scales: Vec<f64>,
    scales: Vec<f64>,
}

struct Pilot {
    readouts: Vec<Readout>,
    rays: u32,
    /// Of a block.
    work: Work,
    /// Seconds that are counted for what was rendered, and how long that took.
    rendered_s: f64,
    wall: Duration,
    /// What it reads at each meter, where that is one of the blocks.
    block: Option<Vec<f64>>,
    separate_term: Option<SeparateTerm>,
}

/// A term that is read apart from all others, which jobs of other numbers of reflections need, too.
struct SeparateTerm {
    own: usize,
    own_work: Work,
    ground: Ground,
    /// What is found of the others here, by a block's place in the sequence of seeds.
    new: Mutex<BTreeMap<usize, Vec<f64>>>,
}

impl Pilot {
    /// The place of a block in the sequence of seeds, of which the pilot's is the first.
    fn place(&self, block: usize) -> usize {
        block + usize::from(self.block.is_none())
    }

    /// What is known of a block.
    fn others(&self, run: Run, block: usize) -> Option<&[f64]> {
        let SeparateTerm { ground, .. } = self.separate_term.as_ref()?;
        ground.block(self.place(block)).filter(|_| ground.rays == run.count)
    }

    /// The part of a block's work that is the term's own.
    fn own_part(&self, run: Run) -> f64 {
        let times = f64::from(run.count) / f64::from(self.rays);
        let own_s = self.separate_term.as_ref().map_or(0.0, |apart| apart.own_work.seconds(times));
        own_s / self.work.seconds(times).max(f64::MIN_POSITIVE)
    }

    /// What others need, too, where more of it is known than before.
    fn precomputed(self) -> Option<Vec<f64>> {
        let SeparateTerm { mut ground, new, .. } = self.separate_term?;
        for (place, others) in new.into_inner() {
            if place == ground.blocks.len() + 1 {
                ground.blocks.push(others);
            }
        }
        Some(ground.numbers())
    }
}

struct Rendered {
    /// What each frame shows of the meters.
    frames: Vec<Vec<PixelValue>>,
    /// Seconds that are counted for all.
    work_s: f64,
}

#[derive(Clone, Copy)]
enum PixelState {
    Again(Readout),
    Done { lx: f64, resolution_lx: f64 },
}

impl PixelState {
    fn readout(&self) -> Readout {
        match *self {
            Self::Again(readout) => readout,
            Self::Done { lx, .. } => Readout::Coarse(if lx > 0.0 { lx } else { 1.0 }),
        }
    }
}

fn next_look(readout: Readout, seen: PixelValue, upper: f64) -> PixelState {
    match (readout, seen) {
        (_, PixelValue::Value { lx, resolution_lx }) if resolution_lx <= 1e-7 * lx => {
            PixelState::Done { lx, resolution_lx }
        }
        (_, PixelValue::Value { lx, .. }) if lx > 0.0 => PixelState::Again(Readout::Fine(lx)),
        (_, PixelValue::Below(limit)) if limit < DARK * upper => PixelState::Done { lx: 0.0, resolution_lx: limit },
        (_, PixelValue::Below(limit)) => PixelState::Again(Readout::Coarse(4.0 * limit)),
        (r, PixelValue::Above) => PixelState::Again(Readout::Coarse(1e3 * scale_of(r))),
        (r, _) => PixelState::Again(Readout::Coarse(scale_of(r))),
    }
}

fn scale_of(readout: Readout) -> f64 {
    match readout {
        Readout::Coarse(scale) | Readout::Fine(scale) => scale,
    }
}

fn coarse(scales: &[f64]) -> Vec<Readout> {
    scales.iter().map(|scale| Readout::Coarse(*scale)).collect()
}

fn is_fine(seen: &PixelValue) -> bool {
    matches!(seen, PixelValue::Value { lx, resolution_lx } if *resolution_lx <= RESOLVED * lx)
}
