//! Traces as MCAP recordings, with the messages that the node publishes.

use std::io::{self, Write};

use super::mcap_out::{Recording, Topic, USUAL_QOS};
use crate::messages::sensor_msgs::msg::JointState;
use crate::messages::{DriveStates, MotorCurrents, Sampled, Schema};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::Nanoseconds;

/// Writes a trace on the topics of a node of the default name: `/joint_states`,
/// `/virtual_axes/motor_currents` and `/virtual_axes/drive_states`, a message of each per row.
#[derive(Debug)]
pub struct TraceMcap<W: Write> {
    recording: Recording<W>,
    states: (Topic, JointState),
    currents: (Topic, MotorCurrents),
    drives: (Topic, DriveStates),
}

impl<W: Write> TraceMcap<W> {
    /// Begins a trace of `joints`; `output` need not be able to seek.
    ///
    /// # Errors
    /// Those of the output.
    pub fn new(output: W, joints: &[String]) -> io::Result<Self> {
        let mut recording = Recording::new(output)?;
        let states = recording.topic("/joint_states", &Schema::joint_state(), USUAL_QOS)?;
        let currents =
            recording.topic("/virtual_axes/motor_currents", &Schema::motor_currents(), USUAL_QOS)?;
        let drives = recording.topic("/virtual_axes/drive_states", &Schema::drive_states(), USUAL_QOS)?;
        Ok(TraceMcap {
            recording,
            states: (states, JointState::named(joints)),
            currents: (currents, MotorCurrents::named(joints)),
            drives: (drives, DriveStates::named(joints)),
        })
    }

    /// Adds a row at `time`, ns since the Unix epoch and not before it: stamp, log time and publish time.
    ///
    /// # Errors
    /// Those of the output; a time before the epoch.
    pub fn row(&mut self, time: Nanoseconds, samples: &[AxisSample]) -> io::Result<()> {
        fn put<W: Write, M: Sampled + serde::Serialize>(
            recording: &mut Recording<W>,
            (topic, message): &mut (Topic, M),
            time: Nanoseconds,
            samples: &[AxisSample],
        ) -> io::Result<()> {
            message.fill(time, samples);
            recording.write(topic, time, message)
        }
        put(&mut self.recording, &mut self.states, time, samples)?;
        put(&mut self.recording, &mut self.currents, time, samples)?;
        put(&mut self.recording, &mut self.drives, time, samples)
    }

    /// Hands everything over and gives the output back.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(self) -> io::Result<W> {
        let mut output = self.recording.finish()?;
        output.flush()?;
        Ok(output)
    }
}
