//! `virtual_axes psec`: writes setpoints (PSEC) to a file.

pub mod campaign;
mod probe;

use std::error::Error;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::{DEFAULT_MACHINE, Parameters};
use virtual_axes_core::path::Program;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::trial::SetpointSource;
use virtual_axes_core::units::seconds;
use virtual_axes_io::files::psec_writer;

use crate::arguments::log_arguments::LogArguments;
use crate::arguments::variant;
use crate::input::part_program::PartProgramArguments;
use crate::input::{CommandInput, must_not_replace};
use crate::output::interrupt;

/// Arguments of `virtual_axes psec`.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct PsecArguments {
    #[command(subcommand)]
    kind: Option<PsecKind>,
    #[command(flatten)]
    scenario: Option<ScenarioPsecArguments>,
    // Not in the optional group of the scenario: clap does not see the words of such a group if it contains another.
    #[command(flatten)]
    part_program: PartProgramArguments,
    #[command(flatten)]
    log: LogArguments,
}

/// Source of the setpoints other than a scenario.
#[derive(Debug, clap::Subcommand)]
enum PsecKind {
    /// Write the setpoints of an identification campaign for one axis and print its timetable.
    Campaign(campaign::CampaignArguments),
    /// Write a part program whose setpoints show the profile of a control, for identify-control.
    #[command(long_flag = "probe")]
    Probe(probe::ProbeArguments),
}

/// Arguments of `virtual_axes psec` for a scenario.
#[derive(Debug, clap::Args)]
struct ScenarioPsecArguments {
    /// Built-in scenario or part program, scenario file, part program file (`.nc`, `.ngc`, …), setpoints as CSV, or a log
    /// of a control (halsampler, Sinumerik Edge or trace, TwinCAT Scope).
    scenario: String,
    /// Output file: CSV (`time,x,y,…` in s, m, rad), MCAP with a JointTrajectory on `/psec`, or YAML for
    /// `ros2 topic pub`, by the extension .csv, .mcap or .yaml.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Built-in machine or machine file whose limits and sampling period apply.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// Set a parameter, for example `x.limits.jerk_m_s3=20`; can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Override the feed of the scenario, m/min (rpm for a scenario of rotary moves).
    #[arg(long, allow_negative_numbers = true)]
    feed: Option<f64>,
}

/// Writes the setpoints of a scenario or of a campaign.
pub fn run(arguments: &PsecArguments) -> Result<String, Box<dyn Error>> {
    match (&arguments.kind, &arguments.scenario) {
        (Some(PsecKind::Campaign(arguments)), _) => campaign::run(arguments),
        (Some(PsecKind::Probe(arguments)), _) => probe::run(arguments),
        (None, Some(scenario)) => write_scenario(scenario, &arguments.part_program, &arguments.log),
        (None, None) => {
            Err("psec requires a scenario or one of the subcommands `campaign` and `probe`".into())
        }
    }
}

/// Writes the setpoints of a scenario and returns an empty text.
fn write_scenario(
    arguments: &ScenarioPsecArguments,
    part_program: &PartProgramArguments,
    log: &LogArguments,
) -> Result<String, Box<dyn Error>> {
    let machine = Parameters::load(&arguments.machine, crate::builtin::MACHINES)?;
    let config = variant::parameters(&machine, None, &arguments.set, &[])?.machine_config()?;
    let input = CommandInput::open(&arguments.scenario, None, log)?.with_part_program(part_program)?;
    input.must_not_be(&arguments.out)?;
    must_not_replace(&arguments.out, Path::new(&arguments.machine))?;
    let program = input.program(&config, arguments.feed)?;
    let SetpointSource::Grid(mut source) = input.setpoints(&config, program.as_ref())? else {
        return Err(format!(
            "{}: contains trajectories; psec requires a scenario or a part program",
            arguments.scenario
        )
        .into());
    };
    let limits = joint_limits(&config, "");
    let names: Vec<String> = source
        .joints()
        .iter()
        .filter_map(|&index| limits.get(index))
        .map(|joint| joint.name.clone())
        .collect();
    let mut writer = psec_writer(&arguments.out, &names)?;
    let mut row = vec![0.0; names.len()];
    let mut time = 0;
    let mut progress = input.progress(program.as_deref().map(Program::duration), false)?;
    while source.next(&mut row).map_err(|error| -> Box<dyn Error> { error })? {
        interrupt::check()?;
        input.report_progress(&mut progress, seconds(time));
        writer.row(time, &row)?;
        time += config.periods().position;
    }
    progress.finish();
    writer.finish()?;
    input.print_program_notes();
    Ok(String::new())
}
