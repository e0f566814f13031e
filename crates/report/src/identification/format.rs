//! Formatting of numbers and units in text and tables.

use super::super::table::TableColumn;
use super::super::text::number;
use super::super::unit::DisplayUnit;
use super::IdentificationPage;
use virtual_axes_core::config::AxisKind;

/// Magnitude below which numbers have an exponent.
const SMALLEST_PLAIN: f64 = 1e-4;
/// Magnitude from which numbers have an exponent.
const LARGEST_PLAIN: f64 = 1e7;
/// Significant digits of exact numbers.
const EXACT_DIGITS: usize = 6;
/// Maximum number of decimals of R².
const R_SQUARED_DECIMALS: usize = 6;

/// Formats a number with `count` significant digits; a dash if it is not finite.
pub(super) fn digits(value: f64, count: usize) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if value != 0.0 && !(SMALLEST_PLAIN..LARGEST_PLAIN).contains(&value.abs()) {
        return format!("{value:.*e}", count.saturating_sub(1)).replace('-', "−");
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let before = value.abs().log10().floor() as i32 + 1;
    number(value, usize::try_from(count as i32 - before).unwrap_or(0))
}

/// Formats an exact number with up to six significant digits, without trailing zeros.
pub(super) fn exact(value: f64) -> String {
    let text = digits(value, EXACT_DIGITS);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Formats a number with full precision, like in a machine file.
pub(super) fn full(value: f64) -> String {
    if !value.is_finite() {
        "–".to_owned()
    } else if value != 0.0 && value.abs() < SMALLEST_PLAIN {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

/// Formats a value in SI units in `unit`, with `count` significant digits, without the symbol.
pub(super) fn plain(value: f64, unit: &DisplayUnit, count: usize) -> String {
    digits(value / unit.size, count)
}

/// Formats a value in SI units in `unit`, with `count` significant digits and the symbol.
pub(super) fn with_unit(value: f64, unit: &DisplayUnit, count: usize) -> String {
    format!("{}\u{a0}{}", plain(value, unit, count), unit.symbol).trim_end().to_owned()
}

/// Formats an optional value; an empty string if it is missing.
pub(super) fn optional(value: Option<f64>, unit: &DisplayUnit, count: usize) -> String {
    value.map_or_else(String::new, |value| plain(value, unit, count))
}

/// Formats a ratio in percent, with one decimal.
pub(super) fn percent(part: f64) -> String {
    if part.is_finite() { number(100.0 * part, 1) } else { "–".to_owned() }
}

/// Formats R² with four decimals, or up to six if needed to distinguish it from 1.
pub(super) fn format_r_squared(r2: f64) -> String {
    if !r2.is_finite() {
        return "–".to_owned();
    }
    let decimals =
        (4..R_SQUARED_DECIMALS).find(|d| number(r2, *d) != number(1.0, *d)).unwrap_or(R_SQUARED_DECIMALS);
    number(r2, decimals)
}

/// Formats a count such as "one recording", "3 recordings".
pub(super) fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("one {what}") } else { format!("{} {what}s", number(count as f64, 0)) }
}

/// Creates the columns of a table from names and units.
pub(super) fn columns<const N: usize>(heads: [(&str, &str); N]) -> Vec<TableColumn> {
    heads.map(|(name, unit)| TableColumn::new(name, unit)).to_vec()
}

impl IdentificationPage<'_> {
    pub(super) fn position_unit(&self) -> DisplayUnit {
        DisplayUnit::position(self.kind())
    }

    pub(super) fn error_unit(&self) -> DisplayUnit {
        DisplayUnit::error(self.kind())
    }

    pub(super) fn velocity_unit(&self) -> DisplayUnit {
        DisplayUnit::velocity(self.kind())
    }

    /// Returns the unit of the equivalent inertia.
    pub(super) fn inertia_unit(&self) -> DisplayUnit {
        let value = self.axis().motor.inertia.abs();
        DisplayUnit::new(if self.has_linear_motor() { "kg" } else { "kg·m²" }, 1.0, 1e-3 * value)
    }

    /// Returns the unit of the exponents of the friction law.
    pub(super) fn exponent_unit(&self) -> &'static str {
        match self.kind() {
            AxisKind::Linear => "min/m",
            AxisKind::Rotary => "min/rev",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_digits() {
        assert_eq!(digits(0.028_04, 4), "0.02804");
        assert_eq!(digits(-95.113, 4), "−95.11");
        assert_eq!(digits(12_345.6, 3), "12\u{202f}346");
        assert_eq!(digits(1.234e-6, 3), "1.23e−6");
        assert_eq!(digits(f64::NAN, 3), "–");
        assert_eq!(digits(0.0, 3), "0");
        assert_eq!([exact(6.0), exact(0.25), exact(1.2e-5)], ["6", "0.25", "1.20000e−5"]);
    }

    #[test]
    fn r_squared_near_one_is_distinguished_from_one() {
        assert_eq!(format_r_squared(0.995), "0.9950");
        assert_eq!(format_r_squared(0.999_987), "0.99999");
        assert_eq!(format_r_squared(1.0), "1.000000");
    }
}
