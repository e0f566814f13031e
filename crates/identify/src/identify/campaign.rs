//! Position setpoints of an identification campaign.
//!
//! A campaign has up to three parts ([`FeedforwardMode`]). `off` runs without feedforward and excites
//! everything that the steps of the paper need: a slow start, legs in both directions at constant speeds
//! (Prévost eq. 3), standstills approached from both sides and, on a rotary axis, slow sweeps (gravity), and
//! ramps at half and at full acceleration where the highest speed permits (eq. 5). `velocity` and `both` are
//! short: legs in both directions at a medium and at the highest speed, for the feedforward and its delays
//! (eqs. 6–8).
//!
//! Each part starts and ends at rest at [`Campaign::start`], on the grid of Tsp.

mod error;
mod options;
mod planner;
mod travel_limits;

use std::ops::Range;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::units::{Nanoseconds, seconds};

pub use error::CampaignError;
pub use options::CampaignOptions;

use planner::CampaignPlanner;
use travel_limits::TravelLimits;

use super::feedforward_mode::FeedforwardMode;

/// Rest between two parts, s, for switching the feedforward.
const PAUSE: f64 = 3.0;
/// Longest duration of a part, s.
const LONGEST: f64 = 3600.0;

/// Part of a campaign within its setpoints.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignRun {
    /// Feedforward of the part.
    pub part: FeedforwardMode,
    /// Index range of the part in [`Campaign::psec`].
    pub rows: Range<usize>,
    /// Speeds of the legs in rising order, m/s or rad/s.
    pub speeds: Vec<f64>,
}

/// Planned setpoints of one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Campaign {
    period: Nanoseconds,
    start: f64,
    range: [f64; 2],
    runs: Vec<CampaignRun>,
    psec: Vec<f64>,
}

impl Campaign {
    /// Plans `parts` in sequence for the axis at `index`, with 3 s of standstill between them, starting
    /// at time 0.
    ///
    /// Speeds reach up to 20 m/min (rev/min), limited to 95 % of Vmax and of the motor speed, or
    /// `options.max_feed`. Setpoints keep 5 % of the range (the travel limits, or `options.range`) from its
    /// ends, and stay within Amax and Jmax. Each part starts and ends at home, 0, if it is within the range,
    /// otherwise at the nearest permitted position.
    ///
    /// # Errors
    /// [`CampaignError`] if the axis does not exist, if the range is outside the travel limits or too short,
    /// or if the axis cannot reach the feed.
    pub fn plan(
        machine: &MachineConfig,
        index: usize,
        parts: &[FeedforwardMode],
        options: &CampaignOptions,
    ) -> Result<Self, CampaignError> {
        let limits = TravelLimits::new(machine, index, options)?;
        let period = machine.periods().position;
        let mut campaign = Campaign {
            period,
            start: limits.start,
            range: limits.window,
            runs: Vec::new(),
            psec: Vec::new(),
        };
        for &part in parts {
            if let Some(&last) = campaign.psec.last() {
                let pause = (PAUSE / seconds(period)).round() as usize;
                campaign.psec.resize(campaign.psec.len() + pause, last);
            }
            let mut planner = CampaignPlanner::new(machine, index, &limits);
            let speeds = match part {
                FeedforwardMode::Off => planner.plan_off()?,
                FeedforwardMode::Velocity | FeedforwardMode::Both => planner.plan_short()?,
            };
            let program = planner.program(machine)?;
            let duration = program.duration();
            if duration > LONGEST {
                let axis = limits.axis.name().to_owned();
                return Err(CampaignError::TooLong { axis, part: part.name(), duration, limit: LONGEST });
            }
            let from = campaign.psec.len();
            let last = (duration / seconds(period)).ceil() as Nanoseconds;
            let mut joints = vec![0.0; machine.axes().len()];
            campaign.psec.extend((0..=last).map(|k| {
                program.psec(seconds(k * period), &mut joints);
                joints[index]
            }));
            campaign.runs.push(CampaignRun { part, rows: from..campaign.psec.len(), speeds });
        }
        Ok(campaign)
    }

    /// Returns the setpoints from time 0 on, one per position cycle, m or rad.
    pub fn psec(&self) -> &[f64] {
        &self.psec
    }

    /// Returns the parts in order of time.
    pub fn runs(&self) -> &[CampaignRun] {
        &self.runs
    }

    /// Returns the times of the first and last setpoint of `run`, s.
    pub fn times(&self, run: &CampaignRun) -> [f64; 2] {
        let time = |row: usize| seconds(row as Nanoseconds * self.period);
        [time(run.rows.start), time(run.rows.end.saturating_sub(1))]
    }

    /// Returns the position cycle Tsp, ns.
    pub fn period(&self) -> Nanoseconds {
        self.period
    }

    /// Returns the start and end position of each part, m or rad.
    pub fn start(&self) -> f64 {
        self.start
    }

    /// Returns the range of motion, m or rad; the start can lie outside of it, at home.
    pub fn range(&self) -> [f64; 2] {
        self.range
    }
}
