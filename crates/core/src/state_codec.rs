//! Conversion of simulation states to bytes and back, by one description of their order.

/// FNV-1a hash, 64 bits: detects damage and other parameters, not intent.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fnv(u64);

impl Fnv {
    /// Creates the hash of no bytes.
    pub fn new() -> Self {
        Fnv(0xcbf2_9ce4_8422_2325)
    }

    /// Adds bytes.
    pub fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
        }
    }

    /// Returns the hash of the bytes so far.
    pub fn value(self) -> u64 {
        self.0
    }
}

impl std::fmt::Write for Fnv {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.add(text.as_bytes());
        Ok(())
    }
}

/// Returns the FNV-1a hash of `bytes`, 64 bits.
pub fn checksum(bytes: &[u8]) -> u64 {
    let mut hash = Fnv::new();
    hash.add(bytes);
    hash.value()
}

/// Writer or reader of a state: both pass over its values in one order, in words of 8 bytes, little endian.
#[derive(Debug)]
pub(crate) enum StateCodec<'a> {
    /// Writer to bytes.
    Writer(Vec<u8>),
    /// Reader of bytes.
    Reader {
        /// Bytes that are still to be read.
        bytes: &'a [u8],
        /// True if the bytes ended early or a value was out of its range.
        is_invalid: bool,
    },
}

impl StateCodec<'_> {
    fn word(&mut self, value: u64) -> u64 {
        match self {
            StateCodec::Writer(bytes) => {
                bytes.extend(value.to_le_bytes());
                value
            }
            StateCodec::Reader { bytes, is_invalid } => match bytes.split_first_chunk() {
                Some((word, rest)) => {
                    *bytes = rest;
                    u64::from_le_bytes(*word)
                }
                None => {
                    *is_invalid = true;
                    value
                }
            },
        }
    }

    /// Writes `value` and returns it, or returns the number that is read.
    pub fn number(&mut self, value: f64) -> f64 {
        f64::from_bits(self.word(value.to_bits()))
    }

    /// Writes `value` and returns it, or returns the integer that is read; one above `max` is invalid and becomes
    /// `value`.
    pub fn integer(&mut self, value: u64, max: u64) -> u64 {
        let found = self.word(value);
        match self {
            StateCodec::Reader { is_invalid, .. } if found > max => {
                *is_invalid = true;
                value
            }
            _ => found,
        }
    }

    /// Writes or replaces a flag.
    pub fn flag(&mut self, value: &mut bool) {
        *value = self.integer(u64::from(*value), 1) == 1;
    }

    /// Writes or replaces a count of position cycles.
    pub fn cycles(&mut self, value: &mut u32) {
        *value = self.integer(u64::from(*value), u64::from(u32::MAX)) as u32;
    }

    /// Writes or replaces numbers.
    pub fn numbers<'n>(&mut self, values: impl IntoIterator<Item = &'n mut f64>) {
        values.into_iter().for_each(|value| *value = self.number(*value));
    }
}
