//! Formatting of numbers as the shortest decimal that parses to the same value, without an exponent, equal to `{}`.

use std::io::Write;

/// Upper limit of the fast path. Below it, a number with fewer trailing zero bits than [`FAST_PATH_ZEROS`] has a
/// unique nearest shortest decimal. A tie between two decimals needs a binary fraction as short as the decimals.
const FAST_PATH_LIMIT: f64 = (1_u32 << 20) as f64;
/// Minimum number of trailing zero bits of a tie: 17 digits from 2^0 to 2^20 have at most 17 binary places.
const FAST_PATH_ZEROS: u32 = 20;
/// Prefix of the exponent of a small number.
const EXPONENT: &[u8] = b"e-";
/// Suffix of an integer.
const POINT_ZERO: &[u8] = b".0";

/// Appends `value` to `text`.
pub(super) fn push(text: &mut Vec<u8>, value: f64) {
    // Most signals of axes at rest are 0.
    if value == 0.0 {
        text.extend_from_slice(if value.is_sign_negative() { b"-0" } else { b"0" });
        return;
    }
    if value.abs() < FAST_PATH_LIMIT && value.to_bits().trailing_zeros() < FAST_PATH_ZEROS {
        let mut buffer = zmij::Buffer::new();
        let shortest = buffer.format_finite(value).as_bytes();
        match shortest.iter().rposition(|&byte| byte == b'e') {
            None => text.extend_from_slice(shortest.strip_suffix(POINT_ZERO).unwrap_or(shortest)),
            Some(end) => push_small(text, &shortest[..end], &shortest[end + EXPONENT.len()..]),
        }
        return;
    }
    // Writing to a vector cannot fail.
    let _ = write!(text, "{value}");
}

/// Appends a number below 1, given as `mantissa` with one digit before the point, and the digits of its negative
/// exponent.
fn push_small(text: &mut Vec<u8>, mantissa: &[u8], exponent: &[u8]) {
    let digits = mantissa.strip_prefix(b"-").unwrap_or(mantissa);
    text.extend_from_slice(&mantissa[..mantissa.len() - digits.len()]);
    let places = exponent.iter().fold(0, |places, digit| 10 * places + usize::from(digit - b'0'));
    text.extend_from_slice(b"0.");
    text.resize(text.len() + places - 1, b'0');
    text.extend(digits.iter().filter(|byte| **byte != b'.'));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn text(value: f64) -> String {
        let mut text = Vec::new();
        push(&mut text, value);
        String::from_utf8(text).expect("digits")
    }

    #[test]
    fn selected_numbers_equal_their_display_format() {
        let numbers = [
            0.0,
            -0.0,
            1.0,
            -3.0,
            0.1,
            100.0,
            1e15,
            1e16,
            1e300,
            -1e-5,
            9.9e-6,
            5e-324,
            f64::MIN_POSITIVE,
            f64::MAX,
            123_456.789,
            0.125,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ];
        for number in numbers {
            assert_eq!(text(number), format!("{number}"));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn any_number_equals_its_display_format(bits in any::<u64>(), small in -2e6..2e6f64) {
            let exact = f64::from_bits(bits);
            for number in [exact, small, small * 1e-6, small * 1e-12, exact.fract()] {
                prop_assert_eq!(text(number), format!("{number}"));
            }
        }

        /// Ties between two shortest decimals.
        #[test]
        fn a_tie_between_two_decimals_equals_its_display_format(whole in any::<i64>(), places in 0..80i32, cut in 0..60u32) {
            let number = ((whole >> cut) | 1) as f64 * 2f64.powi(-places);
            prop_assert_eq!(text(number), format!("{number}"));
        }
    }
}
