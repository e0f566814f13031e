//! Times, worst lines and feed of a part program: texts, and a section of a page.

use virtual_axes_core::units::MILLIDEGREE;
use virtual_axes_nc::offline::{ProgramFigures, WorstLine};

use super::FeedAlongPath;
use crate::{Section, Table, TableColumn};

/// Figures of a part program, and the feed along its path.
#[derive(Debug, Clone)]
pub struct ProgramReport {
    /// Times and worst lines.
    pub figures: ProgramFigures,
    /// Programmed and reached feed over the path position.
    pub feed: FeedAlongPath,
}

impl ProgramReport {
    /// Returns a section of a page: times, worst lines and feed along the path.
    pub fn section(&self, heading: &str) -> Section {
        let mut table = self.worst_table(str::to_owned);
        table.caption = "Lines with the largest contour errors".to_owned();
        Section {
            paragraphs: vec![format!("{}.", self.times())],
            tables: vec![table],
            charts: vec![self.feed.chart()],
            ..Section::new(heading)
        }
    }

    /// Returns cycle time and programmed time as one line.
    pub fn times(&self) -> String {
        format!(
            "cycle time {:.2} s; motions at programmed feed alone {:.2} s",
            self.figures.cycle_time, self.figures.programmed_time
        )
    }

    /// Returns a table of the worst lines; `escape` is applied to the texts of lines.
    pub fn worst_table(&self, escape: impl Fn(&str) -> String) -> Table {
        let column =
            |name: &str, unit: &str| TableColumn { name: name.to_owned(), unit: unit.to_owned(), run: None };
        let row = |worst: &WorstLine| {
            vec![
                worst.line.to_string(),
                escape(&worst.text),
                worst.cause.text(),
                format!("{:.2}", worst.error * 1e6),
                format!("{:.3}", worst.time),
            ]
        };
        let mut columns = vec![
            column("line", ""),
            column("text", ""),
            column("cause", ""),
            column("contour error", "µm"),
            column("time", "s"),
        ];
        let mut rows: Vec<Vec<String>> = self.figures.worst_lines.iter().map(row).collect();
        if self.figures.worst_lines.iter().any(|worst| worst.orientation > 0.0) {
            columns.insert(4, column("orientation error", "mdeg"));
            for (row, worst) in rows.iter_mut().zip(&self.figures.worst_lines) {
                row.insert(4, format!("{:.2}", worst.orientation / MILLIDEGREE));
            }
        }
        Table { caption: String::new(), columns, rows }
    }
}
