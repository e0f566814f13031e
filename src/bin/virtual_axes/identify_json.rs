//! JSON output of `virtual_axes identify`.
//!
//! Keys contain units; units that depend on the axis are in `position_unit`, `velocity_unit` and
//! `speed_unit`.

use serde_json::{Value, json};
use virtual_axes_core::units::{DEGREE, MILLISECOND, MILLISECOND_NS};
use virtual_axes_identify::identify::{
    Agreement, DelayFit, ExperimentComparison, FeedforwardRegression, FrictionFit, FrictionLaw,
    GravityCurrent, GravityFit, GravitySource, IdentifiedValue, LawFit, Refinement, ResidualStatistics,
    SteadyCurrent,
};
use virtual_axes_identify::recording::Finding;

use crate::axis::AxisUnits;
use crate::identify_result::IdentificationResult;
use crate::identify_text::{by_speed, modes, severity, velocity_scale};
use crate::recordings::ConditionedRecording;
use crate::table;

/// Returns the result as a JSON object.
pub fn object(found: &IdentificationResult) -> Value {
    let (kind, identification) = (found.axis.kind(), &found.identification);
    let scales = Scales::of(found);
    let agreements: Vec<Value> = found
        .recordings
        .iter()
        .zip(&identification.agreements)
        .map(|(recorded, agreement)| scales.agreement(recorded, agreement))
        .collect();
    let validations = found.validations.iter().map(|validation| {
        let (recorded, agreement) = (&validation.recorded, &validation.agreement);
        let mut object = recording(recorded, Some(agreement));
        if let (Value::Object(object), Value::Object(agreement)) =
            (&mut object, scales.agreement(recorded, agreement))
        {
            object.extend(agreement);
        }
        object
    });
    let all = identification.agreements.iter().map(Some).chain(std::iter::repeat(None));
    let recordings =
        found.recordings.iter().zip(all).map(|(recorded, agreement)| recording(recorded, agreement));
    json!({
        "machine": found.machine,
        "axis": found.axis.name(),
        "position_unit": table::scale(kind).1,
        "velocity_unit": scales.velocity_name,
        "speed_unit": scales.units.speed_name,
        "recordings": recordings.collect::<Vec<_>>(),
        "values": found.values.iter().map(value).collect::<Vec<_>>(),
        "friction": identification.friction.as_ref().map(|f| scales.friction(f, &identification.steady.levels)),
        "inertia": inertia(found),
        "gravity": identification.gravity.as_ref().map(gravity),
        "feedforward": {
            "velocity": identification.feedforward.velocity.as_ref().map(regression),
            "torque": identification.feedforward.torque.as_ref().map(regression),
        },
        "delays": identification.delays.iter().map(|fit| scales.delay(fit)).collect::<Vec<_>>(),
        "refinement": identification.refinement.as_ref().map(|refinement| scales.refinement(refinement)),
        "agreement": agreements,
        "validation": validations.collect::<Vec<_>>(),
        "findings": found.findings.iter().map(finding).collect::<Vec<_>>(),
    })
}

fn recording(recorded: &ConditionedRecording, agreement: Option<&Agreement>) -> Value {
    let signals = &recorded.signals;
    json!({
        "name": signals.name,
        "duration_s": recorded.duration(),
        "samples": recorded.samples(),
        "spans": signals.spans.len(),
        "period_ms": signals.period / MILLISECOND,
        "cutoff_hz": signals.cutoff,
        "current_lag_ms": signals.current_lag / MILLISECOND,
        "feedforward": agreement.map_or_else(Vec::new, |agreement| modes(recorded, agreement)),
    })
}

fn value(value: &IdentifiedValue) -> Value {
    json!({
        "key": value.key,
        "value": value.value,
        "unit": value.unit,
        "before": value.before,
        "standard_error": value.error,
        "interval": value.interval,
        "source": value.source,
    })
}

fn finding(finding: &Finding) -> Value {
    json!({
        "severity": severity(finding.severity),
        "code": finding.code,
        "text": finding.what,
        "remedy": finding.remedy,
    })
}

fn law(law: &LawFit) -> Value {
    let c = &law.config;
    let [a, b, c_error, d] = law.errors;
    json!({
        "law": match law.law {
            FrictionLaw::DoubleExponential => "double-exponential",
            FrictionLaw::Linear => "linear",
        },
        "a": c.a,
        "b": c.b,
        "c": c.c,
        "d": c.d,
        "i0": c.i0,
        "standard_errors": { "a": a, "b": b, "c": c_error, "d": d },
        "line": law.line().map(|(level, slope)| json!({ "level_a": level, "slope_a": slope })),
        "r_squared": law.r_squared,
    })
}

fn inertia(found: &IdentificationResult) -> Value {
    let Some(inertia) = &found.identification.inertia else { return Value::Null };
    let refined = found.identification.refinement.as_ref().and_then(|refinement| {
        let of = |r: &&virtual_axes_identify::identify::RefinedValue| {
            r.parameter == virtual_axes_identify::identify::RefinedParameter::Inertia
        };
        refinement.parameters.iter().find(of)
    });
    json!({
        "eq5": inertia.value,
        "error": inertia.error,
        "spread": inertia.spread,
        "accelerations": inertia.accelerations,
        "instants": inertia.instants.len(),
        "simulated_eq5": found.identification.replayed_inertia,
        "refined": refined.map(|refined| refined.value),
        "refined_error": refined.map(|refined| refined.error),
    })
}

fn gravity(gravity: &GravityFit) -> Value {
    let current =
        |c: &GravityCurrent| json!({ "constant_a": c.constant, "sine_a": c.sine, "cosine_a": c.cosine });
    let with_error = |scale: f64| move |(value, error): (f64, f64)| json!({ "value": value / scale, "error": error / scale });
    json!({
        "source": match gravity.source {
            GravitySource::Motion => "motion",
            GravitySource::Rest => "rest",
        },
        "current": current(&gravity.current),
        "error": current(&gravity.error),
        "model": current(&gravity.model),
        "weight_n": gravity.weight.map(with_error(1.0)),
        "tilt_nm": gravity.tilt.map(with_error(1.0)),
        "tilt_phase_deg": gravity.phase.map(with_error(DEGREE)),
        "at_rest": gravity.at_rest.as_ref().map(|(value, error)| {
            json!({ "current": current(value), "error": current(error) })
        }),
    })
}

fn regression(found: &FeedforwardRegression) -> Value {
    json!({
        "value": found.value,
        "error": found.error,
        "r_squared": found.r_squared,
        "delay_ms": [found.delay.0 / MILLISECOND, found.delay.1 / MILLISECOND],
    })
}

fn deviation(found: Option<ResidualStatistics>, scale: f64) -> Value {
    found.map_or(Value::Null, |d| json!({ "max": d.max / scale, "rms": d.rms / scale }))
}

/// Units of the axis and their names.
struct Scales {
    position: f64,
    velocity: f64,
    velocity_name: &'static str,
    units: AxisUnits,
}

impl Scales {
    fn of(found: &IdentificationResult) -> Self {
        let kind = found.axis.kind();
        let (velocity_name, velocity) = velocity_scale(kind);
        Scales { position: table::scale(kind).2, velocity, velocity_name, units: AxisUnits::for_kind(kind) }
    }

    fn friction(&self, friction: &FrictionFit, levels: &[SteadyCurrent]) -> Value {
        let mut object = law(&friction.law);
        let level = |level: &SteadyCurrent| {
            json!({
                "speed": level.velocity / self.units.speed,
                "friction_a": level.friction,
                "current_a": level.current,
                "error_a": level.error,
                "duration_s": level.duration,
            })
        };
        object["speeds"] = json!(by_speed(levels).len());
        object["levels"] = levels.iter().map(level).collect();
        object["asymmetry"] = json!(friction.asymmetry);
        let [plus, minus] = &friction.directions;
        object["directions"] = json!({ "plus": plus.as_ref().map(law), "minus": minus.as_ref().map(law) });
        object
    }

    fn delay(&self, fit: &DelayFit) -> Value {
        let ms = |delay: i64| delay as f64 / MILLISECOND_NS as f64;
        let profile = fit.profile.iter().map(|(delay, rms)| json!([ms(*delay), rms / self.position]));
        json!({
            "name": fit.delay.name(),
            "feedforward": fit.delay.feedforward_mode().name(),
            "value_ms": ms(fit.value),
            "interval_ms": [ms(fit.interval.0), ms(fit.interval.1)],
            "left": fit.is_unchanged,
            "profile": profile.collect::<Vec<_>>(),
        })
    }

    fn refinement(&self, refinement: &Refinement) -> Value {
        let parameters = refinement.parameters.iter().map(|refined| {
            json!({
                "parameter": refined.parameter.to_string(),
                "before": refined.before,
                "value": refined.value,
                "error": refined.error,
                "at_bound": refined.is_at_bound,
            })
        });
        let (before, after) = refinement.position;
        json!({
            "parameters": parameters.collect::<Vec<_>>(),
            "correlations": refinement.correlations,
            "position_rms": { "before": before / self.position, "after": after / self.position },
            "current_rms_a": refinement.current.map(|(before, after)| json!({ "before": before, "after": after })),
        })
    }

    fn agreement(&self, recorded: &ConditionedRecording, agreement: &Agreement) -> Value {
        let part = |(mode, comparison): (&str, &ExperimentComparison)| {
            json!({
                "feedforward": mode,
                "constant_velocity": deviation(comparison.constant_velocity, self.position),
                "elsewhere": deviation(comparison.elsewhere, self.position),
                "velocity": deviation(comparison.velocity, self.velocity),
                "current_a": deviation(comparison.current, 1.0),
                "current_r_squared": comparison.current_r_squared,
            })
        };
        let modes = agreement.experiments.iter().map(|experiment| experiment.mode.name());
        json!({
            "name": recorded.signals.name,
            "parts": modes.zip(&agreement.comparisons).map(part).collect::<Vec<_>>(),
            "inverse_dynamics": agreement.inverse.as_ref().map(|inverse| json!({
                "current_a": deviation(Some(inverse.current), 1.0),
                "current_r_squared": inverse.r_squared,
            })),
        })
    }
}
