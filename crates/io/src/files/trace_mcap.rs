//! Writing of simulation traces as MCAP recordings, with the messages of the ROS node.

use std::io::{self, Write};

use super::mcap_writer::{DEFAULT_QOS, McapTopic, McapWriter};
use crate::messages::sensor_msgs::msg::JointState;
use crate::messages::{DriveStates, MotorCurrents, Recorded, Sampled};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::Nanoseconds;

/// Writer of a trace as MCAP, with one message per row on the default topics of the node: `/joint_states`,
/// `/virtual_axes/motor_currents` and `/virtual_axes/drive_states`.
#[derive(Debug)]
pub struct TraceMcapWriter<W: Write> {
    recording: McapWriter<W>,
    states: (McapTopic, JointState),
    currents: (McapTopic, MotorCurrents),
    drives: (McapTopic, DriveStates),
}

impl<W: Write> TraceMcapWriter<W> {
    /// Creates a trace of `joints`; `output` does not need to be seekable.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn new(output: W, joints: &[String]) -> io::Result<Self> {
        let mut recording = McapWriter::new(output)?;
        let states = recording.topic("/joint_states", &JointState::schema(), DEFAULT_QOS)?;
        let currents =
            recording.topic("/virtual_axes/motor_currents", &MotorCurrents::schema(), DEFAULT_QOS)?;
        let drives = recording.topic("/virtual_axes/drive_states", &DriveStates::schema(), DEFAULT_QOS)?;
        Ok(TraceMcapWriter {
            recording,
            states: (states, JointState::named(joints)),
            currents: (currents, MotorCurrents::named(joints)),
            drives: (drives, DriveStates::named(joints)),
        })
    }

    /// Adds a row with `time` as stamp, log time and publish time, ns since the Unix epoch.
    ///
    /// # Errors
    /// Returns the errors of the output, and an error for a time before the epoch.
    pub fn row(&mut self, time: Nanoseconds, samples: &[AxisSample]) -> io::Result<()> {
        fn write_sample<W: Write, M: Sampled + serde::Serialize>(
            recording: &mut McapWriter<W>,
            (topic, message): &mut (McapTopic, M),
            time: Nanoseconds,
            samples: &[AxisSample],
        ) -> io::Result<()> {
            message.fill(time, samples);
            recording.write(topic, time, message)
        }
        write_sample(&mut self.recording, &mut self.states, time, samples)?;
        write_sample(&mut self.recording, &mut self.currents, time, samples)?;
        write_sample(&mut self.recording, &mut self.drives, time, samples)
    }

    /// Completes the recording, flushes and returns the output.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn finish(self) -> io::Result<W> {
        let mut output = self.recording.finish()?;
        output.flush()?;
        Ok(output)
    }
}
