//! Takes one reading in a child process (see [`super::Isolation::Subprocess`]).

use std::path::Path;

use super::machine::Machine;
use super::outcome::{CostedMeasurement, Failure};
use super::question::{Instrument, Question, Trial};
use super::reader::Reader;
use super::subprocess::Request;
use luxproof_engines::{EngineRoot, Job};
use luxproof_spec::Resolve;
use luxproof_spec::{Case, Trust};

/// Takes the requested reading; the outer error says why the request itself is invalid.
pub fn answer(request: &Request, site: &EngineRoot) -> Result<Result<CostedMeasurement, Failure>, String> {
    // The process that asks has named the spec; what is in it is as trusted here as there.
    let spec = request.spec.resolve(Trust::Own, Path::new("")).map_err(|e| e.to_string())?;
    let cases = Case::load_all(&spec, request.trust).map_err(|e| e.to_string())?;
    let case = cases.into_iter().find(|c| c.name == request.key.case).ok_or("the case is gone")?;
    if case.sha256 != request.spec_sha256 {
        return Err("the spec has changed meanwhile".into());
    }
    let engine = luxproof_engines::all().into_iter().find(|e| e.name() == request.key.engine);
    let engine = engine.ok_or_else(|| format!("no engine {}", request.key.engine))?;
    let version = engine.probe(site).map_err(|absent| absent.to_string())?;
    let job = job(request, &case).ok_or("the job is gone")?;
    let instrument = Instrument { engine: engine.into(), version };
    let trial = Trial { case: &case, variant: None, repetition: 0, threads: request.threads };
    let question = Question { trial: Some(&trial), ..Question::new(&instrument, &job, "apart") };
    Ok(Reader::bare(site, Machine::new(request.threads)).read(&question))
}

/// The job of a request, with its variant.
fn job(request: &Request, case: &Case) -> Option<Job> {
    let base = Job::of_task(case, &case.task(request.key.procedure)?);
    let job = match &request.variant {
        None => base,
        Some(place) => luxproof_laws::job(&base, place)?,
    };
    Some(Job { settings: request.settings.clone(), budget: request.budget, seed: request.seed, ..job })
}
