//! A period on the command line: a number with a unit.

use std::str::FromStr;

use virtual_axes_core::units::{MICROSECOND_NS, MILLISECOND_NS, Nanoseconds, SECOND_NS};

/// Units. A unit precedes every shorter unit that is its suffix.
const UNITS: [(&str, Nanoseconds); 5] =
    [("ns", 1), ("us", MICROSECOND_NS), ("µs", MICROSECOND_NS), ("ms", MILLISECOND_NS), ("s", SECOND_NS)];
/// Longest period, ns.
const LONGEST: Nanoseconds = 3600 * SECOND_NS;

/// Positive period in whole nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PeriodArgument(Nanoseconds);

impl PeriodArgument {
    /// Returns the period, ns.
    pub fn nanoseconds(self) -> Nanoseconds {
        self.0
    }
}

impl FromStr for PeriodArgument {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let unit = UNITS.iter().find_map(|(unit, ns)| Some((text.strip_suffix(unit)?, *ns)));
        let expected = "must be a number with a unit (ns, us, ms, s), for example 125us";
        let (number, unit) = unit.ok_or(expected)?;
        let number: f64 = number.trim().parse().map_err(|_| expected)?;
        let period = number * unit as f64;
        if !(period > 0.0 && period <= LONGEST as f64) {
            return Err("must be greater than 0 and at most 3600s".to_owned());
        }
        let whole = period.round();
        if (period - whole).abs() > 1e-6 {
            return Err("must be a whole number of nanoseconds".to_owned());
        }
        Ok(PeriodArgument(whole as Nanoseconds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_requires_a_unit() {
        let ns = |text: &str| text.parse::<PeriodArgument>().map(PeriodArgument::nanoseconds);
        assert_eq!(ns("125us"), Ok(125_000));
        assert_eq!(ns("125 µs"), Ok(125_000));
        assert_eq!(ns("0.006s"), Ok(6_000_000));
        assert_eq!(ns("1ms"), Ok(1_000_000));
        for wrong in ["", "125", "us", "-1ms", "0s", "nanms", "1e300s", "0.3ns"] {
            assert!(ns(wrong).is_err(), "{wrong}");
        }
    }
}
