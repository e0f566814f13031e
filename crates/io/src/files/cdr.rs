//! Messages as bytes: CDR behind its four bytes of header, as on the wire and in recordings.

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::CdrDeserializer;
use serde::Serialize;
use serde::de::DeserializeSeed;

/// What stands before CDR in little-endian order, options zero.
const CDR_LE: [u8; 4] = [0, 1, 0, 0];
/// Likewise big-endian, without the options.
const CDR_BE: [u8; 2] = [0, 0];

/// Puts a message into `bytes`, which are emptied before.
///
/// # Errors
/// What the encoder says; a value that CDR has cannot fail.
pub fn encode(message: &impl Serialize, bytes: &mut Vec<u8>) -> Result<(), cdr_encoding::Error> {
    bytes.clear();
    bytes.extend_from_slice(&CDR_LE);
    cdr_encoding::to_writer::<_, LittleEndian, _>(bytes, message)
}

/// What `seed` makes of the bytes of a message, in either order.
///
/// # Errors
/// A sentence that says what is wrong.
pub(super) fn decode<'de, S: DeserializeSeed<'de>>(seed: S, bytes: &'de [u8]) -> Result<S::Value, String> {
    let Some((header, body)) = bytes.split_first_chunk::<4>() else {
        return Err(format!("{} bytes are too few for a message", bytes.len()));
    };
    let decoded = match [header[0], header[1]] {
        CDR_BE => seed.deserialize(&mut CdrDeserializer::<BigEndian>::new(body)),
        order if order == CDR_LE[..2] => seed.deserialize(&mut CdrDeserializer::<LittleEndian>::new(body)),
        [a, b] => {
            return Err(format!(
                "its encoding is {a:#04x} {b:#04x}, must be plain CDR, 0x00 0x00 (big-endian) or \
                 0x00 0x01 (little-endian)"
            ));
        }
    };
    decoded.map_err(|error| format!("it is not a message of this type: {error}"))
}

#[cfg(test)]
mod tests {
    use std::marker::PhantomData;

    use super::*;
    use crate::messages::builtin_interfaces::msg::Time;

    #[test]
    fn both_byte_orders_are_read() {
        let little = [0, 1, 0, 0, 1, 0, 0, 0, 2, 1, 0, 0];
        let big = [0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 2];
        let time = Time { sec: 1, nanosec: 258 };
        assert_eq!(decode(PhantomData::<Time>, &little), Ok(time.clone()));
        assert_eq!(decode(PhantomData::<Time>, &big), Ok(time.clone()));
        let mut bytes = vec![9; 3];
        encode(&time, &mut bytes).expect("a message");
        assert_eq!(bytes, little);
    }

    #[test]
    fn what_is_not_plain_cdr_is_refused() {
        let error = decode(PhantomData::<Time>, &[0, 7, 0, 0, 1, 0, 0, 0]).expect_err("XCDR2");
        assert!(error.contains("0x00 0x07") && error.contains("plain CDR"), "{error}");
        assert!(decode(PhantomData::<Time>, &[0, 1, 0]).expect_err("short").contains("3 bytes"));
        assert!(decode(PhantomData::<Time>, &[0, 1, 0, 0, 1]).is_err());
    }
}
