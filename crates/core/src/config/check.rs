//! Validation of a parameter set: each value against the schema, then values against each other.

use std::collections::HashSet;

use super::control::{ControlProfile, PROFILE};
use super::control_check::check_control;
use super::coupling_check::check_couplings;
use super::cross_check::CrossChecks;
use super::declaration::{CheckedValues, Entries, JointVariant, ParameterEntry, ParameterGroup};
use super::definition::{AxisKind, MotorKind, Presence};
use super::error::{ConfigError, ValueSource};
use super::layout::{ParameterLayout, joint_name_violation, plain_definition};
use super::machine::Periods;
use super::plant_check::check_plant;
use super::value::{Value, number_text};
use crate::text::shortened;
use crate::units::{MILLISECOND_NS, Rounded, SECOND_NS};

/// Relative tolerance of `publish_rate` above the rate of position cycles: 166.7 Hz is accepted for 6 ms.
const RATE_TOLERANCE: f64 = 1e-2;

/// Beginning of the keys that belong to the profile of the control.
const CONTROL: &str = "control.";

/// Keys that determine the other keys of a joint.
const TYPE: &str = "type";
const DIRECT: &str = "transmission.direct";

/// Checks `entries` and converts each value to the type of its definition. The new keys `changed` are checked first, in
/// order. Errors about missing keys name `origin`.
pub(super) fn check(
    entries: &mut Entries,
    changed: &[String],
    origin: &ValueSource,
) -> Result<ParameterLayout, ConfigError> {
    let layout = layout(entries, changed, origin)?;
    // New keys in order: the first error in a file is reported.
    for key in changed {
        if let Some(entry) = entries.get_mut(key) {
            check_entry(&layout, key, entry)?;
        }
    }
    let checked: HashSet<&String> = changed.iter().collect();
    for (key, entry) in entries.iter_mut().filter(|(key, _)| !checked.contains(key)) {
        check_entry(&layout, key, entry)?;
    }
    for (key, definition) in layout.definitions() {
        if definition.presence == Presence::Required && !entries.contains_key(&key) {
            return Err(ConfigError::missing(origin, &key, &definition.description_with_range()));
        }
    }
    let set = CrossChecks { entries, changed, layout: &layout, origin };
    check_periods(&set)?;
    check_publish_rate(&set)?;
    check_clock(&set)?;
    check_couplings(&set)?;
    check_profile(&set)?;
    for joint in &layout.joints {
        check_plant(&set, joint)?;
        check_control(&set, joint)?;
    }
    Ok(layout)
}

fn check_entry(layout: &ParameterLayout, key: &str, entry: &mut ParameterEntry) -> Result<(), ConfigError> {
    let definition = layout.find(key, &entry.source)?;
    entry.value = definition.checked(key, &entry.value, &entry.source)?;
    Ok(())
}

/// Returns the joints with their types. Misspelt keys are rejected before missing keys.
fn layout(
    entries: &Entries,
    changed: &[String],
    origin: &ValueSource,
) -> Result<ParameterLayout, ConfigError> {
    let names = joint_names(entries)?;
    let layout = ParameterLayout { joints: names.iter().map(|name| joint(entries, name)).collect() };
    for key in changed {
        if let Some(entry) = entries.get(key)
            // Without `joints`, the prefix of a key with a dot is not known to be a joint name.
            && (!names.is_empty() || !key.contains('.'))
        {
            layout.check_name(key, &entry.source)?;
        }
    }
    if names.is_empty() {
        let wanted = plain_definition("joints").map(|definition| definition.description_with_range());
        return Err(ConfigError::missing(origin, "joints", &wanted.unwrap_or_default()));
    }
    for name in &names {
        // Keys that determine the other keys are checked first.
        for (suffix, required) in [(TYPE, true), (DIRECT, false)] {
            let key = format!("{name}.{suffix}");
            let at = entries.get(&key).map_or(origin, |entry| &entry.source);
            let definition = layout.find(&key, at)?;
            match entries.get(&key) {
                Some(entry) => {
                    definition.checked(&key, &entry.value, at)?;
                }
                None if required => {
                    return Err(ConfigError::missing(at, &key, &definition.description_with_range()));
                }
                None => {}
            }
        }
    }
    Ok(layout)
}

/// Returns the types of the joint `name`; by default a linear axis with a rotary motor.
fn joint(entries: &Entries, name: &str) -> JointVariant {
    let is = |suffix: &str, wanted: Value| {
        entries.get(&format!("{name}.{suffix}")).is_some_and(|entry| entry.value == wanted)
    };
    let rotary = is(TYPE, Value::Text("rotary".to_owned()));
    let direct = is(DIRECT, Value::Bool(true));
    JointVariant {
        name: name.to_owned(),
        axis: if rotary { AxisKind::Rotary } else { AxisKind::Linear },
        motor: if direct && !rotary { MotorKind::Linear } else { MotorKind::Rotary },
    }
}

/// Returns the value of `joints` after checking the names, or an empty list if `joints` is missing.
pub(super) fn joint_names(entries: &Entries) -> Result<Vec<String>, ConfigError> {
    const KEY: &str = "joints";
    let (Some(entry), Some(definition)) = (entries.get(KEY), plain_definition(KEY)) else {
        return Ok(Vec::new());
    };
    let rejection =
        |allowed: String| ConfigError::not_allowed(&entry.source, KEY, &entry.value.to_string(), &allowed);
    let Value::TextList(names) = definition.checked(KEY, &entry.value, &entry.source)? else {
        return Ok(Vec::new());
    };
    if names.is_empty() {
        return Err(rejection("contain at least one name".to_owned()));
    }
    let mut seen = HashSet::new();
    for name in &names {
        if let Some(allowed) = joint_name_violation(name) {
            return Err(rejection(allowed));
        }
        if !seen.insert(name) {
            return Err(rejection(format!("contain each name once, found {} twice", shortened(name))));
        }
    }
    Ok(names)
}

fn check_periods(set: &CrossChecks<'_>) -> Result<(), ConfigError> {
    const KEYS: [&str; 3] = ["periods.position_ms", "periods.velocity_us", "periods.current_us"];
    let values = CheckedValues { entries: set.entries, joints: &set.layout.joints, joint: None };
    let Some(periods) = Periods::read(&values) else { return Ok(()) };
    let periods = [periods.position, periods.velocity, periods.current];
    for (keys, periods) in KEYS.windows(2).zip(periods.windows(2)) {
        if let (&[long, short], &[long_ns, short_ns]) = (keys, periods)
            && (short_ns <= 0 || long_ns < short_ns || long_ns % short_ns != 0)
        {
            return Err(set.rejection(
                keys,
                format!("keep {long} an integer multiple of {short}, found {long_ns} ns and {short_ns} ns"),
            ));
        }
    }
    Ok(())
}

fn check_publish_rate(set: &CrossChecks<'_>) -> Result<(), ConfigError> {
    let (Some(rate), Some(period)) = (set.number("publish_rate"), set.number("periods.position_ms")) else {
        return Ok(());
    };
    let most = SECOND_NS as f64 / (period * MILLISECOND_NS as f64);
    if rate > most * (1.0 + RATE_TOLERANCE) {
        return Err(set.rejection(
            &["publish_rate"],
            format!(
                "be at most {} Hz, one message per position cycle of {} ms",
                Rounded(most),
                number_text(period)
            ),
        ));
    }
    Ok(())
}

fn check_clock(set: &CrossChecks<'_>) -> Result<(), ConfigError> {
    if set.is_chosen("time", "fast") && set.value("use_sim_time") == Some(Value::Bool(true)) {
        return Err(set.rejection(
            &["time", "use_sim_time"],
            "not be combined: time = fast publishes /clock, use_sim_time = true subscribes to it".to_owned(),
        ));
    }
    Ok(())
}

/// Rejects parameters that have no effect with the profile, but for those with their default, as in a dump.
fn check_profile(set: &CrossChecks<'_>) -> Result<(), ConfigError> {
    let is_default = |key: &str, value: &Value| {
        let presence = plain_definition(key).map(|definition| definition.presence);
        matches!(presence, Some(Presence::Default(default)) if Value::from(default) == *value)
    };
    let belongs = |key: &str| key.starts_with(CONTROL) && key != PROFILE;
    let given = set.entries.iter().filter(|(key, entry)| belongs(key) && !is_default(key, &entry.value));
    let mut keys = given.map(|(key, _)| key);
    match keys.next() {
        Some(key) if set.is_chosen(PROFILE, ControlProfile::Own.name()) => {
            let allowed =
                format!("not be given with {PROFILE} own: set {PROFILE} to linuxcnc, or remove {key}");
            Err(set.rejection(&[key, PROFILE], allowed))
        }
        _ => Ok(()),
    }
}
