//! `virtual_axes identify`: the parameters of an axis from recordings of it.

use std::cmp::Reverse;
use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::{AxisConfig, DEFAULT_MACHINE, Kind, MachineConfig, Parameters, Periods};
use virtual_axes_core::units::MILLISECOND_NS;
use virtual_axes_identify::identify::{
    Agreement, Breakaway, Identification, IdentifiedValue, IdentificationInput, IdentificationOptions, RefinementScope,
};
use virtual_axes_identify::recording::{Finding, Severity};
use virtual_axes_io::files::OutputFile;
use virtual_axes_report::{ValidationRecording, IdentificationPage};

use crate::campaign::PartName;
use crate::input::must_not_replace;
use crate::progress::Spinner;
use crate::recordings::{self, Reading, Recorded};
use crate::{axis, identify_json, identify_text, machine_file, report, variant};

/// What the refinement can move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Group {
    /// Jeq.
    Inertia,
    /// The friction law.
    Friction,
    /// Weight, or tilting torque and phase.
    Gravity,
    /// VFFW and TFFW, where their setpoints were not recorded.
    Feedforward,
}

/// What to identify, from what.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Recordings of the axis: CSV, or MCAP with DriveStates or JointState messages. Those of a campaign are one
    /// for each kind of feedforward.
    #[arg(value_name = "RECORDING", required = true)]
    recordings: Vec<PathBuf>,
    /// The axis that was recorded.
    #[arg(long)]
    axis: String,
    /// A shipped machine or a machine file, to begin from.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// A parameter, as in `x.motor.torque_constant_nm_a=1.2`; can be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    reading: Reading,
    /// The feedforward that acted: one for all recordings, or one for each in their order; needed where a
    /// recording does not show it (VFFWS, TFFWS).
    #[arg(long, value_enum, value_delimiter = ',', value_name = "off|velocity|both[,…]")]
    feedforward: Vec<PartName>,
    /// Find i0 in the refinement, in the place of a + c; asks for several slow starts from rest.
    #[arg(long, conflicts_with = "no_refine")]
    free_i0: bool,
    /// What the refinement on the whole closed loop moves, a list; all by default.
    #[arg(long, value_enum, value_delimiter = ',', conflicts_with = "no_refine", value_name = "WHAT,…")]
    refine: Vec<Group>,
    /// Only the steps of the paper, without the refinement on the whole closed loop.
    #[arg(long)]
    no_refine: bool,
    /// A recording to try the identified axis on; can be given several times.
    #[arg(long, value_name = "RECORDING")]
    validate: Vec<PathBuf>,
    /// The feedforward that acted in the --validate recordings: one for all, or one for each; that of
    /// --feedforward if that is one for all.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        value_name = "off|velocity|both[,…]",
        requires = "validate"
    )]
    validate_feedforward: Vec<PartName>,
    /// Where to write the machine with what was identified.
    #[arg(long, value_name = "FILE.yaml")]
    out: Option<PathBuf>,
    /// Where to write a page with each step and with plots of measured against simulated signals.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print the result as one JSON object.
    #[arg(long)]
    json: bool,
}

/// The identified axis on a recording that it was not identified from.
#[derive(Debug)]
pub struct Validation {
    /// The recording.
    pub recorded: Recorded,
    /// How the two agree.
    pub agreement: Agreement,
}

/// What the command has found.
#[derive(Debug)]
pub struct Found {
    /// Name of the machine.
    pub machine: String,
    /// The axis as it was taken for.
    pub axis: AxisConfig,
    /// What it was identified from.
    pub recordings: Vec<Recorded>,
    /// What came out.
    pub identification: Identification,
    /// The same as parameters of the machine file.
    pub values: Vec<IdentifiedValue>,
    /// Other recordings.
    pub validations: Vec<Validation>,
    /// All that must be said, the worst first.
    pub findings: Vec<Finding>,
}

/// Runs it; the text is tables, or JSON.
pub fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    check_outputs(arguments)?;
    let machine = Parameters::load(&arguments.machine)?;
    let parameters = variant::parameters(&machine, None, &arguments.set, &[])?;
    let config = variant::checked(&parameters, &machine, &arguments.machine)?;
    let place = axis::place(&config, &arguments.axis)?;

    let spinner = Spinner::new();
    let (found, identified) = find(arguments, &parameters, &config, place, &spinner)?;
    spinner.now("writing")?;
    if let Some(out) = &arguments.out {
        machine_file::write(out, &machine_text(arguments, &found, &identified))?;
    }
    if let Some(page) = &arguments.report {
        write_report(page, &found, config.periods())?;
    }
    drop(spinner);
    if arguments.json {
        return Ok(format!("{:#}\n", identify_json::object(&found)));
    }
    Ok(identify_text::text(&found))
}

/// Refuses, before the work begins, what could not be written behind it.
fn check_outputs(arguments: &Arguments) -> Result<(), String> {
    if let (Some(out), Some(page)) = (&arguments.out, &arguments.report)
        && out == page
    {
        return Err(format!("{}: given for the machine and for the report", out.display()));
    }
    if let Some(out) = &arguments.out {
        machine_file::check_name(out)?;
    }
    if let Some(page) = &arguments.report {
        report::check_name(page)?;
    }
    let read = || {
        let recordings = arguments.recordings.iter().chain(&arguments.validate).map(PathBuf::as_path);
        recordings.chain(arguments.reading.map()).chain([Path::new(&arguments.machine)])
    };
    for output in [&arguments.out, &arguments.report].into_iter().flatten() {
        read().try_for_each(|input| must_not_replace(output, input))?;
    }
    Ok(())
}

/// Writes the page; it stands under its name only when it is whole.
fn write_report(path: &Path, found: &Found, periods: Periods) -> io::Result<()> {
    let inputs: Vec<IdentificationInput<'_>> = found.recordings.iter().map(Recorded::input).collect();
    let findings: Vec<Vec<Finding>> = found.recordings.iter().map(|r| r.findings.clone()).collect();
    fn check(validation: &Validation) -> ValidationRecording<'_> {
        let Validation { recorded, agreement } = validation;
        ValidationRecording { input: recorded.input(), findings: &recorded.findings, agreement }
    }
    let validations: Vec<ValidationRecording<'_>> = found.validations.iter().map(check).collect();
    let page = IdentificationPage {
        machine: &found.machine,
        periods,
        inputs: &inputs,
        findings: &findings,
        identification: &found.identification,
        values: &found.values,
        validations: &validations,
    };
    let mut file = OutputFile::create(path)?;
    page.document().write(&mut file)?;
    file.finish()
}

/// What was found, and the machine with it.
fn find(
    arguments: &Arguments,
    parameters: &Parameters,
    config: &MachineConfig,
    place: usize,
    spinner: &Spinner,
) -> Result<(Found, Parameters), Box<dyn Error>> {
    let (axis, periods) = (&config.axes()[place], config.periods());
    let (files, others) = (&arguments.recordings, &arguments.validate);
    let modes = recordings::feedforward(&arguments.feedforward, files.len(), "--feedforward")?;
    let for_others = match (arguments.validate_feedforward.as_slice(), arguments.feedforward.as_slice()) {
        ([], [one]) => std::slice::from_ref(one),
        (given, _) => given,
    };
    let other_modes = recordings::feedforward(for_others, others.len(), "--validate-feedforward")?;
    let options = arguments.reading.options()?;
    let read = |path: &PathBuf, feedforward, option| {
        spinner.now(format!("reading {}", path.display()))?;
        let reading = (&arguments.reading, &options);
        recordings::read(path, (axis, &periods), reading, (feedforward, option))
    };
    let recordings = files.iter().zip(modes).map(|(path, mode)| read(path, mode, "--feedforward"));
    let recordings: Vec<Recorded> = recordings.collect::<Result<_, _>>()?;
    let others =
        others.iter().zip(other_modes).map(|(path, mode)| read(path, mode, "--validate-feedforward"));
    let others: Vec<Recorded> = others.collect::<Result<_, _>>()?;

    spinner.now(format!("identifying {}", axis.name()))?;
    let inputs: Vec<IdentificationInput<'_>> = recordings.iter().map(Recorded::input).collect();
    let i0 = if arguments.free_i0 { Breakaway::Freed } else { Breakaway::Held };
    let options = IdentificationOptions { i0, refine: refine(arguments) };
    let identification = virtual_axes_identify::identify::identify(&inputs, axis, &periods, &options);
    let of_files = recordings.iter().chain(&others).flat_map(|recorded| &recorded.findings);
    // A file can be given twice.
    let mut findings: Vec<Finding> = Vec::new();
    for finding in of_files.chain(&identification.findings) {
        if !findings.contains(finding) {
            findings.push(finding.clone());
        }
    }
    findings.sort_by_key(|finding| Reverse(finding.severity));
    let values = identification.values(parameters, axis.name());
    if !values.iter().any(|value| tells(value, parameters, &periods)) {
        return Err(nothing(axis.name(), &findings).into());
    }
    let mut identified = parameters.clone();
    virtual_axes_identify::identify::adopt(&mut identified, axis.name(), &values)?;
    // With the digits of the machine file.
    let adopted = identified.machine_config()?;

    spinner.now(format!("validating {}", axis.name()))?;
    let validations = others.into_iter().map(|recorded| {
        let agreement =
            virtual_axes_identify::identify::validate(&recorded.input(), &adopted.axes()[place], &periods)?;
        Ok(Validation { recorded, agreement })
    });
    let validations = validations.collect::<Result<_, Box<dyn Error>>>()?;
    let (machine, axis) = (config.name().to_owned(), axis.clone());
    let found = Found { machine, axis, recordings, identification, values, validations, findings };
    Ok((found, identified))
}

/// Whether a value says more than that any is as good.
fn tells(value: &IdentifiedValue, parameters: &Parameters, periods: &Periods) -> bool {
    let Some([low, high]) = value.interval else { return true };
    // Delays are tried in steps of a period, which need not end at the longest one.
    let step = periods.position as f64 / MILLISECOND_NS as f64;
    match parameters.definition(&value.key).map(|definition| definition.kind) {
        Some(Kind::Number { min, max }) => low > min || high + step <= max,
        _ => true,
    }
}

/// Why the command comes to nothing.
fn nothing(axis: &str, findings: &[Finding]) -> String {
    let mut text = format!("nothing of {axis} could be identified");
    for finding in findings {
        text.push_str(&format!("\n{}", identify_text::finding(finding)));
    }
    text
}

/// The machine file.
fn machine_text(arguments: &Arguments, found: &Found, identified: &Parameters) -> String {
    let list = |recorded: &mut dyn Iterator<Item = &Recorded>| -> String {
        recorded.map(|r| r.signals.name.as_str()).collect::<Vec<_>>().join(", ")
    };
    let mut head = format!(
        "{}, from the machine {} by `virtual_axes identify`.\nWhere its other values come from stands there.\n\
         {} was identified from {}; ± is a standard error.",
        found.machine,
        arguments.machine,
        found.axis.name(),
        list(&mut found.recordings.iter()),
    );
    if !found.validations.is_empty() {
        let others = list(&mut found.validations.iter().map(|v| &v.recorded));
        head.push_str(&format!("\nValidated on {others}."));
    }
    for finding in found.findings.iter().filter(|finding| finding.severity > Severity::Note) {
        head.push_str(&format!("\n{}", identify_text::finding(finding)));
    }
    identified
        .to_yaml(&head, |key| found.values.iter().find(|value| value.key == key).map(IdentifiedValue::comment))
}

/// What the refinement moves.
fn refine(arguments: &Arguments) -> RefinementScope {
    let of = |group: Group| arguments.refine.contains(&group);
    match (arguments.no_refine, arguments.refine.is_empty()) {
        (true, _) => RefinementScope::NONE,
        (false, true) => RefinementScope::ALL,
        (false, false) => RefinementScope {
            inertia: of(Group::Inertia),
            friction: of(Group::Friction),
            gravity: of(Group::Gravity),
            feedforward: of(Group::Feedforward),
        },
    }
}
