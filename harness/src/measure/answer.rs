//! The other end of [`super::Isolation::Subprocess`]: the process that takes one reading and prints it.

use super::machine::Machine;
use super::outcome::{Failure, Taken};
use super::question::{Instrument, Question, Trial};
use super::reader::Reader;
use super::subprocess::Request;
use crate::engines::{self, Job, Site};
use crate::laws;
use crate::spec::{Case, Trust};

pub fn answer(request: &Request, site: &Site) -> Result<Result<Taken, Failure>, String> {
    let cases = Case::load_all(&request.spec, Trust::Own).map_err(|e| e.to_string())?;
    let case = cases.into_iter().find(|c| c.name == request.key.case).ok_or("the case is gone")?;
    if case.sha256 != request.spec_sha256 {
        return Err("the spec has changed meanwhile".into());
    }
    let engine = engines::all().into_iter().find(|e| e.name() == request.key.engine);
    let engine = engine.ok_or_else(|| format!("no engine {}", request.key.engine))?;
    let version = engine.probe(site).map_err(|absent| absent.to_string())?;
    let job = job(request, &case).ok_or("the job is gone")?;
    let instrument = Instrument { engine: engine.into(), version };
    let trial = Trial { case: &case, variant: None, repetition: 0, threads: request.threads };
    let question = Question { trial: Some(&trial), ..Question::new(&instrument, &job, "apart") };
    Ok(Reader::bare(site, Machine::new(request.threads)).read(&question))
}

fn job(request: &Request, case: &Case) -> Option<Job> {
    let base = Job::of_task(case, &case.task(request.key.procedure)?);
    let job = match &request.variant {
        None => base,
        Some(place) => laws::job(&base, place)?,
    };
    Some(Job { settings: request.settings.clone(), budget: request.budget, seed: request.seed, ..job })
}
