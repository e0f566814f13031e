//! Work offsets as texts: `G54=120,80,-350`.

use std::str::FromStr;

use virtual_axes_core::units::{DEGREE, MILLIMETER};

use super::limits::{ADDITIONAL_OFFSET_COUNT, MAX_LENGTH, WORK_OFFSET_COUNT};
use crate::motion::{AXIS_COUNT, Coordinates, is_rotary};

/// Work offset that is given to the interpreter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorkOffset {
    /// Index in the work offsets.
    pub index: usize,
    /// Axis positions at programmed coordinate 0, m and rad.
    pub coordinates: Coordinates,
}

impl FromStr for WorkOffset {
    type Err = String;

    /// Reads `G54=X,Y,Z`, `G59.1=…`, `G54.1P7=…` or `G154P7=…`, in mm, and up to three angles in degrees.
    fn from_str(text: &str) -> Result<Self, String> {
        let required = |wrong: &str| {
            format!(
                "{text}: must be a work coordinate system with X,Y,Z in mm, as in G54=120,80,-350: {wrong}"
            )
        };
        let (name, values) = text.split_once('=').ok_or_else(|| required("= is missing"))?;
        let index = index(&name.trim().to_ascii_uppercase().replace(' ', "")).ok_or_else(|| {
            required(&format!(
                "{name} is none of G54 to G59, G59.1 to G59.3, and G54.1Pn or G154Pn with n from 1 to {ADDITIONAL_OFFSET_COUNT}"
            ))
        })?;
        let mut coordinates = [0.0; AXIS_COUNT];
        let mut count = 0;
        for value in values.split(',') {
            let number = value.trim().parse::<f64>().ok().filter(|number| number.is_finite());
            let unit = if is_rotary(count) { DEGREE } else { MILLIMETER };
            let number = number.map(|number| number * unit).filter(|number| number.abs() <= MAX_LENGTH);
            let number = number.ok_or_else(|| required(&format!("{value:?} is no length or angle")))?;
            *coordinates.get_mut(count).ok_or_else(|| required("more values than axes"))? = number;
            count += 1;
        }
        if count < 3 {
            Err(required(&format!("{count} of 3 values")))
        } else {
            Ok(Self { index, coordinates })
        }
    }
}

/// Returns the code of a work coordinate system by its index.
pub fn system_name(index: usize) -> String {
    match index {
        0..6 => format!("G{}", 54 + index),
        6..WORK_OFFSET_COUNT => format!("G59.{}", index - 5),
        _ => format!("G54.1 P{}", index + 1 - WORK_OFFSET_COUNT),
    }
}

/// Returns the index of a work coordinate system by its code.
fn index(name: &str) -> Option<usize> {
    if let Some(number) = name.strip_prefix("G54.1P").or_else(|| name.strip_prefix("G154P")) {
        let number = number.parse().ok().filter(|number| (1..=ADDITIONAL_OFFSET_COUNT).contains(number))?;
        return Some(WORK_OFFSET_COUNT - 1 + number);
    }
    (0..WORK_OFFSET_COUNT).find(|index| system_name(*index) == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_offsets_are_read_in_millimeters_and_degrees() {
        let offset: WorkOffset = "G55=10,-20.5,0,0,90".parse().unwrap();
        assert_eq!(offset.index, 1);
        assert_eq!(offset.coordinates[..3], [0.01, -0.0205, 0.0]);
        assert!((offset.coordinates[4] - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        for (text, index) in [("g59.3=0,0,0", 8), ("G54.1 P1=0,0,0", 9), ("G154P300=1,2,3", 308)] {
            assert_eq!(text.parse::<WorkOffset>().map(|offset| offset.index), Ok(index), "{text}");
        }
        for (text, wrong) in [
            ("", "= is missing"),
            ("G54", "= is missing"),
            ("G54=1,2", "2 of 3 values"),
            ("G53=1,2,3", "G53 is none of G54 to G59"),
            ("G54=1,2,x", "\"x\" is no length or angle"),
            ("G154P301=0,0,0", "with n from 1 to 300"),
            ("G54=1,2,1e99", "\"1e99\" is no length or angle"),
            ("G54=1,2,3,4,5,6,7,8,9,10", "more values than axes"),
        ] {
            let error = text.parse::<WorkOffset>().unwrap_err();
            assert!(error.contains(wrong), "{error}");
        }
    }
}
