//! The difference of two distributions over all directions, and whether the rounding of their files explains it.

use super::eulumdat::intensity_scale;
use super::orientation::cell_middles_deg;
use super::{Details, LuminousIntensityDistribution, Photometry};

/// Tables with differences below this fraction of the largest intensity are equal.
const EQUAL_FRACTION: f64 = 1e-9;
/// Photometers write at most this number of decimals in the unit of a file.
const MAX_DECIMALS: i32 = 6;
/// Up to this number of directions, every angle of one table is combined with every angle of the other.
const MAX_DIRECTIONS: usize = 4_000_000;

/// A direction and both intensities there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Departure {
    /// C of the direction.
    pub c_deg: f64,
    /// Gamma of the direction.
    pub gamma_deg: f64,
    /// The intensity of the first table in candela.
    pub first_cd: f64,
    /// The intensity of the second table in candela.
    pub second_cd: f64,
}

impl Departure {
    /// Second minus first intensity in candela.
    pub fn change_cd(&self) -> f64 {
        self.second_cd - self.first_cd
    }
}

/// Whether two distributions are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Likeness {
    /// Equal to 1e-9 of the largest intensity in every compared direction.
    Equal,
    /// Equal to half the last printed digit of both tables together.
    WithinRounding,
    /// Different by more than rounding.
    Different,
}

/// The result of comparing two photometric files.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The direction of the largest difference; of several the first by gamma, then by C.
    pub largest: Departure,
    /// The larger of the two largest intensities in candela, the reference of relative differences.
    pub peak_cd: f64,
    /// Root mean square of the difference over the solid angle in candela, from cells of one degree.
    pub rms_cd: f64,
    /// Last printed digit of each table in candela, where it is known.
    pub steps_cd: [Option<f64>; 2],
    /// Whether every angle of one table was combined with every angle of the other, so that the largest difference is exact.
    ///
    /// Very large tables and those of types A and B are compared at the angles of each table separately.
    pub is_exhaustive: bool,
    /// Whether they are the same.
    pub likeness: Likeness,
}

impl Difference {
    /// Compares two files.
    ///
    /// Both tables are bilinear between the angles of both together, so that the largest difference is at one of those.
    pub fn between(first: &Photometry, second: &Photometry) -> Self {
        let pair = [&first.distribution, &second.distribution];
        let (largest, is_exhaustive) = find_largest(pair);
        let peak_cd = pair.map(|d| d.max_intensity().value()).into_iter().fold(0.0, f64::max);
        let steps_cd = [first, second].map(printed_step_cd);
        let largest_cd = largest.change_cd().abs();
        let rounding: f64 = steps_cd.iter().flatten().map(|step| 0.5 * step).sum();
        let likeness = if largest_cd <= EQUAL_FRACTION * peak_cd {
            Likeness::Equal
        } else if largest_cd <= rounding + EQUAL_FRACTION * peak_cd {
            Likeness::WithinRounding
        } else {
            Likeness::Different
        };
        Self { largest, peak_cd, rms_cd: rms(pair, peak_cd), steps_cd, is_exhaustive, likeness }
    }
}

/// Finds the largest difference of two tables among their angles and the middles of cells of one degree.
///
/// The flag is true where every angle of one table was combined with every angle of the other.
fn find_largest([a, b]: [&LuminousIntensityDistribution; 2]) -> (Departure, bool) {
    let circles = [a.full_circle(), b.full_circle()];
    let [own_a, own_b] = &circles.each_ref().map(|full| (full.c_deg().to_vec(), with_ends(full.gamma_deg())));
    let union = (merge_angles(&own_a.0, &own_b.0), merge_angles(&own_a.1, &own_b.1));
    let is_small = union.0.len().saturating_mul(union.1.len()) <= MAX_DIRECTIONS;
    // Types A and B are bilinear in other angles: the largest difference can lie between those of type C.
    let is_exhaustive = is_small && !a.is_native() && !b.is_native();
    let mut grids = if is_small { vec![union] } else { vec![own_a.clone(), own_b.clone()] };
    grids.push((cell_middles_deg(360), cell_middles_deg(180)));
    let mut worst: Option<Departure> = None;
    for (c_deg, gamma_deg) in &grids {
        // One gamma angle at a time: all at once would take the memory of the grid.
        for gamma in gamma_deg {
            let rows = [a, b].map(|d| d.intensities(c_deg, &[*gamma]));
            for (k, c) in c_deg.iter().enumerate() {
                let found = Departure { c_deg: *c, gamma_deg: *gamma, first_cd: rows[0][k], second_cd: rows[1][k] };
                if worst.is_none_or(|w| found.change_cd().abs() > w.change_cd().abs()) {
                    worst = Some(found);
                }
            }
        }
    }
    for (c_deg, gamma_deg) in
        [a, b].into_iter().filter(|t| t.is_native()).flat_map(LuminousIntensityDistribution::nodes_deg)
    {
        let [first_cd, second_cd] = [a, b].map(|d| d.intensity(c_deg, gamma_deg).value());
        let found = Departure { c_deg, gamma_deg, first_cd, second_cd };
        if worst.is_none_or(|w| found.change_cd().abs() > w.change_cd().abs()) {
            worst = Some(found);
        }
    }
    let nowhere = Departure { c_deg: 0.0, gamma_deg: 0.0, first_cd: 0.0, second_cd: 0.0 };
    (worst.unwrap_or(nowhere), is_exhaustive)
}

/// All angles of two lists, sorted, each once.
fn merge_angles(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut all = [a, b].concat();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// The angles of a table and those just beyond its ends, where it jumps to zero.
fn with_ends(gamma_deg: &[f64]) -> Vec<f64> {
    let ends = [gamma_deg[0].next_down(), gamma_deg[gamma_deg.len() - 1].next_up()];
    let mut all = gamma_deg.to_vec();
    all.extend(ends.into_iter().filter(|g| (0.0..=180.0).contains(g)));
    all
}

/// Root mean square of the difference over the sphere in candela. Squares of fractions of the peak never overflow.
fn rms([a, b]: [&LuminousIntensityDistribution; 2], peak_cd: f64) -> f64 {
    if peak_cd <= 0.0 {
        return 0.0;
    }
    let (c_deg, gamma_deg) = (cell_middles_deg(360), cell_middles_deg(180));
    let (mut sum, mut total) = (0.0, 0.0);
    let [first, second] = [a, b].map(|d| d.intensities(&c_deg, &gamma_deg));
    for (row, gamma) in gamma_deg.iter().enumerate() {
        let cells = row * c_deg.len()..(row + 1) * c_deg.len();
        let squares: f64 = cells.map(|k| ((second[k] - first[k]) / peak_cd).powi(2)).sum();
        let weight = gamma.to_radians().sin();
        sum += weight * squares;
        total += weight * c_deg.len() as f64;
    }
    peak_cd * (sum / total).sqrt()
}

/// The last printed digit of a file's table in candela.
///
/// It is the largest power of ten, at most 1, of which all numbers of the file are multiples, times the factor of the
/// file. `None` where there is no such power.
fn printed_step_cd(photometry: &Photometry) -> Option<f64> {
    let mut largest = None;
    for factor in candidate_factors(photometry) {
        let mut steps = (0..=MAX_DECIMALS).map(|decimals| factor * 10f64.powi(-decimals));
        if let Some(step) = steps.find(|step| are_multiples_of(&photometry.distribution, *step)) {
            largest = Some(largest.map_or(step, |other: f64| other.max(step)));
        }
    }
    largest
}

/// Whether all intensities of a table are multiples of a step, to the precision of the printed numbers.
fn are_multiples_of(table: &LuminousIntensityDistribution, step: f64) -> bool {
    let mut candela = (0..table.c_deg().len()).flat_map(|c| table.plane(c));
    candela.all(|v| (v / step - (v / step).round()).abs() <= 1e-7 * (v / step).abs().max(1.0))
}

/// The possible factors between the numbers of a file and candela: 1 and the factors of the file.
fn candidate_factors(photometry: &Photometry) -> Vec<f64> {
    let own = match &photometry.details {
        Details::Eulumdat(details) => vec![intensity_scale(details)],
        Details::Lm63(_) => photometry.lm63_file().map_or(vec![], |file| lm63_factors(&file.bytes)),
        Details::None => vec![],
    };
    own.into_iter().chain([1.0]).filter(|f| f.is_normal() && *f > 0.0).collect()
}

/// The candela multiplier of an LM-63 file, alone and with its two further factors. Editions differ in their use.
fn lm63_factors(bytes: &[u8]) -> Vec<f64> {
    let Some([multiplier, ballast, further]) = read_multipliers(bytes) else { return vec![] };
    vec![multiplier * ballast * further, multiplier * ballast, multiplier]
}

/// The candela multiplier, the ballast factor and the number behind it, as an LM-63 file has them.
pub(super) fn read_multipliers(bytes: &[u8]) -> Option<[f64; 3]> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text.lines().skip_while(|line| !line.trim_start().starts_with("TILT="));
    let includes = lines.next().is_some_and(|line| line.contains("INCLUDE"));
    let mut numbers = lines.flat_map(|line| line.split([' ', ',', '\t'])).filter_map(|word| word.parse::<f64>().ok());
    if includes {
        let count = numbers.by_ref().nth(1).unwrap_or(0.0).clamp(0.0, 1e6) as usize;
        // Skip the angles and factors of the tilt.
        numbers.by_ref().take(2 * count).for_each(drop);
    }
    let head: Vec<f64> = numbers.take(13).collect();
    let [_, _, multiplier, .., ballast, further, _] = head[..] else { return None };
    Some([multiplier, ballast, further])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{eulumdat, lm63};

    fn of(candela: Vec<f64>) -> Photometry {
        let gamma = (0..candela.len()).map(|k| 10.0 * k as f64).collect();
        Photometry::of(LuminousIntensityDistribution::axial(gamma, candela).unwrap())
    }

    #[test]
    fn a_file_differs_from_itself_nowhere_and_from_its_rounded_self_within_rounding() {
        let exact = of(vec![812.4, 733.6, 511.2, 120.0]);
        let same = Difference::between(&exact, &exact);
        assert_eq!((same.likeness, same.rms_cd), (Likeness::Equal, 0.0));
        let rounded = of(vec![812.0, 734.0, 511.0, 120.0]);
        let found = Difference::between(&exact, &rounded);
        assert_eq!(found.likeness, Likeness::WithinRounding);
        assert_eq!(found.steps_cd, [Some(0.1), Some(1.0)]);
        assert!((found.largest.change_cd().abs() - 0.4).abs() < 1e-9);
        assert_eq!(Difference::between(&exact, &of(vec![812.4, 733.6, 510.2, 120.0])).likeness, Likeness::Different);
    }

    #[test]
    fn the_largest_difference_is_found_between_the_angles_of_both() {
        // One has a spike where the other has no angle.
        let coarse = Photometry::of(LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![100.0; 2]).unwrap());
        let spike = LuminousIntensityDistribution::axial(
            vec![0.0, 30.0, 30.01, 30.02, 90.0],
            vec![100.0, 100.0, 900.0, 100.0, 100.0],
        );
        let found = Difference::between(&coarse, &Photometry::of(spike.unwrap()));
        assert_eq!((found.largest.gamma_deg, found.largest.change_cd()), (30.01, 800.0));
        assert_eq!((found.likeness, found.peak_cd, found.is_exhaustive), (Likeness::Different, 900.0, true));
        // One ends where the other goes on.
        let longer = Photometry::of(
            LuminousIntensityDistribution::axial(vec![0.0, 90.0, 95.0], vec![100.0, 100.0, 50.0]).unwrap(),
        );
        let found = Difference::between(&coarse, &longer).largest;
        assert!(found.gamma_deg > 90.0 && found.gamma_deg < 90.001 && found.second_cd > 99.0, "{found:?}");
    }

    #[test]
    fn the_mean_square_is_over_solid_angle() {
        let [dark, light] = [0.0, 6.0]
            .map(|i| Photometry::of(LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![i; 2]).unwrap()));
        // Half the sphere differs by 6: 6 / sqrt 2, but for the row of cells that holds the edge.
        let rms = Difference::between(&dark, &light).rms_cd;
        assert!((rms - 6.0 / 2f64.sqrt()).abs() < 1e-3, "{rms}");
        let huge = Photometry { distribution: light.distribution.scaled(1e299), ..light };
        assert!(Difference::between(&dark, &huge).rms_cd.is_finite());
    }

    #[test]
    fn the_printed_digit_excludes_the_factor_of_the_file() {
        let text = "IESNA:LM-63-2002\r\nTILT=INCLUDE\r\n1\r\n2\r\n0 90\r\n1 0.9\r\n1 1000 0.37 3 1 1 2 0 0 0\r\n1 1 10\r\n0 45 90\r\n0\r\n100 50 3\r\n";
        let read = lm63::parse(text.as_bytes()).unwrap();
        let bytes: std::sync::Arc<[u8]> = text.as_bytes().into();
        let file = super::super::SourceFile { name: "a.ies".into(), bytes };
        let named = Photometry { source: vec![file], ..read };
        assert!((printed_step_cd(&named).unwrap() - 0.37).abs() < 1e-12);
        // 2700 lm: a step of .1 cd/klm is .27 cd.
        let lamp = Photometry { lamp_lumens: Some(2700.0), ..of(vec![270.0, 27.27, 0.0]) };
        let ldt = eulumdat::parse(eulumdat::write(&lamp).text.as_bytes()).unwrap();
        assert!((printed_step_cd(&ldt).unwrap() - 0.27).abs() < 1e-12, "{:?}", printed_step_cd(&ldt));
    }

    /// Angles from 0 to `last` in 4000 even steps.
    fn many_angles(last: f64) -> Vec<f64> {
        (0..=4000).map(|k| last * f64::from(k) / 4000.0).collect()
    }

    #[test]
    fn tables_too_large_for_every_pair_of_angles_are_compared_at_the_angles_of_each() {
        let c_deg = many_angles(360.0);
        let wide = LuminousIntensityDistribution::new(c_deg, vec![0.0, 90.0], vec![1.0; 2 * 4001]).unwrap();
        let deep = LuminousIntensityDistribution::axial(many_angles(90.0), vec![1.0; 4001]).unwrap();
        let found = Difference::between(&Photometry::of(wide), &Photometry::of(deep));
        assert_eq!((found.likeness, found.is_exhaustive), (Likeness::Equal, false));
    }
}
