//! What can be known to be wrong before any engine starts: all of it, of all specs, policies, tables and options.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{Access, access};

use super::{Options, published};
use crate::judge::Policy;
use crate::plan;
use crate::spec::{Case, Faults, SpecError, Suite, Trust, filtered};

/// The cases that are asked for, under the profile chosen, each with its policy; all read and checked before any engine starts.
pub fn chosen(specs: &[PathBuf], options: &Options<'_>) -> Result<(Vec<Case>, Vec<Arc<Policy>>), Faults> {
    let Suite { mut cases, mut faults } = Suite::read(specs, options.trust);
    let is_sound = faults.is_empty();
    if is_sound {
        match filtered(cases, &options.filter) {
            Ok(all) => cases = all,
            Err(fault) => {
                cases = vec![];
                faults.push(fault);
            }
        }
    }
    // What a stranger's spec names is looked at no further than the spec is sound.
    if is_sound || options.trust == Trust::Own {
        faults.extend(plan::faults(&cases, &options.selection));
    }
    if is_sound {
        faults.extend(published(&cases).err().iter().flat_map(|wrong| wrong.all().iter().cloned()));
    }
    faults.extend(unusable(&options.out));
    // Of a suite, the cases that the chosen procedures concern; a choice that concerns none is refused by the planner.
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

/// Why a run's files could not lie there.
fn unusable(out: &Path) -> Option<SpecError> {
    let help = "name a folder with --out that can be made and written";
    let fault = |message: String| Some(SpecError::of(out, message, help));
    let whole = std::path::absolute(out).ok()?;
    let nearest = whole.ancestors().find(|place| place.exists())?;
    let here = std::env::current_dir().unwrap_or_default();
    let shown = nearest.strip_prefix(here).unwrap_or(nearest).display();
    if !nearest.is_dir() {
        return fault(format!("{shown} is no folder, so that no run can be kept there"));
    }
    match access(nearest, Access::WRITE_OK) {
        Ok(()) => None,
        Err(error) => fault(format!("{shown} cannot be written: {error}")),
    }
}
