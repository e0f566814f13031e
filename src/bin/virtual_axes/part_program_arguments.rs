//! Arguments of commands that plan part programs.

use virtual_axes_nc::offline::{OverrideSchedule, PartProgramOptions, parse_m_code};
use virtual_axes_nc::plan::PlanOptions;

/// Micrometer, m.
const MICROMETER: f64 = 1e-6;

/// Options of the interpretation and planning of a part program.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct PartProgramArguments {
    /// Feed override of a part program, 0 to 200 %: constant, or from times on, as in `0:100,2.5:0,4:120`.
    #[arg(long = "override", value_name = "PERCENT|S:PERCENT,…", allow_hyphen_values = true)]
    feed_override: Option<String>,
    /// M codes that have no effect in a part program: 7,M110. Of a line without other codes only F, S and T remain. Each one found is noted.
    #[arg(long, value_name = "M_CODES", value_delimiter = ',', value_parser = parse_m_code)]
    pub ignore: Vec<u32>,
    /// Bound of the chord error of a part program's setpoints as a polyline, µm: slows the feed in curves [default: none].
    #[arg(long, value_name = "UM", value_parser = positive, allow_negative_numbers = true)]
    chord_error_um: Option<f64>,
    /// Bound of the centripetal acceleration of the tool tip of a part program, m/s² [default: none besides the axes'].
    #[arg(long, value_name = "M_S2", value_parser = positive, allow_negative_numbers = true)]
    centripetal_m_s2: Option<f64>,
}

impl PartProgramArguments {
    /// Returns the first option that is given.
    pub fn given(&self) -> Option<&'static str> {
        let given = [
            (self.feed_override.is_some(), "--override"),
            (!self.ignore.is_empty(), "--ignore"),
            (self.chord_error_um.is_some(), "--chord-error-um"),
            (self.centripetal_m_s2.is_some(), "--centripetal-m-s2"),
        ];
        given.into_iter().find(|(is_given, _)| *is_given).map(|(_, name)| name)
    }

    /// Returns the options.
    ///
    /// # Errors
    ///
    /// Returns an error if the feed override is invalid.
    pub fn options(&self) -> Result<PartProgramOptions, String> {
        let schedule = match &self.feed_override {
            Some(text) => {
                OverrideSchedule::parse(text).map_err(|error| format!("--override {text}: {error}"))?
            }
            None => OverrideSchedule::default(),
        };
        let default = PlanOptions::default();
        let plan = PlanOptions {
            chord_error: self.chord_error_um.map_or(default.chord_error, |error| error * MICROMETER),
            centripetal_acceleration: self.centripetal_m_s2.unwrap_or(default.centripetal_acceleration),
            ..default
        };
        Ok(PartProgramOptions { schedule, ignored_m_codes: self.ignore.clone(), plan })
    }
}

/// Reads a positive number.
fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|value| *value > 0.0 && value.is_finite());
    number.ok_or_else(|| "must be a positive number".to_owned())
}
