//! Times, worst lines and path of a part program.

use virtual_axes_core::units::{MICROMETER, MILLIDEGREE};
use virtual_axes_nc::offline::{ProgramFigures, WorstLine};

use crate::{Table, TableColumn, ToolPath};

/// Number of lines at rapid traverse in tables, behind those at feed.
const RAPIDS: usize = 3;

/// Figures of a part program, and its path.
#[derive(Debug, Clone)]
pub struct ProgramReport {
    /// Times and worst lines.
    pub figures: ProgramFigures,
    /// Path with feeds and lines.
    pub path: ToolPath,
}

impl ProgramReport {
    /// Returns the worst lines as a table of the page, whose rows show their places.
    pub fn page_table(&self, caption: String, run: usize) -> Table {
        let instants = self.lines().map(|(worst, _)| (run, worst.time)).collect();
        Table { caption, instants, ..self.worst_table(str::to_owned) }
    }

    /// Returns cycle time and programmed time as one line.
    pub fn times(&self) -> String {
        format!(
            "cycle time {:.2} s; motions at programmed feed alone {:.2} s",
            self.figures.cycle_time, self.figures.programmed_time
        )
    }

    /// Returns the worst lines of the motions at feed, then those at rapid traverse, with the kind of motion.
    fn lines(&self) -> impl Iterator<Item = (&WorstLine, &'static str)> {
        let rapids = self.figures.worst_rapids.iter().take(RAPIDS);
        self.figures
            .worst_lines
            .iter()
            .map(|worst| (worst, "feed"))
            .chain(rapids.map(|worst| (worst, "rapid")))
    }

    /// Returns a table of the worst lines; `escape` is applied to the texts of lines.
    pub fn worst_table(&self, escape: impl Fn(&str) -> String) -> Table {
        let row = |(worst, motion): (&WorstLine, &str)| {
            vec![
                worst.line.to_string(),
                escape(&worst.text),
                motion.to_owned(),
                worst.cause.text(),
                format!("{:.2}", worst.error / MICROMETER),
                format!("{:.2}", worst.blending / MICROMETER),
                format!("{:.2}", worst.drives / MICROMETER),
                format!("{:.3}", worst.time),
            ]
        };
        let columns = [
            ("line", ""),
            ("text", ""),
            ("motion", ""),
            ("cause", ""),
            ("contour error", "µm"),
            ("blending", "µm"),
            ("drives", "µm"),
            ("time", "s"),
        ];
        let mut table = Table::new("", &columns);
        table.rows.extend(self.lines().map(row));
        if self.lines().any(|(worst, _)| worst.orientation > 0.0) {
            table.columns.insert(7, TableColumn::new("orientation error", "mdeg"));
            for (row, (worst, _)) in table.rows.iter_mut().zip(self.lines()) {
                row.insert(7, format!("{:.2}", worst.orientation / MILLIDEGREE));
            }
        }
        table
    }
}
