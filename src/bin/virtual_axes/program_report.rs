//! Times, worst lines and feed of a part program, as text and as a section of a page.

use virtual_axes_core::text::escaped;
use virtual_axes_core::units::MILLIDEGREE;
use virtual_axes_nc::offline::{ProgramFigures, WorstLine};
use virtual_axes_report::{Section, Table, TableColumn};

use crate::feed_along_path::FeedAlongPath;
use crate::text_table;

/// Figures of a part program, and the feed along its path.
#[derive(Debug, Clone)]
pub struct ProgramReport {
    pub figures: ProgramFigures,
    pub feed: FeedAlongPath,
}

impl ProgramReport {
    /// Returns the times and a table of the worst lines.
    pub fn text(&self) -> String {
        let table = self.worst_table(escaped);
        text_table::wrapped_line(&self.times()) + &text_table::aligned(&table, &[1, 2])
    }

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

    fn times(&self) -> String {
        format!(
            "cycle time {:.2} s; motions at programmed feed alone {:.2} s",
            self.figures.cycle_time, self.figures.programmed_time
        )
    }

    /// Returns a table of the worst lines; `escape` is applied to the texts of lines.
    fn worst_table(&self, escape: impl Fn(&str) -> String) -> Table {
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
