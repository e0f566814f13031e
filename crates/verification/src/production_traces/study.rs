//! Study of the identification over many hidden axes.

use std::fmt;

use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::statistics::quantile;
use virtual_axes_core::units::{MILLISECOND_NS, seconds};
use virtual_axes_identify::identify::{
    FeedforwardMode, Identification, IdentificationInput, IdentificationOptions, identify, validate,
};
use virtual_axes_identify::recording::{Conditioning, Severity, Signals, condition};

use super::hidden_axis::{AxisOrientation, HiddenAxis};
use super::position_error::PositionError;
use super::recorder::TraceRecorder;

/// Result of the identification of one hidden axis from one trace, and of its check with an unseen program.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyCase {
    /// Seed and orientation.
    pub name: String,
    /// Errors of the identified values; none if the identification failed, with the reason.
    pub figures: Result<StudyFigures, String>,
}

/// Errors of identified values.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyFigures {
    /// Relative error of Jeq / Kt, and the error in standard errors.
    pub inertia: [f64; 2],
    /// Error of α beyond its interval, position cycles of the hidden axis.
    pub alpha: f64,
    /// Error of β, s, and in standard errors.
    pub beta: [f64; 2],
    /// True if the machine file has the position cycle of the hidden axis.
    pub is_period_known: bool,
    /// Error of W / Kt: relative (absolute in A without weight), and in standard errors.
    pub weight: [f64; 2],
    /// True if the hidden axis has a weight.
    pub has_weight: bool,
    /// RMS position residual of the unseen program, m, and that of the best constant lag.
    pub unseen: [f64; 2],
    /// RMS position residual of the unseen program with the hidden parameters, m: what the trace itself allows.
    pub hidden: f64,
    /// Position error on the unseen program with exact setpoints, without a trace in between.
    pub exact: PositionError,
    /// R² of the current of the unseen program, by inverse dynamics.
    pub r_squared: f64,
    /// Codes of findings about invalid results.
    pub invalid: Vec<&'static str>,
    /// True if backlash was found.
    pub has_backlash: bool,
}

/// Study over many axes.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceStudy {
    duration: f64,
    backlash: f64,
    stribeck: f64,
    cases: Vec<StudyCase>,
}

impl TraceStudy {
    /// Creates a study of programs of `duration` s on axes with a backlash, m, and Stribeck friction, A.
    pub fn new(duration: f64, backlash: f64, stribeck: f64) -> Self {
        TraceStudy { duration, backlash, stribeck, cases: Vec::new() }
    }

    /// Returns the cases so far.
    pub fn cases(&self) -> &[StudyCase] {
        &self.cases
    }

    /// Identifies the hidden axis of a seed and returns its case.
    pub fn add(&mut self, seed: u64, orientation: AxisOrientation) -> &StudyCase {
        let mut hidden = HiddenAxis::draw(seed, orientation);
        hidden.backlash = self.backlash;
        hidden.stribeck = self.stribeck;
        let figures = study(&hidden, seed, self.duration);
        self.cases.push(StudyCase { name: format!("{seed} {orientation:?}"), figures });
        &self.cases[self.cases.len() - 1]
    }
}

fn study(hidden: &HiddenAxis, seed: u64, duration: f64) -> Result<StudyFigures, String> {
    let guess = hidden.guess(seed);
    let record = |program: u64| -> Result<Signals, String> {
        let program = hidden.program(program, duration).map_err(|error| error.to_string())?;
        let raw = hidden
            .record(&program, &TraceRecorder::default(), program_seed(seed))
            .map_err(|e| e.to_string())?;
        let conditioned = condition(&raw, &guess.config, &guess.periods, &Conditioning::default());
        conditioned.map(|(signals, _)| signals).map_err(|error| error.to_string())
    };
    let (seen, unseen) = (record(2 * seed + 1)?, record(2 * seed + 2)?);
    let input = |signals| IdentificationInput { signals, feedforward: Some(FeedforwardMode::Both) };
    let found = identify(&[input(&seen)], &guess.config, &guess.periods, &IdentificationOptions::default());
    let periods = found.periods.unwrap_or(guess.periods);
    let agreement = validate(&input(&unseen), found.axis(), &periods).map_err(|error| error.to_string())?;
    let baseline = agreement.baseline.ok_or("no simulation of the unseen program")?;
    let inverse = agreement.inverse.ok_or("no current of the unseen program")?;
    let truth =
        validate(&input(&unseen), &hidden.config, &hidden.periods).map_err(|error| error.to_string())?;
    let truth = truth.baseline.ok_or("no simulation of the hidden axis")?;
    let program = hidden.program(2 * seed + 2, duration).map_err(|error| error.to_string())?;
    let exact = PositionError::compute(hidden, found.axis(), periods, &program).map_err(|e| e.to_string())?;
    let figures = figures(hidden, &guess.config, &found);
    let (inertia, alpha, beta, weight) = figures.ok_or_else(|| reasons(&found))?;
    Ok(StudyFigures {
        inertia,
        alpha,
        beta,
        is_period_known: guess.is_period_known,
        weight,
        has_weight: hidden.config.gravity.weight != 0.0,
        unseen: [baseline.model, baseline.delayed],
        hidden: truth.model,
        exact,
        r_squared: inverse.r_squared,
        has_backlash: found.findings.iter().any(|finding| finding.code == "backlash"),
        invalid: found.findings.iter().filter(|f| f.severity == Severity::Invalid).map(|f| f.code).collect(),
    })
}

fn program_seed(seed: u64) -> u64 {
    7 * seed + 1
}

fn reasons(found: &Identification) -> String {
    let texts: Vec<String> =
        found.findings.iter().filter(|f| f.severity > Severity::Note).map(|f| f.what.clone()).collect();
    texts.join("; ")
}

type Errors = ([f64; 2], f64, [f64; 2], [f64; 2]);

/// Returns the errors of inertia, α, β and weight; none if one of them was not identified.
fn figures(hidden: &HiddenAxis, guess: &AxisConfig, found: &Identification) -> Option<Errors> {
    let (truth, kt) = (&hidden.config, guess.motor.torque_constant);
    let per_current = truth.motor.inertia / truth.motor.torque_constant;
    let inertia = found.inertia.as_ref()?;
    let weight_truth = truth.gravity.weight / truth.motor.torque_constant * truth.transmission_ratio;
    let gravity = found.gravity.as_ref()?;
    let gravity_error = gravity.current.constant - weight_truth;
    let delay = |name: &str| found.delays.iter().find(|fit| fit.delay.name() == name);
    let (alpha, beta) = (delay("alpha")?, delay("beta")?);
    let cycle = hidden.periods.position as f64;
    let lag = hidden.lag() / seconds(MILLISECOND_NS);
    let alpha_error =
        (lag - alpha.interval.1 as f64 / MILLISECOND_NS as f64).abs() * MILLISECOND_NS as f64 / cycle;
    let beta_error = seconds(found.axis().delays.beta) - seconds(truth.delays.beta);
    let beta_sigma = seconds(beta.interval.1 - beta.value) / 2.0;
    let relative = if weight_truth == 0.0 { gravity_error } else { gravity_error / weight_truth };
    Some((
        [inertia.value / kt / per_current - 1.0, (inertia.value / kt - per_current) / (inertia.error / kt)],
        alpha_error,
        [beta_error, beta_error / beta_sigma],
        [relative, gravity_error / gravity.error.constant],
    ))
}

impl fmt::Display for StudyCase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.figures {
            Err(reason) => write!(f, "{}: failed: {reason}", self.name),
            Ok(x) => write!(
                f,
                "{}: J {:+.2} % ({:+.1} σ), α {:.2} cycles, β {:+.2} ms ({:+.1} σ{}), W {:+.3} ({:+.1} σ), unseen {:.1} µm \
                 of {:.1} µm, exact {:.1} µm of {:.1} µm, R² {:.4} {}",
                self.name,
                100.0 * x.inertia[0],
                x.inertia[1],
                x.alpha,
                1e3 * x.beta[0],
                x.beta[1],
                if x.is_period_known { "" } else { ", cycle not known" },
                x.weight[0],
                x.weight[1],
                1e6 * x.unseen[0],
                1e6 * x.unseen[1],
                1e6 * x.exact.model,
                1e6 * x.exact.delayed,
                x.r_squared,
                x.invalid.join(" ")
            ),
        }
    }
}

impl fmt::Display for TraceStudy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all: Vec<&StudyFigures> =
            self.cases.iter().filter_map(|case| case.figures.as_ref().ok()).collect();
        writeln!(f, "{} traces, {} without result", self.cases.len(), self.cases.len() - all.len())?;
        writeln!(f, "{:44} {:>8} {:>8} {:>8} {:>8}", "", "median", "90 %", "98 %", "largest")?;
        let mut row = |name: &str, values: Vec<f64>| {
            let mut sorted = values;
            let mut at = |q: f64| quantile(&mut sorted, q).unwrap_or(f64::NAN);
            let (a, b, c, d) = (at(0.5), at(0.9), at(0.98), at(1.0));
            writeln!(f, "{name:44} {a:8.3} {b:8.3} {c:8.3} {d:8.3}")
        };
        row("Jeq / Kt, error, %", all.iter().map(|x| 100.0 * x.inertia[0].abs()).collect())?;
        row("α, error, position cycles", all.iter().map(|x| x.alpha).collect())?;
        let known = || all.iter().filter(|x| x.is_period_known);
        row("β, error, ms, position cycle known", known().map(|x| 1e3 * x.beta[0].abs()).collect())?;
        row("β, error, ms, all", all.iter().map(|x| 1e3 * x.beta[0].abs()).collect())?;
        let heavy = |is_heavy: bool| all.iter().filter(move |x| x.has_weight == is_heavy);
        row("W / Kt, error, %, vertical axes", heavy(true).map(|x| 100.0 * x.weight[0].abs()).collect())?;
        row("W / Kt, error, A, horizontal axes", heavy(false).map(|x| x.weight[0].abs()).collect())?;
        row("unseen program, position RMS, µm", all.iter().map(|x| 1e6 * x.unseen[0]).collect())?;
        row("– relative to the best constant lag", all.iter().map(|x| x.unseen[0] / x.unseen[1]).collect())?;
        row("– the same for the hidden parameters", all.iter().map(|x| x.hidden / x.unseen[1]).collect())?;
        row("– with exact setpoints, RMS, µm", all.iter().map(|x| 1e6 * x.exact.model).collect())?;
        row(
            "– relative to the best constant lag",
            all.iter().map(|x| x.exact.model / x.exact.delayed).collect(),
        )?;
        row("unseen program, 1 − R² of the current", all.iter().map(|x| 1.0 - x.r_squared).collect())?;
        let within = |name: &str, f: &mut fmt::Formatter<'_>, of: &dyn Fn(&StudyFigures) -> Option<f64>| {
            let errors: Vec<f64> = all.iter().filter_map(|x| of(x)).collect();
            let inside = errors.iter().filter(|error| error.abs() <= 1.96).count();
            writeln!(f, "{name:44} {:7.1} %", 100.0 * inside as f64 / errors.len().max(1) as f64)
        };
        within("95 % interval contains the truth: Jeq / Kt", f, &|x| Some(x.inertia[1]))?;
        within("95 % interval contains the truth: W / Kt", f, &|x| Some(x.weight[1]))?;
        within("– and β, position cycle known", f, &|x| x.is_period_known.then_some(x.beta[1]))?;
        let invalid = all.iter().filter(|x| !x.invalid.is_empty()).count();
        writeln!(f, "{:44} {invalid:7}", "results rejected as invalid")?;
        let backlash = all.iter().filter(|x| x.has_backlash).count();
        writeln!(f, "{:44} {backlash:7}", "axes with a finding of backlash")
    }
}
