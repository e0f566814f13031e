//! Results of a limit audit as JSON and as sentences, for the command and the Python module.

use serde_json::{Map, Value, json};
use virtual_axes_core::assess::{AuditedAxis, ExtremePosition, LargestUse, LimitAudit, SetpointPlace};
use virtual_axes_core::config::{AxisKind, AxisUnits};
use virtual_axes_core::path::SetpointDerivative;
use virtual_axes_core::units::{REVOLUTION, Rounded};

/// Names of the extreme positions.
const EXTREMES: [&str; 2] = ["lowest position", "highest position"];
/// Returns name, position and travel limit of both extremes of an axis.
pub fn extremes(axis: &AuditedAxis) -> impl Iterator<Item = (&'static str, ExtremePosition, f64)> {
    let limits = [axis.limits.travel_min, axis.limits.travel_max];
    let extremes = EXTREMES.into_iter().zip(axis.extremes.into_iter().flatten());
    extremes.zip(limits).map(|((name, extreme), limit)| (name, extreme, limit))
}

/// Returns a note for each limit that is smaller than the rounding errors of all differences, and one on jerk limits that
/// the control does not keep.
pub fn notes(audit: &LimitAudit) -> Vec<String> {
    let quantities = audit.moving().flat_map(|axis| axis.limited().map(move |largest| (axis, largest)));
    let unchecked = quantities.filter(|(_, largest)| largest.least_rounding > largest.value.allowed);
    let note = |(axis, LargestUse { value, least_rounding, .. }): (&AuditedAxis, &LargestUse)| {
        let (name, size, unit) = describe(value.quantity, axis.kind);
        format!(
            "{name} of {} is not checked: the rounding of the positions adds up to {} {unit}, the limit is {} {unit}; \
             write more digits",
            axis.name,
            Rounded(least_rounding / size),
            Rounded(value.allowed / size)
        )
    };
    let has_no_jerk_limit = audit.moving().any(|axis| axis.limits.jerk.is_infinite());
    let no_jerk_limit = "jerk is not checked: the control does not limit it (control.jerk_limited is false)";
    unchecked.map(note).chain(has_no_jerk_limit.then(|| no_jerk_limit.to_owned())).collect()
}

/// Returns the audit of the setpoints of `input`, with a duration in s, as one JSON object.
pub fn json(audit: &LimitAudit, input: &str, machine: &str, duration: f64) -> Value {
    json!({
        "input": input,
        "machine": machine,
        "duration_s": duration,
        "within_limits": excess(audit).is_none(),
        "axes": axes_json(audit),
        "notes": notes(audit),
    })
}

fn axes_json(audit: &LimitAudit) -> Value {
    let axes = audit.moving().map(|axis| {
        let units = AxisUnits::for_kind(axis.kind);
        let extremes = extremes(axis).map(|(name, extreme, limit)| {
            let value = json!({
                "unit": units.length_key,
                "value": extreme.position / units.length,
                "limit": limit / units.length,
                "time_s": extreme.place.time,
                "line": extreme.place.line,
                "setpoints_beyond": extreme.beyond,
            });
            (name.replace(' ', "_"), value)
        });
        let quantities = axis.limited().map(|largest| {
            let LargestUse { value, place, beyond, .. } = largest;
            let (name, size, unit) = describe(value.quantity, axis.kind);
            let value = json!({
                "unit": unit,
                "largest": value.found / size,
                "rounding": value.rounding / size,
                "limit": value.allowed / size,
                "ratio": value.ratio(),
                "time_s": place.time,
                "line": place.line,
                "setpoints_beyond": beyond,
            });
            (name.to_owned(), value)
        });
        (axis.name.clone(), Value::Object(extremes.chain(quantities).collect()))
    });
    Value::Object(axes.collect::<Map<_, _>>())
}

/// Returns a sentence on the largest excess: of a position, or by the ratio to the limit. `None` if all limits are kept.
pub fn excess(audit: &LimitAudit) -> Option<String> {
    let outside = audit.moving().flat_map(|axis| {
        extremes(axis).filter(|(_, extreme, _)| extreme.beyond > 0).map(move |found| (axis, found))
    });
    let distance = |extreme: &ExtremePosition, limit: f64| (extreme.position - limit).abs();
    let farthest = outside
        .max_by(|(_, (_, a, of_a)), (_, (_, b, of_b))| distance(a, *of_a).total_cmp(&distance(b, *of_b)));
    if let Some((axis, (name, extreme, limit))) = farthest {
        let AxisUnits { length, length_name: unit, .. } = AxisUnits::for_kind(axis.kind);
        let [position, limit] = [extreme.position, limit].map(|value| Rounded(value / length).to_string());
        let place = place(extreme.place);
        return Some(format!(
            "{place}: {name} of {}, {position} {unit}, is beyond its travel limit {limit} {unit}",
            axis.name
        ));
    }
    let quantities = audit.moving().flat_map(|axis| axis.limited().map(move |largest| (axis, largest)));
    let beyond = quantities.filter(|(_, largest)| largest.beyond > 0);
    let (axis, largest) = beyond.max_by(|(_, a), (_, b)| a.value.ratio().total_cmp(&b.value.ratio()))?;
    let value = largest.value;
    let (name, size, unit) = describe(value.quantity, axis.kind);
    Some(format!(
        "{}: {name} of {}, {} {unit}, is {} times its limit {} {unit}",
        place(largest.place),
        axis.name,
        Rounded(value.found / size),
        Rounded(value.ratio()),
        Rounded(value.allowed / size)
    ))
}

fn place(place: SetpointPlace) -> String {
    let line = place.line.map_or_else(String::new, |line| format!("line {line}, "));
    format!("{line}at {:.3} s", place.time)
}

/// Returns name, size and symbol of the unit of a derivative, as in machine files.
pub fn describe(quantity: SetpointDerivative, kind: AxisKind) -> (&'static str, f64, &'static str) {
    match (quantity, kind) {
        (SetpointDerivative::Speed, kind) => {
            let AxisUnits { speed, speed_name, .. } = AxisUnits::for_kind(kind);
            ("velocity", speed, speed_name)
        }
        (SetpointDerivative::Acceleration, AxisKind::Linear) => ("acceleration", 1.0, "m/s²"),
        (SetpointDerivative::Acceleration, AxisKind::Rotary) => ("acceleration", REVOLUTION, "rev/s²"),
        (SetpointDerivative::Jerk, AxisKind::Linear) => ("jerk", 1.0, "m/s³"),
        (SetpointDerivative::Jerk, AxisKind::Rotary) => ("jerk", REVOLUTION, "rev/s³"),
    }
}
