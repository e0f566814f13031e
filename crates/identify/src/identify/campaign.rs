//! The setpoints of an identification campaign: what an axis is to be moved through.
//!
//! A campaign has up to three parts ([`FeedforwardMode`]). `off` excites everything that the steps of the paper need with the
//! feedforward off: a slow start, legs there and back at constant speeds (Prévost eq. 3), standstills approached
//! from both sides and, on a rotary axis, slow sweeps (gravity), ramps at half and at full acceleration, as far
//! as the highest speed lets the axis reach it (eq. 5). `velocity` and `both` are short: there and back at a middle and at the highest speed, for the
//! feedforward and its delays (eqs. 6–8).
//!
//! Every part starts and ends at rest at [`Campaign::start`], on the grid of Tsp.

mod error;
mod legs;
mod room;

use std::ops::Range;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::units::{Nanoseconds, seconds};

pub use error::CampaignError;

use legs::Legs;
use room::Room;

use super::mode::FeedforwardMode;

/// Rest between two parts, s: time to switch the feedforward.
const PAUSE: f64 = 3.0;
/// Longest part, s.
const LONGEST: f64 = 3600.0;

/// What limits a campaign besides the axis.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Options {
    /// Where the setpoints have to stay, m or rad; none: the stroke.
    pub range: Option<[f64; 2]>,
    /// Highest speed, m/s or rad/s; none: 20 m/min or 20 rev/min, or what the axis has.
    pub max_feed: Option<f64>,
}

/// A part within the setpoints of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Which part.
    pub part: FeedforwardMode,
    /// Its setpoints in [`Campaign::psec`].
    pub rows: Range<usize>,
    /// Speeds of its legs, m/s or rad/s, rising.
    pub speeds: Vec<f64>,
}

/// The setpoints of one axis, part after part.
#[derive(Debug, Clone, PartialEq)]
pub struct Campaign {
    period: Nanoseconds,
    start: f64,
    range: [f64; 2],
    runs: Vec<Run>,
    psec: Vec<f64>,
}

impl Campaign {
    /// Plans `parts`, one after the other with 3 s of standstill between them, for the axis at `place`, from 0.
    ///
    /// Speeds reach up to 20 m/min (rev/min), 95 % of Vmax or of the motor's speed, or `options.max_feed`; setpoints
    /// stay 5 % of the range (the stroke, or `options.range`) away from its ends, and within Amax and Jmax. Start and
    /// end of each part are at home, 0, if that is within the range, otherwise at the place nearest to it that the
    /// setpoints may have.
    ///
    /// # Errors
    /// [`CampaignError`]: no such axis; a range outside the stroke, or too short; a feed that the axis does not have.
    pub fn plan(
        machine: &MachineConfig,
        place: usize,
        parts: &[FeedforwardMode],
        options: &Options,
    ) -> Result<Self, CampaignError> {
        let room = Room::of(machine, place, options)?;
        let period = machine.periods().position;
        let mut campaign =
            Campaign { period, start: room.start, range: room.window, runs: Vec::new(), psec: Vec::new() };
        for &part in parts {
            if let Some(&last) = campaign.psec.last() {
                let pause = (PAUSE / seconds(period)).round() as usize;
                campaign.psec.resize(campaign.psec.len() + pause, last);
            }
            let mut legs = Legs::new(machine, place, &room);
            let speeds = match part {
                FeedforwardMode::Off => legs.off()?,
                FeedforwardMode::Velocity | FeedforwardMode::Both => legs.short()?,
            };
            let program = legs.program(machine)?;
            let duration = program.duration();
            if duration > LONGEST {
                let axis = room.axis.name().to_owned();
                return Err(CampaignError::TooLong { axis, part: part.name(), duration, limit: LONGEST });
            }
            let from = campaign.psec.len();
            let last = (duration / seconds(period)).ceil() as Nanoseconds;
            let mut joints = vec![0.0; machine.axes().len()];
            campaign.psec.extend((0..=last).map(|k| {
                program.psec(seconds(k * period), &mut joints);
                joints[place]
            }));
            campaign.runs.push(Run { part, rows: from..campaign.psec.len(), speeds });
        }
        Ok(campaign)
    }

    /// The setpoints, m or rad, one per position period, from time 0 on.
    pub fn psec(&self) -> &[f64] {
        &self.psec
    }

    /// The parts, in the order of time.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// First and last setpoint of `run`, s.
    pub fn times(&self, run: &Run) -> [f64; 2] {
        let time = |row: usize| seconds(row as Nanoseconds * self.period);
        [time(run.rows.start), time(run.rows.end.saturating_sub(1))]
    }

    /// Tsp, ns.
    pub fn period(&self) -> Nanoseconds {
        self.period
    }

    /// Where every part starts and ends, m or rad.
    pub fn start(&self) -> f64 {
        self.start
    }

    /// Between which places the axis is moved, m or rad; start and end can lie outside, at home.
    pub fn range(&self) -> [f64; 2] {
        self.range
    }
}
