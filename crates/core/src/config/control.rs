//! Trajectory planner of the control: how a part program becomes setpoints.

use super::declaration::{choice_of, parameters};
use super::definition::DefaultValue::{Integer, Number, Text};
use super::definition::{ParameterDefinition, choice, integer, number};
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
            corner_tolerance: None,
            look_ahead: 50,
            block_cycle: MILLISECOND,
            gap_cycles: 4.0,
            wait: 25.0 * MILLISECOND,
        }
    }
}
