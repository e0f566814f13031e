//! A period on the command line: a number with its unit.

use std::str::FromStr;

use virtual_axes_core::units::{MICROSECOND_NS, MILLISECOND_NS, Nanoseconds, SECOND_NS};

/// Units, longest first where one ends with another.
const UNITS: [(&str, Nanoseconds); 5] =
    [("ns", 1), ("us", MICROSECOND_NS), ("µs", MICROSECOND_NS), ("ms", MILLISECOND_NS), ("s", SECOND_NS)];
/// Longest period, ns.
const LONGEST: Nanoseconds = 3600 * SECOND_NS;

/// More than no time, in whole nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Period(Nanoseconds);

impl Period {
    /// ns.
    pub fn nanoseconds(self) -> Nanoseconds {
        self.0
    }
}

impl FromStr for Period {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let unit = UNITS.iter().find_map(|(unit, ns)| Some((text.strip_suffix(unit)?, *ns)));
        let wanted = "a number with its unit is wanted, as in 125us, 1ms, 0.01s";
        let (number, unit) = unit.ok_or(wanted)?;
        let number: f64 = number.trim().parse().map_err(|_| wanted)?;
        let period = number * unit as f64;
        if !(period > 0.0 && period <= LONGEST as f64) {
            return Err("must be longer than 0 and at most an hour".to_owned());
        }
        let whole = period.round();
        if (period - whole).abs() > 1e-6 {
            return Err("must be whole nanoseconds".to_owned());
        }
        Ok(Period(whole as Nanoseconds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_with_a_unit() {
        let ns = |text: &str| text.parse::<Period>().map(Period::nanoseconds);
        assert_eq!(ns("125us"), Ok(125_000));
        assert_eq!(ns("125 µs"), Ok(125_000));
        assert_eq!(ns("0.006s"), Ok(6_000_000));
        assert_eq!(ns("1ms"), Ok(1_000_000));
        for wrong in ["", "125", "us", "-1ms", "0s", "nanms", "1e300s", "0.3ns"] {
            assert!(ns(wrong).is_err(), "{wrong}");
        }
    }
}
