//! Machines of the stress test: each machine with every kind of controller.

use std::sync::Arc;

use super::energy::DriveEnergy;
use super::linear_axis::LinearAxis;
use super::response::ImpulseResponses;
use virtual_axes_core::config::{
    Assignment, AxisConfig, ConfigError, MachineConfig, Parameters, Value, ValueSource,
};
use virtual_axes_core::machine::MachineError;
use virtual_axes_core::simulation::{SimulationError, joint_limits};
use virtual_axes_core::trajectory::JointLimits;
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Largest number of ticks of a trajectory.
pub const MAX_TICKS: usize = 3072;

/// Error in the setup of the test machines.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TestMachinesError {
    /// The list of machines is empty.
    #[error("no machines are given, at least one is required")]
    Empty,
    /// A machine rejects the parameters of a controller.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The controller of an axis cannot be designed.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// A machine cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// An axis has a property that the independent checks do not contain.
    #[error(
        "{machine}: axis {axis} has {property}, the checks of the stress test are those of the paper's model; \
         remove the parameters {keys}"
    )]
    Extended {
        /// Name of the machine.
        machine: String,
        /// Name of the axis.
        axis: String,
        /// Property, as a noun phrase.
        property: &'static str,
        /// Parameters that it comes from.
        keys: &'static str,
    },
    /// Machine with axes that are coupled mechanically, which the independent checks do not contain.
    #[error(
        "{machine}: axes are coupled, the checks of the stress test are those of the paper's model; remove the \
         parameters workpiece and gantry"
    )]
    Coupled {
        /// Name of the machine.
        machine: String,
    },
    /// The position cycle of a machine has too many ticks.
    #[error(
        "{machine}: a position cycle has {ticks} current cycles, at most {most} are allowed in the stress test",
        most = MAX_TICKS / MIN_PERIODS
    )]
    Ticks {
        /// Name of the machine.
        machine: String,
        /// Ticks of its position cycle.
        ticks: usize,
    },
}

/// Smallest number of position cycles of the longest trajectory.
const MIN_PERIODS: usize = 32;

/// Controller settings of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Law {
    Cascade,
    NoFeedforward,
    VelocityFeedforward,
    TorqueFeedforward,
    FrictionCompensation,
    Gpc,
    Rst,
}

impl Law {
    /// Returns the parameter assignments for joint `axis`.
    fn assignments(self, machine: &Parameters, axis: &AxisConfig) -> Vec<Assignment> {
        let set = |key: &str, value| Assignment {
            key: format!("{}.{key}", axis.name),
            value,
            source: ValueSource::named("stress"),
        };
        let controller = |name: &str| set("position_loop.controller", Value::Text(name.to_owned()));
        let of_screw = format!("{}.feedforward.torque_kg_m2", axis.name);
        let has_screw = machine.iter().any(|(key, _)| key == of_screw);
        let torque = if has_screw { "feedforward.torque_kg_m2" } else { "feedforward.torque_kg" };
        let off = |key: &str| set(key, Value::Double(0.0));
        match self {
            Law::Cascade => vec![controller("cascade")],
            Law::NoFeedforward => vec![controller("cascade"), off("feedforward.velocity"), off(torque)],
            Law::VelocityFeedforward => vec![controller("cascade"), off(torque)],
            Law::TorqueFeedforward => vec![controller("cascade"), off("feedforward.velocity")],
            Law::FrictionCompensation => {
                vec![controller("cascade"), set("feedforward.friction", Value::Double(1.0))]
            }
            Law::Gpc => vec![controller("gpc")],
            Law::Rst => {
                // The proportional gain of the axis, spread over two cycles each of position and setpoint.
                let gain = axis.position_loop.gain;
                let list = |values: &[f64]| Value::DoubleList(values.to_vec());
                vec![
                    controller("rst"),
                    set("position_loop.rst.r", list(&[1.2 * gain, -0.2 * gain])),
                    set("position_loop.rst.s", list(&[1.0, 0.1])),
                    set("position_loop.rst.t", list(&[0.4 * gain, 0.6 * gain])),
                    set("position_loop.rst.t_first", Value::Integer(-1)),
                ]
            }
        }
    }
}

/// Variants of a machine: name, and controller settings that are assigned to its axes in turn.
const VARIANTS: [(&str, &[Law]); 8] = [
    ("cascade", &[Law::Cascade]),
    ("cascade without feedforward", &[Law::NoFeedforward]),
    ("cascade, velocity feedforward", &[Law::VelocityFeedforward]),
    ("cascade, torque feedforward", &[Law::TorqueFeedforward]),
    ("cascade, friction compensation", &[Law::FrictionCompensation]),
    ("gpc", &[Law::Gpc]),
    ("rst", &[Law::Rst]),
    ("mixed", &[Law::Gpc, Law::FrictionCompensation, Law::Rst, Law::Cascade, Law::NoFeedforward]),
];

/// Reference model of an axis, computed before the simulation.
#[derive(Debug)]
pub struct ReferenceModel {
    /// Energy model.
    pub energy: DriveEnergy,
    /// Impulse responses.
    pub response: ImpulseResponses,
    /// Preview: setpoints ahead of the present one that the controller reads.
    pub preview: usize,
    /// True if the position controller has a fallback controller.
    pub has_fallback: bool,
    /// True if friction compensation is active.
    pub is_compensated: bool,
}

/// Machine with one set of controllers.
#[derive(Debug)]
pub struct MachineVariant {
    /// Name of the machine.
    pub machine: String,
    /// Name of the set of controllers.
    pub controllers: &'static str,
    /// Configuration.
    pub config: MachineConfig,
    /// Joint limits.
    pub joints: Vec<JointLimits>,
    /// Reference models of the axes.
    pub(super) axes: Vec<ReferenceModel>,
}

impl MachineVariant {
    fn new(base: &Parameters, name: &'static str, laws: &[Law]) -> Result<Self, TestMachinesError> {
        let machine = base.machine_config()?;
        let of_axis = |(axis, law): (&AxisConfig, &Law)| law.assignments(base, axis);
        let mut parameters = base.clone();
        parameters.set_all(machine.axes().iter().zip(laws.iter().cycle()).flat_map(of_axis).collect())?;
        let config = parameters.machine_config()?;
        let periods = config.periods();
        let longest = MAX_TICKS / periods.ticks_per_position() as usize;
        let model = |axis: &AxisConfig| {
            let linear = LinearAxis::new(axis, &periods)
                .map_err(|source| MachineError::Axis { axis: axis.name.clone(), source })?;
            Ok(ReferenceModel {
                energy: DriveEnergy::new(axis, seconds(periods.current)),
                response: ImpulseResponses::new(&linear, longest),
                preview: linear.preview(),
                has_fallback: linear.has_fallback(),
                is_compensated: axis.feedforward.friction != 0.0,
            })
        };
        let axes = config.axes().iter().map(model).collect::<Result<_, MachineError>>()?;
        let joints = joint_limits(&config, "");
        Ok(MachineVariant { machine: config.name().to_owned(), controllers: name, config, joints, axes })
    }

    /// Returns Tsp, ns.
    pub fn period(&self) -> Nanoseconds {
        self.config.periods().position
    }

    /// Returns the ticks of a position cycle.
    pub fn ticks(&self) -> usize {
        self.config.periods().ticks_per_position() as usize
    }

    /// Returns the largest number of position cycles of a trajectory.
    pub fn longest(&self) -> usize {
        MAX_TICKS / self.ticks()
    }
}

/// Machines with all sets of controllers, shared by all threads.
#[derive(Debug, Clone)]
pub struct TestMachines {
    variants: Arc<[MachineVariant]>,
}

/// Rejects an axis with a property that the independent checks do not contain.
fn reject_extended(machine: &str, axis: &AxisConfig) -> Result<(), TestMachinesError> {
    let has_terms = axis.stribeck.current > 0.0 || axis.stribeck.viscous > 0.0;
    let (property, keys) = match axis {
        _ if axis.transmission.is_some() => {
            ("an elastic transmission", "transmission.stiffness and transmission.load")
        }
        _ if axis.presliding.is_some() => ("friction with presliding", "friction.presliding"),
        _ if has_terms => ("Stribeck or viscous friction", "friction.stribeck and friction.viscous"),
        _ => return Ok(()),
    };
    let (machine, axis) = (machine.to_owned(), axis.name().to_owned());
    Err(TestMachinesError::Extended { machine, axis, property, keys })
}

impl TestMachines {
    /// Creates all variants of `machines`.
    ///
    /// # Errors
    /// [`TestMachinesError`] if the list is empty, or if a machine rejects a controller, has a property beyond the paper's
    /// model or too many ticks.
    pub fn new(machines: &[Parameters]) -> Result<Self, TestMachinesError> {
        let mut variants = Vec::new();
        for machine in machines {
            let config = machine.machine_config()?;
            let ticks = config.periods().ticks_per_position() as usize;
            if ticks * MIN_PERIODS > MAX_TICKS {
                return Err(TestMachinesError::Ticks { machine: config.name().to_owned(), ticks });
            }
            if config.has_coupled_axes() {
                return Err(TestMachinesError::Coupled { machine: config.name().to_owned() });
            }
            config.axes().iter().try_for_each(|axis| reject_extended(config.name(), axis))?;
            for (name, laws) in VARIANTS {
                variants.push(MachineVariant::new(machine, name, laws)?);
            }
        }
        if variants.is_empty() {
            return Err(TestMachinesError::Empty);
        }
        Ok(TestMachines { variants: variants.into() })
    }

    /// Creates all variants of the shipped machines.
    ///
    /// # Errors
    /// [`TestMachinesError`] if a shipped machine rejects a controller, which the tests exclude.
    pub fn shipped() -> Result<Self, TestMachinesError> {
        let machines: Result<Vec<_>, _> = Parameters::builtin_names().map(Parameters::builtin).collect();
        Self::new(&machines?)
    }

    /// Returns the machine variants.
    pub fn variants(&self) -> &[MachineVariant] {
        &self.variants
    }
}
