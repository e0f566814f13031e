//! Planner of part programs: setpoints of all joints at each position cycle.

use std::sync::Arc;

use virtual_axes_core::config::{ControlProfile, LimitsConfig, MachineConfig};
use virtual_axes_core::kinematics::{AxisRole, Kinematics};
use virtual_axes_core::trajectory::feed_override::{FeedControl, check_feed_override};
use virtual_axes_core::trajectory::{JointLimits, PathPlace};
use virtual_axes_core::units::seconds;

use super::activity::{ProgramActivity, TimeKind};
use super::error::{FeedPlanError, StepError};
use super::filter::MovingAverage;
use super::interval_motion::Law;
use super::look_ahead::LookAhead;
use super::machine_model::MachineModel;
use super::pieces::PieceSource;
use super::planned::{Ahead, ORIGIN};
use super::planned_interval::PlannedInterval;
use super::source::{PartSource, ProgramAxes};
use super::trapezoid::TrapezoidPlanner;
use super::vector::{JointVector, MAX_JOINTS, TipToJoints};
use crate::motion::ProgramStep;

/// Options of look-ahead and feed planning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanOptions {
    /// Deviation of linear axes where the program blends without a tolerance (G64 without P), m.
    pub blend_tolerance: f64,
    /// Deviation of rotary axes where the program blends without a tolerance, rad.
    pub rotary_tolerance: f64,
    /// Largest distance of the knots of a blended path, m: a longer distance smooths more, within the tolerance.
    pub knot_distance: f64,
    /// Largest centripetal acceleration of the tool path, m/s²; infinite for no limit besides those of the axes.
    pub centripetal_acceleration: f64,
    /// Largest chord error of the setpoints as a polyline, m; infinite for no limit.
    pub chord_error: f64,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self {
            blend_tolerance: 20e-6,
            rotary_tolerance: 0.02_f64.to_radians(),
            knot_distance: 2e-3,
            centripetal_acceleration: f64::INFINITY,
            chord_error: f64::INFINITY,
        }
    }
}

/// Setpoints of one position cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedSetpoint {
    pub(super) psec: JointVector,
    /// Place on the path. A radian of the rotary axes counts as 0.1 m of the path position, in the root of the sum of squares.
    pub place: PathPlace,
    /// Activity in the position cycle that ends at this setpoint.
    pub activity: ProgramActivity,
    joints: usize,
}

impl PlannedSetpoint {
    /// Returns the position setpoint (PSEC) of each joint, m or rad.
    pub fn psec(&self) -> &[f64] {
        &self.psec[..self.joints]
    }
}

/// Streaming planner of a part program, in constant memory.
///
/// ```
/// use std::io::Cursor;
///
/// use virtual_axes_core::config::Parameters;
/// use virtual_axes_nc::motion::{Coordinates, Feed, MotionKind, PathControl, ProgramMotion, ProgramStep};
/// use virtual_axes_nc::plan::{PartProgramPlanner, PlanOptions};
///
/// let machine = Parameters::embedded_default()?.machine_config()?;
/// let mut end: Coordinates = [0.0; 9];
/// end[0] = 0.1;
/// // 100 mm along X at 12 m/min, with 2.5 m/s² and 50 m/s³: 0.5 s and the ramps.
/// let motion = ProgramMotion {
///     line: 1,
///     kind: MotionKind::Line,
///     start: [0.0; 9],
///     end,
///     feed: Feed::Linear(0.2),
///     path_control: PathControl::ExactStop,
///     tcp_length: None,
/// };
/// let steps = [Ok::<_, std::io::Error>(ProgramStep::Motion(motion))];
/// let mut planner = PartProgramPlanner::new(steps.into_iter(), &machine, PlanOptions::default())?;
/// let mut last = None;
/// while let Some(setpoint) = planner.next_setpoint(1.0)? {
///     last = Some(setpoint);
/// }
/// assert_eq!(last.map(|setpoint| setpoint.psec()[0]), Some(0.1));
/// let ramps = 0.2 / 2.5 + 2.5 / 50.0;
/// assert!((planner.path_time() - (0.5 + ramps)).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct PartProgramPlanner<'a> {
    pub(super) ahead: LookAhead<'a>,
    limits: Vec<JointLimits>,
    pub(super) period: f64,
    pub(super) reserve: f64,
    /// Time in the first interval of the window, s.
    pub(super) local: f64,
    /// Duration of the intervals passed, s.
    pub(super) passed: f64,
    control: FeedControl,
    pub(super) is_started: bool,
    pub(super) is_finished: bool,
    pub(super) last: PlannedSetpoint,
    /// Filters of the setpoints, and the time and number of cycles by which they delay the end.
    pub(super) filters: Vec<MovingAverage>,
    pub(super) filter_time: f64,
    settling_cycles: usize,
}

impl<'a> PartProgramPlanner<'a> {
    /// Creates a planner for the steps of a program on a machine.
    ///
    /// # Errors
    /// Returns [`FeedPlanError`] if an option is invalid, or if the machine has too many axes.
    pub fn new<E: Into<StepError>>(
        steps: impl Iterator<Item = Result<ProgramStep, E>> + 'a,
        machine: &MachineConfig,
        options: PlanOptions,
    ) -> Result<Self, FeedPlanError> {
        let limits: Vec<JointLimits> = machine.axes().iter().map(JointLimits::from_axis).collect();
        if limits.len() > MAX_JOINTS {
            return Err(FeedPlanError::TooManyAxes { found: limits.len(), allowed: MAX_JOINTS });
        }
        check_options(&options)?;
        let axes = ProgramAxes::new(&limits);
        let kinematics = Kinematics::new(machine);
        let tip = match AxisRole::LINEAR.map(|role| kinematics.role(role)) {
            [Some(x), Some(y), Some(z)] => Some(TipToJoints::new(*kinematics.rotations(), [x, y, z])),
            _ => None,
        };
        let joints: Vec<LimitsConfig> = limits.iter().map(|joint| joint.limits).collect();
        let nanoseconds = machine.periods().position;
        let period = seconds(nanoseconds);
        let chord = 8.0 * options.chord_error / (period * period);
        let centripetal = options.centripetal_acceleration.min(chord);
        let slowest = joints.iter().map(|j| j.acceleration / j.jerk).fold(0.0, f64::max);
        let inverses = joints.iter().map(|joint| [1.0 / joint.acceleration, 1.0 / joint.jerk]).collect();
        let model = MachineModel { joints, inverses, kinds: axes.kinds.clone(), tip, centripetal };
        let steps = Box::new(steps.map(|step| step.map_err(Into::into)));
        let control = *machine.control();
        let is_trapezoidal = control.profile == ControlProfile::LinuxCnc;
        let tolerance = match is_trapezoidal {
            true => [control.corner_tolerance.unwrap_or(f64::INFINITY), f64::INFINITY],
            false => [options.blend_tolerance, options.rotary_tolerance],
        };
        let mut parts = PartSource::new(steps, axes, tolerance);
        parts.stops_at_auxiliaries = is_trapezoidal;
        let mut ahead = LookAhead::new(PieceSource::new(parts, options.knot_distance), Arc::new(model));
        ahead.trapezoid = is_trapezoidal.then(|| TrapezoidPlanner::new(control));
        let times =
            [control.filter_1, control.filter_2].into_iter().filter(|time| is_trapezoidal && *time > 0.0);
        let filter_time = times.clone().sum();
        let filters = times.clone().map(|time| MovingAverage::new(time, period)).collect();
        let settling_cycles = times.map(|time| (time / period).ceil() as usize).sum();
        let place = PathPlace { programmed_feed: f64::INFINITY, ..PathPlace::default() };
        let last = PlannedSetpoint {
            psec: ORIGIN,
            place,
            activity: ProgramActivity::default(),
            joints: limits.len(),
        };
        let control = FeedControl::new(&limits, nanoseconds, &ORIGIN[..limits.len()], 1.0);
        Ok(Self {
            ahead,
            period,
            reserve: 2.0 * slowest + 4.0 * period,
            local: 0.0,
            passed: 0.0,
            control,
            is_started: false,
            limits,
            is_finished: false,
            last,
            filters,
            filter_time,
            settling_cycles,
        })
    }

    /// Returns the time passed along the path, s: at a feed override of 100 % the time since the start, at the end of the
    /// program its duration.
    pub fn path_time(&self) -> f64 {
        self.passed + self.local
    }

    /// Returns the duration of the motions read at their programmed feeds, s, without ramps, rapid traverse and dwells; at
    /// the end of the program that of all motions.
    pub fn programmed_time(&self) -> f64 {
        self.ahead.source.programmed_time
    }

    /// Returns the number of intervals of the path planned so far, counted each time they were planned: the work of planning.
    pub fn planned_intervals(&self) -> u64 {
        self.ahead.planned_intervals
    }

    /// Returns the setpoints of the next position cycle, or `None` after the end of the program.
    ///
    /// `feed_override` is 0 to 2 (200 %). Up to 1 it scales the speed along the path, 0 is a feed hold; changes take effect
    /// at once, within the limits of the axes, and the setpoints stay on the path. Above 1 it scales the programmed feeds of
    /// the path beyond the look-ahead window, within the limits of the axes.
    ///
    /// # Errors
    /// Returns [`FeedPlanError`] with the source line.
    pub fn next_setpoint(&mut self, feed_override: f64) -> Result<Option<PlannedSetpoint>, FeedPlanError> {
        check_feed_override(feed_override)?;
        if self.is_finished && (!self.is_started || self.settling_cycles == 0) {
            return Ok(None);
        }
        let result = if self.is_finished {
            self.settling_cycles -= 1;
            Ok(Some(self.last))
        } else {
            self.cycle(feed_override)
        };
        if result.is_err() {
            (self.is_finished, self.settling_cycles) = (true, 0);
        }
        result.map(|setpoint| setpoint.map(|setpoint| self.filtered(setpoint)))
    }

    /// Returns a setpoint behind the filters.
    fn filtered(&mut self, setpoint: PlannedSetpoint) -> PlannedSetpoint {
        let psec = self.filters.iter_mut().fold(setpoint.psec, |psec, filter| filter.next(&psec));
        PlannedSetpoint { psec, ..setpoint }
    }

    fn cycle(&mut self, feed_override: f64) -> Result<Option<PlannedSetpoint>, FeedPlanError> {
        self.ahead.feed_factor = feed_override.max(1.0);
        if !self.is_started {
            if !self.start()? {
                return Ok(None);
            }
            self.control.start_at(feed_override);
            for (joint, &position) in self.last.psec().iter().enumerate() {
                self.control.exclude(joint, position);
            }
            self.check_travel_limits()?;
            return Ok(Some(self.last));
        }
        self.ahead.renew(self.passed, self.local + self.reserve)?;
        let factor = self
            .ahead
            .entries
            .front()
            .and_then(|entry| entry.piece.as_ref())
            .map_or(1.0, |piece| piece.feed_factor);
        let motion = Ahead {
            model: &self.ahead.model,
            entries: &self.ahead.entries,
            local: self.local,
            period: self.period,
        };
        let rate = self.control.advance(feed_override / factor, &motion);
        let ended = self.pass(rate, |_, _, _| ())?;
        self.set_state(ended, rate);
        self.control.record(self.last.psec());
        self.check_travel_limits()?;
        Ok(Some(self.last))
    }

    /// Reads the start of the program; returns false if it has no motion.
    pub(super) fn start(&mut self) -> Result<bool, FeedPlanError> {
        let start = self.ahead.start()?;
        (self.is_started, self.is_finished) = (true, start.is_none());
        self.last.psec = start.unwrap_or(ORIGIN);
        Ok(!self.is_finished)
    }

    /// Advances by one position period at the fraction `rate` of the planned speed. Returns the last interval of the program
    /// at its end. `visit` receives each interval, the time from its start, and the time passed in it.
    pub(super) fn pass(
        &mut self,
        rate: f64,
        mut visit: impl FnMut(&PlannedInterval, f64, f64),
    ) -> Result<Option<PlannedInterval>, FeedPlanError> {
        // Real time left in the cycle: a standstill takes its time at any rate.
        let (mut left, mut passed) = (self.period, None);
        loop {
            self.ahead.renew(self.passed, self.local + self.reserve)?;
            let Some(entry) = self.ahead.entries.front() else {
                self.is_finished = true;
                return Ok(passed);
            };
            let Some(motion) = entry.motion else { return Ok(None) };
            let pace = if motion.law == Law::Dwell { 1.0 } else { rate };
            if self.local + left * pace < motion.duration {
                visit(entry, self.local, left);
                self.local += left * pace;
                return Ok(None);
            }
            visit(entry, self.local, motion.duration - self.local);
            if pace > 0.0 {
                left -= (motion.duration - self.local) / pace;
            }
            self.local = 0.0;
            self.passed += motion.duration;
            passed = self.ahead.entries.pop_front();
        }
    }

    /// Sets the setpoints at the fraction `pace` of the planned speed; after the program, to the end of its last interval.
    fn set_state(&mut self, ended: Option<PlannedInterval>, pace: f64) {
        let Some(entry) = ended.as_ref().or(self.ahead.entries.front()) else { return };
        let standstill = entry.standstill;
        if let Some(activity) = standstill {
            self.last.activity = activity;
        }
        let (Some(motion), Some(piece)) = (&entry.motion, &entry.piece) else {
            self.last.place.path_rate = 0.0;
            return;
        };
        let state = motion.at(self.local);
        let (u, rate) = match ended {
            Some(_) => (piece.length, 0.0),
            None => ((entry.from + state.u).min(piece.length), pace * state.rate),
        };
        self.last.psec = self.ahead.model.joints(piece, u)[0];
        self.last.place.path_position = piece.start + u;
        self.last.place.path_rate = rate;
        let position = self.last.place.path_position;
        let marks = &mut self.ahead.source.marks;
        while marks.len() > 1 && marks[0].end < position {
            marks.pop_front();
        }
        if let Some(mark) = marks.front() {
            self.last.place.line = mark.line;
            self.last.place.programmed_feed = mark.feed;
            if standstill.is_none() {
                let kind = if mark.feed.is_infinite() { TimeKind::Rapid } else { TimeKind::Feed };
                self.last.activity = ProgramActivity { kind, line: mark.line, tool: mark.tool };
            }
        }
    }

    pub(super) fn check_travel_limits(&self) -> Result<(), FeedPlanError> {
        for (joint, &position) in self.limits.iter().zip(&self.last.psec) {
            if !joint.is_within_travel(position) {
                return Err(FeedPlanError::OutsideTravelLimits {
                    line: self.last.place.line,
                    axis: joint.name.clone(),
                    unit: joint.unit(),
                    position,
                    min: joint.limits.travel_min,
                    max: joint.limits.travel_max,
                });
            }
        }
        Ok(())
    }
}

fn check_options(options: &PlanOptions) -> Result<(), FeedPlanError> {
    let finite = [
        ("blend_tolerance", options.blend_tolerance),
        ("rotary_tolerance", options.rotary_tolerance),
        ("knot_distance", options.knot_distance),
    ];
    for (name, value) in finite {
        if !(value > 0.0 && value.is_finite()) {
            return Err(FeedPlanError::InvalidOption { name, value, allowed: "a positive finite number" });
        }
    }
    let positive = [
        ("centripetal_acceleration", options.centripetal_acceleration),
        ("chord_error", options.chord_error),
    ];
    for (name, value) in positive {
        if value.is_nan() || value <= 0.0 {
            return Err(FeedPlanError::InvalidOption { name, value, allowed: "a positive number" });
        }
    }
    Ok(())
}
