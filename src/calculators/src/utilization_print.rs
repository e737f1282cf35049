//! Prints a table of coefficients of utilization in percent, as photometric reports do.
//!
//! Layout after IES LM-57, Calculating Coefficients of Utilization, Wall and Ceiling Exitance.

use std::fmt;

use super::zonal_cavity::UtilizationTable;

impl fmt::Display for UtilizationTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Coefficients of utilization in percent, zonal cavity method")?;
        writeln!(f, "Effective floor cavity reflectance {:.0} %", percent(self.floor_cavity))?;
        write!(f, "\nceiling ")?;
        for (k, (ceiling, _)) in self.columns.iter().enumerate() {
            let repeated = k > 0 && self.columns[k - 1].0 == *ceiling;
            let text = if repeated { String::new() } else { format!("{:.0}", percent(*ceiling)) };
            write!(f, "{}{text:>4}", self.gap(k))?;
        }
        write!(f, "\nwalls   ")?;
        for (k, (_, walls)) in self.columns.iter().enumerate() {
            write!(f, "{}{:>4.0}", self.gap(k), percent(*walls))?;
        }
        write!(f, "\nRCR")?;
        for (ratio, row) in self.rows.iter().enumerate() {
            write!(f, "\n{ratio:>3}     ")?;
            for (k, cell) in row.iter().enumerate() {
                write!(f, "{}{:>4.0}", self.gap(k), percent(cell.utilization))?;
            }
        }
        writeln!(f)
    }
}

impl UtilizationTable {
    /// The gap before a column, which separates columns of different ceilings.
    fn gap(&self, column: usize) -> &'static str {
        if column > 0 && self.columns[column].0 != self.columns[column - 1].0 { "  " } else { "" }
    }
}

/// A fraction in whole percent.
fn percent(fraction: f64) -> f64 {
    (100.0 * fraction).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zonal_cavity::ZonalFlux;
    use luxproof_photometry::LuminousIntensityDistribution;

    /// A downlight; the tests of the zonal cavity method have its table from an independent program.
    #[test]
    fn a_table_prints_percent_by_ceiling_walls_and_cavity_ratio() {
        let gamma = vec![0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0];
        let candela = vec![1000.0, 950.0, 780.0, 420.0, 150.0, 30.0, 0.0];
        let distribution = LuminousIntensityDistribution::axial(gamma, candela).unwrap();
        let lamp_lumens = 1.25 * distribution.flux().value();
        let table = UtilizationTable::customary(&ZonalFlux::of(&distribution), lamp_lumens).unwrap();
        let text = table.to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[3],
            "ceiling   80                70                50            30            10             0"
        );
        assert_eq!(
            lines[4],
            "walls     70  50  30  10    70  50  30  10    50  30  10    50  30  10    50  30  10     0"
        );
        // Columns (80, 70), (70, 30), (30, 50), (0, 0) of the independent table at ratio 0, 5 and 10.
        for (ratio, golden) in [(0, [95, 93, 85, 80]), (5, [66, 50, 53, 43]), (10, [47, 32, 36, 26])] {
            let cells: Vec<u32> = lines[6 + ratio].split_whitespace().map(|cell| cell.parse().unwrap()).collect();
            assert_eq!((cells[0] as usize, cells.len()), (ratio, 19));
            assert_eq!([cells[1], cells[7], cells[12], cells[18]], golden, "ratio {ratio}");
        }
    }
}
