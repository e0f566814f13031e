//! States as bytes, for `fmi2SerializeFMUstate`.

use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::{Machine, check_input};
use virtual_axes_core::state_codec::{SealedBytes, seal};

use crate::slave::{Phase, Slave, discretized};

/// First bytes of a state; the last two are the version of the format.
const HEAD: [u8; 8] = *b"vastfm02";

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
        bytes.extend(slave.stop_time.to_le_bytes());
        for values in [&slave.psec, &slave.loads, &slave.start_positions, &slave.preview] {
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        }
        bytes.extend((yaml.len() as u64).to_le_bytes());
        bytes.extend(yaml.as_bytes());
        bytes.extend(slave.machine.state_bytes());
        seal(&mut bytes);
        Ok(bytes)
    }

    /// Reads a state of the same FMU; `model` has its axes and number of previews.
    pub fn from_bytes(model: &Slave, bytes: &[u8]) -> Result<Self, String> {
        let size = bytes.len();
        let damaged = || format!("the state of {size} bytes is truncated or damaged");
        if !bytes.starts_with(&HEAD) {
            return Err(format!("the {size} bytes are no state of this version of the FMU"));
        }
        let mut reader = SealedBytes::open(bytes, &HEAD).ok_or_else(damaged)?;
        let mut slave = model.clone();
        let flags = reader.bytes(2).ok_or_else(damaged)?;
        slave.phase = *Phase::ALL.get(usize::from(flags[0])).ok_or_else(damaged)?;
        slave.uses_preview = flags[1] != 0;
        slave.is_changed = false;
        slave.start_time = reader.number().ok_or_else(damaged)?;
        slave.stop_time = reader.number().ok_or_else(damaged)?;
        for values in [&mut slave.psec, &mut slave.loads, &mut slave.start_positions, &mut slave.preview] {
            for value in values {
                *value = reader.number().filter(|&value| check_input(value).is_ok()).ok_or_else(damaged)?;
            }
        }
        let yaml = reader.counted(1).and_then(|text| std::str::from_utf8(text).ok()).ok_or_else(damaged)?;
        slave.parameters = Parameters::from_yaml(yaml, "state").map_err(|error| error.to_string())?;
        if slave.parameters.get("joints") != model.parameters.get("joints") {
            return Err("the state is that of a machine with other axes".to_owned());
        }
        slave.machine = Machine::from_state_bytes(discretized(&slave.parameters)?, reader.rest())
            .map_err(|error| error.to_string())?;
        Ok(slave)
    }
}
