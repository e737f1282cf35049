//! Checks specs, policies, tables and options before any engine starts, and reports all faults at once.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{Access, access};

use super::{Options, published};
use crate::plan;
use luxproof_spec::{Case, Faults, SpecError, Suite, Trust, filtered};
use luxproof_verdict::Policy;

/// Reads and checks the requested cases, each with its policy, under the chosen profile.
pub fn chosen(specs: &[PathBuf], options: &Options<'_>) -> Result<(Vec<Case>, Vec<Arc<Policy>>), Faults> {
    let Suite { mut cases, mut faults } = Suite::read(specs, options.trust);
    let is_valid = faults.is_empty();
    if is_valid {
        match filtered(cases, &options.filter) {
            Ok(all) => cases = all,
            Err(fault) => {
                cases = vec![];
                faults.push(fault);
            }
        }
    }
    // Files that a foreign spec names are opened only if the spec is valid.
    if is_valid || options.trust == Trust::Own {
        faults.extend(plan::faults(&cases, &options.selection));
    }
    if is_valid {
        faults.extend(published(&cases).err().iter().flat_map(|wrong| wrong.all().iter().cloned()));
    }
    faults.extend(output_fault(&options.out));
    // Keeps the cases that have a chosen procedure; the planner refuses a choice that no case has.
    if cases.iter().any(|case| options.selection.concerns(case)) {
        cases.retain(|case| options.selection.concerns(case));
    }
    let policies = options.policy.of_cases(&cases).unwrap_or_else(|of_policies| {
        faults.extend(of_policies.all().iter().cloned());
        vec![]
    });
    if let Some(faults) = Faults::of(faults) {
        return Err(faults);
    }
    for (case, policy) in cases.iter_mut().zip(&policies) {
        case.budget = options.budget.over(policy.profile.budget.over(case.budget));
    }
    Ok((cases, policies))
}

/// Why a folder cannot be the output folder.
fn output_fault(out: &Path) -> Option<SpecError> {
    const HELP: &str = "name a folder with --out that can be made and written";
    let path = std::path::absolute(out).ok()?;
    let nearest = path.ancestors().find(|place| place.exists())?;
    let here = std::env::current_dir().unwrap_or_default();
    let shown = nearest.strip_prefix(here).unwrap_or(nearest).display();
    if !nearest.is_dir() {
        let message = format!("{shown} is no folder, so that no run can be kept there");
        return Some(SpecError::of(out, message, HELP));
    }
    let error = access(nearest, Access::WRITE_OK).err()?;
    Some(SpecError::of(out, format!("{shown} cannot be written: {error}"), HELP))
}
