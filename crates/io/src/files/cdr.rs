//! CDR serialization of ROS messages, with the 4-byte encapsulation header, as on the wire and in recordings.

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::CdrDeserializer;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Encapsulation header of little-endian CDR, options 0.
const CDR_LE: [u8; 4] = [0, 1, 0, 0];
/// Representation identifier of big-endian CDR.
const CDR_BE: [u8; 2] = [0, 0];

/// Serializes a message as little-endian CDR into `bytes`, replacing their content.
///
/// # Errors
/// Returns the error of the serializer, for a type that CDR cannot represent.
pub fn encode_cdr(message: &impl Serialize, bytes: &mut Vec<u8>) -> Result<(), cdr_encoding::Error> {
    bytes.clear();
    bytes.extend_from_slice(&CDR_LE);
    cdr_encoding::to_writer::<_, LittleEndian, _>(bytes, message)
}

/// Deserializes a CDR message of either byte order.
///
/// # Errors
/// Returns the reason if the bytes are not plain CDR or not a message of this type.
pub(super) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    let Some((header, body)) = bytes.split_first_chunk::<4>() else {
        return Err(format!("the message has {} bytes, CDR needs at least 4", bytes.len()));
    };
    let decoded = match [header[0], header[1]] {
        CDR_BE => T::deserialize(&mut CdrDeserializer::<BigEndian>::new(body)),
        order if order == CDR_LE[..2] => T::deserialize(&mut CdrDeserializer::<LittleEndian>::new(body)),
        [a, b] => {
            return Err(format!(
                "the CDR encoding is {a:#04x} {b:#04x}, must be plain CDR, 0x00 0x00 (big-endian) or \
                 0x00 0x01 (little-endian)"
            ));
        }
    };
    decoded.map_err(|error| format!("not a message of this type: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::builtin_interfaces::msg::Time;

    #[test]
    fn both_byte_orders_are_read() {
        let little = [0, 1, 0, 0, 1, 0, 0, 0, 2, 1, 0, 0];
        let big = [0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 2];
        let time = Time { sec: 1, nanosec: 258 };
        assert_eq!(decode(&little), Ok(time.clone()));
        assert_eq!(decode(&big), Ok(time.clone()));
        let mut bytes = vec![9; 3];
        encode_cdr(&time, &mut bytes).expect("a message");
        assert_eq!(bytes, little);
    }

    #[test]
    fn encodings_other_than_plain_cdr_are_rejected() {
        let error = decode::<Time>(&[0, 7, 0, 0, 1, 0, 0, 0]).expect_err("XCDR2");
        assert!(error.contains("0x00 0x07") && error.contains("plain CDR"), "{error}");
        assert!(decode::<Time>(&[0, 1, 0]).expect_err("short").contains("3 bytes"));
        assert!(decode::<Time>(&[0, 1, 0, 0, 1]).is_err());
    }
}
