//! Identification of several axes by `virtual_axes identify`.

use std::error::Error;
use std::path::PathBuf;

use virtual_axes_core::config::{MachineConfig, Parameters, Value, ValueSource};
use virtual_axes_identify::identify::{AxisIdentification, update_parameters};
use virtual_axes_identify::recording::{Finding, Severity};
use virtual_axes_io::files::read_recording;

use crate::arguments::axis;
use crate::identify::machine_output::with_axes;
use crate::identify::recordings::RecordingArguments;
use crate::identify::selection::SelectedAxis;

/// Parameter of the position cycle, which all axes share.
const POSITION_CYCLE: &str = "periods.position_ms";
/// Range of the setpoint, or else of the position, of an axis at rest, m or rad.
const AT_REST: f64 = 2e-5;

/// Rejects options that name the signals of one axis.
pub fn check_options(reading: &RecordingArguments) -> Result<(), Box<dyn Error>> {
    match reading.single_axis_option()? {
        None => Ok(()),
        Some(option) => Err(format!(
            "--axis all: {option} names the signals of one axis; give the name of that axis in place of all"
        )
        .into()),
    }
}

/// Returns the axes that move in one of the recordings, and the names of the others.
///
/// # Errors
/// Returns an error if an axis is none of the machine, or none moves.
pub fn moving_axes(
    axes: Vec<SelectedAxis>,
    recordings: &[PathBuf],
    reading: &RecordingArguments,
    config: &MachineConfig,
) -> Result<(Vec<SelectedAxis>, Option<Finding>), Box<dyn Error>> {
    let (mut moving, mut resting) = (Vec::new(), Vec::new());
    for selected in axes {
        let axis = &config.axes()[axis::index(config, &selected.name)?];
        let options = reading.with_joint(selected.joint.as_deref()).options()?;
        let moves = |path: &PathBuf| {
            // The identification reports a recording that cannot be read.
            let Ok((raw, _)) = read_recording(path, axis, &options) else { return true };
            let signal = raw.psec.or(raw.position).unwrap_or_default();
            let range = |bounds: (f64, f64), x: &f64| (bounds.0.min(*x), bounds.1.max(*x));
            let (least, most) = signal.iter().fold((f64::INFINITY, f64::NEG_INFINITY), range);
            most - least > AT_REST
        };
        match recordings.iter().any(moves) {
            true => moving.push(selected),
            false => resting.push(selected.name),
        }
    }
    if moving.is_empty() {
        return Err(format!("--axis all: no axis moves in the recordings ({})", resting.join(", ")).into());
    }
    let what = || format!("at rest, not identified: {}", resting.join(", "));
    let finding = (!resting.is_empty()).then(|| Finding::note("at-rest", what()));
    Ok((moving, finding))
}

/// Removes axes without a valid result from a new machine if another has one. Returns a line for each.
///
/// # Errors
/// Returns an error if the machine is invalid without them.
pub fn exclude(
    found: &mut Vec<AxisIdentification>,
    failures: &mut Vec<String>,
    identified: &mut Parameters,
) -> Result<Vec<String>, Box<dyn Error>> {
    let reason = |found: &AxisIdentification| {
        let mut findings = found.summary.findings.iter();
        let invalid = findings.find(|finding| finding.severity == Severity::Invalid)?;
        Some(format!("{}: {invalid}", found.summary.axis))
    };
    if found.iter().all(|found| reason(found).is_some()) {
        return Ok(Vec::new());
    }
    let reasons: Vec<String> = failures.drain(..).chain(found.iter().filter_map(reason)).collect();
    found.retain(|found| reason(found).is_none());
    let names: Vec<&str> = found.iter().map(|found| found.summary.axis.as_str()).collect();
    *identified = with_axes(identified, &names)?;
    Ok(reasons.into_iter().map(|reason| format!("not an axis of the new machine: {reason}")).collect())
}

/// Results of the axes of a machine.
pub struct AxesResult {
    /// Each identified axis.
    pub found: Vec<AxisIdentification>,
    /// Axes without a result, with the reason.
    pub failures: Vec<String>,
    /// Machine with the identified values of all axes.
    pub identified: Parameters,
}

/// Identifies the axes of the machine `parameters` one after the other by `identify`.
///
/// An axis can require another position cycle, which all axes share: then the axes that were identified with another cycle
/// are identified again, with the shortest of the cycles, which they keep. The last argument of `identify` is true if the
/// axis keeps the position cycle of the machine.
pub fn identify_all(
    parameters: &Parameters,
    axes: &[usize],
    identify: impl Fn(&Parameters, usize, bool) -> Result<AxisIdentification, Box<dyn Error>>,
) -> Result<AxesResult, Box<dyn Error>> {
    let mut results: Vec<AxisResult> = axes.iter().map(|axis| AxisResult::Open(*axis)).collect();
    let mut initial = parameters.clone();
    let mut cause = None;
    loop {
        let mut present = initial.clone();
        for result in &mut results {
            result.complete(&mut present, cause.as_deref(), &identify);
        }
        let cycle = results.iter().filter_map(AxisResult::cycle).fold(f64::INFINITY, f64::min);
        if cause.is_some() || results.iter().all(|result| result.fits(cycle)) {
            return Ok(collected(results, present));
        }
        cause = Some(cause_of(cycle, &results));
        initial.set(POSITION_CYCLE, Value::Double(cycle), &ValueSource::named("identification"))?;
        for result in &mut results {
            result.reopen(cycle);
        }
    }
}

/// Returns the position cycle, ms.
fn position_cycle(parameters: &Parameters) -> f64 {
    match parameters.get(POSITION_CYCLE) {
        Some(Value::Double(cycle)) => cycle,
        _ => f64::NAN,
    }
}

/// State of an axis.
enum AxisResult {
    /// Axis to be identified.
    Open(usize),
    /// Axis that cannot be identified, with the reason.
    Failed(String),
    /// Identified axis: index, results, and position cycle in ms.
    Identified(usize, Box<AxisIdentification>, f64),
}

impl AxisResult {
    /// Identifies an open axis; adds its values to the machine `present`. `cause` is the reason of a repetition.
    fn complete(
        &mut self,
        present: &mut Parameters,
        cause: Option<&str>,
        identify: impl Fn(&Parameters, usize, bool) -> Result<AxisIdentification, Box<dyn Error>>,
    ) {
        match self {
            AxisResult::Failed(_) => {}
            AxisResult::Identified(_, found, _) => {
                let mut updated = present.clone();
                let result = update_parameters(&mut updated, &found.summary.axis, &found.summary.values);
                // Values outside their range are a finding of the summary.
                if result.is_ok() && updated.machine_config().is_ok() {
                    *present = updated;
                }
            }
            AxisResult::Open(index) => match identify(present, *index, cause.is_some()) {
                Ok(mut found) => {
                    let cycle = position_cycle(&found.identified);
                    let shared = cause.map(|cause| Finding::note("position-cycle-shared", cause));
                    found.summary.findings.extend(shared);
                    present.clone_from(&found.identified);
                    *self = AxisResult::Identified(*index, Box::new(found), cycle);
                }
                Err(error) => {
                    let config = present.machine_config();
                    let name = config.ok().map(|config| config.axes()[*index].name().to_owned());
                    *self = AxisResult::Failed(format!("{}: {error}", name.unwrap_or_default()));
                }
            },
        }
    }

    /// Returns the position cycle of an identified axis, ms.
    fn cycle(&self) -> Option<f64> {
        if let AxisResult::Identified(_, _, cycle) = self { Some(*cycle) } else { None }
    }

    /// Returns true if the axis was identified with this position cycle, ms, or not at all.
    fn fits(&self, cycle: f64) -> bool {
        !matches!(self, AxisResult::Identified(_, _, other) if *other != cycle)
    }

    /// Discards the result with another position cycle, ms.
    fn reopen(&mut self, cycle: f64) {
        if let AxisResult::Identified(index, _, other) = *self
            && other != cycle
        {
            *self = AxisResult::Open(index);
        }
    }
}

/// Returns the reason of a repetition with another position cycle, ms: the axes that require it.
fn cause_of(cycle: f64, results: &[AxisResult]) -> String {
    let requires = |result: &AxisResult| match result {
        AxisResult::Identified(_, found, other) if *other == cycle => {
            let summary = &found.summary;
            let changes = summary.values.iter().any(|value| value.key == POSITION_CYCLE);
            changes.then(|| summary.axis.clone())
        }
        _ => None,
    };
    let names: Vec<String> = results.iter().filter_map(requires).collect();
    format!(
        "identified again with a position cycle of {cycle} ms, which {} requires and all axes share",
        names.join(", ")
    )
}

fn collected(results: Vec<AxisResult>, identified: Parameters) -> AxesResult {
    let (mut found, mut failures) = (Vec::new(), Vec::new());
    for result in results {
        match result {
            AxisResult::Identified(_, identification, _) => found.push(*identification),
            AxisResult::Failed(reason) => failures.push(reason),
            AxisResult::Open(_) => {}
        }
    }
    AxesResult { found, failures, identified }
}
