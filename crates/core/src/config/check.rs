//! Validation of a parameter set: each value against the schema, then values against each other.

use std::collections::{BTreeMap, HashSet};

use super::definition::{MotorKind, Presence};
use super::error::{ConfigError, ValueSource};
use super::layout::{JointVariant, ParameterLayout, joint_name_violation, plain_definition};
use super::machine::AxisKind;
use super::value::{Value, number_text};
use crate::text::shortened;
use crate::units::{MICROSECOND_NS, MILLISECOND_NS, Nanoseconds, Rounded, SECOND_NS};

/// Relative tolerance of `publish_rate` above the rate of position cycles: 166.7 Hz is accepted for 6 ms.
const RATE_TOLERANCE: f64 = 1e-2;

/// Keys that determine the other keys of a joint.
const TYPE: &str = "type";
pub(super) const DIRECT: &str = "transmission.direct";

/// Value with its origin.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ParameterEntry {
    pub value: Value,
    pub source: ValueSource,
}

/// Values and origins by full key.
pub(super) type Entries = BTreeMap<String, ParameterEntry>;

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
            return Err(missing(origin, &key, definition.description_with_range()));
        }
    }
    let set = CrossChecks { entries, changed, layout: &layout };
    set.check_periods()?;
    set.check_publish_rate()?;
    set.check_clock()?;
    set.check_workpiece(origin)?;
    set.check_gantry(origin)?;
    set.check_contour_control()?;
    for joint in &layout.joints {
        set.check_transmission(joint, origin)?;
        set.check_elasticity(joint, origin)?;
        set.check_backlash(joint, origin)?;
        set.check_friction(joint, origin)?;
        set.check_travel_limits(joint)?;
        set.check_horizons(joint)?;
        set.check_polynomials(joint)?;
        set.check_current_filters(joint)?;
    }
    Ok(layout)
}

fn check_entry(layout: &ParameterLayout, key: &str, entry: &mut ParameterEntry) -> Result<(), ConfigError> {
    let definition = layout.find(key, &entry.source)?;
    entry.value = definition.checked(key, &entry.value, &entry.source)?;
    Ok(())
}

pub(super) fn missing(at: &ValueSource, key: &str, wanted: String) -> ConfigError {
    ConfigError::Missing { at: at.clone(), key: key.to_owned(), wanted }
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
        return Err(missing(origin, "joints", wanted.unwrap_or_default()));
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
                None if required => return Err(missing(at, &key, definition.description_with_range())),
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
    let rejection = |allowed: String| ConfigError::NotAllowed {
        at: entry.source.clone(),
        key: KEY.to_owned(),
        value: entry.value.to_string(),
        allowed,
    };
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

/// Checks between parameters, after each value is checked.
pub(super) struct CrossChecks<'a> {
    pub(super) entries: &'a Entries,
    changed: &'a [String],
    pub(super) layout: &'a ParameterLayout,
}

impl CrossChecks<'_> {
    /// Returns an error for the one of `keys` that was set last.
    pub(super) fn rejection(&self, keys: &[&str], allowed: String) -> ConfigError {
        let set = |key: &&&str| self.entries.contains_key(**key);
        let newest = keys.iter().filter(set).max_by_key(|key| {
            self.changed.iter().rposition(|changed| changed == **key).map_or(0, |position| position + 1)
        });
        let key = newest.or(keys.first()).copied().unwrap_or_default();
        match self.entries.get(key) {
            Some(entry) => ConfigError::NotAllowed {
                at: entry.source.clone(),
                key: key.to_owned(),
                value: entry.value.to_string(),
                allowed,
            },
            None => missing(&ValueSource::named("parameters"), key, allowed),
        }
    }

    /// Returns the value or default of `key` as a number.
    pub(super) fn number(&self, key: &str) -> Option<f64> {
        match self.value(key)? {
            Value::Double(number) => Some(number),
            _ => None,
        }
    }

    pub(super) fn value(&self, key: &str) -> Option<Value> {
        match self.entries.get(key) {
            Some(entry) => Some(entry.value.clone()),
            None => self.layout.find(key, &ValueSource::named("")).ok()?.default_value(),
        }
    }

    fn check_periods(&self) -> Result<(), ConfigError> {
        const KEYS: [&str; 3] = ["periods.position_ms", "periods.velocity_us", "periods.current_us"];
        const FACTORS: [Nanoseconds; 3] = [MILLISECOND_NS, MICROSECOND_NS, MICROSECOND_NS];
        let period = |i: usize| Some(to_ns(self.number(KEYS[i])?, FACTORS[i]));
        for i in 0..2 {
            if let (Some(long), Some(short)) = (period(i), period(i + 1))
                && (short <= 0 || long < short || long % short != 0)
            {
                return Err(self.rejection(
                    &[KEYS[i], KEYS[i + 1]],
                    format!(
                        "keep {} an integer multiple of {}, found {long} ns and {short} ns",
                        KEYS[i],
                        KEYS[i + 1]
                    ),
                ));
            }
        }
        Ok(())
    }

    fn check_publish_rate(&self) -> Result<(), ConfigError> {
        let (Some(rate), Some(period)) = (self.number("publish_rate"), self.number("periods.position_ms"))
        else {
            return Ok(());
        };
        let most = SECOND_NS as f64 / (period * MILLISECOND_NS as f64);
        if rate > most * (1.0 + RATE_TOLERANCE) {
            return Err(self.rejection(
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

    fn check_clock(&self) -> Result<(), ConfigError> {
        let fast = self.value("time") == Some(Value::Text("fast".to_owned()));
        if fast && self.value("use_sim_time") == Some(Value::Bool(true)) {
            return Err(self.rejection(
                &["time", "use_sim_time"],
                "not be combined: time = fast publishes /clock, use_sim_time = true subscribes to it"
                    .to_owned(),
            ));
        }
        Ok(())
    }

    fn check_horizons(&self, joint: &JointVariant) -> Result<(), ConfigError> {
        let key = |name: &str| format!("{}.position_loop.gpc.{name}", joint.name);
        let last = key("n2");
        let count = |key: &str| match self.value(key) {
            Some(Value::Integer(count)) => Some(count),
            _ => None,
        };
        for first in [key("n1"), key("nu")] {
            if let (Some(value), Some(most)) = (count(&first), count(&last))
                && value > most
            {
                let allowed = format!("keep {first} ≤ {last}, found {value} and {most}");
                return Err(self.rejection(&[&first, &last], allowed));
            }
        }
        Ok(())
    }

    fn check_polynomials(&self, joint: &JointVariant) -> Result<(), ConfigError> {
        let controller = format!("{}.position_loop.controller", joint.name);
        let Some(entry) = self.entries.get(&controller).filter(|e| e.value == Value::Text("rst".to_owned()))
        else {
            return Ok(());
        };
        for name in ["r", "s", "t"] {
            let key = format!("{}.position_loop.rst.{name}", joint.name);
            if !self.entries.contains_key(&key) {
                return Err(missing(
                    &entry.source,
                    &key,
                    format!("list of numbers, since {controller} = rst"),
                ));
            }
        }
        Ok(())
    }

    /// Checks that filters of the current setpoint are below half the rate of velocity cycles.
    fn check_current_filters(&self, joint: &JointVariant) -> Result<(), ConfigError> {
        const PERIOD: &str = "periods.velocity_us";
        for filter in ["current_filter_1", "current_filter_2"] {
            let [filter_type, frequency] =
                ["type", "frequency_hz"].map(|key| format!("{}.{filter}.{key}", joint.name));
            if self.value(&filter_type) == Some(Value::Text("none".to_owned())) {
                continue;
            }
            let (Some(value), Some(period)) = (self.number(&frequency), self.number(PERIOD)) else {
                continue;
            };
            let most = 0.5e6 / period;
            if value >= most {
                let allowed = format!(
                    "keep {frequency} below {} Hz, half the rate of velocity cycles of {} µs",
                    Rounded(most),
                    number_text(period)
                );
                return Err(self.rejection(&[&frequency, &filter_type, PERIOD], allowed));
            }
        }
        Ok(())
    }

    /// Checks that the travel limits differ. The ranges of the schema keep home, 0, within them.
    fn check_travel_limits(&self, joint: &JointVariant) -> Result<(), ConfigError> {
        let unit = match joint.axis {
            AxisKind::Linear => "mm",
            AxisKind::Rotary => "deg",
        };
        let min_key = format!("{}.limits.travel_min_{unit}", joint.name);
        let max_key = format!("{}.limits.travel_max_{unit}", joint.name);
        match (self.number(&min_key), self.number(&max_key)) {
            (Some(min), Some(max)) if min >= max => {
                Err(self.rejection(&[&min_key, &max_key], format!("keep {min_key} < {max_key}")))
            }
            _ => Ok(()),
        }
    }
}

/// Converts `value` with the unit `factor` (ns) to nanoseconds, rounded.
pub(super) fn to_ns(value: f64, factor: Nanoseconds) -> Nanoseconds {
    (value * factor as f64).round() as Nanoseconds
}
