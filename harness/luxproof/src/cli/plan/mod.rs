//! `luxproof plan` and `luxproof read`: the readings that specs ask for as jobs, which any process on any machine may take.

mod snakemake;

use luxproof_model::ForeignPath;
use luxproof_model::Request;
use luxproof_model::numbers::plural;
use luxproof_spec::SpecError;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, Report as Diagnostic, WrapErr, miette};
use serde::{Deserialize, Serialize};

use super::not_audited;
use super::{Audited, at_least_one};
use luxproof_audit::Options;
use luxproof_audit::measure::cache::{Cache, Key};
use luxproof_audit::measure::{CacheMissPolicy, Failures, Node};
use luxproof_audit::plan::Group;
use luxproof_audit::plan::groups;
use luxproof_console::diagnose;
use luxproof_console::{json, print};
use luxproof_engines::EngineRoot;
use luxproof_model::Exit;
use luxproof_model::{EngineName, EngineStatus, Status};
use luxproof_process::files::{FileError, MAX_KEPT_BYTES};
use luxproof_process::printable::quoted;
use luxproof_process::{files, foreign_json, process};
use luxproof_spec::Resolve;
use luxproof_spec::Trust;
use luxproof_verdict::PolicyChoice;

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    audited: Audited,
    /// Print JSON, the input of `luxproof read`
    #[arg(long)]
    json: bool,
    /// Write a workflow for all jobs, into --out
    #[arg(long, value_name = "ENGINE", requires = "out")]
    emit: Option<Workflow>,
    /// Threads of one job [default: one per core]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    jobs: Option<usize>,
    /// Group short jobs up to this time
    #[arg(long, value_name = "S", default_value_t = 60.0)]
    group_seconds: f64,
}

#[derive(Debug, Args)]
pub(super) struct ReadArgs {
    /// Ids of jobs or groups of the plan
    #[arg(required = true, value_name = "JOB")]
    jobs: Vec<String>,
    /// The plan, as `luxproof plan --json` prints it
    #[arg(long, value_name = "FILE", default_value = "plan.json")]
    plan: PathBuf,
    /// With --untrusted: the folder that contains all specs [default: the current folder]
    #[arg(long, value_name = "DIR")]
    below: Option<PathBuf>,
    /// The policy [default: that of the plan, except with --untrusted]
    #[arg(long, value_name = "FILE")]
    policy: Option<PathBuf>,
    /// Store a failure as the answer, and exit with 0
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
    /// What is audited and how; paths are relative to the folder where it was planned.
    asked: AskedOfPlan,
    /// The readings requested so far. Further stages follow from their values: plan again when all have been taken.
    jobs: Vec<Node>,
    /// The jobs that are still open, in groups that run together.
    groups: Vec<Group>,
}

/// The most specs, folders and patterns of a plan that is not trusted: one that is named again is read again.
const MAX_FOREIGN_SPECS: usize = 100;

/// The most bytes of a plan that is not trusted: a job has about 600.
const MAX_FOREIGN_BYTES: u64 = 16 << 20;

/// Specs and what is asked of them, as a plan holds it, by an author that is not known.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct AskedOfPlan {
    specs: Vec<ForeignPath>,
    #[serde(flatten)]
    request: Request,
}

impl AskedOfPlan {
    fn of(audited: &Audited, options: &Options<'_>) -> Self {
        let specs = audited.selected.specs.iter().cloned().map(ForeignPath::from).collect();
        Self { specs, request: options.request() }
    }

    /// What of it is used: its specs and its policy as far as they are trusted, or the policy that the user names.
    fn trusted(&self, args: &ReadArgs, trust: Trust) -> Result<(Vec<PathBuf>, Option<PathBuf>), SpecError> {
        let below = args.below.as_deref().unwrap_or(Path::new(""));
        if trust != Trust::Own && self.specs.len() > MAX_FOREIGN_SPECS {
            let message = format!("names more than {MAX_FOREIGN_SPECS} specs, and is not trusted");
            return Err(SpecError::of(&args.plan, message, "name folders or patterns of specs"));
        }
        if let Some(message) = crate::bundle::excess(&self.request).filter(|_| trust != Trust::Own) {
            return Err(SpecError::of(
                &args.plan,
                message,
                "plan again with fewer, or read the plan without --untrusted",
            ));
        }
        let specs = self.specs.iter().map(|spec| spec.resolve(trust, below)).collect::<Result<Vec<_>, _>>()?;
        let policy = match (&args.policy, &self.request.policy) {
            (Some(own), _) => Some(own.clone()),
            (None, Some(named)) if trust != Trust::Own => {
                let message = format!("names the policy {}, and is not trusted", named.shown());
                return Err(SpecError::of(&args.plan, message, "name the policy with --policy"));
            }
            (None, named) => named.as_ref().map(|file| file.resolve(trust, below)).transpose()?,
        };
        Ok((specs, policy))
    }
}

pub(super) fn plan(args: &PlanArgs, site: &EngineRoot, cache: &Cache, trust: Trust) -> Result<Exit, Diagnostic> {
    let threads = args.jobs.unwrap_or_else(process::cores);
    if let (Some(Workflow::Snakemake), Some(folder)) = (args.emit, &args.audited.selected.choice.out) {
        // Specs are read and checked before anything is written.
        let Audited { selected, .. } = &args.audited;
        luxproof_audit::chosen(&selected.specs, &args.audited.options(site, trust, folder.clone()))
            .map_err(diagnose)?;
        super::refuse_links(folder, trust)?;
        snakemake::emit(&args.audited, trust, threads, args.group_seconds, folder).into_diagnostic()?;
        print(&format!(
            "snakemake --directory {0} --snakefile {0}/Snakefile --profile {0}/profiles/local\n",
            folder.display()
        ))?;
        return Ok(Exit::Passed);
    }
    let options = Options {
        asking: CacheMissPolicy::LeaveOpen,
        jobs: threads,
        cache: Some(cache.clone()),
        ..args.audited.options(site, trust, PathBuf::new())
    };
    let (jobs, engines) = surveyed(&args.audited.selected.specs, &options)?;
    let groups = groups(&jobs, args.group_seconds);
    let is_missing = engines.iter().any(|engine| engine.is_required && engine.status == Status::Absent);
    if args.json {
        print(&json(&Workload { luxproof: FORM, asked: AskedOfPlan::of(&args.audited, &options), jobs, groups })?)?;
    } else {
        print(&summary(&jobs, &groups).into_diagnostic()?)?;
    }
    Ok(if is_missing { Exit::Engine } else { Exit::Passed })
}

/// What a run asks for, and how its engines fared.
fn surveyed(specs: &[PathBuf], options: &Options<'_>) -> Result<(Vec<Node>, Vec<EngineStatus>), Diagnostic> {
    let engines = luxproof_audit::survey(specs, options).map_err(not_audited)?;
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
        writeln!(out, "{engine:<12} {}, {left} to read: at most about {seconds:.0} s", plural(all, "job"))?;
    }
    match groups.len() {
        0 => writeln!(out, "everything is read: luxproof report --from CACHE SPEC...")?,
        n => writeln!(out, "{}; --json names them for `luxproof read`", plural(n, "group"))?,
    }
    Ok(out)
}

pub(super) fn read(args: &ReadArgs, site: &EngineRoot, cache: &Cache, trust: Trust) -> Result<Exit, Diagnostic> {
    let workload = Workload::read(&args.plan, trust)?;
    let nodes = workload.named(&args.jobs)?;
    let wanted: Arc<BTreeSet<Key>> = Arc::new(nodes.iter().map(|node| node.id.clone()).collect());
    let cases = nodes.iter().flat_map(|node| node.cases.clone()).collect();
    let failures = if args.give_up { Failures::Kept } else { Failures::TriedAgain };
    let asking = CacheMissPolicy::AskFor { wanted, failures };
    let threads = nodes.iter().map(|node| node.threads).max().unwrap_or(1);
    // The plan may come from a stranger, who does not know this machine and may want to harm it.
    let threads = if trust == Trust::Own { threads } else { threads.min(process::cores()) };
    let (specs, policy) = workload.asked.trusted(args, trust).map_err(diagnose)?;
    let options = Options {
        asking,
        jobs: threads,
        only: Some(cases),
        cache: Some(cache.clone()),
        trust,
        policy: PolicyChoice { file: policy, ..PolicyChoice::default() },
        ..Options::new(site.clone(), PathBuf::new())
    };
    let (asked, _) = surveyed(&specs, &options.with_request(&workload.asked.request))?;
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
                format!("not asked for {key}: {}", why_not_asked(node, &asked))
            }
        };
        writeln!(out, "{line}").into_diagnostic()?;
    }
    print(&out)?;
    Ok(exit)
}

impl Workload {
    fn read(path: &Path, trust: Trust) -> Result<Self, Diagnostic> {
        let shown = path.display();
        let most = if trust == Trust::Own { MAX_KEPT_BYTES } else { MAX_FOREIGN_BYTES };
        let bytes = trust.check_given(path).and_then(|()| files::read_bounded(path, most));
        let bytes = bytes.map_err(|source| FileError::of(path, source)).into_diagnostic()?;
        let plan: Self = foreign_json::from_slice(&bytes).map_err(|error| {
            let why = quoted(&error.to_string());
            miette!(help = "give what `luxproof plan --json` prints", "{shown} is no plan: {why}")
        })?;
        if plan.luxproof != FORM {
            return Err(miette!(help = "plan again with this program", "{shown} is of version {}", plan.luxproof));
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
        let chosen = ids.into_iter().map(|id| {
            jobs.get(&id).copied().ok_or_else(|| {
                miette!(help = "`luxproof plan --json` prints the ids of jobs and groups", "the plan has no job {id}")
            })
        });
        chosen.collect()
    }
}

/// Why the same specs ask for something else here.
fn why_not_asked(node: &Node, asked: &[Node]) -> String {
    let here = asked.iter().find(|other| other.engine == node.engine).map(|other| &other.needs);
    match here {
        Some(here) if *here != node.needs => format!(
            "it needs {} {} ({:.8}), and here is {} ({:.8})",
            node.engine, node.needs.version, node.needs.fingerprint, here.version, here.fingerprint
        ),
        _ => "specs, options or what was read before are others by now: plan again".to_owned(),
    }
}
