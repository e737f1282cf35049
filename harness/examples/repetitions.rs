//! Twenty seeded repetitions of case S1's reflected light on every renderer: are its standard errors honest, and what is its bias?
//!
//! `cargo run --release -p luxproof --example repetitions -- [ENGINE...] [--repetitions N] [--seconds S] [--relative-error E]`
//!
//! A repetition is one job of the audit preset with a seed of its own. At each of the four points it counts as within three of
//! its standard errors or not; the mean over repetitions shows a bias that no single repetition resolves.

use std::path::Path;
use std::time::{Duration, Instant};

use clap::Parser;
use luxproof::engines::{Engine, Estimate, Job, Site, Workbench};
use luxproof::plan::{Selection, plan};
use luxproof::spec::Case;

/// Indirect illuminance of case S1 at its work plane, by two independent exact methods, in lux.
const EXACT_LX: [f64; 4] = [0.94314714, 1.15551735, 1.15551735, 1.42062868];

#[derive(Debug, Parser)]
struct Options {
    /// Engines
    #[arg(default_values_t = ["mitsuba".to_owned(), "radiance".to_owned(), "povray".to_owned()])]
    engines: Vec<String>,
    /// How many seeds
    #[arg(long, default_value_t = 20)]
    repetitions: u64,
    /// Budget of a repetition
    #[arg(long, default_value_t = 10.0)]
    seconds: f64,
    /// Standard error at which a repetition may stop
    #[arg(long, default_value_t = 0.003)]
    relative_error: f64,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = Options::parse();
    let site = Site::of_user()?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/analytic/s1.yaml");
    let mut case = Case::load(&path)?;
    case.budget.seconds = options.seconds;
    case.budget.relative_error = options.relative_error;
    println!(
        "| engine | version | point | within 3 standard errors | mean deviation | standard error of that | a repetition's own standard error | s |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for engine in &options.engines {
        let selection =
            Selection { engines: vec![engine.clone()], procedures: vec!["indirect_illuminance".into()], seed: 1 };
        let plan = plan(&case, &selection, &site)?;
        let run = plan.runs.iter().find(|r| plan.engines[r.engine].engine.id().name() == engine);
        let run = run.ok_or_else(|| format!("{engine} is absent: run `luxproof engines install`"))?;
        let planned = &plan.engines[run.engine];
        let version = planned.found.as_ref().map(|v| v.0.clone()).unwrap_or_default();
        let started = Instant::now();
        let mut found = vec![];
        for seed in 1..=options.repetitions {
            let job = Job { seed, ..run.job.clone() };
            found.push(read(planned.engine.as_ref(), &job, &site)?);
        }
        let seconds = started.elapsed().as_secs_f64() / found.len() as f64;
        for (k, exact) in EXACT_LX.into_iter().enumerate() {
            let of_point: Vec<Estimate> = found.iter().map(|r| r[k]).collect();
            println!("| {engine} | {version} | {} | {seconds:.1} |", row(k, exact, &of_point));
        }
    }
    Ok(())
}

fn read(engine: &dyn Engine, job: &Job, site: &Site) -> Result<Vec<Estimate>, Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let jobs = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let (scene_dir, log) = (folder.path().to_owned(), folder.path().join("log"));
    let workbench = Workbench { site: site.clone(), scene_dir, log, jobs, limit: Duration::from_secs(600) };
    Ok(engine.read(job, &workbench)?.estimates)
}

/// One point's repetitions as cells of the table.
fn row(k: usize, exact: f64, found: &[Estimate]) -> String {
    let n = found.len() as f64;
    let error = |e: &Estimate| e.std_error_lx.unwrap_or(f64::NAN);
    let within = found.iter().filter(|e| (e.value_lx - exact).abs() <= 3.0 * error(e)).count();
    let mean = found.iter().map(|e| e.value_lx / exact - 1.0).sum::<f64>() / n;
    let spread = found.iter().map(|e| (e.value_lx / exact - 1.0 - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let typical = found.iter().map(|e| error(e) / exact).sum::<f64>() / n;
    let (mean, own, typical) = (100.0 * mean, 100.0 * (spread / n).sqrt(), 100.0 * typical);
    format!("workplane[{k}] | {within} of {} | {mean:+.3} % | {own:.3} % | {typical:.3} %", found.len())
}
