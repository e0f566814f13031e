//! Report of a compilation: verdict, figures, lines before and after.

use serde_json::{Value, json};
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::text::escaped;
use virtual_axes_nc::compile::{CompileAim, CompileOptions, Compiled, CompiledFigures};
use virtual_axes_report::Table;

use crate::input::CommandInput;
use crate::output::text_table;

/// Number of lines in the table; the other forms contain all.
const LINES: usize = 10;
/// Longest text of a line in the table, characters.
const TEXT: usize = 60;
/// Micrometer, m.
const MICROMETER: f64 = 1e-6;

/// Compilation with its input.
pub(super) struct CompileOutput<'a> {
    pub input: &'a CommandInput,
    pub machine: &'a MachineConfig,
    pub options: &'a CompileOptions,
    pub found: &'a Compiled,
}

impl CompileOutput<'_> {
    /// Returns the verdict in one line.
    pub fn verdict(&self) -> String {
        let [before, after] = &self.found.figures;
        let um = |value: f64| format!("{:.1}", value / MICROMETER);
        let aim = match self.options.aim {
            CompileAim::Tolerance(tolerance) if after.worst > tolerance => {
                format!("; tolerance {} µm not held", um(tolerance))
            }
            CompileAim::Tolerance(tolerance) => format!("; tolerance {} µm held", um(tolerance)),
            CompileAim::Time(_) => String::new(),
        };
        if !self.found.is_changed {
            let (worst, time) = (um(before.worst), before.cycle_time);
            return format!(
                "program unchanged: no better one was found, contour error of the cuts up to {worst} µm in {time:.2} s{aim}\n"
            );
        }
        format!(
            "contour error of the cuts up to {} → {} µm on all plants, {} → {} µm on the nominal one; cycle time {:.2} → {:.2} s ({:+.1} %){aim}\n",
            um(before.worst),
            um(after.worst),
            um(before.nominal),
            um(after.nominal),
            before.cycle_time,
            after.cycle_time,
            100.0 * (after.cycle_time / before.cycle_time.max(f64::MIN_POSITIVE) - 1.0)
        )
    }

    /// Returns the line and the error beyond the tolerance.
    pub fn excess(&self) -> Option<String> {
        let after = &self.found.figures[1];
        let CompileAim::Tolerance(tolerance) = self.options.aim else { return None };
        if after.worst <= tolerance {
            return None;
        }
        let worst = self.found.lines.iter().max_by(|a, b| a.errors[1].total_cmp(&b.errors[1]));
        let place = worst.map_or(String::new(), |worst| format!(" on line {}", worst.line));
        Some(format!(
            "contour error {:.1} µm{place} is beyond the tolerance {:.1} µm; allow more, lower the feed there, or the deviation \
             of the plants (--by)",
            after.worst / MICROMETER,
            tolerance / MICROMETER
        ))
    }

    /// Returns verdict, changes and the lines with the largest errors.
    pub fn text(&self) -> String {
        let Compiled { eligible, left, counts: [points, extra, feeds], largest_shift, .. } = self.found;
        let mut text = text_table::wrapped_line(self.verdict().trim_end());
        text += &text_table::wrapped_line(&format!(
            "{points} points shifted, by at most {:.1} µm, {extra} extra points, {feeds} feeds changed, in {eligible} lines that can be changed",
            largest_shift / MICROMETER
        ));
        for (reason, count) in left {
            let lines = if *count == 1 { "line" } else { "lines" };
            text += &text_table::wrapped_line(&format!("{count} {lines} left as programmed: {reason}"));
        }
        let rows: Vec<Vec<String>> = self.rows().take(LINES).collect();
        if !rows.is_empty() {
            let columns = [("line", ""), ("text", ""), ("new", ""), ("before", "µm"), ("after", "µm")];
            let table = Table { rows, ..Table::new("", &columns) };
            text += &format!("\n{}", text_table::aligned(&table, &[1]));
        }
        text
    }

    /// Returns a row for each line at feed, the largest error before first.
    fn rows(&self) -> impl Iterator<Item = Vec<String>> {
        self.found.lines.iter().map(|line| {
            let short: String = line.texts[0].chars().take(TEXT).collect();
            let [before, after] = line.errors.map(|error| format!("{:.2}", error / MICROMETER));
            vec![line.line.to_string(), escaped(&short), line.new_line.to_string(), before, after]
        })
    }

    /// Returns all lines as CSV.
    pub fn csv(&self) -> String {
        let mut text = "line,new_line,before_um,after_um,text,new_text\n".to_owned();
        for line in &self.found.lines {
            let [before, after] = line.errors.map(|error| (error / MICROMETER).to_string());
            let [old, new] = line.texts.clone();
            text += &text_table::csv_row(&[
                line.line.to_string(),
                line.new_line.to_string(),
                before,
                after,
                old,
                new,
            ]);
        }
        text
    }

    /// Returns all figures as a JSON object.
    pub fn json(&self) -> Value {
        let figures = |figures: &CompiledFigures| {
            json!({
                "cycle_time_s": figures.cycle_time,
                "contour_error_um": {
                    "nominal": figures.nominal / MICROMETER,
                    "all_plants": figures.worst / MICROMETER,
                    "rms_all_plants": figures.rms / MICROMETER,
                },
            })
        };
        let [before, after] = &self.found.figures;
        let [points, extra, feeds] = self.found.counts;
        let lines = self.found.lines.iter().map(|line| {
            json!({
                "line": line.line,
                "new_line": line.new_line,
                "text": line.texts[0],
                "new_text": line.texts[1],
                "before_um": line.errors[0] / MICROMETER,
                "after_um": line.errors[1] / MICROMETER,
            })
        });
        json!({
            "input": self.input.name(),
            "machine": self.machine.name(),
            "is_changed": self.found.is_changed,
            "before": figures(before),
            "after": figures(after),
            "lines_changeable": self.found.eligible,
            "lines_left": self.found.left,
            "points_shifted": points,
            "extra_points": extra,
            "feeds_changed": feeds,
            "largest_shift_um": self.found.largest_shift / MICROMETER,
            "lines": lines.collect::<Vec<_>>(),
        })
    }
}
