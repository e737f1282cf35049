//! `luxproof plan` and `luxproof read`: the readings that specs ask for as jobs, which any process on any machine may take.

mod snakemake;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr, miette};
use serde::{Deserialize, Serialize};

use super::diagnostic::{diagnose, not_audited};
use super::{Audited, at_least_one, json, print};
use crate::audit::{self, Options};
use crate::engines::Site;
use crate::measure::cache::{Cache, Key};
use crate::measure::{Asking, Failures, Node};
use crate::plan::{Group, groups};
use crate::record::{EngineName, EngineStatus, Status};
use crate::report::Exit;
use crate::spec::Trust;
use crate::system::{files, process};

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    audited: Audited,
    /// Print JSON, which `luxproof read` takes
    #[arg(long)]
    json: bool,
    /// Write a workflow that takes them all, into the folder of --out
    #[arg(long, value_name = "ENGINE", requires = "out")]
    emit: Option<Workflow>,
    /// Threads that one job may take [default: one a core]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    jobs: Option<usize>,
    /// Short jobs are grouped until a group is expected to take so many seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    group_seconds: f64,
}

#[derive(Debug, Args)]
pub(super) struct ReadArgs {
    /// Jobs or groups of the plan, by id
    #[arg(required = true, value_name = "JOB")]
    jobs: Vec<String>,
    /// The plan: what `luxproof plan --json` prints
    #[arg(long, value_name = "FILE", default_value = "plan.json")]
    plan: PathBuf,
    /// Take a failure for the answer: it is kept for the report, and the exit code is 0
    #[arg(long)]
    give_up: bool,
}

/// Whose workflow is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Workflow {
    Snakemake,
}

/// Version of the form of a plan.
const FORM: u32 = 1;

/// A plan as a file.
#[derive(Debug, Serialize, Deserialize)]
struct Workload {
    luxproof: u32,
    /// What is audited and how; paths count from where it was planned.
    asked: Audited,
    /// All that is asked for by now. Further looks follow from what is read: plan again when everything has been.
    jobs: Vec<Node>,
    /// Those that nobody has read, packed.
    groups: Vec<Group>,
}

pub(super) fn plan(args: &PlanArgs, site: &Site, cache: &Cache, trust: Trust) -> Result<Exit, Diagnostic> {
    let threads = args.jobs.unwrap_or_else(process::cores);
    if let (Some(Workflow::Snakemake), Some(folder)) = (args.emit, &args.audited.selected.choice.out) {
        // Specs are read and checked before anything is written.
        let Audited { selected, .. } = &args.audited;
        audit::chosen(&selected.specs, &args.audited.options(site, trust, folder.clone())).map_err(diagnose)?;
        snakemake::emit(&args.audited, threads, args.group_seconds, folder).into_diagnostic()?;
        print(&format!(
            "snakemake --directory {0} --snakefile {0}/Snakefile --profile {0}/profiles/local\n",
            folder.display()
        ))?;
        return Ok(Exit::Passed);
    }
    let (jobs, engines) = surveyed(&args.audited, site, cache, trust, |options| Options {
        asking: Asking::Nobody,
        jobs: threads,
        ..options
    })?;
    let groups = groups(&jobs, args.group_seconds);
    let is_missing = engines.iter().any(|engine| engine.is_required && engine.status == Status::Absent);
    if args.json {
        print(&json(&Workload { luxproof: FORM, asked: args.audited.clone(), jobs, groups })?)?;
    } else {
        print(&summary(&jobs, &groups).into_diagnostic()?)?;
    }
    Ok(if is_missing { Exit::Engine } else { Exit::Passed })
}

/// What a run asks for, and how its engines fared.
fn surveyed(
    audited: &Audited,
    site: &Site,
    cache: &Cache,
    trust: Trust,
    with: impl FnOnce(Options<'static>) -> Options<'static>,
) -> Result<(Vec<Node>, Vec<EngineStatus>), Diagnostic> {
    let options = with(Options { cache: Some(cache.clone()), ..audited.options(site, trust, PathBuf::new()) });
    let engines = audit::survey(&audited.selected.specs, &options).map_err(not_audited)?;
    Ok((options.asked.nodes(), engines))
}

fn summary(jobs: &[Node], groups: &[Group]) -> Result<String, std::fmt::Error> {
    let mut engines: BTreeMap<&EngineName, Vec<&Node>> = BTreeMap::new();
    for job in jobs {
        engines.entry(&job.engine).or_default().push(job);
    }
    let mut out = String::new();
    for (engine, jobs) in engines {
        let open: Vec<&&Node> = jobs.iter().filter(|job| !job.is_read).collect();
        let seconds: f64 = open.iter().map(|job| job.seconds).sum();
        let (all, left) = (jobs.len(), open.len());
        writeln!(out, "{engine:<12} {all} job(s), {left} to read: at most about {seconds:.0} s")?;
    }
    match groups.len() {
        0 => writeln!(out, "everything is read: luxproof report --from CACHE SPEC...")?,
        n => writeln!(out, "{n} group(s); --json names them for `luxproof read`")?,
    }
    Ok(out)
}

pub(super) fn read(args: &ReadArgs, site: &Site, cache: &Cache, trust: Trust) -> Result<Exit, Diagnostic> {
    let workload = Workload::read(&args.plan)?;
    let nodes = workload.named(&args.jobs)?;
    let wanted: Arc<BTreeSet<Key>> = Arc::new(nodes.iter().map(|node| node.id.clone()).collect());
    let cases = nodes.iter().flat_map(|node| node.cases.clone()).collect();
    let failures = if args.give_up { Failures::Kept } else { Failures::TriedAgain };
    let asking = Asking::Only { wanted, failures };
    let threads = nodes.iter().map(|node| node.threads).max().unwrap_or(1);
    let (asked, _) = surveyed(&workload.asked, site, cache, trust, |options| Options {
        asking,
        jobs: threads,
        only: Some(cases),
        ..options
    })?;
    let (mut out, mut exit) = (String::new(), Exit::Passed);
    for node in nodes {
        let key = &node.id;
        let line = match cache.outcome(key) {
            Some(Ok(cost)) => format!("read {key} in {:.2} s", cost.wall_s),
            Some(Err(failure)) => format!("gave up {key}: {failure}"),
            None if asked.iter().any(|other| other.id == *key) => {
                exit = exit.max(Exit::Engine);
                format!("failed {key}")
            }
            None => {
                exit = exit.max(Exit::Usage);
                format!("not asked for {key}: {}", node.why_not_asked(&asked))
            }
        };
        writeln!(out, "{line}").into_diagnostic()?;
    }
    print(&out)?;
    Ok(exit)
}

impl Workload {
    fn read(path: &Path) -> Result<Self, Diagnostic> {
        let whole = || path.display().to_string();
        let bytes = files::read_kept(path).into_diagnostic()?;
        let plan: Self = serde_json::from_slice(&bytes)
            .into_diagnostic()
            .wrap_err_with(|| format!("{} is no plan of `luxproof plan --json`", whole()))?;
        if plan.luxproof != FORM {
            return Err(miette!(help = "plan again with this program", "{} is of version {}", whole(), plan.luxproof));
        }
        Ok(plan)
    }

    /// Its jobs and those of its groups that are named, each once.
    fn named(&self, names: &[String]) -> Result<Vec<&Node>, Diagnostic> {
        let mut ids = BTreeSet::new();
        for name in names {
            match self.groups.iter().find(|group| group.id == *name) {
                Some(group) => ids.extend(group.jobs.clone()),
                None => drop(ids.insert(name.parse::<Key>().into_diagnostic().wrap_err_with(|| name.clone())?)),
            }
        }
        let jobs: BTreeMap<&Key, &Node> = self.jobs.iter().map(|node| (&node.id, node)).collect();
        let find = |id: Key| {
            jobs.get(&id).copied().ok_or_else(|| {
                miette!(help = "`luxproof plan --json` prints the ids of jobs and groups", "the plan has no job {id}")
            })
        };
        ids.into_iter().map(find).collect()
    }
}

impl Node {
    /// Why the same specs ask for something else here.
    fn why_not_asked(&self, asked: &[Self]) -> String {
        let here = asked.iter().find(|other| other.engine == self.engine).map(|other| &other.needs);
        match here {
            Some(here) if *here != self.needs => format!(
                "it needs {} {} ({:.8}), and here is {} ({:.8})",
                self.engine, self.needs.version, self.needs.fingerprint, here.version, here.fingerprint
            ),
            _ => "specs, options or what was read before are others by now: plan again".to_owned(),
        }
    }
}
