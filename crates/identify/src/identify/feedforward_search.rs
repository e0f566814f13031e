//! Active feedforward of a recording that does not contain it, by the residuals of the closed loop.

use super::feedforward_mode::FeedforwardMode;
use super::loop_problem::LoopProblem;
use super::loop_search::LoopMinimum;
use super::loop_values::LoopFit;
use super::options::IdentificationInput;
use super::plant_regression::PlantRegression;
use super::recorded_feedforward::recorded_feedforward;
use super::validate::constant_lag;
use crate::recording::{Finding, Signals};
use virtual_axes_core::config::{AxisConfig, AxisUnits, Periods};
use virtual_axes_core::statistics::mean;

/// Ratio of the residuals with and without feedforward from which the smaller one is certain.
const CLEAR: f64 = 1.5;
/// Ratio of two residuals that explain a motion alike.
const ALIKE: f64 = 1.1;
/// Standard errors of a value within its interval.
const INTERVAL: f64 = 1.96;
/// Factor on the position-loop gain of the machine file beyond which a mode is implausible.
const IMPLAUSIBLE: f64 = 3.0;
/// Ratio of the residual of a search to the least one up to which it can end in a local minimum that is followed further.
const COMPARED: f64 = 2.0;

/// Search for the feedforward of a recording.
pub(super) struct FeedforwardSearch {
    recording: String,
    /// Modes whose residuals were compared; empty if the mode is known.
    tried: Vec<TriedMode>,
    mode: FeedforwardMode,
}

/// Feedforward mode that was tried.
struct TriedMode {
    mode: FeedforwardMode,
    minimum: LoopMinimum,
    /// RMS residual, m or rad.
    rms: f64,
    /// Position-loop gain, and that of the machine file, s⁻¹.
    gain: f64,
    given_gain: f64,
}

impl TriedMode {
    /// Returns true if the position-loop gain is about that of the machine file.
    fn is_plausible(&self) -> bool {
        (self.given_gain / IMPLAUSIBLE..=self.given_gain * IMPLAUSIBLE).contains(&self.gain)
    }
}

impl FeedforwardSearch {
    /// Searches the active feedforward of a recording: as given, as recorded, or with the smaller residual of the closed loop.
    pub fn new(
        input: &IdentificationInput<'_>,
        (axis, periods): (&AxisConfig, &Periods),
        problem: LoopProblem<'_>,
    ) -> Self {
        let recording = input.signals.name.clone();
        if let Some(mode) = input.feedforward.or_else(|| recorded_feedforward(input.signals)) {
            return FeedforwardSearch { recording, tried: Vec::new(), mode };
        }
        let tried = tried_modes(input, (axis, periods), problem);
        let mut search = FeedforwardSearch { recording, tried, mode: FeedforwardMode::Both };
        search.select();
        search
    }

    /// Takes, of the modes that explain the motion alike, a plausible one, and of these the one with the least feedforward.
    fn select(&mut self) {
        let least = self.least();
        let mut alike = self.tried.iter().filter(|tried| tried.rms <= ALIKE * least);
        let first = alike.clone().next();
        if let Some(tried) = alike.find(|tried| tried.is_plausible()).or(first) {
            self.mode = tried.mode;
        }
    }

    fn least(&self) -> f64 {
        self.tried.iter().map(|tried| tried.rms).fold(f64::INFINITY, f64::min)
    }

    pub fn mode(&self) -> FeedforwardMode {
        self.mode
    }

    /// Compares the modes that the search does not distinguish by the identification of each, `fit`, and returns the mode
    /// with its identification.
    pub fn converged(
        &mut self,
        fit: impl Fn(FeedforwardMode, Option<LoopMinimum>) -> Option<(LoopFit, Option<PlantRegression>)>,
    ) -> (FeedforwardMode, Option<(LoopFit, Option<PlantRegression>)>) {
        let least = self.least();
        let mut found = Vec::new();
        for tried in self.tried.iter_mut().filter(|tried| tried.rms <= CLEAR * least) {
            if let Some(identified) = fit(tried.mode, Some(tried.minimum.clone())) {
                tried.rms = identified.0.exact_rms;
                tried.gain = identified.0.axis.position_loop.gain;
                found.push((tried.mode, identified));
            }
        }
        self.select();
        let taken = found.iter().position(|(mode, _)| *mode == self.mode);
        let mut identified = match taken {
            Some(k) => Some(found.swap_remove(k).1),
            None => fit(self.mode, None),
        };
        if let Some((fit, Some(plant))) = &mut identified {
            // The interval contains the inertia of a mode that explains the motion alike.
            let alike = found.iter().filter(|(_, (other, _))| other.exact_rms <= ALIKE * fit.exact_rms);
            for (_, (_, other)) in alike {
                let change = other.as_ref().map_or(0.0, |other| other.inertia.value - plant.inertia.value);
                plant.inertia.error = plant.inertia.error.hypot(change / INTERVAL);
            }
        }
        (self.mode, identified)
    }

    /// Reports a feedforward that was found by the residuals.
    pub fn report(&self, axis: &AxisConfig, findings: &mut Vec<Finding>) {
        if self.tried.is_empty() {
            return;
        }
        let AxisUnits { error: unit, error_name: name, .. } = axis.units();
        let residual =
            |TriedMode { mode, rms, .. }: &TriedMode| format!("{} {:.1} {name}", mode.name(), rms / unit);
        let residuals = self.tried.iter().map(residual).collect::<Vec<String>>().join(", ");
        let least = |is_off: bool| {
            let of_it = self.tried.iter().filter(|tried| (tried.mode == FeedforwardMode::Off) == is_off);
            let of_it = of_it.filter(|tried| tried.is_plausible() || tried.mode == self.mode);
            of_it.map(|tried| tried.rms).fold(f64::INFINITY, f64::min)
        };
        let (off, on) = (least(true), least(false));
        let recording = &self.recording;
        if off.max(on) < CLEAR * off.min(on) {
            findings.push(Finding::invalid(
                "feedforward-unknown",
                format!("{recording}: the motion does not show whether feedforward was active: RMS residuals {residuals}"),
                "give --feedforward off, velocity or both",
            ));
        }
        findings.push(Finding::note(
            "feedforward-inferred",
            format!("{recording}: feedforward {} is assumed: RMS residuals {residuals}", self.mode.name()),
        ));
    }
}

/// Returns the minimum of each mode that is possible. They are compared once each of them has converged.
fn tried_modes(
    input: &IdentificationInput<'_>,
    (axis, periods): (&AxisConfig, &Periods),
    problem: LoopProblem<'_>,
) -> Vec<TriedMode> {
    let has_velocity = input.signals.spans.iter().any(|span| span.velocity_feedforward.is_some());
    let is_possible = |mode: &FeedforwardMode| match mode {
        FeedforwardMode::Off => !has_velocity,
        FeedforwardMode::Velocity => true,
        FeedforwardMode::Both => axis.feedforward.torque != 0.0,
    };
    let mut tried: Vec<TriedMode> = Vec::new();
    for mode in FeedforwardMode::ALL.into_iter().filter(is_possible) {
        let recordings = [(input.signals, mode)];
        let problem = LoopProblem { recordings: &recordings, ..problem };
        let minimum = mean_lag(&recordings, axis).and_then(|lag| problem.search(axis, periods, lag));
        let Some(minimum) = minimum else { continue };
        let Some(rms) = problem.searched_rms(axis, periods, &minimum) else { continue };
        let (gain, given_gain) = (problem.gain_of(axis, &minimum), problem.given_gain);
        tried.push(TriedMode { mode, minimum, rms, gain, given_gain });
    }
    let least = tried.iter().map(|tried| tried.rms).fold(f64::INFINITY, f64::min);
    let mut without_torque = Vec::new();
    for tried in tried.iter_mut().filter(|tried| tried.rms <= COMPARED * least) {
        let recordings = [(input.signals, tried.mode)];
        let problem = LoopProblem { recordings: &recordings, ..problem };
        let mut starts = vec![tried.minimum.clone()];
        // A search over all parameters can miss the minimum without torque feedforward.
        starts.extend(match tried.mode {
            FeedforwardMode::Both => problem.with_torque(axis, periods, &without_torque),
            FeedforwardMode::Off | FeedforwardMode::Velocity => None,
        });
        for start in starts {
            let Some(minimum) = problem.polished(axis, periods, start) else { continue };
            let Some(rms) = problem.searched_rms(axis, periods, &minimum) else { continue };
            if rms < tried.rms {
                tried.gain = problem.gain_of(axis, &minimum);
                (tried.minimum, tried.rms) = (minimum, rms);
            }
        }
        if tried.mode == FeedforwardMode::Velocity {
            let values = tried.minimum.values.iter().copied();
            without_torque = problem.parameters(axis).into_iter().zip(values).collect();
        }
    }
    tried
}

/// Returns the mean lag of the recordings behind PSEC, s, without that of the position loop.
pub(super) fn mean_lag(recordings: &[(&Signals, FeedforwardMode)], axis: &AxisConfig) -> Option<f64> {
    let starts = recordings.iter().filter_map(|(signals, mode)| {
        let (lag, _) = constant_lag(signals)?;
        // Without feedforward the axis lags by 1 / Kp in addition.
        let off = *mode == FeedforwardMode::Off;
        Some(if off { (lag - 1.0 / axis.position_loop.gain).max(0.0) } else { lag })
    });
    mean(&starts.collect::<Vec<f64>>())
}
