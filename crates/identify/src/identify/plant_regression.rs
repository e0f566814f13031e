//! Inertia, friction and gravity from any motion, by regression of the current.
//!
//! `i = Jeq (a + ρ a_ripple) / (Kt r) + s f(|V|) + C_gravity / Kt + δ di/dt` (Prévost eqs. 1 to 3) over all samples in
//! motion. a_ripple is the difference between the acceleration of an instant and the mean over a position cycle, by
//! simulation of the closed loop; its factor ρ and the lag δ of the current are fitted with a prior. Each standstill bounds
//! the gravity: friction holds any current within ±i0 around it.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::covariance::posterior_covariance;
use super::current_logging::CurrentLoggings;
use super::experiment::CurrentLogging;
use super::fit::r_squared;
use super::friction::{FrictionFit, FrictionLaw, LawFit};
use super::gravity::{GravityCurrent, GravityFit, GravitySource};
use super::inertia::InertiaFit;
use super::moving_data::{FEWEST_STILL, MovingData, RIPPLE, law_of, smoothed};
use crate::recording::Signals;
use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_core::statistics::quantile;

/// Standard errors of a 95 % interval.
const INTERVAL: f64 = 1.96;
/// Standard errors of a significant gravity.
const SIGNIFICANT: f64 = 3.0;
/// Gravity relative to friction below which it is neglected.
const RELEVANT: f64 = 0.02;
/// Longest distance of the samples of the regression, s: a tenth of the length of its filter.
const THINNED: f64 = 2e-3;
/// Correlation above which two parameters are reported as collinear.
const COLLINEAR: f64 = 0.95;

/// Result of the regression.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlantRegression {
    /// Inertia with clustered standard error.
    pub inertia: InertiaFit,
    /// Friction law.
    pub friction: FrictionFit,
    /// Gravity current with clustered standard error.
    pub gravity: GravityFit,
    /// Coefficient of determination R² over the samples in motion.
    pub r_squared: f64,
    /// Logging of the current; none if none was compared.
    pub logging: Option<CurrentLogging>,
    /// Pairs of collinear parameters with their correlation.
    pub collinear: Vec<(&'static str, &'static str, f64)>,
}

impl PlantRegression {
    /// Returns true if the 95 % interval of the inertia is narrower than its value.
    pub fn is_inertia_known(&self) -> bool {
        self.inertia.value > INTERVAL * self.inertia.error
    }

    /// Sets inertia, friction and weight of an axis.
    pub fn apply(&self, axis: &mut AxisConfig) {
        if self.is_inertia_known() {
            axis.motor.inertia = self.inertia.value;
        }
        axis.friction = self.friction.law.config;
        if let (Some((weight, _)), AxisKind::Linear) = (self.gravity.weight, axis.kind()) {
            axis.gravity.weight = if self.gravity.model == GravityCurrent::default() { 0.0 } else { weight };
        }
    }
}

/// Names of the parameters in messages.
const NAMES: [&str; 6] = ["inertia", "gravity", "friction.a", "friction.c", "friction.b", "friction.d"];

/// Fits inertia, friction and gravity, with the ways in which the control can log the current if they are known; none if the
/// axis hardly moves. A gravity that is not significant, or that of a rotary axis, which a constant does not describe, is
/// that of the model without it.
pub(super) fn fit_plant(
    recordings: &[&Signals],
    axis: &AxisConfig,
    loggings: Option<&CurrentLoggings>,
) -> Option<PlantRegression> {
    let smooth: Vec<Signals> = recordings.iter().map(|signals| smoothed(signals)).collect();
    let recordings: Vec<&Signals> = smooth.iter().collect();
    let free = fit_plant_by_regression(&recordings, axis, loggings, true)?;
    let (value, error) = (free.gravity.current.constant.abs(), free.gravity.error.constant);
    let law = &free.friction.law.config;
    let is_kept = axis.kind() == AxisKind::Linear
        && value >= SIGNIFICANT * error
        && value >= RELEVANT * (law.a + law.c).abs();
    if is_kept {
        return Some(free);
    }
    let mut fixed = fit_plant_by_regression(&recordings, axis, loggings, false)?;
    if axis.kind() == AxisKind::Linear {
        // The weight that is set to zero is as uncertain as before, and with it what the motion does not separate from it.
        fixed.friction.law = fixed.friction.law.with_errors_of(&free.friction.law);
        fixed.inertia.error = free.inertia.error.max(fixed.inertia.error);
        fixed.collinear = free.collinear;
    }
    fixed.gravity = GravityFit { model: GravityCurrent::default(), ..free.gravity };
    Some(fixed)
}

fn fit_plant_by_regression(
    recordings: &[&Signals],
    axis: &AxisConfig,
    loggings: Option<&CurrentLoggings>,
    has_gravity: bool,
) -> Option<PlantRegression> {
    let known = loggings.and_then(|loggings| loggings.instants.first()).map(|instant| &instant.ripple);
    let mut data = MovingData::new(recordings, axis, THINNED, known)?;
    let measured = data.measured(recordings, axis);
    let mut fit = data.fit(&measured, None, has_gravity)?;
    let mut logging = loggings.map(|_| CurrentLogging::MEAN);
    let mut spread = None;
    if let Some(loggings) = loggings {
        let per_current = axis.motor.torque_constant * axis.transmission_ratio;
        let ripple_of = |instant| data.ripple_of(recordings, instant, per_current);
        let columns: Vec<Vec<f64>> = loggings.instants.par_iter().map(ripple_of).collect();
        let compared = data.compare(&measured, (&fit, has_gravity), (loggings, &columns));
        spread = Some(compared.spread);
        if let Some(k) = compared.best {
            data.samples.iter_mut().zip(&columns[k]).for_each(|(sample, ripple)| sample.ripple = *ripple);
            fit = data.fit(&measured, Some(loggings.error), has_gravity)?;
            logging =
                Some(CurrentLogging { ripple: fit.values[RIPPLE], offset: loggings.instants[k].offset });
        }
    }
    let clusters: Vec<Option<usize>> = data.samples.iter().map(|sample| Some(sample.cluster)).collect();
    let residuals = |x: &[f64]| Some(data.residuals(x, &measured, (fit.noise, fit.ripple)));
    let covariance = posterior_covariance(&fit.parameters, &fit.values, residuals, &clusters, fit.noise)?;
    if loggings.is_some_and(|loggings| loggings.is_of_identified_loop) {
        spread = spread.map(|spread| spread + ripple_doubt(&covariance, fit.values[RIPPLE]));
    }
    Some(PlantRegression { logging, ..result(&data, &measured, axis, &fit.values, (covariance, spread)) })
}

/// Returns the covariance of values that a ripple of another size than the simulated one leaves in doubt: their change if its
/// `factor` was 1.
fn ripple_doubt(covariance: &DMatrix<f64>, factor: f64) -> DMatrix<f64> {
    let variance = covariance[(RIPPLE, RIPPLE)];
    if !(variance > 0.0 && factor > 0.0) {
        return DMatrix::zeros(covariance.nrows(), covariance.ncols());
    }
    let change = covariance.column(RIPPLE) * ((factor - 1.0) / variance);
    &change * change.transpose()
}

/// Returns center and half width of the gravity currents that the standstills permit, A: friction holds the axis with any
/// current within ±`i0`, the largest that is probable.
fn gravity_at_rest(still: &[f64], i0: f64) -> Option<(GravityCurrent, GravityCurrent)> {
    if still.len() < FEWEST_STILL {
        return None;
    }
    let mut still = still.to_vec();
    let (low, high) = (quantile(&mut still, 0.05)?, quantile(&mut still, 0.95)?);
    let only = |constant| GravityCurrent { constant, ..GravityCurrent::default() };
    let half = i0 - 0.5 * (high - low);
    (half > 0.0).then(|| (only(0.5 * (low + high)), only(half)))
}

/// Converts the fitted values into results of the identification.
fn result(
    data: &MovingData,
    measured: &[f64],
    axis: &AxisConfig,
    x: &[f64],
    (mut covariance, spread): (DMatrix<f64>, Option<DMatrix<f64>>),
) -> PlantRegression {
    let mut collinear = Vec::new();
    for j in 0..NAMES.len() {
        for k in 0..j {
            let rho = covariance[(j, k)] / (covariance[(j, j)] * covariance[(k, k)]).sqrt();
            if rho.abs() > COLLINEAR {
                collinear.push((NAMES[k], NAMES[j], rho));
            }
        }
    }
    if let Some(spread) = spread {
        covariance += spread;
    }
    let error = |k: usize| covariance[(k, k)].max(0.0).sqrt();
    let per_current = axis.motor.torque_constant * axis.transmission_ratio;
    let modeled = data.modeled(x);
    let r_squared = r_squared(measured.iter().copied().zip(modeled));
    // Derivatives of a, b, c, d with respect to the fitted a, −c/a, b, ln(−d).
    let law = law_of(x);
    let mut to_law = DMatrix::zeros(4, x.len());
    to_law[(0, 2)] = 1.0;
    to_law[(1, 4)] = 1.0;
    to_law[(2, 2)] = -x[3];
    to_law[(2, 3)] = -x[2];
    to_law[(3, 5)] = law.d;
    let of_law = &to_law * &covariance * to_law.transpose();
    let errors = [0, 1, 2, 3].map(|k| of_law[(k, k)].max(0.0).sqrt());
    // i0 = a + c.
    let i0_error = (of_law[(0, 0)] + of_law[(2, 2)] + 2.0 * of_law[(0, 2)]).max(0.0).sqrt();
    let force = axis.motor.torque_constant / axis.transmission_ratio;
    let only = |constant| GravityCurrent { constant, ..GravityCurrent::default() };
    PlantRegression {
        inertia: InertiaFit {
            value: x[0] * per_current,
            error: error(0) * per_current,
            spread: f64::NAN,
            instants: Vec::new(),
            accelerations: data.moves,
        },
        friction: FrictionFit {
            law: LawFit::new(FrictionLaw::DoubleExponential, law, errors, r_squared, of_law),
            directions: [None, None],
            asymmetry: f64::NAN,
        },
        gravity: GravityFit {
            current: only(x[1]),
            error: only(error(1)),
            model: only(x[1]),
            weight: Some((x[1] * force, error(1) * force)),
            tilt: None,
            phase: None,
            source: GravitySource::Regression,
            at_rest: gravity_at_rest(&data.still, law.i0 + INTERVAL * i0_error),
        },
        r_squared,
        logging: None,
        collinear,
    }
}
