//! `virtual_axes identify`: identification of the parameters of an axis from recordings.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::{DEFAULT_MACHINE, MachineConfig, Parameters, Periods};
use virtual_axes_identify::identify::summary::IdentificationSummary;
use virtual_axes_identify::identify::{
    AxisIdentification, AxisRecordings, AxisValidation, Breakaway, ConditionedRecording, IdentificationInput,
    IdentificationOptions, IdentifiedValue, RefinementScope,
};
use virtual_axes_identify::recording::{Finding, Severity};
use virtual_axes_io::files::OutputFile;
use virtual_axes_report::{IdentificationPage, ValidationRecording};

use crate::campaign::FeedforwardName;
use crate::identify_axes::{self as axes, AxesResult};
use crate::identify_columns as columns;
use crate::identify_result::InvalidResult;
use crate::input::must_not_replace;
use crate::output_arguments::{OutputArguments, OutputFormat};
use crate::progress::Spinner;
use crate::recordings::{self, RecordingArguments};
use crate::{axis, identify_text, machine_file, report, text_table, variant};

/// Group of parameters that the refinement adjusts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum RefinedGroup {
    /// Equivalent inertia Jeq.
    Inertia,
    /// Friction law.
    Friction,
    /// Weight, or gravity torque and phase of a tilting axis.
    Gravity,
    /// VFFW and TFFW, if their signals were not recorded.
    Feedforward,
    /// Position-loop gain, from recordings that are coarser than the position cycle.
    Gain,
}

/// Arguments of `virtual_axes identify`.
#[derive(Debug, clap::Args)]
pub struct IdentifyArguments {
    /// Recordings of the axis: CSV, or MCAP with DriveStates or JointState messages; for a campaign one for
    /// each feedforward mode.
    #[arg(value_name = "RECORDING", required_unless_present = "transmission")]
    recordings: Vec<PathBuf>,
    /// Recorded axis, or `all`; without it the columns of the recordings are listed.
    #[arg(long)]
    axis: Option<String>,
    /// Initial machine: built-in machine or machine file.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// Set a parameter, for example `x.motor.torque_constant_nm_a=1.2`; can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    reading: RecordingArguments,
    /// Active feedforward, one for all recordings or one for each [default: by the signals VFFWS and TFFWS, or by the lag
    /// of the position].
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
    /// Returns the recordings of the axis, without those for validation.
    fn listed(&self) -> Vec<PathBuf> {
        self.recordings.iter().chain(&self.transmission).cloned().collect()
    }
}

/// Runs the command and returns tables or JSON.
pub fn run(arguments: &IdentifyArguments) -> Result<String, Box<dyn Error>> {
    check_listing(arguments)?;
    check_outputs(arguments)?;
    let machine = Parameters::load(&arguments.machine)?;
    let parameters = variant::parameters(&machine, None, &arguments.set, &[])?;
    let config = variant::checked(&parameters, &machine, &arguments.machine)?;
    let Some(name) = &arguments.axis else {
        let recordings = (arguments.recordings.as_slice(), arguments.transmission.as_slice());
        return columns::listing(recordings, &arguments.reading, &config, &arguments.machine);
    };
    let is_all = name == ALL;
    let (indices, resting) = if is_all {
        axes::check_options(&arguments.reading)?;
        axes::moving_axes(&arguments.listed(), &arguments.reading, &config)?
    } else {
        (vec![axis::index(&config, name)?], Vec::new())
    };
    if let (Some(page), true) = (&arguments.report, is_all) {
        return Err(
            format!("{}: --axis all writes no report; give the name of one axis", page.display()).into()
        );
    }
    let spinner = Spinner::new();
    let one = |parameters: &Parameters, index: usize| {
        let config = parameters.machine_config()?;
        identify(arguments, parameters, &config, index, &spinner)
    };
    let found = if is_all {
        axes::identify_all(&parameters, &indices, one)?
    } else {
        let found = one(&parameters, indices.first().copied().unwrap_or_default())?;
        spinner.set_activity("writing")?;
        if let Some(page) = &arguments.report {
            write_report(page, &found, config.periods())?;
        }
        AxesResult { summaries: vec![found.summary], failures: Vec::new(), identified: found.identified }
    };
    let AxesResult { mut summaries, failures, identified } = found;
    if !resting.is_empty() && arguments.output.format() == OutputFormat::Json {
        let finding = axes::at_rest(&resting);
        summaries.iter_mut().for_each(|summary| summary.findings.push(finding.clone()));
    }
    let mut texts: Vec<String> = summaries.iter().map(|summary| output(arguments, summary)).collect();
    if let Some(reason) = InvalidResult::reason(&summaries, &failures) {
        drop(spinner);
        return Err(Box::new(InvalidResult { text: joined(arguments, &summaries, &texts)?, reason }));
    }
    if let Some(out) = &arguments.out {
        machine_file::write(out, &machine_text(arguments, &summaries, &identified))?;
    }
    drop(spinner);
    if !resting.is_empty() && matches!(arguments.output.format(), OutputFormat::Text | OutputFormat::Quiet) {
        texts.push(text_table::wrapped_line(&axes::at_rest(&resting).what));
    }
    joined(arguments, &summaries, &texts)
}

/// Value of `--axis` for all recorded axes.
const ALL: &str = "all";

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
        (OutputFormat::Json, [one]) if arguments.axis.as_deref() != Some(ALL) => {
            serde_json::to_string_pretty(one)? + "\n"
        }
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
    match (&arguments.axis, given.as_slice()) {
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

/// Writes the page. The file is replaced atomically.
fn write_report(path: &Path, found: &AxisIdentification, periods: Periods) -> io::Result<()> {
    let inputs: Vec<IdentificationInput<'_>> =
        found.recordings.iter().map(ConditionedRecording::input).collect();
    let findings: Vec<Vec<Finding>> = found.recordings.iter().map(|r| r.findings.clone()).collect();
    fn check(validation: &AxisValidation) -> ValidationRecording<'_> {
        let AxisValidation { recorded, agreement } = validation;
        ValidationRecording { input: recorded.input(), findings: &recorded.findings, agreement }
    }
    let validations: Vec<ValidationRecording<'_>> = found.validations.iter().map(check).collect();
    let page = IdentificationPage {
        summary: &found.summary,
        periods,
        inputs: &inputs,
        findings: &findings,
        identification: &found.identification,
        validations: &validations,
    };
    let mut file = OutputFile::create(path)?;
    page.document().write(&mut file)?;
    file.finish()
}

/// Reads the recordings and identifies the axis.
fn identify(
    arguments: &IdentifyArguments,
    parameters: &Parameters,
    config: &MachineConfig,
    index: usize,
    spinner: &Spinner,
) -> Result<AxisIdentification, Box<dyn Error>> {
    let (axis, periods) = (&config.axes()[index], config.periods());
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
    let reading = match arguments.presliding {
        true => arguments.reading.clone().without_estimated_current_lag(),
        false => arguments.reading.clone(),
    };
    let options = reading.options()?;
    let read = |path: &PathBuf, feedforward, option| {
        spinner.set_activity(format!("reading {}", path.display()))?;
        let reading = (&reading, &options);
        recordings::read(path, (axis, &periods), reading, (feedforward, option))
    };
    let recordings = files.iter().zip(modes).map(|(path, mode)| read(path, mode, "--feedforward"));
    let recordings: Vec<ConditionedRecording> = recordings.collect::<Result<_, _>>()?;
    let others =
        others.iter().zip(other_modes).map(|(path, mode)| read(path, mode, "--validate-feedforward"));
    let others: Vec<ConditionedRecording> = others.collect::<Result<_, _>>()?;
    let both = arguments.transmission.iter().map(|path| {
        spinner.set_activity(format!("reading {}", path.display()))?;
        recordings::read_both_encoders(path, (axis, &periods), (&arguments.reading, &options))
    });
    let transmission: Vec<ConditionedRecording> = both.collect::<Result<_, _>>()?;

    let i0 = if arguments.free_i0 { Breakaway::Freed } else { Breakaway::Held };
    let options =
        IdentificationOptions { i0, refine: refined_groups(arguments), presliding: arguments.presliding };
    let start = |part: &str| spinner.set_activity(part);
    let recordings = AxisRecordings { identification: recordings, transmission, validation: others };
    Ok(AxisIdentification::new((parameters, index), recordings, &options, start)?)
}

/// Returns the machine file.
fn machine_text(
    arguments: &IdentifyArguments,
    found: &[IdentificationSummary],
    identified: &Parameters,
) -> String {
    let mut head = format!(
        "{}, from the machine {} by `virtual_axes identify`; see there for the sources of the other values.",
        found.first().map_or("", |summary| summary.machine.as_str()),
        arguments.machine,
    );
    for summary in found {
        let recordings = summary.recordings.iter().chain(&summary.transmission_recordings);
        let recordings: Vec<&str> = recordings.map(|r| r.name.as_str()).collect();
        head.push_str(&format!(
            "\n{} was identified from {}; ± is the standard error.",
            summary.axis,
            recordings.join(", ")
        ));
        if !summary.validation.is_empty() {
            let others: Vec<&str> = summary.validation.iter().map(|v| v.recording.name.as_str()).collect();
            head.push_str(&format!("\nValidated on {}.", others.join(", ")));
        }
        for finding in summary.findings.iter().filter(|finding| finding.severity > Severity::Note) {
            head.push_str(&format!("\n{}", finding.line()));
        }
    }
    let comment = |key: &str| {
        let mut values = found.iter().flat_map(|summary| &summary.values);
        values.rfind(|value| value.key == key).map(IdentifiedValue::comment)
    };
    identified.to_yaml(&head, comment)
}

/// Returns the parameters that the refinement adjusts.
fn refined_groups(arguments: &IdentifyArguments) -> RefinementScope {
    let has = |group: RefinedGroup| arguments.refine.contains(&group);
    match (arguments.no_refine, arguments.refine.is_empty()) {
        (true, _) => RefinementScope::NONE,
        (false, true) => RefinementScope::ALL,
        (false, false) => RefinementScope {
            inertia: has(RefinedGroup::Inertia),
            friction: has(RefinedGroup::Friction),
            gravity: has(RefinedGroup::Gravity),
            feedforward: has(RefinedGroup::Feedforward),
            gain: has(RefinedGroup::Gain),
        },
    }
}
