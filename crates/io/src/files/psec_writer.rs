//! Writing of position setpoints as CSV, YAML (format of `ros2 topic pub`) or MCAP.

use std::io::{self, Write};

use serde::ser::{Serialize, Serializer};

use super::decimal;
use super::mcap_writer::{DEFAULT_QOS, McapTopic, McapWriter};
use super::psec_error::TIME;
use crate::messages::builtin_interfaces::msg::Duration;
use crate::messages::std_msgs::msg::Header;
use crate::messages::trajectory_msgs::msg::JointTrajectory;
use crate::messages::{self, Recorded};
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Topic of the trajectory in a recording.
const TOPIC: &str = "/psec";

/// Writer of setpoints as CSV, `time,x,…`; numbers are the shortest decimals that parse to the same value.
#[derive(Debug)]
pub struct PsecCsvWriter<W> {
    output: W,
    /// Buffer of a row.
    row: Vec<u8>,
}

impl<W: Write> PsecCsvWriter<W> {
    /// Creates a writer and writes the header.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn new(mut output: W, joints: &[String]) -> io::Result<Self> {
        writeln!(output, "{TIME},{}", joints.join(","))?;
        Ok(PsecCsvWriter { output, row: Vec::new() })
    }

    /// Adds one setpoint per joint, m or rad, at `time`, ns from the start.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn row(&mut self, time: Nanoseconds, positions: &[f64]) -> io::Result<()> {
        self.row.clear();
        decimal::push(&mut self.row, seconds(time));
        for &position in positions {
            self.row.push(b',');
            decimal::push(&mut self.row, position);
        }
        self.row.push(b'\n');
        self.output.write_all(&self.row)
    }

    /// Flushes and returns the output.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.output.flush()?;
        Ok(self.output)
    }
}

/// Writer of a `JointTrajectory` with stamp 0 as YAML for `ros2 topic pub --once … "$(cat F.yaml)"`, one line per
/// point; numbers are the shortest decimals that YAML 1.1 parsers read as the same value.
#[derive(Debug)]
pub struct PsecYamlWriter<W> {
    output: W,
    is_empty: bool,
    /// Buffer of a point.
    row: Vec<u8>,
}

impl<W: Write> PsecYamlWriter<W> {
    /// Creates a writer and writes the joint names.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn new(mut output: W, joints: &[String]) -> io::Result<Self> {
        // A JSON list of strings is valid YAML.
        let names = serde_json::to_string(joints).map_err(io::Error::other)?;
        write!(output, "joint_names: {names}\npoints:")?;
        Ok(PsecYamlWriter { output, is_empty: true, row: Vec::new() })
    }

    /// Adds one setpoint per joint, m or rad, at `time`, ns from the start.
    ///
    /// # Errors
    /// Returns the errors of the output, and an error for a time beyond the 32-bit seconds of a message.
    pub fn row(&mut self, time: Nanoseconds, positions: &[f64]) -> io::Result<()> {
        let (sec, nanosec) = message_time(time)?;
        self.row.clear();
        self.row.extend_from_slice(b"\n- {positions: [");
        self.is_empty = false;
        for (column, &position) in positions.iter().enumerate() {
            self.row.extend_from_slice(if column > 0 { b", " } else { b"" });
            // YAML 1.1 has another syntax of exponents, and reads a number without a point as an integer.
            decimal::push(&mut self.row, position);
            self.row.extend_from_slice(if position.fract() == 0.0 { b".0" } else { b"" });
        }
        write!(self.row, "], time_from_start: {{sec: {sec}, nanosec: {nanosec}}}}}")?;
        self.output.write_all(&self.row)
    }

    /// Flushes and returns the output.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.output.write_all(if self.is_empty { b" []\n" } else { b"\n" })?;
        self.output.flush()?;
        Ok(self.output)
    }
}

/// Writer of setpoints as an MCAP recording with one `JointTrajectory` on `/psec`, stamp and log time 0. The message
/// is kept in memory until [`finish`](Self::finish).
#[derive(Debug)]
pub struct PsecMcapWriter<W: Write> {
    recording: McapWriter<W>,
    topic: McapTopic,
    message: FlatTrajectory,
}

impl<W: Write> PsecMcapWriter<W> {
    /// Starts a recording.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn new(output: W, joints: &[String]) -> io::Result<Self> {
        let mut recording = McapWriter::new(output)?;
        let topic = recording.topic(TOPIC, &JointTrajectory::schema(), DEFAULT_QOS)?;
        let message = FlatTrajectory { joint_names: joints.to_vec(), ..FlatTrajectory::default() };
        Ok(PsecMcapWriter { recording, topic, message })
    }

    /// Adds one setpoint per joint, m or rad, at `time`, ns from the start.
    ///
    /// # Errors
    /// Returns an error for a time beyond the 32-bit seconds of a message.
    pub fn row(&mut self, time: Nanoseconds, positions: &[f64]) -> io::Result<()> {
        message_time(time)?;
        let Points { times, positions: all, begins } = &mut self.message.points;
        times.push(time);
        begins.push(all.len());
        all.extend_from_slice(positions);
        Ok(())
    }

    /// Writes the message and returns the output.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.recording.write(&mut self.topic, 0, &self.message)?;
        let mut output = self.recording.finish()?;
        output.flush()?;
        Ok(output)
    }
}

/// Message `trajectory_msgs/JointTrajectory` with positions only, in contiguous memory.
#[derive(Debug, Default, serde::Serialize)]
struct FlatTrajectory {
    header: Header,
    joint_names: Vec<String>,
    points: Points,
}

/// Points of a trajectory in contiguous memory.
#[derive(Debug, Default)]
struct Points {
    /// Time of each point, ns from the start.
    times: Vec<Nanoseconds>,
    /// Positions of all points, m or rad.
    positions: Vec<f64>,
    /// Start of each point in `positions`.
    begins: Vec<usize>,
}

/// Message `trajectory_msgs/JointTrajectoryPoint`.
#[derive(serde::Serialize)]
struct Point<'a> {
    positions: &'a [f64],
    velocities: &'a [f64],
    accelerations: &'a [f64],
    effort: &'a [f64],
    time_from_start: Duration,
}

impl Serialize for Points {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let ends = self.begins.iter().skip(1).copied().chain([self.positions.len()]);
        let ranges = self.begins.iter().zip(ends).map(|(&begin, end)| &self.positions[begin..end]);
        let points = self.times.iter().zip(ranges).map(|(&time, positions)| Point {
            positions,
            velocities: &[],
            accelerations: &[],
            effort: &[],
            time_from_start: messages::duration(time),
        });
        serializer.collect_seq(points)
    }
}

/// Splits a time into the seconds and nanoseconds of a message.
fn message_time(time: Nanoseconds) -> io::Result<(i32, u32)> {
    let (sec, nanosec) = messages::parts(time);
    if i64::from(sec) == time.div_euclid(virtual_axes_core::units::SECOND_NS) {
        return Ok((sec, nanosec));
    }
    let text =
        format!("the time is {} s, must be within ±{} s, the range of a message", seconds(time), i32::MAX);
    Err(io::Error::new(io::ErrorKind::InvalidInput, text))
}
