//! The fit of cells to their table, by examples that were worked out by hand.

use luxproof_model::Uncertainty;

use super::*;

/// The quantile .975 of Student's t with 3 degrees of freedom.
const T_3: f64 = 3.182_446_305_284;
/// The same with 4 degrees of freedom.
const T_4: f64 = 2.776_445_105_198;

fn are_close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-6 * b.abs()
}

/// Spacings at rows 0, 1 and so on, each with its rounding.
fn spacings(values: &[(f64, f64)]) -> Vec<Spacing> {
    values
        .iter()
        .enumerate()
        .map(|(row, (value, rounding))| Spacing { row, value: *value, rounding: *rounding })
        .collect()
}

#[test]
fn a_value_may_deviate_from_the_median_of_others_by_their_spread_and_its_rounding() {
    // The others have the median 3 and deviate from it by 2, 1, 0, 1 and 2: the median deviation is 1.
    let all = spacings(&[(10.0, 0.5), (1.0, 0.06), (2.0, 0.06), (3.0, 0.06), (4.0, 0.06), (5.0, 0.06)]);
    let fit = fit_to_others(&all, 0).unwrap();
    assert!(are_close(fit.distance, 7.0) && are_close(fit.median, 3.0), "{}", fit.distance);
    assert!(are_close(fit.allowed, T_4 * 1.4826 + 0.5), "{}", fit.allowed);
    assert!(are_close(fit.excess(), 7.0 / (T_4 * 1.4826 + 0.5)));
    // Equal values spread by their rounding, of 6^(1/2) * .1.
    let rounding = 0.1 * 6f64.sqrt();
    let all =
        spacings(&[(2.0, 0.5), (3.0, rounding), (3.0, rounding), (3.0, rounding), (3.0, rounding), (3.0, rounding)]);
    let fit = fit_to_others(&all, 0).unwrap();
    assert!(are_close(fit.distance, 1.0) && are_close(fit.allowed, T_4 * 0.1 + 0.5), "{}", fit.allowed);
    // Three others are enough, and two are not.
    assert!(fit_to_others(&all[..4], 0).is_some() && fit_to_others(&all[..3], 0).is_none());
    assert!(fit_to_others(&all, 6).is_none());
}

/// A column of cells, each within this interval; a cell without a value is not printed.
fn column(name: &'static str, cells: &[Option<f64>], half_width: f64) -> Printed<'static> {
    let print = |value: f64| ("", Estimate { value, uncertainty: Uncertainty::Bound(half_width) });
    (name, cells.iter().map(|cell| cell.map(print)).collect())
}

const A: [Option<f64>; 6] = [Some(10.0), Some(20.0), Some(30.0), None, Some(40.0), Some(50.0)];

#[test]
fn a_row_is_broken_where_neither_difference_nor_ratio_is_that_of_the_others() {
    // One less everywhere, and 5 at the third row.
    let b = [Some(9.0), Some(19.0), Some(25.0), Some(1.0), Some(39.0), Some(49.0)];
    let (a, b) = (column("a", &A, 0.01), column("b", &b, 0.02));
    let broken = find_broken_rows(&a, &b);
    let [(row, of_a, of_b)] = &broken[..] else { panic!("one row") };
    // The others do not spread, except by rounding of .03 / 6^(1/2).
    let allowed = T_3 * 0.03 / 6f64.sqrt() + 0.03;
    assert_eq!((*row, of_a.by.as_str(), of_b.by.as_str()), (2, "b", "a"));
    assert!(are_close(of_a.expected, 26.0) && are_close(of_b.expected, 29.0));
    for found in [of_a, of_b] {
        assert!(are_close(found.half_width, allowed) && are_close(found.excess, 4.0 / allowed), "{}", found.excess);
    }
}

#[test]
fn columns_with_one_ratio_or_one_difference_have_no_broken_row() {
    // Four rows have little light, and one has much.
    let uneven = [10.0, 11.0, 12.0, 13.0, 100.0].map(Some);
    let ratio = uneven.map(|cell| cell.map(|value| 0.9 * value));
    assert!(find_broken_rows(&column("a", &uneven, 0.01), &column("b", &ratio, 0.01)).is_empty());
    let difference = uneven.map(|cell| cell.map(|value| value - 3.0));
    assert!(find_broken_rows(&column("a", &uneven, 0.01), &column("b", &difference, 0.01)).is_empty());
    // Darkness has no ratio: then the difference decides.
    let mut dark = difference;
    dark[0] = Some(0.0);
    let broken = find_broken_rows(&column("a", &uneven, 0.01), &column("b", &dark, 0.01));
    assert_eq!(broken.iter().map(|(row, ..)| *row).collect::<Vec<_>>(), [0]);
}

#[test]
fn a_cell_contradicts_a_law_beyond_both_intervals() {
    let columns = [column("a", &A, 0.1)];
    for (expected, is_misfit) in [(10.29, false), (10.31, true), (9.71, false), (9.69, true)] {
        let lawful = Estimate { value: expected, uncertainty: Uncertainty::Bound(0.2) };
        let found = misfits(&columns, &[(0, "a", lawful)]);
        assert_eq!(found.len(), usize::from(is_misfit), "{expected}");
        if let Some(misfit) = found.first() {
            assert_eq!((misfit.row, misfit.column.as_str(), misfit.expected), (0, "a", expected));
            assert!(are_close(misfit.half_width, 0.3));
        }
        // A cell that is not printed contradicts nothing.
        assert!(misfits(&columns, &[(3, "a", lawful), (9, "a", lawful), (0, "b", lawful)]).is_empty());
    }
}

#[test]
fn of_three_columns_the_one_that_two_contradict_does_not_fit() {
    let b = A.map(|cell| cell.map(|value| value - 1.0));
    let mut c = A.map(|cell| cell.map(|value| value + 2.0));
    c[2] = Some(50.0);
    let columns = [column("a", &A, 0.01), column("b", &b, 0.01), column("c", &c, 0.01)];
    let found = misfits(&columns, &[]);
    let [misfit] = &found[..] else { panic!("{found:?}") };
    assert_eq!((misfit.row, misfit.column.as_str(), &misfit.by[..]), (2, "c", &["a".to_owned(), "b".to_owned()][..]));
    // Each expects 32, by the same excess.
    assert!(are_close(misfit.expected, 32.0), "{misfit:?}");
    // A pair of columns does not show which of both is wrong.
    let found = misfits(&columns[1..], &[]);
    assert_eq!(found.iter().map(|m| m.column.as_str()).collect::<Vec<_>>(), ["b", "c"]);
}
