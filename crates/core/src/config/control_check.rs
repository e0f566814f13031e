//! Validation of the controllers and limits of an axis against each other.

use super::axis::ControllerName;
use super::cross_check::CrossChecks;
use super::declaration::JointVariant;
use super::error::ConfigError;
use super::value::number_text;
use crate::units::Rounded;

/// Checks controllers and limits of an axis.
pub(super) fn check_control(set: &CrossChecks<'_>, joint: &JointVariant) -> Result<(), ConfigError> {
    check_travel_limits(set, joint)?;
    check_horizons(set, joint)?;
    check_polynomials(set, joint)?;
    check_current_filters(set, joint)
}

/// Checks that the travel limits differ. The ranges of the schema keep home, 0, within them.
fn check_travel_limits(set: &CrossChecks<'_>, joint: &JointVariant) -> Result<(), ConfigError> {
    let min_key = joint.key(&["limits.travel_min_mm", "limits.travel_min_deg"]);
    let max_key = joint.key(&["limits.travel_max_mm", "limits.travel_max_deg"]);
    match (set.number(&min_key), set.number(&max_key)) {
        (Some(min), Some(max)) if min >= max => {
            Err(set.rejection(&[&min_key, &max_key], format!("keep {min_key} < {max_key}")))
        }
        _ => Ok(()),
    }
}

fn check_horizons(set: &CrossChecks<'_>, joint: &JointVariant) -> Result<(), ConfigError> {
    let [n1, n2, nu] = ["n1", "n2", "nu"].map(|name| format!("{}.position_loop.gpc.{name}", joint.name));
    for first in [&n1, &nu] {
        if let (Some(value), Some(most)) = (set.number(first), set.number(&n2))
            && value > most
        {
            let allowed = format!("keep {first} ≤ {n2}, found {value} and {most}");
            return Err(set.rejection(&[first, &n2], allowed));
        }
    }
    Ok(())
}

fn check_polynomials(set: &CrossChecks<'_>, joint: &JointVariant) -> Result<(), ConfigError> {
    let controller = joint.key(&["position_loop.controller"]);
    let (true, Some(entry)) =
        (set.is_chosen(&controller, ControllerName::Rst.name()), set.entries.get(&controller))
    else {
        return Ok(());
    };
    for name in ["r", "s", "t"] {
        let key = format!("{}.position_loop.rst.{name}", joint.name);
        if !set.entries.contains_key(&key) {
            let wanted = format!("list of numbers, since {controller} = rst");
            return Err(ConfigError::missing(&entry.source, &key, &wanted));
        }
    }
    Ok(())
}

/// Checks that filters of the current setpoint are below half the rate of velocity cycles.
fn check_current_filters(set: &CrossChecks<'_>, joint: &JointVariant) -> Result<(), ConfigError> {
    const PERIOD: &str = "periods.velocity_us";
    for filter in ["current_filter_1", "current_filter_2"] {
        let [filter_type, frequency] =
            ["type", "frequency_hz"].map(|key| format!("{}.{filter}.{key}", joint.name));
        let (Some(value), Some(period)) = (set.number(&frequency), set.number(PERIOD)) else { continue };
        let most = 0.5e6 / period;
        if value >= most && !set.is_chosen(&filter_type, "none") {
            let allowed = format!(
                "keep {frequency} below {} Hz, half the rate of velocity cycles of {} µs",
                Rounded(most),
                number_text(period)
            );
            return Err(set.rejection(&[&frequency, &filter_type, PERIOD], allowed));
        }
    }
    Ok(())
}
