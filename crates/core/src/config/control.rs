//! Trajectory planner of the control: how a part program becomes setpoints.

use super::declaration::{choice_of, parameters};
use super::definition::DefaultValue::{Flag, Integer, Number, Text};
use super::definition::{ParameterDefinition, choice, flag, integer, number};
use crate::units::{METER_PER_MINUTE, MILLIMETER, MILLISECOND};

/// Key of the profile.
pub(super) const PROFILE: &str = "control.profile";

crate::named_values! {
    /// Name of a profile of the control.
    pub enum ControlProfile {
        /// Time-optimal within the velocity, acceleration and jerk limits of the axes.
        Own = "own",
        /// Trapezoidal, as LinuxCNC.
        LinuxCnc = "linuxcnc",
    }
}

crate::named_values! {
    /// Name of a rule for corners in G64.
    pub enum CornerRule {
        /// Arc that touches both motions, within P.
        Arc = "arc",
        /// Stop.
        Stop = "stop",
        /// The change of the velocity has a limit.
        VelocityStep = "velocity_step",
        /// The speed is that of an arc within P, which is not moved along.
        Deviation = "deviation",
    }
}

/// Defines a time of a filter.
const fn filter(key: &'static str) -> ParameterDefinition {
    number(key, "ms", 0.0, 1000.0).zero().si(MILLISECOND)
}

/// Defines a fraction.
const fn fraction(key: &'static str, value: f64) -> ParameterDefinition {
    number(key, "", 0.01, 1.0).default(Number(value))
}

parameters! {
    /// Trajectory planner of the control.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct ControlConfig of Machine {
        /// Trajectory planner of part programs: own is time-optimal within the velocity, acceleration and jerk limits of the
        /// axes; linuxcnc has a trapezoidal speed within their velocity and acceleration limits, and the rules that the other
        /// parameters of the group describe.
        pub profile: ControlProfile = choice(PROFILE, ControlProfile::NAMES).default(Text("own")) => choice_of;
        /// Speed limit of X, Y and Z along the path, also at rapid traverse, with control.profile linuxcnc (MAX_LINEAR_VELOCITY
        /// of the section TRAJ); 0 is no limit besides those of the axes.
        pub path_velocity: Option<f64> =
            number("control.path_velocity_m_min", "m/min", 0.0, 1e4).zero().si(METER_PER_MINUTE);
        /// Fraction of the acceleration limits that arcs and corners may use normal to the path, with control.profile
        /// linuxcnc.
        pub normal_fraction: f64 = fraction("control.normal_fraction", 0.866);
        /// Fraction of the acceleration limits that arcs and corners may use along the path, with control.profile linuxcnc.
        pub tangential_fraction: f64 = fraction("control.tangential_fraction", 0.5);
        /// Fraction of the acceleration limits of motions that overlap: with rotary axes, helices, and before a standstill in
        /// G64, with control.profile linuxcnc.
        pub overlap_fraction: f64 = fraction("control.overlap_fraction", 0.5);
        /// Fraction of the acceleration limits that a change of direction may use in one block cycle with G61, with
        /// control.profile linuxcnc; the rest limits the motion (ARC_BLEND_KINK_RATIO of the section TRAJ).
        pub kink_fraction: f64 =
            number("control.kink_fraction", "", 1e-3, 0.9).default(Number(0.1));
        /// Rule for corners of lines and arcs in G64, with control.profile linuxcnc: arc, an arc that touches both motions
        /// within P; stop; velocity_step, the exact path with at most the change of velocity control.corner_velocity_m_min;
        /// deviation, the exact path at the speed of an arc within P. Motions of rotary axes overlap with arc, and stop
        /// otherwise.
        pub corners: CornerRule = choice("control.corners", CornerRule::NAMES).default(Text("arc")) => choice_of;
        /// Largest change of the velocity in a corner, with control.corners velocity_step.
        pub corner_velocity: f64 =
            number("control.corner_velocity_m_min", "m/min", 1e-6, 1e4).default(Number(0.5)).si(METER_PER_MINUTE);
        /// True if the jerk limits of the axes hold along the path, with control.profile linuxcnc: the acceleration is 0 where
        /// two motions meet.
        pub is_jerk_limited: bool = flag("control.jerk_limited").default(Flag(false));
        /// Time of a moving average of the setpoints of each axis, with control.profile linuxcnc; 0 is no filter. The control
        /// waits for the end of filtered motions at standstills and in G61.1.
        pub filter_1: f64 = filter("control.filter_1_ms");
        /// Time of a second moving average of the setpoints.
        pub filter_2: f64 = filter("control.filter_2_ms");
        /// Deviation of G64 without P, with control.profile linuxcnc; 0 is no limit: as much as the feed needs.
        pub corner_tolerance: Option<f64> =
            number("control.corner_tolerance_mm", "mm", 0.0, 1e3).zero().si(MILLIMETER);
        /// Number of blocks ahead at whose end the control can stop, corners included, with control.profile linuxcnc
        /// (ARC_BLEND_OPTIMIZATION_DEPTH of the section TRAJ).
        pub look_ahead: usize = integer("control.look_ahead", "blocks", 1, 5000).default(Integer(50));
        /// Shortest duration of a block, with control.profile linuxcnc: its servo period.
        pub block_cycle: f64 = number("control.block_cycle_ms", "ms", 0.01, 100.0).default(Number(1.0)).si(MILLISECOND);
        /// Number of block cycles; the rest of a line before a corner that is shorter at the feed has the acceleration of the
        /// corner, with control.profile linuxcnc (ARC_BLEND_GAP_CYCLES of the section TRAJ).
        pub gap_cycles: f64 = number("control.gap_cycles", "", 0.0, 1e4).default(Number(4.0));
        /// Duration of the wait for the end of the motion at dwells, stops and changes of tool and spindle, in addition to
        /// theirs, with control.profile linuxcnc.
        pub wait: f64 = number("control.wait_ms", "ms", 0.0, 1e4).default(Number(25.0)).si(MILLISECOND);
    }
}

impl Default for ControlConfig {
    fn default() -> Self {
        Self {
            profile: ControlProfile::Own,
            path_velocity: None,
            normal_fraction: 0.866,
            tangential_fraction: 0.5,
            overlap_fraction: 0.5,
            kink_fraction: 0.1,
            corners: CornerRule::Arc,
            corner_velocity: 0.5 * METER_PER_MINUTE,
            is_jerk_limited: false,
            filter_1: 0.0,
            filter_2: 0.0,
            corner_tolerance: None,
            look_ahead: 50,
            block_cycle: MILLISECOND,
            gap_cycles: 4.0,
            wait: 25.0 * MILLISECOND,
        }
    }
}

impl ControlConfig {
    /// Returns true if setpoints of the control keep the jerk limits of the axes.
    pub fn has_jerk_limits(&self) -> bool {
        self.profile == ControlProfile::Own || self.is_jerk_limited
    }

    /// Returns the time by which the filters of the setpoints delay the end of a motion, s.
    pub fn filter_time(&self) -> f64 {
        self.filter_1 + self.filter_2
    }
}
