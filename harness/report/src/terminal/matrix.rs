//! The verdict matrix: rows are procedures, columns are engines.

use std::ops::Range;

use comfy_table::{Attribute, Cell as TableCell, Color};

use super::screen::{Screen, Style, draw_table};
use crate::matrix::{Cell, Row as MatrixRow, matrix};
use crate::words::abridged;
use luxproof_model::{Report, Verdict};

/// The colour of a verdict.
pub(super) const fn colour(verdict: Verdict) -> Color {
    match verdict {
        Verdict::Pass => Color::Green,
        Verdict::KnownDeviation | Verdict::NotJudged => Color::Cyan,
        Verdict::Undecided => Color::Yellow,
        Verdict::Fail | Verdict::UnexpectedPass | Verdict::Missing => Color::Red,
    }
}

/// Formats a cell of the matrix, in full or in brief.
type CellFormat = fn(&Cell) -> String;

/// Where the matrix shows the name of a case.
#[derive(Clone, Copy, PartialEq, Eq)]
enum CasePosition {
    /// In the first column.
    InFront,
    /// On the line above the rows of the case.
    Above,
}

/// A layout of the verdict matrix.
#[derive(Clone, Copy)]
struct MatrixLayout {
    case: CasePosition,
    format: CellFormat,
    /// Letters to a line.
    width: usize,
}

/// Draws the verdict matrix in the most detailed layout that fits the screen.
pub(super) fn verdict_matrix(report: &Report, screen: Screen) -> String {
    let (all, rows) = (0..report.engines.len(), matrix(report));
    let full = MatrixLayout { case: CasePosition::InFront, format: Cell::text, width: screen.width() };
    let brief = MatrixLayout { format: Cell::brief, ..full };
    let narrow = MatrixLayout { case: CasePosition::Above, ..brief };
    let layout = [full, brief]
        .into_iter()
        .find(|layout| screen.has_room_for(&draw_matrix(report, &rows, &all, *layout, Style::Plain)))
        .unwrap_or(narrow);
    screen.draw_in_blocks(all.len(), |range, style| draw_matrix(report, &rows, &range, layout, style))
}

/// The name of a row's case where the row is the first of that case.
fn case_of_first_row(rows: &[MatrixRow], k: usize) -> Option<&str> {
    (k == 0 || rows[k - 1].case != rows[k].case).then_some(rows[k].case.as_str())
}

/// Draws the verdicts of some of the engines.
fn draw_matrix(
    report: &Report,
    rows: &[MatrixRow],
    engines: &Range<usize>,
    layout: MatrixLayout,
    style: Style,
) -> String {
    let is_in_front = report.is_suite() && layout.case == CasePosition::InFront;
    let heads = if is_in_front { &["Verdicts", "procedure", "against"][..] } else { &["Verdicts", "against"] };
    let names = report.engines[engines.clone()].iter().map(|e| e.id.as_str());
    let mut cells: Vec<Vec<TableCell>> = vec![];
    for (k, row) in rows.iter().enumerate() {
        let mut line = vec![];
        if is_in_front {
            let case = case_of_first_row(rows, k).unwrap_or_default();
            line.push(TableCell::new(case).add_attribute(Attribute::Bold));
        }
        line.extend([TableCell::new(&row.label), TableCell::new(row.basis)]);
        line.extend(row.cells[engines.clone()].iter().map(|cell| matrix_cell(cell, layout.format)));
        cells.push(line);
    }
    let table = draw_table(heads.iter().copied().chain(names), cells, 0..0, style);
    if is_in_front || !report.is_suite() {
        return table;
    }
    let mut lines = vec![];
    for (k, line) in table.lines().enumerate() {
        // The first line is the table's head.
        if let Some(case) = k.checked_sub(1).and_then(|k| case_of_first_row(rows, k)) {
            lines.push(draw_table([abridged(case, layout.width - 1)], Vec::<Vec<TableCell>>::new(), 0..0, style));
        }
        lines.push(format!(" {line}"));
    }
    lines.join("\n")
}

/// A cell of the matrix, in the colour of its verdict.
fn matrix_cell(cell: &Cell, format: CellFormat) -> TableCell {
    let drawn = TableCell::new(format(cell));
    match cell {
        Cell::Judged { verdict, .. } => drawn.fg(colour(*verdict)),
        _ => drawn,
    }
}
