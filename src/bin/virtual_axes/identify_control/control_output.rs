//! Output of the identified profile of a control.

use serde_json::{Value, json};
use virtual_axes_nc::identify_control::{ControlIdentification, ControlValue};
use virtual_axes_report::Table;

use crate::output::text_table;

/// Relative difference of the times of the program in the log and in the profile that is reported.
const SAME_TIME: f64 = 0.01;

/// Identified profile, and the time of the program in it, s, or why it cannot be planned.
pub(super) struct ControlOutput<'a> {
    pub found: &'a ControlIdentification,
    pub planned: Result<f64, String>,
}

/// Formats a number with a number of significant digits.
pub(super) fn significant(value: f64, digits: i32) -> String {
    let decimals =
        (f64::from(digits) - 1.0 - value.abs().max(1e-12).log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

/// Formats a value with the digits that its interval leaves.
fn value_text(value: &ControlValue) -> [String; 2] {
    let decimals = (1.0 - value.half_width.max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
    [format!("{:.decimals$}", value.value), format!("{:.decimals$}", value.half_width)]
}

impl ControlOutput<'_> {
    /// Returns the verdict in one line.
    pub fn verdict(&self) -> String {
        let time = self.found.motion_time;
        match &self.planned {
            Ok(planned) => format!(
                "{} parameters; the program lasts {time:.3} s in the log, {planned:.3} s in the profile ({:+.2} %)\n",
                self.found.values.len(),
                100.0 * (planned / time - 1.0)
            ),
            Err(error) => format!(
                "{} parameters; the program lasts {time:.3} s in the log, and cannot be planned: {error}\n",
                self.found.values.len()
            ),
        }
    }

    /// Returns the warnings, with one if the program takes another time in the profile than in the log and no other cause is
    /// known.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = self.found.warnings.clone();
        let change = self.planned.as_ref().map_or(0.0, |planned| planned / self.found.motion_time - 1.0);
        if change.abs() > SAME_TIME && warnings.is_empty() && !self.found.values.is_empty() {
            warnings.push(format!(
                "the program takes {:.1} % {} time in the profile than in the log: the control has properties outside the profile \
                 (a jerk limit together with filters, exponential filters), or the log has other motions before or behind the \
                 program; values can be wrong beyond their intervals",
                100.0 * change.abs(),
                if change > 0.0 { "more" } else { "less" }
            ));
        }
        warnings
    }

    /// Returns verdict, parameters, choices and what the program cannot show.
    pub fn text(&self) -> String {
        let mut text = text_table::wrapped_line(self.verdict().trim_end());
        let columns = [("parameter", ""), ("value", ""), ("±", ""), ("unit", ""), ("motions", "")];
        let rows = self.found.values.iter().map(|value| {
            let [number, half_width] = value_text(value);
            vec![value.key.clone(), number, half_width, value.unit.to_owned(), value.count.to_string()]
        });
        let table = Table { rows: rows.collect(), ..Table::new("", &columns) };
        text += &text_table::aligned(&table, &[0, 3]);
        for (key, value, reason) in self.found.choices.iter().filter(|(_, _, reason)| !reason.is_empty()) {
            text += &text_table::wrapped_line(&format!("{key} = {value}: {reason}"));
        }
        for missing in &self.found.not_shown {
            text += &text_table::wrapped_line(&format!("not shown by the program: {missing}"));
        }
        text
    }

    /// Returns the rows of the parameters.
    pub fn csv(&self) -> String {
        let head = ["parameter", "value", "half_width", "unit", "motions"].map(str::to_owned);
        let mut text = text_table::csv_row(&head);
        for value in &self.found.values {
            let numbers = [value.value.to_string(), value.half_width.to_string()];
            let [number, half_width] = numbers;
            let row = [value.key.clone(), number, half_width, value.unit.to_owned(), value.count.to_string()];
            text += &text_table::csv_row(&row);
        }
        text
    }

    /// Returns all figures.
    pub fn json(&self) -> Value {
        let values = self.found.values.iter().map(|value| {
            json!({
                "parameter": value.key,
                "value": value.value,
                "half_width": value.half_width,
                "unit": value.unit,
                "motions": value.count,
            })
        });
        let choices = self
            .found
            .choices
            .iter()
            .map(|(key, value, reason)| json!({ "parameter": key, "value": value, "reason": reason }));
        json!({
            "values": values.collect::<Vec<_>>(),
            "choices": choices.collect::<Vec<_>>(),
            "not_shown": self.found.not_shown,
            "warnings": self.warnings(),
            "motions": self.found.motions,
            "log_time_s": self.found.motion_time,
            "profile_time_s": self.planned.as_ref().ok(),
            "profile_error": self.planned.as_ref().err(),
        })
    }
}
