//! Times, worst lines and path of a part program.

use virtual_axes_core::units::{MICROMETER, MILLIDEGREE};
use virtual_axes_nc::offline::{OperationSummary, ProgramEnergy, ProgramFigures, ProgramTimes, WorstLine};

use crate::{Table, TableColumn, ToolPath};

/// Number of lines at rapid traverse in tables, behind those at feed.
const RAPIDS: usize = 3;

/// Columns of times and energy.
const TIMES: [(&str, &str); 6] = [
    ("time", "s"),
    ("feed", "s"),
    ("rapid", "s"),
    ("dwell", "s"),
    ("auxiliary", "s"),
    ("electrical input", "J"),
];

/// Returns the cells of [`TIMES`].
fn part(times: &ProgramTimes, energy: Option<ProgramEnergy>) -> impl Iterator<Item = String> {
    let ProgramTimes { feed, rapid, dwell, auxiliary } = *times;
    let times = [times.total(), feed, rapid, dwell, auxiliary].map(|time| format!("{time:.2}"));
    times.into_iter().chain([energy.map_or("–".to_owned(), |energy| format!("{:.1}", energy.input))])
}

fn tool_name(tool: Option<u32>) -> String {
    tool.map_or("–".to_owned(), |tool| format!("T{tool}"))
}

/// Returns the times by kind of motion as one line.
pub fn time_shares(operations: &OperationSummary) -> String {
    let ProgramTimes { feed, rapid, dwell, auxiliary } = operations.times;
    format!(
        "feed {feed:.2} s, rapid traverse {rapid:.2} s, dwell {dwell:.2} s, auxiliary (tool changes, spindle) \
         {auxiliary:.2} s"
    )
}

/// Returns a table of the operations, of which the `most` longest; without rows if there is only one. `escape` is applied
/// to the texts.
pub fn operations_table(summary: &OperationSummary, most: usize, escape: impl Fn(&str) -> String) -> Table {
    let operations = &summary.operations;
    let mut times: Vec<f64> = operations.iter().map(|one| one.times.total()).collect();
    times.sort_by(|a, b| b.total_cmp(a));
    let least = times.get(most.saturating_sub(1)).copied().unwrap_or(0.0);
    let columns = [("line", ""), ("operation", ""), ("tool", "")];
    let mut table = Table::new("", &[&columns[..], &TIMES].concat());
    for one in operations.iter().filter(|one| operations.len() > 1 && one.times.total() >= least) {
        let text = if one.text.is_empty() { "start".to_owned() } else { escape(&one.text) };
        let row = [one.line.to_string(), text, tool_name(one.tool)].into_iter();
        table.rows.push(row.chain(part(&one.times, one.energy)).collect());
    }
    table.rows.truncate(most);
    if operations.iter().all(|one| one.energy.is_none()) {
        remove_energy(&mut table);
    }
    table
}

/// Returns a table of the tools; without rows if there is only one.
pub fn tools_table(summary: &OperationSummary) -> Table {
    let tools = &summary.tools;
    let mut table = Table::new("", &[&[("tool", "")][..], &TIMES].concat());
    for one in tools.iter().filter(|_| tools.len() > 1) {
        let row = std::iter::once(tool_name(one.tool)).chain(part(&one.times, one.energy));
        table.rows.push(row.collect());
    }
    if tools.iter().all(|one| one.energy.is_none()) {
        remove_energy(&mut table);
    }
    table
}

/// Removes the last column, the energy.
fn remove_energy(table: &mut Table) {
    table.columns.pop();
    table.rows.iter_mut().for_each(|row| row.truncate(table.columns.len()));
}

/// Figures of a part program, and its path.
#[derive(Debug, Clone)]
pub struct ProgramReport {
    /// Times and worst lines.
    pub figures: ProgramFigures,
    /// Path with feeds and lines.
    pub path: ToolPath,
}

impl ProgramReport {
    /// Creates a report whose path has the position cycles of the worst lines.
    pub fn new(figures: ProgramFigures, mut path: ToolPath) -> Self {
        let worst = figures.worst_lines.iter().chain(&figures.worst_rapids);
        path.worst = worst.map(|worst| worst.cycle).collect();
        Self { figures, path }
    }

    /// Returns the worst lines as a table of the page, whose rows show their places.
    pub fn page_table(&self, caption: String, run: usize) -> Table {
        let instants = self.lines().map(|(worst, _)| (run, worst.cycle.time)).collect();
        Table { caption, instants, ..self.worst_table(str::to_owned) }
    }

    /// Returns cycle time and programmed time as one line.
    pub fn times(&self) -> String {
        format!(
            "cycle time {:.2} s; motions at programmed feed alone {:.2} s",
            self.figures.cycle_time, self.figures.programmed_time
        )
    }

    /// Returns a table of the lines with the largest electrical input; `escape` is applied to their texts.
    pub fn energy_table(&self, escape: impl Fn(&str) -> String) -> Table {
        let columns = [("line", ""), ("text", ""), ("electrical input", "J"), ("copper loss", "J")];
        let mut table = Table::new("", &columns);
        for one in &self.figures.operations.energy_lines {
            let energies = [one.energy.input, one.energy.copper_loss].map(|energy| format!("{energy:.1}"));
            let row = [one.line.to_string(), escape(&one.text)].into_iter().chain(energies);
            table.rows.push(row.collect());
        }
        table
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
                worst.cycle.line.to_string(),
                escape(&worst.text),
                motion.to_owned(),
                worst.cause.text(),
                format!("{:.2}", worst.cycle.contour_error / MICROMETER),
                format!("{:.2}", worst.cycle.blending / MICROMETER),
                format!("{:.2}", worst.cycle.drives / MICROMETER),
                format!("{:.3}", worst.cycle.time),
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
