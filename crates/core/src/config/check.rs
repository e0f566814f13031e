//! The check of a whole set of parameters: each against the schema, then against one another.

use std::collections::{BTreeMap, HashSet};

use super::definition::{MotorKind, Presence};
use super::error::{ConfigError, Source, shortened};
use super::layout::{Joint, Layout, plain_definition, refused_joint_name};
use super::machine::AxisKind;
use super::value::{Value, number_text};
use crate::units::{MICROSECOND_NS, MILLISECOND_NS, Nanoseconds, SECOND_NS};

/// How much faster than the position periods `publish_rate` may be, so that 166.7 Hz fits 6 ms.
const RATE_TOLERANCE: f64 = 1e-2;

/// The keys that decide which others a joint has.
const TYPE: &str = "type";
const DIRECT: &str = "transmission.direct";

/// A value and where it was set.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    pub value: Value,
    pub source: Source,
}

/// Values by full key.
pub(super) type Entries = BTreeMap<String, Entry>;

/// Checks `entries`, of which `changed` (in order) are new and are looked at first; brings each
/// value to the kind that its definition wants. `origin` is to blame for what is missing.
pub(super) fn check(
    entries: &mut Entries,
    changed: &[String],
    origin: &Source,
) -> Result<Layout, ConfigError> {
    let layout = layout(entries, changed, origin)?;
    // The new keys in their order, so that the first error in a file is the one reported.
    for key in changed {
        if let Some(entry) = entries.get_mut(key) {
            check_entry(&layout, key, entry)?;
        }
    }
    for (key, entry) in entries.iter_mut() {
        check_entry(&layout, key, entry)?;
    }
    for (key, definition) in layout.definitions() {
        if definition.presence == Presence::Required && !entries.contains_key(&key) {
            return Err(missing(origin, &key, definition.wanted()));
        }
    }
    let set = Set { entries, changed, layout: &layout };
    set.check_periods()?;
    set.check_publish_rate()?;
    set.check_clock()?;
    for joint in &layout.joints {
        set.check_transmission(joint, origin)?;
        set.check_friction(joint)?;
        set.check_travel_limits(joint)?;
        set.check_horizons(joint)?;
        set.check_polynomials(joint)?;
    }
    Ok(layout)
}

fn check_entry(layout: &Layout, key: &str, entry: &mut Entry) -> Result<(), ConfigError> {
    let definition = layout.find(key, &entry.source)?;
    entry.value = definition.checked(key, &entry.value, &entry.source)?;
    Ok(())
}

fn missing(at: &Source, key: &str, wanted: String) -> ConfigError {
    ConfigError::Missing { at: at.clone(), key: key.to_owned(), wanted }
}

/// The joints with their types; refuses misspelt keys before it says that something is missing.
fn layout(entries: &Entries, changed: &[String], origin: &Source) -> Result<Layout, ConfigError> {
    let names = joint_names(entries)?;
    let layout = Layout { joints: names.iter().map(|name| joint(entries, name)).collect() };
    for key in changed {
        if let Some(entry) = entries.get(key)
            // Without joints, keys with a dot cannot be told apart yet.
            && (!names.is_empty() || !key.contains('.'))
        {
            layout.check_name(key, &entry.source)?;
        }
    }
    if names.is_empty() {
        let wanted = plain_definition("joints").map(|definition| definition.wanted());
        return Err(missing(origin, "joints", wanted.unwrap_or_default()));
    }
    for name in &names {
        // What decides which keys apply is checked before the others are.
        for (suffix, required) in [(TYPE, true), (DIRECT, false)] {
            let key = format!("{name}.{suffix}");
            let at = entries.get(&key).map_or(origin, |entry| &entry.source);
            let definition = layout.find(&key, at)?;
            match entries.get(&key) {
                Some(entry) => {
                    definition.checked(&key, &entry.value, at)?;
                }
                None if required => return Err(missing(at, &key, definition.wanted())),
                None => {}
            }
        }
    }
    Ok(layout)
}

/// The joint `name` as its keys describe it, taken for linear with a screw where they do not.
fn joint(entries: &Entries, name: &str) -> Joint {
    let is = |suffix: &str, wanted: Value| {
        entries.get(&format!("{name}.{suffix}")).is_some_and(|entry| entry.value == wanted)
    };
    let rotary = is(TYPE, Value::Text("rotary".to_owned()));
    let direct = is(DIRECT, Value::Bool(true));
    Joint {
        name: name.to_owned(),
        axis: if rotary { AxisKind::Rotary } else { AxisKind::Linear },
        motor: if direct && !rotary { MotorKind::Linear } else { MotorKind::Rotating },
    }
}

/// The value of `joints`, empty when there is none; every name is usable and stands once.
pub(super) fn joint_names(entries: &Entries) -> Result<Vec<String>, ConfigError> {
    const KEY: &str = "joints";
    let (Some(entry), Some(definition)) = (entries.get(KEY), plain_definition(KEY)) else {
        return Ok(Vec::new());
    };
    let refused = |allowed: String| ConfigError::NotAllowed {
        at: entry.source.clone(),
        key: KEY.to_owned(),
        value: entry.value.to_string(),
        allowed,
    };
    let Value::TextList(names) = definition.checked(KEY, &entry.value, &entry.source)? else {
        return Ok(Vec::new());
    };
    if names.is_empty() {
        return Err(refused("hold at least one name".to_owned()));
    }
    let mut seen = HashSet::new();
    for name in &names {
        if let Some(allowed) = refused_joint_name(name) {
            return Err(refused(allowed));
        }
        if !seen.insert(name) {
            return Err(refused(format!("hold each name once, not {} twice", shortened(name))));
        }
    }
    Ok(names)
}

/// Checks across keys, on values that are each valid.
struct Set<'a> {
    entries: &'a Entries,
    changed: &'a [String],
    layout: &'a Layout,
}

impl Set<'_> {
    /// Error on the one of `keys` that was set last, since it is the one the user has in hand.
    fn refused(&self, keys: &[&str], allowed: String) -> ConfigError {
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
            None => missing(&Source::named("parameters"), key, allowed),
        }
    }

    /// The value of `key` or its default, as a number.
    fn number(&self, key: &str) -> Option<f64> {
        match self.value(key)? {
            Value::Double(number) => Some(number),
            _ => None,
        }
    }

    fn value(&self, key: &str) -> Option<Value> {
        match self.entries.get(key) {
            Some(entry) => Some(entry.value.clone()),
            None => self.layout.find(key, &Source::named("")).ok()?.default_value(),
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
                return Err(self.refused(
                    &[KEYS[i], KEYS[i + 1]],
                    format!(
                        "keep {} an integer multiple of {}: they are {long} ns and {short} ns",
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
            return Err(self.refused(
                &["publish_rate"],
                format!(
                    "be at most one per position period, {most:.2} Hz with \
                     periods.position_ms = {}",
                    number_text(period)
                ),
            ));
        }
        Ok(())
    }

    fn check_clock(&self) -> Result<(), ConfigError> {
        let fast = self.value("time") == Some(Value::Text("fast".to_owned()));
        if fast && self.value("use_sim_time") == Some(Value::Bool(true)) {
            return Err(self.refused(
                &["time", "use_sim_time"],
                "leave the clock to one: time = fast publishes /clock, use_sim_time = true \
                 follows it"
                    .to_owned(),
            ));
        }
        Ok(())
    }

    fn check_transmission(&self, joint: &Joint, origin: &Source) -> Result<(), ConfigError> {
        let drive = match joint.axis {
            AxisKind::Linear => "screw_lead_mm",
            AxisKind::Rotary => "gear_ratio",
        };
        let name = &joint.name;
        let drive = format!("{name}.transmission.{drive}");
        let direct = format!("{name}.transmission.direct");
        let is_direct = self.value(&direct) == Some(Value::Bool(true));
        match (is_direct, self.entries.contains_key(&drive)) {
            (true, true) => Err(self.refused(
                &[&drive, &direct],
                format!("be the only transmission of {name}: {drive} and {direct} = true are given"),
            )),
            (false, false) => Err(missing(
                origin,
                &format!("{name}.transmission"),
                format!("one of {drive} and {direct} = true"),
            )),
            _ => Ok(()),
        }
    }

    fn check_friction(&self, joint: &Joint) -> Result<(), ConfigError> {
        let a_key = format!("{}.friction.a", joint.name);
        let c_key = format!("{}.friction.c", joint.name);
        match (self.number(&a_key), self.number(&c_key)) {
            (Some(a), Some(c)) if a + c < 0.0 => Err(self.refused(
                &[&a_key, &c_key],
                format!(
                    "keep a + c ≥ 0, since friction does not drive: a = {}, c = {}",
                    number_text(a),
                    number_text(c)
                ),
            )),
            _ => Ok(()),
        }
    }

    fn check_horizons(&self, joint: &Joint) -> Result<(), ConfigError> {
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
                let allowed = format!("keep {first} ≤ {last}: they are {value} and {most}");
                return Err(self.refused(&[&first, &last], allowed));
            }
        }
        Ok(())
    }

    fn check_polynomials(&self, joint: &Joint) -> Result<(), ConfigError> {
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

    /// The ranges of the schema keep home, 0, within the stroke; this keeps the stroke open.
    fn check_travel_limits(&self, joint: &Joint) -> Result<(), ConfigError> {
        let unit = match joint.axis {
            AxisKind::Linear => "mm",
            AxisKind::Rotary => "deg",
        };
        let min_key = format!("{}.limits.travel_min_{unit}", joint.name);
        let max_key = format!("{}.limits.travel_max_{unit}", joint.name);
        match (self.number(&min_key), self.number(&max_key)) {
            (Some(min), Some(max)) if min >= max => {
                Err(self.refused(&[&min_key, &max_key], format!("leave a stroke: {min_key} < {max_key}")))
            }
            _ => Ok(()),
        }
    }
}

/// `value` times `factor` to the nearest nanosecond.
pub(super) fn to_ns(value: f64, factor: Nanoseconds) -> Nanoseconds {
    (value * factor as f64).round() as Nanoseconds
}
