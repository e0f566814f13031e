//! `virtual_axes identify`: identification of the parameters of an axis from recordings.

pub mod axes;
pub mod columns;
pub mod identify_text;
pub mod invalid_result;
pub mod machine_output;
pub mod new_machine;
pub mod next_command;
pub mod recordings;
pub mod refinement;
pub mod selection;

use std::error::Error;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::{DEFAULT_MACHINE, MachineConfig, Parameters};
use virtual_axes_identify::identify::summary::IdentificationSummary;
use virtual_axes_identify::identify::{
    AxisIdentification, AxisRecordings, Breakaway, ConditionedRecording, IdentificationOptions,
    RefinementScope,
};
use virtual_axes_identify::recording::{Finding, StatedValues};
use virtual_axes_io::files::OutputFile;
use virtual_axes_report::{IdentificationPage, identification_document};

use crate::arguments::output_arguments::{OutputArguments, OutputFormat};
use crate::arguments::{axis, variant};
use crate::input::must_not_replace;
use crate::output::progress::Spinner;
use crate::output::unusable::{INVALID_RESULT, UnusableResult};
use crate::output::{machine_file, report, text_table};
use crate::psec::campaign::FeedforwardName;
use axes::AxesResult;
use machine_output::{machine_file_sentence, machine_text};
use recordings::RecordingArguments;
use refinement::{RefinedGroup, refined_groups};
use selection::SelectedAxis;

/// Arguments of `virtual_axes identify`.
#[derive(Debug, clap::Args)]
pub struct IdentifyArguments {
    /// Recordings of the axis: CSV, or MCAP with DriveStates or JointState messages; for a campaign one for
    /// each feedforward mode.
    #[arg(value_name = "RECORDING", required_unless_present = "transmission")]
    recordings: Vec<PathBuf>,
    /// Recorded axis, several separated by commas, or `all`; without it the columns of the recordings are listed, unless
    /// --new-machine is given.
    #[arg(long, value_name = "NAME[,…]|all")]
    axis: Option<String>,
    /// Initial machine: built-in machine or machine file. Values of a file, or of --set, are those that you state: results
    /// far from them are rejected.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// Begin a new machine with this name in place of --machine: it has the recorded axes, all of them without --axis,
    /// travel and limits as recorded, and a template for values that are neither recorded nor set by --set.
    #[arg(long, value_name = "NAME", conflicts_with = "machine")]
    new_machine: Option<String>,
    /// Set a parameter, for example `x.motor.torque_constant_nm_a=1.2`; can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    reading: RecordingArguments,
    /// Active feedforward, one for all recordings or one for each [default: by the signals VFFWS and TFFWS, or by the
    /// closed loop that deviates least].
    #[arg(long, value_enum, value_delimiter = ',', value_name = "off|velocity|both[,…]")]
    feedforward: Vec<FeedforwardName>,
    /// Refine i0 independently of a + c; requires several slow starts from rest.
    #[arg(long, conflicts_with = "no_refine", requires = "recordings")]
    free_i0: bool,
    /// Parameter groups that the refinement in closed loop adjusts [default: all].
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        conflicts_with = "no_refine",
        requires = "recordings",
        value_name = "GROUP,…"
    )]
    refine: Vec<RefinedGroup>,
    /// Skip the refinement in closed loop; run only the steps of the paper.
    #[arg(long)]
    no_refine: bool,
    /// Identify stiffness and damping of the presliding from slow reversals; the lag of the current is that of
    /// --current-lag-ms, 0 by default.
    #[arg(long, requires = "recordings")]
    presliding: bool,
    /// Recording with the encoders of motor and load (channels position and motor_position), to identify stiffness,
    /// damping, inertia of the load and backlash of the transmission; can be repeated.
    #[arg(long, value_name = "RECORDING")]
    transmission: Vec<PathBuf>,
    /// Recording for validation of the identified axis; can be repeated.
    #[arg(long, value_name = "RECORDING")]
    validate: Vec<PathBuf>,
    /// Active feedforward of the --validate recordings, one for all or one for each [default: --feedforward
    /// if it has one value].
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        value_name = "off|velocity|both[,…]",
        requires = "validate"
    )]
    validate_feedforward: Vec<FeedforwardName>,
    /// Write the identified machine to this file.
    #[arg(long, value_name = "FILE.yaml")]
    out: Option<PathBuf>,
    /// Write a page with the results of each step and plots of measured and simulated signals.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArguments,
}

impl IdentifyArguments {
    /// Returns the axes to identify, those of a new machine being all; none if the columns are listed.
    fn axes(&self) -> Option<&str> {
        self.axis.as_deref().or_else(|| self.new_machine.as_ref().map(|_| selection::ALL))
    }

    /// Returns the recordings of the axis, without those for validation.
    fn listed(&self) -> Vec<PathBuf> {
        self.recordings.iter().chain(&self.transmission).cloned().collect()
    }
}

/// Initial machine, with the axes to identify.
struct Start {
    parameters: Parameters,
    axes: Vec<SelectedAxis>,
    /// Findings about the other axes of the recordings.
    others: Vec<Finding>,
}

/// Runs the command and returns tables or JSON.
pub fn run(arguments: &IdentifyArguments) -> Result<String, Box<dyn Error>> {
    check_listing(arguments)?;
    check_outputs(arguments)?;
    let Some(axes) = arguments.axes() else { return listing(arguments) };
    run_axes(arguments, axes).map_err(|error| {
        // A new machine has all axes without --axis.
        let is_listed = arguments.new_machine.is_none() && !error.is::<UnusableResult>();
        match is_listed && next_command::is_corrected(&error.to_string(), &arguments.reading) {
            true => format!("{error}; without --axis, the command with all such units is printed").into(),
            false => error,
        }
    })
}

/// Identifies the axes that the option `--axis` names.
fn run_axes(arguments: &IdentifyArguments, axes: &str) -> Result<String, Box<dyn Error>> {
    let Start { parameters, axes, others } = start(arguments, axes)?;
    let config = parameters.machine_config()?;
    let indices = axes.iter().map(|selected| axis::index(&config, &selected.name));
    let indices: Vec<usize> = indices.collect::<Result<_, _>>()?;
    let spinner = Spinner::new();
    let one = |parameters: &Parameters, index: usize, keeps_cycle: bool| {
        let config = parameters.machine_config()?;
        let joint = indices
            .iter()
            .zip(&axes)
            .find(|(known, _)| **known == index)
            .and_then(|(_, axis)| axis.joint.as_deref());
        let refine = refined_groups(arguments.no_refine, &arguments.refine);
        let position_cycle = refine.position_cycle && !keeps_cycle;
        let refine = RefinementScope { position_cycle, ..refine };
        identify(arguments, parameters, (&config, index, joint), refine, &spinner)
    };
    let AxesResult { mut found, mut failures, mut identified } =
        match (is_single(arguments), indices.as_slice()) {
            (true, [index]) => {
                let found = one(&parameters, *index, false)?;
                let identified = found.identified.clone();
                AxesResult { found: vec![found], failures: Vec::new(), identified }
            }
            _ => axes::identify_all(&parameters, &indices, one)?,
        };
    if arguments.output.format() == OutputFormat::Json {
        found.iter_mut().for_each(|found| found.summary.findings.extend(others.iter().cloned()));
    }
    let mut excluded = Vec::new();
    if arguments.new_machine.is_some() && !is_single(arguments) {
        excluded = axes::exclude(&mut found, &mut failures, &mut identified)?;
    }
    let invalid = invalid_result::reason(found.iter().map(|found| &found.summary), &failures);
    spinner.set_activity("writing")?;
    if let Some(page) = &arguments.report {
        write_report(page, &found, &machine_file_sentence(arguments.out.as_deref(), invalid.is_some()))?;
    }
    let summaries: Vec<IdentificationSummary> = found.into_iter().map(|found| found.summary).collect();
    let mut texts: Vec<String> = summaries.iter().map(|summary| output(arguments, summary)).collect();
    if matches!(arguments.output.format(), OutputFormat::Text | OutputFormat::Quiet) {
        let others = others.iter().map(|finding| &finding.what);
        texts.extend(excluded.iter().chain(others).map(|line| text_table::wrapped_line(line)));
    }
    if let Some(reason) = invalid {
        drop(spinner);
        return Err(Box::new(UnusableResult {
            text: joined(arguments, &summaries, &texts)?,
            reason,
            status: INVALID_RESULT,
        }));
    }
    if let Some(out) = &arguments.out {
        let machine = arguments.new_machine.is_none().then_some(arguments.machine.as_str());
        machine_file::write(out, &machine_text(machine, &summaries, &identified))?;
    }
    drop(spinner);
    joined(arguments, &summaries, &texts)
}

/// Lists the columns of the recordings and the next command.
fn listing(arguments: &IdentifyArguments) -> Result<String, Box<dyn Error>> {
    let machine = Parameters::load(&arguments.machine, crate::builtin::MACHINES)?;
    let parameters = variant::parameters(&machine, None, &arguments.set, &[])?;
    variant::checked(&parameters, &machine, &arguments.machine)?;
    let recordings = (arguments.recordings.as_slice(), arguments.transmission.as_slice());
    let stated = |axis: &str| stated_values(arguments, &parameters, axis);
    let machine = (&parameters, arguments.machine.as_str(), arguments.set.as_slice());
    columns::listing(recordings, &arguments.reading, machine, &stated)
}

/// Returns the initial machine with the axes that the option `--axis` names.
fn start(arguments: &IdentifyArguments, axes: &str) -> Result<Start, Box<dyn Error>> {
    let (reading, files) = (&arguments.reading, arguments.listed());
    let is_all = axes == selection::ALL;
    if is_all {
        axes::check_options(reading)?;
    }
    let selected = || selection::selected(axes, reading.joint());
    if let Some(name) = &arguments.new_machine {
        let new =
            |axes: &[SelectedAxis]| new_machine::parameters(name, axes, &files, (&arguments.set, reading));
        if !is_all {
            let axes = selected()?;
            return Ok(Start { parameters: new(&axes)?, axes, others: Vec::new() });
        }
        let recorded = selection::recorded_axes(&files, reading)?;
        let config = new(&recorded)?.machine_config()?;
        let unnamed = selection::unnamed_axes(&files, reading, &recorded)?;
        let (axes, resting) = axes::moving_axes(recorded, &files, reading, &config)?;
        return Ok(Start {
            parameters: new(&axes)?,
            axes,
            others: resting.into_iter().chain(unnamed).collect(),
        });
    }
    let machine = Parameters::load(&arguments.machine, crate::builtin::MACHINES)?;
    let parameters = variant::parameters(&machine, None, &arguments.set, &[])?;
    let config = variant::checked(&parameters, &machine, &arguments.machine)?;
    if !is_all {
        return Ok(Start { parameters, axes: selected()?, others: Vec::new() });
    }
    let recorded = columns::recorded_axes(&files, reading, &config)?;
    let unnamed = selection::unnamed_axes(&files, reading, &recorded)?;
    let (axes, resting) = axes::moving_axes(recorded, &files, reading, &config)?;
    Ok(Start { parameters, axes, others: resting.into_iter().chain(unnamed).collect() })
}

/// Returns true if `--axis` names one axis.
fn is_single(arguments: &IdentifyArguments) -> bool {
    arguments.axes().is_some_and(|axes| axes != selection::ALL && !axes.contains(','))
}

/// Returns the values of an axis that the user has stated: those of a machine file and of `--set`, not those of a built-in
/// machine or a template.
fn stated_values(arguments: &IdentifyArguments, parameters: &Parameters, axis: &str) -> StatedValues {
    let is_builtin = crate::builtin::MACHINES.iter().any(|(name, _)| *name == arguments.machine);
    match arguments.new_machine.is_some() || is_builtin {
        true => new_machine::stated(parameters, axis),
        false => StatedValues::new(parameters, axis, |_| true),
    }
}

/// Returns the output for one axis, without JSON.
fn output(arguments: &IdentifyArguments, summary: &IdentificationSummary) -> String {
    match arguments.output.format() {
        OutputFormat::Json => String::new(),
        OutputFormat::Csv => identify_text::csv(summary),
        OutputFormat::Quiet => identify_text::verdict(summary),
        OutputFormat::Text => identify_text::text(summary),
    }
}

/// Returns the output for all axes: a JSON list for `--axis all`, an object for one axis.
fn joined(
    arguments: &IdentifyArguments,
    summaries: &[IdentificationSummary],
    texts: &[String],
) -> Result<String, Box<dyn Error>> {
    Ok(match (arguments.output.format(), summaries) {
        (OutputFormat::Json, [one]) if is_single(arguments) => serde_json::to_string_pretty(one)? + "\n",
        (OutputFormat::Json, all) => serde_json::to_string_pretty(all)? + "\n",
        (OutputFormat::Text, _) => texts.join("\n"),
        _ => texts.concat(),
    })
}

/// Rejects options without effect on the list of columns.
fn check_listing(arguments: &IdentifyArguments) -> Result<(), String> {
    let format = arguments.output.format();
    let options = [
        ("--json", format == OutputFormat::Json),
        ("--csv", format == OutputFormat::Csv),
        ("--quiet", format == OutputFormat::Quiet),
        ("--out", arguments.out.is_some()),
        ("--report", arguments.report.is_some()),
        ("--feedforward", !arguments.feedforward.is_empty()),
        ("--free-i0", arguments.free_i0),
        ("--refine", !arguments.refine.is_empty()),
        ("--no-refine", arguments.no_refine),
        ("--presliding", arguments.presliding),
        ("--validate", !arguments.validate.is_empty()),
    ];
    let given: Vec<&str> = options.iter().filter(|(_, is_given)| *is_given).map(|(name, _)| *name).collect();
    match (arguments.axes(), given.as_slice()) {
        (Some(_), _) | (None, []) => Ok(()),
        (None, given) => Err(format!(
            "{}: no effect without --axis, which lists the columns only; give --axis NAME or --axis all",
            given.join(", ")
        )),
    }
}

/// Rejects invalid output files before the identification starts.
fn check_outputs(arguments: &IdentifyArguments) -> Result<(), String> {
    if let (Some(out), Some(page)) = (&arguments.out, &arguments.report)
        && out == page
    {
        return Err(format!("{}: is given for both --out and --report; use different files", out.display()));
    }
    if let Some(out) = &arguments.out {
        machine_file::check_name(out)?;
    }
    if let Some(page) = &arguments.report {
        report::check_name(page)?;
    }
    let read = || {
        let recordings =
            arguments.recordings.iter().chain(&arguments.transmission).chain(&arguments.validate);
        let recordings = recordings.map(PathBuf::as_path);
        recordings.chain(arguments.reading.map()).chain([Path::new(&arguments.machine)])
    };
    for output in [&arguments.out, &arguments.report].into_iter().flatten() {
        read().try_for_each(|input| must_not_replace(output, input))?;
    }
    Ok(())
}

/// Writes the page of all axes; `machine_file` is the sentence about the machine file.
fn write_report(path: &Path, found: &[AxisIdentification], machine_file: &str) -> Result<(), Box<dyn Error>> {
    let mut pages = Vec::new();
    for found in found {
        pages.push(IdentificationPage { found, periods: found.identified.machine_config()?.periods() });
    }
    let mut file = OutputFile::create(path)?;
    identification_document(&pages, Some(machine_file)).write(&mut file)?;
    Ok(file.finish()?)
}

/// Reads the recordings and identifies the axis.
fn identify(
    arguments: &IdentifyArguments,
    parameters: &Parameters,
    (config, index, joint): (&MachineConfig, usize, Option<&str>),
    refine: RefinementScope,
    spinner: &Spinner,
) -> Result<AxisIdentification, Box<dyn Error>> {
    let (axis, periods) = (&config.axes()[index], config.periods());
    let stated = stated_values(arguments, parameters, axis.name());
    let (files, others) = (&arguments.recordings, &arguments.validate);
    let modes = recordings::feedforward(&arguments.feedforward, files.len(), "--feedforward")?;
    let other_modes = match modes.as_slice() {
        [first, rest @ ..]
            if arguments.validate_feedforward.is_empty() && rest.iter().all(|m| m == first) =>
        {
            vec![*first; others.len()]
        }
        _ => {
            recordings::feedforward(&arguments.validate_feedforward, others.len(), "--validate-feedforward")?
        }
    };
    // A lag of the current cannot be told from presliding.
    let reading = arguments.reading.with_joint(joint);
    let reading = if arguments.presliding { reading.without_estimated_current_lag() } else { reading };
    let options = reading.options()?;
    let read = |path: &PathBuf, feedforward| {
        spinner.set_activity(format!("reading {}", path.display()))?;
        let reading = (&reading, &options);
        recordings::read(path, (axis, &periods, stated), reading, feedforward)
    };
    let recordings = files.iter().zip(modes).map(|(path, mode)| read(path, mode));
    let recordings: Vec<ConditionedRecording> = recordings.collect::<Result<_, _>>()?;
    let others = others.iter().zip(other_modes).map(|(path, mode)| read(path, mode));
    let others: Vec<ConditionedRecording> = others.collect::<Result<_, _>>()?;
    let both = arguments.transmission.iter().map(|path| {
        spinner.set_activity(format!("reading {}", path.display()))?;
        recordings::read_both_encoders(path, (axis, &periods, stated), (&reading, &options))
    });
    let transmission: Vec<ConditionedRecording> = both.collect::<Result<_, _>>()?;

    let i0 = if arguments.free_i0 { Breakaway::Freed } else { Breakaway::Held };
    let presliding = arguments.presliding;
    let options = IdentificationOptions { i0, refine, presliding, stated };
    let start = |part: &str| spinner.set_activity(part);
    let recordings = AxisRecordings { identification: recordings, transmission, validation: others };
    Ok(AxisIdentification::new((parameters, index), recordings, &options, start)?)
}
