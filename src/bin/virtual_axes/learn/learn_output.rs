//! Output of `virtual_axes learn`: verdict, tables, JSON and the section of the page.

use serde_json::Value;
use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_core::text::escaped;
use virtual_axes_core::trial::Figures;
use virtual_axes_core::units::{MILLIDEGREE, Rounded};
use virtual_axes_identify::learn::{LearningIteration, LearningOptions, LearningResult};
use virtual_axes_io::files::{learning_end_text, learning_json};
use virtual_axes_report::{
    Chart, ChartAxis, ChartSeries, DisplayUnit, Panel, Section, SeriesStyle, Table, TableColumn,
};

use crate::input::CommandInput;
use crate::output::text_table;

/// Micrometers or microradians per m or rad.
const MICRO: f64 = 1e6;

/// Relative deviation of the plants for which the convergence condition is printed.
pub const DEVIATION: f64 = 0.3;

/// Result of the learning with its input.
pub struct Learned<'a> {
    /// Programmed setpoints.
    pub input: &'a CommandInput,
    /// Machine.
    pub config: &'a MachineConfig,
    /// Name of the position controller.
    pub controller: String,
    /// Options.
    pub options: &'a LearningOptions,
    /// Result.
    pub found: &'a LearningResult,
    /// Figures of the programmed and of the learned setpoints on other machines, by their parameters.
    pub others: Vec<(String, [Figures; 2])>,
    /// Warning on the feed of the scenario.
    pub warning: Option<String>,
}

impl Learned<'_> {
    /// Returns the errors before and after learning in one line, with the reason for an early end.
    pub fn verdict(&self) -> String {
        let runs = &self.found.iterations;
        let (first, best) = (&runs[0], &runs[self.found.best]);
        let name = if first.contour().is_some() { "max contour error" } else { "max error of an axis" };
        let is_angle =
            first.contour().is_none() && first.axes.iter().all(|axis| self.axis(axis.index).1 == "rad");
        let error = |run: &LearningIteration| match is_angle {
            true => format!("{:.3} mdeg", run.error() / MILLIDEGREE),
            false => format!("{:.2} µm", run.error() * MICRO),
        };
        let mut lines = vec![format!(
            "{name} {} → {} in iteration {} of {}",
            error(first),
            error(best),
            self.found.best,
            runs.len() - 1
        )];
        let rapids = |run: &LearningIteration| run.contour().and_then(|contour| contour.rapids);
        if let Some((before, after)) = rapids(first).zip(rapids(best)) {
            let [before, after] = [before, after].map(|rapids| rapids.max * MICRO);
            lines[0] += &format!("; at rapid traverse {before:.2} → {after:.2} µm");
        }
        lines.extend(learning_end_text(&self.found.end));
        if self.found.best == 0 {
            lines.push("no iteration is better than the programmed setpoints".to_owned());
        }
        lines.extend(self.warning.clone());
        lines.iter().map(|line| text_table::wrapped_line(&escaped(line))).collect()
    }

    /// Returns the verdict, the errors of each iteration and the convergence condition.
    pub fn text(&self) -> String {
        let head = format!(
            "{}: {}, {}, encoder step {}",
            escaped(self.input.name()),
            escaped(self.config.name()),
            self.controller,
            self.encoder_step()
        );
        let tables: Vec<String> = self.tables().iter().map(text_table::text).collect();
        format!("{}\n{}\n\n{}", self.verdict(), head, tables.join("\n"))
    }

    fn encoder_step(&self) -> String {
        match self.options.encoder_step {
            0.0 => "0 (exact positions)".to_owned(),
            step => format!("{} µm or µrad", Rounded(step * MICRO)),
        }
    }

    /// Returns the errors as comma-separated values in full precision, SI units.
    pub fn csv(&self) -> String {
        let mut text = "iteration,figure,value,unit\n".to_owned();
        for (number, run) in self.found.iterations.iter().enumerate() {
            let contour =
                run.figures.contour.iter().flat_map(|contour| {
                    [("max contour error", contour.max), ("RMS contour error", contour.rms)]
                });
            let contour = contour.map(|(name, value)| (name.to_owned(), value, "m"));
            let axes = run.axes.iter().flat_map(|error| {
                let (name, unit) = self.axis(error.index);
                [
                    (format!("{name} max error"), error.max, unit),
                    (format!("{name} RMS error"), error.rms, unit),
                    (format!("{name} max compensation"), error.compensation, unit),
                ]
            });
            for (name, value, unit) in contour.chain(axes) {
                text.push_str(&text_table::csv_row(&[
                    number.to_string(),
                    name,
                    value.to_string(),
                    unit.to_owned(),
                ]));
            }
        }
        text
    }

    /// Returns name and unit of an axis of the machine.
    fn axis(&self, index: usize) -> (&str, &'static str) {
        self.config
            .axes()
            .get(index)
            .map_or(("", ""), |axis| (axis.name(), if axis.kind() == AxisKind::Linear { "m" } else { "rad" }))
    }

    /// Returns the errors of the iterations, the convergence condition, and the errors on other machines.
    fn tables(&self) -> Vec<Table> {
        let others = (!self.others.is_empty()).then(|| self.on_others());
        [self.errors(), self.condition()].into_iter().chain(others).collect()
    }

    /// Returns the largest contour errors of the programmed and of the learned setpoints on other machines.
    fn on_others(&self) -> Table {
        let cell = |figures: &Figures| {
            figures.contour.map_or("–".to_owned(), |contour| format!("{:.2}", contour.max * MICRO))
        };
        let row = |(name, [programmed, learned]): &(String, [Figures; 2])| {
            vec![name.clone(), cell(programmed), cell(learned)]
        };
        let columns = [("on", ""), ("programmed", "µm"), ("learned", "µm")];
        let rows = self.others.iter().map(row).collect();
        Table { rows, ..Table::new("Largest contour error of both setpoints on another machine", &columns) }
    }

    /// Returns the errors of each iteration.
    fn errors(&self) -> Table {
        let mut columns = vec![TableColumn::new("iteration", "")];
        let runs = &self.found.iterations;
        if runs[0].contour().is_some() {
            columns.push(TableColumn::new("contour max", "µm"));
            columns.push(TableColumn::new("contour RMS", "µm"));
        }
        for error in &runs[0].axes {
            let (name, unit) = self.axis(error.index);
            let unit = if unit == "m" { "µm" } else { "mdeg" };
            columns.push(TableColumn::new(format!("{name} max"), unit));
            columns.push(TableColumn::new(format!("{name} RMS"), unit));
        }
        let cell = |value: f64| format!("{:.2}", value * MICRO);
        let of_axis = |index: usize, value: f64| match self.axis(index) {
            (_, "m") => cell(value),
            _ => format!("{:.3}", value / MILLIDEGREE),
        };
        let row = |(number, run): (usize, &LearningIteration)| {
            let contour = run.contour().into_iter().flat_map(|contour| [contour.max, contour.rms]);
            let axes = run.axes.iter();
            let axes = axes.flat_map(|error| [error.max, error.rms].map(|value| of_axis(error.index, value)));
            let best = if number == self.found.best && number > 0 {
                format!("{number} (best)")
            } else {
                number.to_string()
            };
            std::iter::once(best).chain(contour.map(cell)).chain(axes).collect()
        };
        let rows = runs.iter().enumerate().map(row).collect();
        let caption = "Contour error, and delay-compensated following error of the axes".to_owned();
        Table { caption, columns, rows, ..Table::default() }
    }

    /// Returns the convergence condition of each axis.
    fn condition(&self) -> Table {
        let plants = format!("plants ±{:.0} %", DEVIATION * 100.0);
        let columns = [
            ("axis", ""),
            ("bandwidth", "Hz"),
            ("|Q (1 − L T)|", ""),
            ("at", "Hz"),
            (&plants, ""),
            ("at", "Hz"),
        ];
        let row = |axis: &virtual_axes_identify::learn::LearningAxis| {
            let (nominal, worst) = (axis.filter.nominal(), axis.worst_deviating());
            vec![
                axis.name.clone(),
                format!("{:.1}", axis.filter.bandwidth()),
                format!("{:.3}", nominal.factor),
                format!("{:.1}", nominal.frequency),
                if worst.factor.is_finite() { format!("{:.3}", worst.factor) } else { "unstable".to_owned() },
                format!("{:.1}", worst.frequency),
            ]
        };
        let rows = self.found.axes.iter().map(row).collect();
        let caption = "Largest contraction factor of an iteration; it must be below 1";
        Table { rows, ..Table::new(caption, &columns) }
    }

    /// Returns the result as a JSON object.
    pub fn json(&self) -> Value {
        let names = (self.input.name(), self.input.description());
        learning_json(names, (self.config, &self.controller), self.options, self.found, &self.others)
    }

    /// Returns the section of the page: tables and a plot of the errors over the iterations.
    pub fn sections(&self) -> Vec<Section> {
        let runs = &self.found.iterations;
        let numbers: Vec<f64> = (0..runs.len()).map(|number| number as f64).collect();
        let series = |label: &str, style, value: &dyn Fn(&LearningIteration) -> f64| {
            let values: Vec<f64> = runs.iter().map(value).collect();
            ChartSeries::from_xy(label, style, &numbers, &values)
        };
        let contour = |rms: bool| {
            move |run: &LearningIteration| {
                run.figures.contour.map_or(f64::NAN, |c| if rms { c.rms } else { c.max })
            }
        };
        let mut panels = Vec::new();
        if runs[0].figures.contour.is_some() {
            let lines = vec![
                series("largest", SeriesStyle::Line(0), &contour(false)),
                series("RMS", SeriesStyle::Line(1), &contour(true)),
            ];
            panels.push(Panel::new(ChartAxis::new("Contour error", DisplayUnit::MICROMETER), lines));
        }
        for (place, error) in runs[0].axes.iter().enumerate() {
            let (name, unit) = self.axis(error.index);
            let unit = if unit == "m" { DisplayUnit::MICROMETER } else { DisplayUnit::MILLIDEGREE };
            let lines = vec![
                series("largest", SeriesStyle::Line(0), &|run| run.axes[place].max),
                series("RMS", SeriesStyle::Line(1), &|run| run.axes[place].rms),
            ];
            panels.push(Panel::new(ChartAxis::new(format!("Error of {name}"), unit), lines));
        }
        let iterations = ChartAxis::new("Iteration", DisplayUnit::NONE);
        let chart = Chart::new("Errors over the iterations", iterations, panels);
        vec![Section { tables: self.tables(), charts: vec![chart], ..Section::new("Iterative learning") }]
    }
}
