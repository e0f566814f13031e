//! States as bytes, for `fmi2SerializeFMUstate`.

use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::{Machine, check_input};
use virtual_axes_core::state_codec::checksum;

use crate::slave::{Phase, Slave, discretized};

/// First bytes of a state; the last two are the version of the format.
const HEAD: [u8; 8] = *b"vastfm01";

impl Slave {
    /// Returns head, phase, inputs, machine file and state of the machine, then the checksum of these.
    pub fn to_bytes(&self) -> Result<Vec<u8>, String> {
        let mut slave = self.clone();
        slave.apply()?;
        let yaml = slave.parameters.to_yaml("", |_| None);
        let mut bytes = Vec::from(HEAD);
        bytes.push(Phase::ALL.iter().position(|phase| *phase == slave.phase).unwrap_or_default() as u8);
        bytes.push(u8::from(slave.uses_preview));
        bytes.extend(slave.start_time.to_le_bytes());
        for values in [&slave.psec, &slave.loads, &slave.start_positions, &slave.preview] {
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        }
        bytes.extend((yaml.len() as u64).to_le_bytes());
        bytes.extend(yaml.as_bytes());
        bytes.extend(slave.machine.state_bytes());
        bytes.extend(checksum(&bytes).to_le_bytes());
        Ok(bytes)
    }

    /// Reads a state of the same FMU; `model` has its axes and number of previews.
    pub fn from_bytes(model: &Slave, bytes: &[u8]) -> Result<Self, String> {
        let size = bytes.len();
        let damaged = || format!("the state of {size} bytes is truncated or damaged");
        if !bytes.starts_with(&HEAD) {
            return Err(format!("the {size} bytes are no state of this version of the FMU"));
        }
        let (content, found) = bytes.split_last_chunk().ok_or_else(damaged)?;
        if content.len() < HEAD.len() || checksum(content) != u64::from_le_bytes(*found) {
            return Err(damaged());
        }
        let mut reader = Reader(&content[HEAD.len()..]);
        let mut slave = model.clone();
        let flags = reader.bytes(2).ok_or_else(damaged)?;
        slave.phase = *Phase::ALL.get(usize::from(flags[0])).ok_or_else(damaged)?;
        slave.uses_preview = flags[1] != 0;
        slave.is_changed = false;
        slave.start_time = reader.number().ok_or_else(damaged)?;
        for values in [&mut slave.psec, &mut slave.loads, &mut slave.start_positions, &mut slave.preview] {
            for value in values {
                *value = reader.number().filter(|&value| check_input(value).is_ok()).ok_or_else(damaged)?;
            }
        }
        let length = u64::from_le_bytes(reader.array().ok_or_else(damaged)?);
        let yaml =
            usize::try_from(length).ok().and_then(|length| reader.bytes(length)).ok_or_else(damaged)?;
        let yaml = std::str::from_utf8(yaml).map_err(|_| damaged())?;
        slave.parameters = Parameters::from_yaml(yaml, "state").map_err(|error| error.to_string())?;
        if slave.parameters.get("joints") != model.parameters.get("joints") {
            return Err("the state is that of a machine with other axes".to_owned());
        }
        slave.machine = Machine::from_state_bytes(discretized(&slave.parameters)?, reader.0)
            .map_err(|error| error.to_string())?;
        Ok(slave)
    }
}

/// Rest of the bytes of a state.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn bytes(&mut self, length: usize) -> Option<&'a [u8]> {
        let (found, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(found)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    fn number(&mut self) -> Option<f64> {
        self.array().map(f64::from_le_bytes).filter(|value| value.is_finite())
    }
}
