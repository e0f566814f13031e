//! Setpoints out: CSV, YAML as `ros2 topic pub` takes it, MCAP.

use std::io::{self, Write};
use std::path::Path;

use serde::ser::{Serialize, Serializer};

use super::mcap_out::{Recording, Topic, USUAL_QOS};
use super::psec_csv::TIME;
use super::trace::extension;
use super::{OutputFile, number};
use crate::messages::builtin_interfaces::msg::Duration;
use crate::messages::std_msgs::msg::Header;
use crate::messages::{self, Schema};
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Topic of the trajectory in a recording.
const TOPIC: &str = "/psec";

/// Setpoints that are being written. Dropped before [`finish`](Self::finish), they leave no file behind.
pub trait PsecWriter {
    /// Adds the setpoints (m or rad, one per joint) of an instant, `time` ns from the start.
    ///
    /// # Errors
    /// Those of the output.
    fn row(&mut self, time: Nanoseconds, positions: &[f64]) -> io::Result<()>;

    /// Makes the file whole.
    ///
    /// # Errors
    /// Those of the output.
    fn finish(self: Box<Self>) -> io::Result<()>;
}

/// Begins setpoints of `joints` in the format that the extension of `path` names: `.csv`, `.yaml` or
/// `.mcap`. A device or a pipe without an extension gets CSV.
///
/// # Errors
/// An unknown extension; those of the output.
pub fn psec_writer(path: &Path, joints: &[String]) -> io::Result<Box<dyn PsecWriter>> {
    match extension(path, &["csv", "mcap", "yaml"])? {
        "mcap" => Ok(Box::new(PsecMcapOut::new(OutputFile::create(path)?, joints)?)),
        "yaml" => Ok(Box::new(PsecYamlOut::new(OutputFile::create(path)?, joints)?)),
        _ => Ok(Box::new(PsecCsvOut::new(OutputFile::create(path)?, joints)?)),
    }
}

/// Writes `time,x,…`; numbers are as short as they can be read back exactly.
#[derive(Debug)]
pub struct PsecCsvOut<W> {
    output: W,
    /// A row as text.
    row: Vec<u8>,
}

impl<W: Write> PsecCsvOut<W> {
    /// Begins with the header.
    ///
    /// # Errors
    /// Those of the output.
    pub fn new(mut output: W, joints: &[String]) -> io::Result<Self> {
        writeln!(output, "{TIME},{}", joints.join(","))?;
        Ok(PsecCsvOut { output, row: Vec::new() })
    }

    /// Adds the setpoints (m or rad) of an instant, ns from the start.
    ///
    /// # Errors
    /// Those of the output.
    pub fn row(&mut self, time: Nanoseconds, positions: &[f64]) -> io::Result<()> {
        self.row.clear();
        number::push(&mut self.row, seconds(time));
        for &position in positions {
            self.row.push(b',');
            number::push(&mut self.row, position);
        }
        self.row.push(b'\n');
        self.output.write_all(&self.row)
    }

    /// Hands everything over and gives the output back.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.output.flush()?;
        Ok(self.output)
    }
}

/// Writes a `JointTrajectory` with stamp 0 for `ros2 topic pub --once … "$(cat F.yaml)"`, a line per point;
/// numbers are as short as they can be read back exactly, by readers of YAML 1.1 too.
#[derive(Debug)]
pub struct PsecYamlOut<W> {
    output: W,
    empty: bool,
    /// A point as text.
    row: Vec<u8>,
}

impl<W: Write> PsecYamlOut<W> {
    /// Begins with the joints.
    ///
    /// # Errors
    /// Those of the output.
    pub fn new(mut output: W, joints: &[String]) -> io::Result<Self> {
        // A list of texts in JSON is one in YAML, whatever the names are.
        let names = serde_json::to_string(joints).map_err(io::Error::other)?;
        write!(output, "joint_names: {names}\npoints:")?;
        Ok(PsecYamlOut { output, empty: true, row: Vec::new() })
    }

    /// Adds the setpoints (m or rad) of an instant, ns from the start.
    ///
    /// # Errors
    /// Those of the output; a time beyond the 32-bit seconds of a message.
    pub fn row(&mut self, time: Nanoseconds, positions: &[f64]) -> io::Result<()> {
        let (sec, nanosec) = message_time(time)?;
        self.row.clear();
        self.row.extend_from_slice(b"\n- {positions: [");
        self.empty = false;
        for (column, &position) in positions.iter().enumerate() {
            self.row.extend_from_slice(if column > 0 { b", " } else { b"" });
            // Without an exponent, which YAML 1.1 wants in a form of its own, and with a point, so that
            // it is no integer.
            number::push(&mut self.row, position);
            self.row.extend_from_slice(if position.fract() == 0.0 { b".0" } else { b"" });
        }
        write!(self.row, "], time_from_start: {{sec: {sec}, nanosec: {nanosec}}}}}")?;
        self.output.write_all(&self.row)
    }

    /// Hands everything over and gives the output back.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.output.write_all(if self.empty { b" []\n" } else { b"\n" })?;
        self.output.flush()?;
        Ok(self.output)
    }
}

/// Writes a recording with one `JointTrajectory` on `/psec`, stamp and log time 0. The message is held
/// until it is whole.
#[derive(Debug)]
pub struct PsecMcapOut<W: Write> {
    recording: Recording<W>,
    topic: Topic,
    message: Trajectory,
}

impl<W: Write> PsecMcapOut<W> {
    /// Begins a recording.
    ///
    /// # Errors
    /// Those of the output.
    pub fn new(output: W, joints: &[String]) -> io::Result<Self> {
        let mut recording = Recording::new(output)?;
        let topic = recording.topic(TOPIC, &Schema::joint_trajectory(), USUAL_QOS)?;
        let message = Trajectory { joint_names: joints.to_vec(), ..Trajectory::default() };
        Ok(PsecMcapOut { recording, topic, message })
    }

    /// Adds the setpoints (m or rad) of an instant, ns from the start.
    ///
    /// # Errors
    /// A time beyond the 32-bit seconds of a message.
    pub fn row(&mut self, time: Nanoseconds, positions: &[f64]) -> io::Result<()> {
        message_time(time)?;
        let Points { times, positions: all, begins } = &mut self.message.points;
        times.push(time);
        begins.push(all.len());
        all.extend_from_slice(positions);
        Ok(())
    }

    /// Writes the message and gives the output back.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.recording.write(&mut self.topic, 0, &self.message)?;
        let mut output = self.recording.finish()?;
        output.flush()?;
        Ok(output)
    }
}

/// `trajectory_msgs/JointTrajectory` with positions only, field by field, without a list for each point.
#[derive(Debug, Default, serde::Serialize)]
struct Trajectory {
    header: Header,
    joint_names: Vec<String>,
    points: Points,
}

/// The points of a trajectory, one after the other.
#[derive(Debug, Default)]
struct Points {
    /// ns from the start.
    times: Vec<Nanoseconds>,
    /// m or rad.
    positions: Vec<f64>,
    /// Where the positions of each point begin.
    begins: Vec<usize>,
}

/// `trajectory_msgs/JointTrajectoryPoint`, field by field.
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

/// Seconds and nanoseconds of a time that a message can say.
fn message_time(time: Nanoseconds) -> io::Result<(i32, u32)> {
    let (sec, nanosec) = messages::parts(time);
    if i64::from(sec) == time.div_euclid(virtual_axes_core::units::SECOND_NS) {
        return Ok((sec, nanosec));
    }
    let text = format!("{} s is beyond the seconds that a message has, ±{}", seconds(time), i32::MAX);
    Err(io::Error::new(io::ErrorKind::InvalidInput, text))
}

macro_rules! writers {
    ($($writer:ident),*) => {$(
        impl PsecWriter for $writer<OutputFile> {
            fn row(&mut self, time: Nanoseconds, positions: &[f64]) -> io::Result<()> {
                $writer::row(self, time, positions)
            }

            fn finish(self: Box<Self>) -> io::Result<()> {
                $writer::finish(*self)?.finish()
            }
        }
    )*};
}

writers!(PsecCsvOut, PsecYamlOut, PsecMcapOut);
