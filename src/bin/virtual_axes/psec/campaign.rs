//! `virtual_axes psec campaign`: setpoints of the identification campaign of an axis.

use std::error::Error;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use virtual_axes_core::config::{self, DEFAULT_MACHINE, Parameters};
use virtual_axes_identify::identify::FeedforwardMode;
use virtual_axes_identify::identify::campaign::{Campaign, CampaignOptions, CampaignRun};
use virtual_axes_io::files::psec_writer;
use virtual_axes_report::Table;

use crate::arguments::axis::{self, AxisUnits};
use crate::arguments::variant;
use crate::input::must_not_replace;
use crate::output::{interrupt, text_table};

/// Arguments of `virtual_axes psec campaign`.
#[derive(Debug, clap::Args)]
pub struct CampaignArguments {
    /// Axis to move; the other axes stay at rest.
    #[arg(long)]
    axis: String,
    /// Part of the campaign [default: all three parts, separated by 3 s of rest to switch the feedforward].
    #[arg(long, value_enum)]
    part: Option<FeedforwardName>,
    /// Output file: CSV (`time,x` in s and m or rad), MCAP with a JointTrajectory on `/psec`, or YAML for
    /// `ros2 topic pub`, by the extension .csv, .mcap or .yaml.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Built-in machine or machine file whose limits and sampling period apply.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// Set a parameter, for example `x.limits.jerk_m_s3=20`; can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Position range, mm or degrees, reduced by 5 % at each end [default: travel limits].
    #[arg(long, value_name = "MIN,MAX", allow_hyphen_values = true, value_parser = range)]
    range: Option<[f64; 2]>,
    /// Highest speed, m/min or rpm [default: 20, at most 95 % of the velocity limit].
    #[arg(long, allow_negative_numbers = true)]
    max_feed: Option<f64>,
    /// Print the timetable as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Feedforward that is switched on.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub enum FeedforwardName {
    /// No feedforward, to identify friction, gravity and inertia.
    Off,
    /// Velocity feedforward.
    Velocity,
    /// Velocity and torque feedforward.
    Both,
}

impl From<FeedforwardName> for FeedforwardMode {
    fn from(name: FeedforwardName) -> Self {
        match name {
            FeedforwardName::Off => FeedforwardMode::Off,
            FeedforwardName::Velocity => FeedforwardMode::Velocity,
            FeedforwardName::Both => FeedforwardMode::Both,
        }
    }
}

fn range(text: &str) -> Result<[f64; 2], String> {
    let numbers = text
        .split_once(',')
        .and_then(|(min, max)| Some([min.trim().parse::<f64>().ok()?, max.trim().parse::<f64>().ok()?]));
    numbers.ok_or_else(|| "must be two numbers MIN,MAX, for example -100,250".to_owned())
}

/// Writes the setpoints and returns the timetable with the parameters to set for each part.
pub fn run(arguments: &CampaignArguments) -> Result<String, Box<dyn Error>> {
    must_not_replace(&arguments.out, Path::new(&arguments.machine))?;
    let machine = Parameters::load(&arguments.machine, crate::builtin::MACHINES)?;
    let parameters = variant::parameters(&machine, None, &arguments.set, &[])?;
    let config = parameters.machine_config()?;
    let index = axis::index(&config, &arguments.axis)?;
    let units = AxisUnits::for_kind(config.axes()[index].kind());
    let options = CampaignOptions {
        range: arguments.range.map(|range| range.map(|value| value * units.length)),
        max_feed: arguments.max_feed.map(|feed| feed * units.speed),
    };
    let parts = arguments.part.map_or(FeedforwardMode::ALL.to_vec(), |part| vec![part.into()]);
    let campaign = Campaign::plan(&config, index, &parts, &options)?;
    let mut writer = psec_writer(&arguments.out, std::slice::from_ref(&arguments.axis))?;
    let mut time = 0;
    for position in campaign.psec() {
        interrupt::check()?;
        writer.row(time, &[*position])?;
        time += campaign.period();
    }
    writer.finish()?;
    let output =
        CampaignOutput { campaign: &campaign, parameters: &parameters, axis: &arguments.axis, units };
    Ok(if arguments.json { format!("{:#}\n", output.json()) } else { output.text() })
}

/// Data of the timetable.
struct CampaignOutput<'a> {
    campaign: &'a Campaign,
    parameters: &'a Parameters,
    axis: &'a str,
    units: AxisUnits,
}

/// Formats a speed with two decimals, or two significant digits if it is below 1.
fn format_speed(speed: f64) -> String {
    let decimals = (1.0 - speed.log10().floor()).clamp(2.0, 12.0) as usize;
    format!("{speed:.decimals$}")
}

impl CampaignOutput<'_> {
    fn settings(&self, run: &CampaignRun) -> Vec<String> {
        let assignments = run.part.assignments(self.parameters, self.axis);
        assignments.iter().map(|assignment| format!("{}={}", assignment.key, assignment.value)).collect()
    }

    fn text(&self) -> String {
        let speed = self.units.speed_name;
        let columns = [("part", ""), ("from", "s"), ("to", "s"), ("duration", "s"), ("speeds", speed)];
        let rows = self.campaign.runs().iter().map(|run| {
            let [from, to] = self.campaign.times(run);
            let speeds: Vec<String> =
                run.speeds.iter().map(|speed| format_speed(speed / self.units.speed)).collect();
            let times = [from, to, to - from].map(|time| format!("{time:.3}"));
            [vec![run.part.name().to_owned()], times.to_vec(), vec![speeds.join(" ")]].concat()
        });
        let table = Table { rows: rows.collect(), ..Table::new("", &columns) };
        let [low, high] = self.campaign.range().map(|position| position / self.units.length);
        let start = self.campaign.start() / self.units.length;
        let unit = self.units.length_name;
        let mut text = text_table::text(&table);
        let first = if start == 0.0 { "" } else { "; move it there before the start" };
        text.push_str(&format!(
            "{} starts and ends at {start:.3} {unit}{first}; it moves between {low:.3} and {high:.3} {unit}\n",
            self.axis
        ));
        for run in self.campaign.runs() {
            let line = format!("before {}: {}", run.part.name(), self.settings(run).join(" "));
            text.push_str(&text_table::wrapped_line(&line));
        }
        let key = format!("{}.feedforward.velocity", self.axis);
        let has_feedforward = self.campaign.runs().iter().any(|run| run.part != FeedforwardMode::Off);
        if has_feedforward && self.parameters.get(&key) == Some(config::Value::Double(0.0)) {
            text.push_str(&format!("warning: {key} is 0: no part has feedforward; set it, usually to 1\n"));
        }
        text
    }

    fn json(&self) -> Value {
        let AxisUnits { length, length_key, speed, speed_key, .. } = self.units;
        let runs = self.campaign.runs().iter().map(|run| {
            let [from, to] = self.campaign.times(run);
            let speeds: Vec<f64> = run.speeds.iter().map(|value| value / speed).collect();
            let mut part =
                json!({ "part": run.part.name(), "from_s": from, "to_s": to, "duration_s": to - from });
            part[format!("speeds_{speed_key}")] = json!(speeds);
            part["set"] = json!(self.settings(run));
            part
        });
        let mut object = json!({ "axis": self.axis });
        object[format!("start_{length_key}")] = json!(self.campaign.start() / length);
        object[format!("range_{length_key}")] =
            json!(self.campaign.range().map(|position| position / length));
        object["parts"] = runs.collect();
        object
    }
}
