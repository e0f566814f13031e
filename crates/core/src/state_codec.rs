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

/// Appends the checksum of all bytes, which [`SealedBytes`] checks.
pub fn seal(bytes: &mut Vec<u8>) {
    bytes.extend(checksum(bytes).to_le_bytes());
}

/// Reader of the bytes of a saved state between its head and its checksum.
#[derive(Debug)]
pub struct SealedBytes<'a>(&'a [u8]);

impl<'a> SealedBytes<'a> {
    /// Opens bytes that begin with `head` and end with their checksum; returns `None` for others.
    pub fn open(bytes: &'a [u8], head: &[u8]) -> Option<Self> {
        let (content, found) = bytes.split_last_chunk()?;
        let is_valid = checksum(content) == u64::from_le_bytes(*found);
        content.strip_prefix(head).filter(|_| is_valid).map(Self)
    }

    /// Returns the next `length` bytes.
    pub fn bytes(&mut self, length: usize) -> Option<&'a [u8]> {
        let (found, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(found)
    }

    /// Returns bytes behind their number, which is given in units of `unit` bytes.
    pub fn counted(&mut self, unit: usize) -> Option<&'a [u8]> {
        let count = u64::from_le_bytes(self.bytes(size_of::<u64>())?.try_into().ok()?);
        self.bytes(usize::try_from(count).ok()?.checked_mul(unit)?)
    }

    /// Returns the next number, unless it is infinite or NaN.
    pub fn number(&mut self) -> Option<f64> {
        let bytes = self.bytes(size_of::<f64>())?.try_into().ok()?;
        Some(f64::from_le_bytes(bytes)).filter(|value| value.is_finite())
    }

    /// Returns all further bytes.
    pub fn rest(self) -> &'a [u8] {
        self.0
    }
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
