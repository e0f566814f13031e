//! Numbers as text: the shortest decimal that is read back exactly, without an exponent, as `{}` has it.

use std::io::Write;

/// Below this, and with fewer zeros at the end of its fraction in binary than [`FEW_ZEROS`], a number has one
/// shortest decimal that is nearest: two are equally near only where the number ends right between them,
/// within as many binary places as there are decimals.
const PLAIN: f64 = (1_u32 << 20) as f64;
/// From 2^0 to 2^20 seventeen digits leave at most 17 binary places to end in: of 52, 20 at least are zeros then.
const FEW_ZEROS: u32 = 20;
/// What stands before the digits of the exponent of a small number.
const EXPONENT: &[u8] = b"e-";
/// What stands behind a whole number.
const POINT_ZERO: &[u8] = b".0";

/// Adds `value` to `text`.
pub(super) fn push(text: &mut Vec<u8>, value: f64) {
    // Axes at rest are at 0 of most signals.
    if value == 0.0 {
        text.extend_from_slice(if value.is_sign_negative() { b"-0" } else { b"0" });
        return;
    }
    if value.abs() < PLAIN && value.to_bits().trailing_zeros() < FEW_ZEROS {
        let mut buffer = zmij::Buffer::new();
        let shortest = buffer.format_finite(value).as_bytes();
        match shortest.iter().rposition(|&byte| byte == b'e') {
            None => text.extend_from_slice(shortest.strip_suffix(POINT_ZERO).unwrap_or(shortest)),
            Some(end) => push_small(text, &shortest[..end], &shortest[end + EXPONENT.len()..]),
        }
        return;
    }
    // A vector takes everything in.
    let _ = write!(text, "{value}");
}

/// Adds a number below 1 that is told as `mantissa`, with a point behind its first digit at most, and the digits
/// of its exponent without their sign.
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
    fn usual_and_unusual_numbers_are_as_display_has_them() {
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
        fn any_number_is_as_display_has_it(bits in any::<u64>(), small in -2e6..2e6f64) {
            let exact = f64::from_bits(bits);
            for number in [exact, small, small * 1e-6, small * 1e-12, exact.fract()] {
                prop_assert_eq!(text(number), format!("{number}"));
            }
        }

        /// Numbers that end between two shortest decimals.
        #[test]
        fn a_number_between_two_decimals_is_as_display_has_it(whole in any::<i64>(), places in 0..80i32, cut in 0..60u32) {
            let number = ((whole >> cut) | 1) as f64 * 2f64.powi(-places);
            prop_assert_eq!(text(number), format!("{number}"));
        }
    }
}
