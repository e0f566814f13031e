//! Identification of a hidden axis from a generated recording, compared with its parameters.

use std::error::Error;

use virtual_axes_core::config::Parameters;
use virtual_axes_core::units::{MILLISECOND, Nanoseconds, seconds};
use virtual_axes_identify::identify::summary::IdentificationSummary;
use virtual_axes_identify::identify::{
    AxisIdentification, AxisRecordings, ConditionedRecording, IdentificationOptions, IdentifiedValue,
};
use virtual_axes_identify::recording::{Conditioning, Severity};

use super::drawn::AxisOrientation;
use super::hidden_axis::HiddenAxis;
use super::trace_files::machine_file;
use super::trace_kind::{TraceKind, TraceProgram};

/// Duration of the unseen program, s.
const UNSEEN: f64 = 15.0;
/// Standard errors of a 95 % interval.
const INTERVAL: f64 = 1.96;

/// Error of an identified value, and true if its 95 % interval contains the hidden value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValueError {
    /// Error; the unit is that of the field.
    pub error: f64,
    /// Half width of the 95 % interval, in the unit of the error.
    pub half_interval: f64,
    /// True if the interval contains the hidden value.
    pub is_covered: bool,
}

impl ValueError {
    fn new(error: f64, half_interval: f64) -> Self {
        ValueError { error, half_interval, is_covered: error.abs() <= half_interval }
    }
}

/// Errors of an identification; values that were not identified are none.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyFigures {
    /// Seed of axis, program and recording.
    pub seed: u64,
    /// Orientation of the axis.
    pub orientation: AxisOrientation,
    /// Period of the samples, ns.
    pub period: Nanoseconds,
    /// Program of the recording.
    pub program: TraceProgram,
    /// Relative error of Kt / Jeq.
    pub acceleration: Option<ValueError>,
    /// Error of the weight relative to the hidden one, or in N without weight; the scale of Kt is taken out.
    pub weight: Option<ValueError>,
    /// Error of the lag at constant velocity, position cycles of the hidden axis.
    pub lag: Option<f64>,
    /// Error of β plus position cycle, s.
    pub beta: Option<ValueError>,
    /// Relative error of the position-loop gain.
    pub gain: Option<ValueError>,
    /// RMS position residual of the recording and of the unseen program, m.
    pub residuals: [Option<f64>; 2],
    /// R² of the current of the recording.
    pub r_squared: Option<f64>,
    /// Codes of the findings that make the result invalid.
    pub invalid: Vec<&'static str>,
    /// Error instead of a result.
    pub failure: Option<String>,
}

/// Identifies the axis of `seed` from a recording of a drawn kind with samples every `period` ns, without options, and
/// predicts an unseen program.
///
/// # Errors
/// An error if the axis cannot be simulated; a failed identification is part of the figures.
pub fn study(
    seed: u64,
    orientation: AxisOrientation,
    period: Nanoseconds,
) -> Result<StudyFigures, Box<dyn Error>> {
    let kind = TraceKind::draw(seed, period);
    let hidden = kind.applied(HiddenAxis::draw(seed, orientation));
    let mut figures = StudyFigures {
        seed,
        orientation,
        period,
        program: kind.program,
        acceleration: None,
        weight: None,
        lag: None,
        beta: None,
        gain: None,
        residuals: [None; 2],
        r_squared: None,
        invalid: Vec::new(),
        failure: None,
    };
    let guess = hidden.guess(seed);
    let text = machine_file("Guess.", &[&guess.config], guess.periods)?;
    let parameters = Parameters::from_yaml(&text, "guess")?;
    let record = |program: &super::ProductionProgram, number: u64| {
        let mut raw = hidden.record(program, &kind.recorder, number)?;
        raw.name = format!("trace {number}");
        Ok::<_, Box<dyn Error>>(raw)
    };
    let seen = record(&kind.plan(&hidden, 2 * seed + 1)?, 2 * seed + 1)?;
    let unseen = record(&hidden.program(2 * seed + 2, UNSEEN)?, 2 * seed + 2)?;
    let machine = parameters.machine_config()?;
    let conditioned = |raw| {
        let of = (&machine.axes()[0], &machine.periods());
        ConditionedRecording::new((raw, Vec::new()), of, &Conditioning::default(), None)
    };
    let found = conditioned(&seen).and_then(|seen| {
        let recordings = AxisRecordings {
            identification: vec![seen],
            validation: vec![conditioned(&unseen)?],
            ..AxisRecordings::default()
        };
        AxisIdentification::new((&parameters, 0), recordings, &IdentificationOptions::default(), |_| Ok(()))
    });
    match found {
        Ok(found) => figures.compare(&found.summary, &kind, &hidden, &parameters),
        Err(error) => figures.failure = Some(error.to_string()),
    }
    Ok(figures)
}

impl StudyFigures {
    /// Compares the values with the hidden ones.
    fn compare(
        &mut self,
        summary: &IdentificationSummary,
        kind: &TraceKind,
        hidden: &HiddenAxis,
        guess: &Parameters,
    ) {
        let value = |key: &str| {
            summary.values.iter().find(|value| value.key == format!("{}.{key}", hidden.config.name))
        };
        // The torque constant of the guess scales inertia and weight.
        let truth = &hidden.config;
        let Ok(machine) = guess.machine_config() else { return };
        let known = machine.axes()[0].motor.torque_constant / truth.motor.torque_constant;
        self.acceleration = value("motor.inertia_kg_m2").map(|found| {
            let inertia = truth.motor.inertia * known;
            ValueError::new(inertia / found.value - 1.0, half(found) / found.value)
        });
        self.weight = value("gravity.weight_n").map(|found| {
            let weight = truth.gravity.weight * known;
            let scale = if weight == 0.0 { 1.0 } else { weight };
            let covers = |[low, high]: [f64; 2]| (low..=high).contains(&weight);
            let of = ValueError::new((found.value - weight) / scale, half(found) / scale);
            ValueError { is_covered: found.interval.map_or(of.is_covered, covers), ..of }
        });
        let cycle = summary.values.iter().find(|value| value.key == "periods.position_ms");
        let cycle = cycle.map_or(seconds(machine.periods().position), |value| value.value * MILLISECOND);
        let delay = kind.logger_delay(hidden);
        self.lag = value("delays.alpha_ms").map(|found| {
            let lag = (found.value * MILLISECOND / cycle - 1e-6).ceil() * cycle;
            (lag - hidden.lag() - delay) / seconds(hidden.periods.position)
        });
        self.beta = value("delays.beta_ms").map(|found| {
            let truth = seconds(truth.delays.beta) + delay + seconds(hidden.periods.position) - cycle;
            let [low, high] = found.interval.unwrap_or([found.value; 2]).map(|bound| bound * MILLISECOND);
            ValueError {
                error: found.value * MILLISECOND - truth,
                half_interval: 0.5 * (high - low),
                is_covered: (low..=high).contains(&truth),
            }
        });
        let gain = truth.position_loop.gain / virtual_axes_core::units::POSITION_GAIN;
        self.gain = value("position_loop.gain")
            .map(|found| ValueError::new(found.value / gain - 1.0, half(found) / gain));
        let model = |baseline: Option<&virtual_axes_identify::identify::summary::BaselineSummary>| {
            baseline.map(|baseline| baseline.model * machine.axes()[0].units().error)
        };
        let first = summary.agreement.first().map(|agreement| &agreement.residuals);
        let validation = summary.validation.first().map(|validation| &validation.residuals);
        self.residuals = [first, validation]
            .map(|residuals| model(residuals.and_then(|residuals| residuals.baseline.as_ref())));
        let inverse = first.and_then(|residuals| residuals.inverse_dynamics.as_ref());
        self.r_squared = inverse.map(|inverse| inverse.current_r_squared);
        let invalid = summary.findings.iter().filter(|finding| finding.severity == Severity::Invalid);
        self.invalid = invalid.map(|finding| finding.code).collect();
    }
}

/// Returns the half width of the 95 % interval of a value; 0 without standard error.
fn half(found: &IdentifiedValue) -> f64 {
    INTERVAL * found.error.unwrap_or(0.0)
}
