//! Aligned tables for the terminal, and how numbers are written in them.

use crate::check::CheckReport;
use crate::plan::CheckRow;
use crate::planner::derivatives::DerivativeError;
use crate::planner::violation::BlockViolation;
use crate::visible::visible;
use crate::warp::{Distribution, MapReport};

/// A table with a header and right-aligned columns of numbers.
pub struct Table {
    header: Vec<String>,
    right: Vec<bool>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows; a column whose name starts with `>` is right-aligned.
    pub fn new(columns: &[&str]) -> Self {
        Self {
            header: columns.iter().map(|c| c.trim_start_matches('>').to_owned()).collect(),
            right: columns.iter().map(|c| c.starts_with('>')).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row; missing cells stay empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        let cells = cells.into_iter().take(self.header.len());
        let mut cells: Vec<String> = cells.map(|cell| visible(&cell).into_owned()).collect();
        cells.resize(self.header.len(), String::new());
        self.rows.push(cells);
    }

    /// The lines; `paint` may color a padded cell, given its row and column.
    pub fn lines(&self, paint: impl Fn(usize, usize, String) -> String) -> Vec<String> {
        let width = |c: usize| {
            let cells = self.rows.iter().map(|row| row[c].chars().count());
            cells.chain([self.header[c].chars().count()]).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.header.len()).map(width).collect();
        let pad = |text: &str, c: usize| {
            let blanks = " ".repeat(widths[c] - text.chars().count());
            if self.right[c] { format!("{blanks}{text}") } else { format!("{text}{blanks}") }
        };
        let line = |cells: Vec<String>| cells.join("  ").trim_end().to_owned();
        let header = line(self.header.iter().enumerate().map(|(c, text)| pad(text, c)).collect());
        let body = self.rows.iter().enumerate().map(|(r, row)| {
            line(row.iter().enumerate().map(|(c, text)| paint(r, c, pad(text, c))).collect())
        });
        std::iter::once(header).chain(body).collect()
    }
}

/// Value, limit and verdict of each law, followed by the figures, which have no limit.
pub fn check_table(report: &CheckReport, color: bool) -> String {
    let mut table = Table::new(&["check", ">value", ">limit", "unit", "verdict", "worst at"]);
    for row in &report.rows {
        let verdict = if row.passed { "ok" } else { "FAILS" };
        table.row([
            row.name.clone(),
            number(row.value),
            number(row.limit),
            row.unit.clone(),
            verdict.into(),
            place(row),
        ]);
    }
    for row in &report.figures {
        table.row([
            row.name.clone(),
            number(row.value),
            "–".into(),
            row.unit.clone(),
            String::new(),
            place(row),
        ]);
    }
    let paint = |r: usize, c: usize, text: String| match (
        color && c == 4,
        report.rows.get(r).map(|row| row.passed),
    ) {
        (true, Some(true)) => format!("\x1b[32m{text}\x1b[0m"),
        (true, Some(false)) => format!("\x1b[1;31m{text}\x1b[0m"),
        _ => text,
    };
    table.lines(paint).join("\n")
}

/// "all 30 checks hold" or "2 of 30 checks fail".
pub fn check_counts(rows: &[CheckRow]) -> String {
    match rows.iter().filter(|row| !row.passed).count() {
        0 => format!("all {} checks hold", rows.len()),
        1 => format!("1 of {} checks fails", rows.len()),
        failed => format!("{failed} of {} checks fail", rows.len()),
    }
}

/// The largest violation of every constraint, units of the NLP.
pub fn violation_table(violations: &[BlockViolation], tolerance: f64) -> String {
    let mut table = Table::new(&["constraint", ">rows", ">largest", "", "worst at"]);
    for block in violations {
        let [x, y] = block.place;
        let place = match block.largest {
            0.0 => String::new(),
            _ => {
                let foot = block.foot.as_ref().map_or(String::new(), |foot| format!(" {foot}"));
                format!("{:.3} s{foot}, base at ({x:.2}, {y:.2}) m", block.time)
            }
        };
        let verdict = if block.largest <= tolerance { "ok" } else { "violated" };
        table.row([
            block.block.clone(),
            block.rows.to_string(),
            number(block.largest),
            verdict.into(),
            place,
        ]);
    }
    table.lines(|_, _, text| text).join("\n")
}

/// Errors of the analytic derivatives against central differences, by block.
pub fn derivative_table(errors: &[DerivativeError]) -> String {
    let mut table = Table::new(&["derivatives of", ">largest error", ">missing", "at"]);
    for error in errors {
        table.row([
            error.block.clone(),
            number(error.largest),
            error.missing.to_string(),
            error.place.clone(),
        ]);
    }
    table.lines(|_, _, text| text).join("\n")
}

/// Size, convergence and quality of a map.
pub fn map_table(report: &MapReport, cached: bool) -> String {
    let [x, y, z] = report.cells;
    let origin = if cached { "from the cache, built" } else { "built" };
    let ending = if report.converged { "converged" } else { "NOT CONVERGED" };
    let folded = match report.inverted_points {
        0 => "no folds".to_owned(),
        n => format!("FOLDED at {n} points"),
    };
    let method = report.method.name();
    let head = format!(
        "Map by {method}, {x}×{y}×{z} cells, {origin} in {} s: {ending} after {} iterations, {folded}\n\
         Distance from the terrain: {} mm rms, {} mm max; smallest determinant {}; scale at the ground {} to {}\n",
        number(report.seconds),
        report.iterations,
        number(1e3 * report.misfit_rms),
        number(1e3 * report.misfit_max),
        number(report.min_determinant),
        number(report.scale[0]),
        number(report.scale[1]),
    );
    let mut table = Table::new(&["", ">mean", ">median", ">95 %", ">max", "unit"]);
    let mut row = |name: &str, d: &Distribution, factor: f64, unit: &str| {
        let figures = [d.mean, d.median, d.p95, d.max].map(|v| number(factor * v));
        table.row([name.to_owned()].into_iter().chain(figures).chain([unit.to_owned()]));
    };
    row("conformal error at the ground", &report.conformal_ground, 100.0, "%");
    row("… up to 0.5 m above", &report.conformal_near_ground, 100.0, "%");
    row("… at the torso, 0.4 to 0.6 m above", &report.conformal_torso, 100.0, "%");
    row("angle of J z to the terrain's normal", &report.normal_angle, 1.0, "°");
    let rejected: String =
        report.rejected.iter().map(|map| format!("Rejected: {}: {}\n", map.method.name(), map.why)).collect();
    format!("{rejected}{head}{}", table.lines(|_, _, text| text).join("\n"))
}

/// Time and foot at which a check is worst.
fn place(row: &CheckRow) -> String {
    // A law that holds exactly has no worst place.
    if row.value == 0.0 {
        return String::new();
    }
    let time = row.time.map(|t| format!("{t:.3} s"));
    [time, row.foot.clone()].into_iter().flatten().collect::<Vec<_>>().join(" ")
}

/// A number with three significant digits, in scientific notation below 10⁻³ and from 10⁵ on.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".into()
    } else if !value.is_finite() {
        value.to_string()
    } else if !(1e-3..1e5).contains(&size) {
        format!("{value:.1e}")
    } else {
        let decimals = (2 - size.log10().floor() as i32).clamp(0, 4) as usize;
        format!("{value:.decimals$}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        for (value, text) in [
            (0.0, "0"),
            (0.012345, "0.0123"),
            (3.0, "3.00"),
            (-41.26, "-41.3"),
            (12345.6, "12346"),
            (1e-7, "1.0e-7"),
            (3e8, "3.0e8"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn columns_are_aligned_by_characters() {
        let mut table = Table::new(&["a", ">b", "c"]);
        table.row(["µµµ".to_owned(), "1".to_owned(), "x".to_owned()]);
        table.row(["y".to_owned(), "100".to_owned()]);
        assert_eq!(table.lines(|_, _, text| text), ["a      b  c", "µµµ    1  x", "y    100"]);
    }
}
