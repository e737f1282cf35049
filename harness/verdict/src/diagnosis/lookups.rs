//! Kinds of wrong look-ups of candela tables: between angles, at their ends, and by angles that mean something else.

use super::fault::{Fault, Parameter};
use super::tables::{
    EndOfGamma, EndOfPlanes, Neighbour, average_planes, continue_planes, interpolate_by_cosine,
    interpolate_by_logarithm, move_nodes, multiply_by_cosine, read_other_gamma, take_neighbours,
};

/// A gamma that is looked up some degrees nearer to the nadir.
pub(super) const GAMMA_OFF: &str = "gamma is off by {0}";

pub(super) fn gamma_shift() -> Parameter {
    Parameter::new(" degrees", 0.0, 0.05, (-20.0, 20.0))
}

/// Lists the kinds of look-ups.
pub(super) fn lookup_kinds() -> Vec<Fault> {
    let mut all = neighbour_faults();
    all.extend(index_faults());
    all.extend(plane_faults());
    all.push(lookup("candela are interpolated by their logarithms, not linearly", interpolate_by_logarithm));
    all.push(lookup("candela are interpolated by the cosine of gamma, not by gamma", interpolate_by_cosine));
    for is_full_circle in [false, true] {
        let what = "light is the mean of the table's planes, each counted once, in every C plane";
        all.push(Fault::new("lookup", what, move |faulty, _| {
            faulty.change_luminaires(|l| average_planes(l, is_full_circle))
        }));
    }
    all.extend(gamma_faults());
    for is_dark_behind in [false, true] {
        let what = "candela are multiplied by the cosine of gamma to the power of {0}";
        let cosine = Fault::new("emission", what, move |faulty, p| {
            let power = p[0];
            faulty.change_luminaires(|l| multiply_by_cosine(l, power, is_dark_behind))
        });
        all.push(cosine.about("cosine of tables").with_parameters([Parameter::new("", 0.0, 0.02, (-2.0, 8.0))]));
    }
    all
}

fn lookup(what: &str, change: fn(&mut luxproof_scene::Luminaire) -> bool) -> Fault {
    Fault::new("lookup", what, move |faulty, _| faulty.change_luminaires(change))
}

/// Another gamma is looked up; each with the ways in which programs treat what lies beyond the table.
fn gamma_faults() -> Vec<Fault> {
    let mut all = vec![];
    for end in [EndOfGamma::Dark, EndOfGamma::WithinSphere, EndOfGamma::WithinTable] {
        let scaled = Fault::new("lookup", "gamma is looked up {0} times as large as it is", move |faulty, p| {
            let factor = p[0];
            faulty.change_luminaires(|l| read_other_gamma(l, factor, 0.0, end))
        });
        all.push(scaled.about("scale of gamma").with_parameters([Parameter::new("", 1.0, 0.01, (0.1, 10.0))]));
        let off = Fault::new("gamma-off", GAMMA_OFF, move |faulty, p| {
            let plus_deg = -p[0];
            faulty.change_luminaires(|l| read_other_gamma(l, 1.0, plus_deg, end))
        });
        all.push(off.about("angles").with_parameters([gamma_shift()]));
    }
    all
}

/// Tables without interpolation along one axis or both.
fn neighbour_faults() -> Vec<Fault> {
    let mut all = vec![];
    for (which, neighbour) in
        [("nearest", Neighbour::Nearest), ("next lower", Neighbour::Lower), ("next higher", Neighbour::Higher)]
    {
        for (name, axes) in [("gamma", [false, true]), ("C", [true, false]), ("C and gamma", [true, true])] {
            let what = format!("the table is not interpolated in {name}: the {which} angle counts");
            all.push(Fault::new("lookup", what, move |faulty, _| {
                faulty.change_luminaires(|l| take_neighbours(l, axes, neighbour))
            }));
        }
    }
    all
}

/// Indices that are off by a step or by half of one.
fn index_faults() -> Vec<Fault> {
    let mut all = vec![];
    for (by, steps) in [(1.0, "one step"), (-1.0, "one step back"), (0.5, "half a step"), (-0.5, "half a step back")] {
        for (name, axes) in [("gamma", [false, true]), ("C", [true, false])] {
            let what = format!("the table's {name} is off by {steps}");
            all.push(Fault::new("lookup", what, move |faulty, _| {
                faulty.change_luminaires(|l| move_nodes(l, axes, by))
            }));
        }
    }
    all
}

/// Planes beyond the last one of a table that covers a part of the circle.
fn plane_faults() -> Vec<Fault> {
    let ends = [
        ("the table is dark beyond its last C plane, not mirrored", EndOfPlanes::Dark),
        ("beyond its last C plane the table's last plane counts, it is not mirrored", EndOfPlanes::Last),
        ("beyond its last C plane the table begins again, it is not mirrored", EndOfPlanes::Repeated),
    ];
    let mut all = vec![];
    for (what, end) in ends {
        all.push(Fault::new("lookup", what, move |faulty, _| faulty.change_luminaires(|l| continue_planes(l, end))));
    }
    all
}
