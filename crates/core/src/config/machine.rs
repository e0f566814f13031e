//! Machine in SI units: axes, kinematics, sampling periods and couplings.
//!
//! [`Parameters::machine_config`](super::Parameters::machine_config) returns it, after the parameters were checked against
//! the schema.
//!
//! Equation numbers in descriptions refer to Prévost, Lavernhe, Lartigue, Dumur: *Feed drive modelling for the simulation of
//! tool path tracking in multi-axis High Speed Machining*.

use super::axis::{AxisConfig, MAX_GAIN};
use super::control::ControlConfig;
use super::declaration::{CheckedValues, Definitions, Field, numbers_of, parameters};
use super::definition::{ParameterDefinition, number, text, texts};
use super::part_program::PartProgramConfig;
use super::rotary_chain::RotaryChain;
use crate::units::{
    MICROSECOND_NS, MILLIMETER, MILLISECOND_NS, NEWTON_PER_MICROMETER, Nanoseconds, POSITION_GAIN,
};

/// Maximum distance in a machine, mm; the largest gantries have some tens of meters.
const MAX_DISTANCE_MM: f64 = 1e5;

/// Defines a sampling period, µs; the resolution of the pacing in the node is 1 µs.
const fn period_us(key: &'static str) -> ParameterDefinition {
    number(key, "µs", 1.0, 50e3).si(MICROSECOND_NS as f64)
}

/// Defines a coordinate in the machine frame, whose origin is the home position.
const fn coordinate(key: &'static str) -> ParameterDefinition {
    number(key, "mm", -MAX_DISTANCE_MM, MAX_DISTANCE_MM).zero().si(MILLIMETER)
}

/// Defines a principal moment of inertia of the workpiece.
const fn moment(key: &'static str) -> ParameterDefinition {
    number(key, "kg·m²", 0.0, 1e6).zero()
}

parameters! {
    /// Machine: axes, kinematics and sampling periods.
    #[derive(Debug, Clone, PartialEq)]
    pub struct MachineConfig of Machine {
        /// Name of the machine.
        pub(crate) name: String = text("machine");
        /// Names of the axes, in the order of messages and tables.
        pub(crate) axes: Vec<AxisConfig> = texts("joints") => |values: &CheckedValues<'_>, _| values.of_axes();
        /// Sampling periods.
        pub(crate) periods: Periods;
        /// Pivots, tool length and workpiece frame.
        pub(crate) kinematics: KinematicsConfig;
        /// Gain of cross-coupled control of X, Y and Z, feedback of the contour error; 0 disables it.
        pub(crate) contour_gain: f64 =
            number("contour_control.gain", "(m/min)/mm", 0.0, MAX_GAIN).zero().live().si(POSITION_GAIN);
        /// Workpiece that couples A and C; `None` without one.
        pub(crate) workpiece: Option<WorkpieceConfig>
            => |values, _| Some(WorkpieceConfig::read(values).filter(|workpiece| workpiece.mass > 0.0));
        use WorkpieceConfig;
        /// Beam that couples two linear axes; `None` without one.
        pub(crate) gantry: Option<GantryConfig>;
        /// Set-up for part programs.
        pub(crate) part_program: PartProgramConfig;
        /// Trajectory planner of part programs.
        pub(crate) control: ControlConfig;
    }
}

parameters! {
    /// Sampling periods of the three loops, each an integer multiple of the next (Prévost Appendix 2).
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Periods of Machine {
        /// Tsp, period of the position cycle, a multiple of periods.velocity_us.
        pub position: Nanoseconds = number("periods.position_ms", "ms", 1e-3, 50.0).si(MILLISECOND_NS as f64);
        /// Tsv, period of the velocity cycle, a multiple of periods.current_us.
        pub velocity: Nanoseconds = period_us("periods.velocity_us");
        /// Tsi, period of the current cycle.
        pub current: Nanoseconds = period_us("periods.current_us");
    }
}

impl Periods {
    /// Returns the number of current cycles per position cycle.
    pub fn ticks_per_position(&self) -> u64 {
        (self.position / self.current) as u64
    }

    /// Returns the number of current cycles per velocity cycle.
    pub fn ticks_per_velocity(&self) -> u64 {
        (self.velocity / self.current) as u64
    }
}

parameters! {
    /// Kinematic chain from the workpiece to the tool: coordinates in the machine frame with every axis at home, m.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct KinematicsConfig of Machine {
        /// Rotary joints from the workpiece to the tool: tables, then xyz, then heads, for example [c, a, xyz],
        /// [c, xyz, b] or [xyz, c, a]; by default c and a, or b without a, are tables.
        pub chain: RotaryChain = texts("kinematics.chain").optional() => RotaryChain::read;
        /// Tool length along -Z, from the point moved by X, Y and Z (the origin at home) to the tool tip.
        pub tool_length: f64 = number("kinematics.tool_length_mm", "mm", 0.0, MAX_DISTANCE_MM).zero().si(MILLIMETER);
        /// Y of the rotation axis of A, which is parallel to X.
        pub pivot_a: [f64; 2] = coordinate("kinematics.pivot_a_y_mm"),
            /// Z of the rotation axis of A, which is parallel to X.
            = coordinate("kinematics.pivot_a_z_mm")
            => numbers_of;
        /// X of the rotation axis of B, which is parallel to Y.
        pub pivot_b: [f64; 2] = coordinate("kinematics.pivot_b_x_mm"),
            /// Z of the rotation axis of B, which is parallel to Y.
            = coordinate("kinematics.pivot_b_z_mm")
            => numbers_of;
        /// X of the rotation axis of C, which is parallel to Z while A is at 0.
        pub pivot_c: [f64; 2] = coordinate("kinematics.pivot_c_x_mm"),
            /// Y of the rotation axis of C, which is parallel to Z while A is at 0.
            = coordinate("kinematics.pivot_c_y_mm")
            => numbers_of;
        /// X of the origin of the workpiece frame.
        pub workpiece: [f64; 3] = coordinate("kinematics.workpiece_x_mm"),
            /// Y of the origin of the workpiece frame.
            = coordinate("kinematics.workpiece_y_mm"),
            /// Z of the origin of the workpiece frame.
            = coordinate("kinematics.workpiece_z_mm")
            => numbers_of;
    }
}

parameters! {
    /// Workpiece on the table of C, which couples A and C; a body in addition to the inertias of both axes.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct WorkpieceConfig of Machine {
        /// Mass of the workpiece on the tables of A and C, in addition to the inertias of the axes; 0 is no workpiece.
        pub mass: f64 = number("workpiece.mass_kg", "kg", 0.0, 5e4).zero();
        /// X of the center of mass of the workpiece, in the workpiece frame.
        pub center_of_mass: [f64; 3] = coordinate("workpiece.center_of_mass_x_mm"),
            /// Y of the center of mass of the workpiece, in the workpiece frame.
            = coordinate("workpiece.center_of_mass_y_mm"),
            /// Z of the center of mass of the workpiece, in the workpiece frame.
            = coordinate("workpiece.center_of_mass_z_mm")
            => numbers_of;
        /// Principal moment of inertia about the center of mass, parallel to X of the workpiece frame.
        pub moments: [f64; 3] = moment("workpiece.inertia_x_kg_m2"),
            /// Principal moment of inertia about the center of mass, parallel to Y of the workpiece frame.
            = moment("workpiece.inertia_y_kg_m2"),
            /// Principal moment of inertia about the center of mass, parallel to Z of the workpiece frame.
            = moment("workpiece.inertia_z_kg_m2")
            => numbers_of;
    }
}

parameters! {
    /// Beam between the two linear axes of a gantry, whose indices in `joints` are `axes`: a spring and a damper between
    /// their positions.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct GantryConfig of Machine {
        /// Names of the two linear axes of a gantry, which a beam couples.
        pub axes: [usize; 2] = texts("gantry.axes").optional() => indices;
        /// Stiffness of the beam between the positions of both axes of the gantry.
        pub stiffness: f64 = number("gantry.stiffness_n_um", "N/µm", 0.0, 1e6).zero().si(NEWTON_PER_MICROMETER);
        /// Damping of the beam between the velocities of both axes of the gantry.
        pub damping: f64 = number("gantry.damping_n_s_m", "N/(m/s)", 0.0, 1e9).zero();
    }
}

/// Returns the indices of joints.
fn indices<const N: usize>(values: &CheckedValues<'_>, rows: Definitions) -> Option<[usize; N]> {
    let index = |name: &String| values.joints.iter().position(|joint| joint.name == *name);
    let indices: Option<Vec<usize>> = <Vec<String>>::read(values, rows)?.iter().map(index).collect();
    indices?.try_into().ok()
}

impl MachineConfig {
    /// Creates an unnamed machine with a single axis and default kinematics, without checking the values against the
    /// schema: a changed copy of a checked [`AxisConfig`] can be simulated.
    pub fn from_axis(axis: AxisConfig, periods: Periods) -> Self {
        MachineConfig {
            name: String::new(),
            periods,
            kinematics: KinematicsConfig::default(),
            axes: vec![axis],
            contour_gain: 0.0,
            workpiece: None,
            gantry: None,
            part_program: PartProgramConfig::default(),
            control: ControlConfig::default(),
        }
    }

    /// Returns the gain of cross-coupled control, 1/s; 0 without it.
    pub fn contour_gain(&self) -> f64 {
        self.contour_gain
    }

    /// Returns the workpiece that couples the tables of A and C; `None` without one.
    pub fn workpiece(&self) -> Option<&WorkpieceConfig> {
        self.workpiece.as_ref()
    }

    /// Returns the beam that couples the two linear axes of a gantry; `None` without one.
    pub fn gantry(&self) -> Option<&GantryConfig> {
        self.gantry.as_ref()
    }

    /// Returns the set-up for part programs.
    pub fn part_program(&self) -> &PartProgramConfig {
        &self.part_program
    }

    /// Returns the trajectory planner of part programs.
    pub fn control(&self) -> &ControlConfig {
        &self.control
    }

    /// Returns true if axes are coupled mechanically, by a workpiece or the beam of a gantry.
    pub fn has_coupled_axes(&self) -> bool {
        self.workpiece.is_some() || self.gantry.is_some()
    }

    /// Returns the machine without velocity and travel limits of trajectories, for setpoints that may exceed them.
    #[must_use]
    pub fn without_trajectory_limits(&self) -> Self {
        let mut machine = self.clone();
        for axis in &mut machine.axes {
            axis.limits.velocity = f64::INFINITY;
            (axis.limits.travel_min, axis.limits.travel_max) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        machine
    }

    /// Returns the name of the machine.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the sampling periods.
    pub fn periods(&self) -> Periods {
        self.periods
    }

    /// Returns pivots, tool length and workpiece frame.
    pub fn kinematics(&self) -> &KinematicsConfig {
        &self.kinematics
    }

    /// Returns the axes in the order of `joints`.
    pub fn axes(&self) -> &[AxisConfig] {
        &self.axes
    }
}
