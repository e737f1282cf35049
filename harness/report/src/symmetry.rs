//! Which points an engine rendered, and how many follow from those by symmetry.

use std::collections::{BTreeMap, BTreeSet};

use itertools::Itertools as _;

use super::words::plural;
use luxproof_model::{Effort, EngineName, MeterId, ProcedureId, Report};

/// The entry of an effort that lists the points that were rendered in addition, to check what follows.
const SPOT_CHECKED: &str = "spot_checked";

/// The points of a reading that follow by symmetry, each with the point that it mirrors.
///
/// Points that were rendered to check the symmetry are not among them.
pub(super) fn mirrored_points(effort: &Effort) -> BTreeMap<&str, &str> {
    let checked: Vec<&str> = effort.get(SPOT_CHECKED).map(|names| names.split(", ").collect()).unwrap_or_default();
    effort.mirrored().into_iter().filter(|(point, _)| !checked.contains(point)).collect()
}

/// The points of an engine in a procedure, over all cases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct PointCounts {
    pub(super) rendered: usize,
    /// Points that mirror rendered ones.
    pub(super) by_symmetry: usize,
}

/// The points with comparisons of each engine in each procedure.
pub(super) fn point_counts(report: &Report) -> BTreeMap<(&EngineName, ProcedureId), PointCounts> {
    let recordings: BTreeMap<_, _> = report.recordings.iter().map(|r| (&r.key, mirrored_points(&r.effort))).collect();
    let mut points: BTreeMap<_, [BTreeSet<(&str, &MeterId)>; 2]> = BTreeMap::new();
    for c in &report.comparisons {
        let is_mirrored = recordings.get(&c.key).is_some_and(|points| points.contains_key(c.meter.0.as_str()));
        let row = points.entry((&c.key.engine, c.key.procedure)).or_default();
        row[usize::from(is_mirrored)].insert((c.key.case.as_str(), &c.meter));
    }
    let counted = points.into_iter().map(|(row, [rendered, mirrored])| {
        (row, PointCounts { rendered: rendered.len(), by_symmetry: mirrored.len() })
    });
    counted.collect()
}

/// The number of rendered points and of those that follow by symmetry, for all engines and procedures that have such.
pub(super) fn symmetry_lines(report: &Report) -> Vec<String> {
    let counts = point_counts(report).into_iter();
    let shown = counts.filter(|((_, procedure), counts)| !procedure.is_calibration() && counts.by_symmetry > 0);
    let groups = shown.map(|((engine, procedure), counts)| (counts, (engine, procedure))).into_group_map();
    let has_one = groups.len() == 1;
    groups
        .into_iter()
        .sorted()
        .map(|(PointCounts { rendered, by_symmetry }, rows)| {
            let engines = rows.iter().map(|(engine, _)| engine.as_str()).unique().join(", ");
            let procedures = rows.iter().map(|(_, procedure)| procedure.name()).unique().join(", ");
            let place = if has_one { engines } else { format!("{engines}, {procedures}") };
            format!("{place}: {} rendered, {by_symmetry} by symmetry", plural(rendered, "point"))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_check_the_symmetry_count_as_rendered() {
        let meters = [MeterId::new("desk", 0), MeterId::new("desk", 4), MeterId::new("desk", 5)];
        let points = meters[1..].iter().map(|meter| (meter, &meters[0], "x -> -x"));
        let checked = (SPOT_CHECKED.to_owned(), "desk[5]".to_owned());
        let effort: Effort = [Effort::mirrored_entry(points), checked].into_iter().collect();
        assert_eq!(mirrored_points(&effort), BTreeMap::from([("desk[4]", "desk[0]")]));
    }
}
