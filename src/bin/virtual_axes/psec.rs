//! `virtual_axes psec`: setpoints as a file.

use std::error::Error;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::{DEFAULT_MACHINE, Parameters};
use virtual_axes_core::simulation::joints;
use virtual_axes_core::trial::Setpoints;
use virtual_axes_io::files::psec_writer;

use crate::input::{Input, must_not_replace};
use crate::{campaign, interrupt, variant};

/// Those of a scenario, or a campaign.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Arguments {
    #[command(subcommand)]
    kind: Option<Kind>,
    #[command(flatten)]
    scenario: Option<OfScenario>,
}

/// What is no scenario.
#[derive(Debug, clap::Subcommand)]
enum Kind {
    /// Write what an axis is to be moved through to be identified, and say what to set when.
    Campaign(campaign::Arguments),
}

/// Which setpoints, and where to.
#[derive(Debug, clap::Args)]
struct OfScenario {
    /// A shipped scenario or a scenario file.
    scenario: String,
    /// The file: CSV (`time,x,y,…` in s, m, rad), MCAP with a JointTrajectory on `/psec`, or the YAML
    /// that `ros2 topic pub` takes.
    #[arg(long, value_name = "FILE.csv|FILE.mcap|FILE.yaml")]
    out: PathBuf,
    /// A shipped machine or a machine file, whose limits and sampling period they are for.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// A parameter, as in `x.limits.jerk_m_s3=20`; can be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Feed in the place of the scenario's, m/min (rpm for a scenario of rotary moves).
    #[arg(long, allow_negative_numbers = true)]
    feed: Option<f64>,
}

/// Writes them.
pub fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    match (&arguments.kind, &arguments.scenario) {
        (Some(Kind::Campaign(arguments)), _) => campaign::run(arguments),
        (None, Some(arguments)) => of_scenario(arguments),
        (None, None) => Err("psec wants a scenario, or `campaign`".into()),
    }
}

/// Writes those of a scenario; says nothing.
fn of_scenario(arguments: &OfScenario) -> Result<String, Box<dyn Error>> {
    let machine = Parameters::load(&arguments.machine)?;
    let config = variant::parameters(&machine, None, &arguments.set, &[])?.machine_config()?;
    let input = Input::open(&arguments.scenario, None)?;
    input.must_not_be(&arguments.out)?;
    must_not_replace(&arguments.out, Path::new(&arguments.machine))?;
    let program = input.program(&config, arguments.feed)?;
    let Setpoints::Grid(mut source) = input.setpoints(&config, program.as_ref())? else {
        return Err(format!("{}: trajectories already; psec wants a scenario", arguments.scenario).into());
    };
    let limits = joints(&config, "");
    let names: Vec<String> = source
        .joints()
        .iter()
        .filter_map(|&place| limits.get(place))
        .map(|joint| joint.name.clone())
        .collect();
    let mut writer = psec_writer(&arguments.out, &names)?;
    let mut row = vec![0.0; names.len()];
    let mut time = 0;
    while source.next(&mut row).map_err(|error| -> Box<dyn Error> { error })? {
        interrupt::check()?;
        writer.row(time, &row)?;
        time += config.periods().position;
    }
    writer.finish()?;
    Ok(String::new())
}
