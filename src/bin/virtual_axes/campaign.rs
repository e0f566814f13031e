//! `virtual_axes psec campaign`: the setpoints that an axis is identified from.

use std::error::Error;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use virtual_axes_core::config::{DEFAULT_MACHINE, Parameters};
use virtual_axes_identify::identify::FeedforwardMode;
use virtual_axes_identify::identify::campaign::{Campaign, CampaignOptions, CampaignRun};
use virtual_axes_io::files::psec_writer;
use virtual_axes_report::{TableColumn, Table};

use crate::axis::{self, Units};
use crate::input::must_not_replace;
use crate::{interrupt, table, variant};

/// Which axis, and where to.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The axis to move; the others are left alone.
    #[arg(long)]
    axis: String,
    /// Only this part; otherwise all three, with 3 s of rest between them to switch the feedforward in.
    #[arg(long, value_enum)]
    part: Option<PartName>,
    /// The file: CSV (`time,x` in s and m or rad), MCAP with a JointTrajectory on `/psec`, or the YAML that
    /// `ros2 topic pub` takes.
    #[arg(long, value_name = "FILE.csv|FILE.mcap|FILE.yaml")]
    out: PathBuf,
    /// A shipped machine or a machine file, whose limits and sampling period the setpoints are for.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// A parameter, as in `x.limits.jerk_m_s3=20`; can be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Where the axis may go, mm or degrees, less 5 % at either end; its stroke if left out.
    #[arg(long, value_name = "MIN,MAX", allow_hyphen_values = true, value_parser = range)]
    range: Option<[f64; 2]>,
    /// Highest speed, m/min or rpm; 20 if left out, or 95 % of what the axis can.
    #[arg(long, allow_negative_numbers = true)]
    max_feed: Option<f64>,
    /// Print the timetable as JSON.
    #[arg(long)]
    json: bool,
}

/// What of the feedforward is on.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub enum PartName {
    /// None, to show friction, gravity and inertia.
    Off,
    /// That of the velocity.
    Velocity,
    /// Those of velocity and torque.
    Both,
}

impl From<PartName> for FeedforwardMode {
    fn from(name: PartName) -> Self {
        match name {
            PartName::Off => FeedforwardMode::Off,
            PartName::Velocity => FeedforwardMode::Velocity,
            PartName::Both => FeedforwardMode::Both,
        }
    }
}

fn range(text: &str) -> Result<[f64; 2], String> {
    let numbers = text
        .split_once(',')
        .and_then(|(min, max)| Some([min.trim().parse::<f64>().ok()?, max.trim().parse::<f64>().ok()?]));
    numbers.ok_or_else(|| "two numbers are wanted, as in -100,250".to_owned())
}

/// Writes them; tells what to set when.
pub fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    must_not_replace(&arguments.out, Path::new(&arguments.machine))?;
    let machine = Parameters::load(&arguments.machine)?;
    let parameters = variant::parameters(&machine, None, &arguments.set, &[])?;
    let config = parameters.machine_config()?;
    let place = axis::place(&config, &arguments.axis)?;
    let units = Units::of(config.axes()[place].kind());
    let options = CampaignOptions {
        range: arguments.range.map(|range| range.map(|value| value * units.length)),
        max_feed: arguments.max_feed.map(|feed| feed * units.speed),
    };
    let parts = arguments.part.map_or(FeedforwardMode::ALL.to_vec(), |part| vec![part.into()]);
    let campaign = Campaign::plan(&config, place, &parts, &options)?;
    let mut writer = psec_writer(&arguments.out, std::slice::from_ref(&arguments.axis))?;
    let mut time = 0;
    for position in campaign.psec() {
        interrupt::check()?;
        writer.row(time, &[*position])?;
        time += campaign.period();
    }
    writer.finish()?;
    let told = Told { campaign: &campaign, parameters: &parameters, axis: &arguments.axis, units };
    Ok(if arguments.json { format!("{:#}\n", told.json()) } else { told.text() })
}

/// What the command says of a campaign.
struct Told<'a> {
    campaign: &'a Campaign,
    parameters: &'a Parameters,
    axis: &'a str,
    units: Units,
}

/// To two decimals, or two digits of what is slower.
fn told_speed(speed: f64) -> String {
    let decimals = (1.0 - speed.log10().floor()).clamp(2.0, 12.0) as usize;
    format!("{speed:.decimals$}")
}

impl Told<'_> {
    fn settings(&self, run: &CampaignRun) -> Vec<String> {
        let assignments = run.part.assignments(self.parameters, self.axis);
        assignments.iter().map(|assignment| format!("{}={}", assignment.key, assignment.value)).collect()
    }

    fn text(&self) -> String {
        let column = |name: &str, unit: &str| TableColumn::new(name, unit);
        let columns = vec![
            column("part", ""),
            column("from", "s"),
            column("to", "s"),
            column("duration", "s"),
            column("speeds", self.units.speed_name),
        ];
        let rows = self.campaign.runs().iter().map(|run| {
            let [from, to] = self.campaign.times(run);
            let speeds: Vec<String> =
                run.speeds.iter().map(|speed| told_speed(speed / self.units.speed)).collect();
            let times = [from, to, to - from].map(|time| format!("{time:.3}"));
            [vec![run.part.name().to_owned()], times.to_vec(), vec![speeds.join(" ")]].concat()
        });
        let table = Table { caption: String::new(), columns, rows: rows.collect() };
        let [low, high] = self.campaign.range().map(|place| place / self.units.length);
        let start = self.campaign.start() / self.units.length;
        let unit = self.units.length_name;
        let mut text = table::text(&table);
        let first = if start == 0.0 { "" } else { ", to be brought there first" };
        text.push_str(&format!(
            "{} starts and ends at {start:.3} {unit}{first}; it moves between {low:.3} and {high:.3} {unit}\n",
            self.axis
        ));
        for run in self.campaign.runs() {
            text.push_str(&format!("before {}: {}\n", run.part.name(), self.settings(run).join(" ")));
        }
        text
    }

    fn json(&self) -> Value {
        let Units { length, length_key, speed, speed_key, .. } = self.units;
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
        object[format!("range_{length_key}")] = json!(self.campaign.range().map(|place| place / length));
        object["parts"] = runs.collect();
        object
    }
}
