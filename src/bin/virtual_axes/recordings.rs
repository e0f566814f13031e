//! Recordings of one axis as a command is given them: read, conditioned, and what feedforward acted.

use std::error::Error;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_identify::identify::{FeedforwardMode, IdentificationInput};
use virtual_axes_identify::recording::{Conditioning, Finding, Signals, condition};
use virtual_axes_io::files::{Columns, RecordingOptions, read_recording};

use crate::campaign::PartName;

/// How recordings are read; alike for all of them.
#[derive(Debug, clap::Args)]
pub struct Reading {
    /// Where a channel of a CSV file stands and in which unit, as in `position=Pos1[mm]`, `current=#4[-1 A]`:
    /// time, psec, position, velocity, current, velocity_feedforward, torque_feedforward; also `delimiter=;`,
    /// `decimal_comma=true`, `skip_lines=2`. Can be given several times.
    #[arg(long, value_name = "CHANNEL=COLUMN[UNIT]")]
    column: Vec<String>,
    /// A file with such a mapping, under --column.
    #[arg(long, value_name = "MAP.yaml")]
    columns: Option<PathBuf>,
    /// A topic of an MCAP recording, or the beginning of its name, where several carry one type; can be given
    /// several times.
    #[arg(long)]
    topic: Vec<String>,
    /// The joint's name in the recordings, if it is not the axis's.
    #[arg(long)]
    joint: Option<String>,
    /// Where the filter of velocity, acceleration and current passes half the power, Hz; 100, or less where the
    /// recording is slow.
    #[arg(long, value_name = "F", allow_negative_numbers = true)]
    cutoff_hz: Option<f64>,
    /// By how much the current lags behind the motion, ms; estimated if it is not given.
    #[arg(long, value_name = "MS", allow_negative_numbers = true)]
    current_lag_ms: Option<f64>,
}

impl Reading {
    /// The file with the mapping of columns, if there is one.
    pub fn map(&self) -> Option<&Path> {
        self.columns.as_deref()
    }

    /// How files are to be read.
    pub fn options(&self) -> Result<RecordingOptions, Box<dyn Error>> {
        let columns = Columns::read(self.map(), &self.column, "--column")?;
        Ok(RecordingOptions { columns, topics: self.topic.clone(), joint: self.joint.clone() })
    }

    fn conditioning(&self) -> Conditioning {
        Conditioning {
            cutoff: self.cutoff_hz,
            current_lag: self.current_lag_ms.map(|milliseconds| milliseconds * MILLISECOND),
        }
    }
}

/// A recording that is fit for use.
#[derive(Debug)]
pub struct Recorded {
    /// The recording.
    pub signals: Signals,
    /// The feedforward that was said to act.
    pub feedforward: Option<FeedforwardMode>,
    /// What reading and conditioning found.
    pub findings: Vec<Finding>,
}

impl Recorded {
    /// As the library takes it.
    pub fn input(&self) -> IdentificationInput<'_> {
        IdentificationInput { signals: &self.signals, feedforward: self.feedforward }
    }

    /// From the first sample to the last, s.
    pub fn duration(&self) -> f64 {
        let Signals { spans, period, .. } = &self.signals;
        let end = spans.last().map(|s| s.start + s.position.len().saturating_sub(1) as f64 * period);
        spans.first().zip(end).map_or(0.0, |(first, end)| end - first.start)
    }

    /// Samples that are used.
    pub fn samples(&self) -> usize {
        self.signals.spans.iter().map(|span| span.position.len()).sum()
    }
}

/// Reads the recording `path` of `axis`; `feedforward` is what was said to act, by `option`.
///
/// # Errors
/// What is wrong with the file; or that its feedforward is not known.
pub fn read(
    path: &Path,
    (axis, periods): (&AxisConfig, &Periods),
    (reading, options): (&Reading, &RecordingOptions),
    (feedforward, option): (Option<FeedforwardMode>, &str),
) -> Result<Recorded, Box<dyn Error>> {
    let (raw, mut findings) = read_recording(path, axis, options)?;
    let (signals, more) = condition(&raw, axis, periods, &reading.conditioning())?;
    findings.extend(more);
    if let (None, Some(unseen)) = (feedforward, unseen_feedforward(&signals)) {
        return Err(format!(
            "{}: it has no {unseen}, so that the feedforward that acted must be said: {option} off, velocity or both",
            signals.name
        )
        .into());
    }
    Ok(Recorded { signals, feedforward, findings })
}

/// What would show the feedforward that acted on the setpoints, if that is not there.
fn unseen_feedforward(signals: &Signals) -> Option<&'static str> {
    let acts = |channel: &[f64]| channel.iter().any(|value| *value != 0.0);
    signals.spans.iter().filter(|span| span.psec.is_some()).find_map(|span| {
        match (&span.velocity_feedforward, &span.torque_feedforward) {
            (None, _) => Some("velocity feedforward (VFFWS)"),
            (Some(velocity), None) if acts(velocity) => Some("torque feedforward (TFFWS)"),
            _ => None,
        }
    })
}

/// The feedforward of each of `count` recordings, from a list for each or one for all; `option` is its name.
pub fn feedforward(
    given: &[PartName],
    count: usize,
    option: &str,
) -> Result<Vec<Option<FeedforwardMode>>, String> {
    match given {
        [] => Ok(vec![None; count]),
        [one] => Ok(vec![Some((*one).into()); count]),
        all if all.len() == count => Ok(all.iter().map(|part| Some((*part).into())).collect()),
        all => Err(format!(
            "{option}: {} given for {count} recording{}; give one for all, or one for each",
            all.len(),
            if count == 1 { "" } else { "s" }
        )),
    }
}
