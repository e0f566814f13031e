//! States of a machine as bytes, to store them or to send them to another process.

use std::fmt::Write;
use std::sync::Arc;

use super::{DriveMode, Machine, MachineParameters};
use crate::state_codec::{Fnv, StateCodec, checksum};

/// First bytes of a state; the last two are the version of the format.
const HEAD: [u8; 8] = *b"vastat06";
/// Bytes of head, fingerprint of the parameters, and checksum.
const FRAME: usize = 24;

/// Error of a state that cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum StateError {
    /// Bytes that do not start like a state of this version.
    #[error(
        "the {0} bytes are no machine state of this version; a state is read by the version that has written it"
    )]
    Foreign(usize),
    /// Bytes with another checksum.
    #[error("the state of {0} bytes is truncated or damaged: its checksum differs from that of its content")]
    Damaged(usize),
    /// State of a machine with other parameters.
    #[error("the state is that of a machine with other parameters; it needs those it was written with")]
    OtherParameters,
    /// State with a value out of its range, or of another length.
    #[error("the state of {0} bytes has a value out of its range or another length than this machine needs")]
    Invalid(usize),
}

impl MachineParameters {
    /// Returns a hash of all parameters.
    fn fingerprint(&self) -> u64 {
        let mut hash = Fnv::new();
        // Neither the hash nor the derived implementations return an error.
        let _ = write!(hash, "{self:?}");
        hash.value()
    }
}

impl Machine {
    /// Returns the state as bytes, with the version of their format, a fingerprint of the parameters, and a checksum.
    ///
    /// [`from_state_bytes`](Self::from_state_bytes) reads them. The bytes are independent of the SIMD width.
    pub fn state_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::from(HEAD);
        bytes.extend(self.parameters.fingerprint().to_le_bytes());
        let mut codec = StateCodec::Writer(bytes);
        self.clone().code(&mut codec);
        let mut bytes = match codec {
            StateCodec::Writer(bytes) => bytes,
            StateCodec::Reader { bytes, .. } => bytes.to_vec(),
        };
        bytes.extend(checksum(&bytes).to_le_bytes());
        bytes
    }

    /// Creates a machine from the state in `bytes`, which [`state_bytes`](Self::state_bytes) has returned for a machine
    /// with equal `parameters`. It goes on with the same bits.
    ///
    /// # Errors
    /// [`StateError`] for bytes of another kind or version, truncated or damaged bytes, and other parameters.
    pub fn from_state_bytes(parameters: Arc<MachineParameters>, bytes: &[u8]) -> Result<Self, StateError> {
        if !bytes.starts_with(&HEAD) {
            return Err(StateError::Foreign(bytes.len()));
        }
        let damaged = StateError::Damaged(bytes.len());
        let (content, found) = bytes.split_last_chunk().ok_or(damaged)?;
        if bytes.len() < FRAME || checksum(content) != u64::from_le_bytes(*found) {
            return Err(damaged);
        }
        let (fingerprint, content) = content[HEAD.len()..].split_first_chunk().ok_or(damaged)?;
        if u64::from_le_bytes(*fingerprint) != parameters.fingerprint() {
            return Err(StateError::OtherParameters);
        }
        let mut machine = Machine::new(parameters);
        let mut codec = StateCodec::Reader { bytes: content, is_invalid: false };
        machine.code(&mut codec);
        match codec {
            StateCodec::Reader { bytes: [], is_invalid: false } => Ok(machine),
            _ => Err(StateError::Invalid(bytes.len())),
        }
    }

    /// Writes or replaces the state.
    fn code(&mut self, codec: &mut StateCodec<'_>) {
        // The simulated time in ns must not overflow, with a margin to go on.
        let longest = i64::MAX / 2 / self.parameters.periods.current.max(1);
        self.tick = codec.integer(self.tick, longest.unsigned_abs());
        for (index, axis) in self.axes.iter_mut().enumerate() {
            axis.code(codec);
            if matches!(codec, StateCodec::Reader { .. }) && axis.mode() != DriveMode::Position {
                self.bank.set_loops(index, &axis.mode().loops(self.parameters.axes[index].loops));
            }
            self.bank.code(index, codec);
        }
    }
}
