//! The machines that trajectories are run on: each with every kind of controller.

use std::sync::Arc;

use super::energy::DriveEnergy;
use super::linear::LinearAxis;
use super::response::Response;
use virtual_axes_core::config::{
    Assignment, AxisConfig, ConfigError, MachineConfig, Parameters, Source, Value,
};
use virtual_axes_core::machine::MachineError;
use virtual_axes_core::simulation::{SimulationError, joints};
use virtual_axes_core::trajectory::JointLimits;
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Most ticks of a trajectory.
pub const MOST_TICKS: usize = 3072;

/// Why there are no machines to run on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FleetError {
    /// There is none.
    #[error("there must be a machine to run on")]
    Empty,
    /// A machine does not take a controller.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// An axis has no such controller.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// A machine cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A machine whose position period has too many ticks.
    #[error(
        "{machine}: a position period has {ticks} ticks of the current loop; at most {most} are allowed here",
        most = MOST_TICKS / FEWEST_PERIODS
    )]
    Ticks {
        /// Name of the machine.
        machine: String,
        /// What it has.
        ticks: usize,
    },
}

/// Fewest position periods that must fit into the longest trajectory.
const FEWEST_PERIODS: usize = 32;

/// What an axis is under.
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
    /// What is set for joint `axis`.
    fn assignments(self, machine: &Parameters, axis: &AxisConfig) -> Vec<Assignment> {
        let set = |key: &str, value| Assignment {
            key: format!("{}.{key}", axis.name),
            value,
            source: Source::named("stress"),
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
                // The axis's own proportional gain, spread over two instants each of position and setpoint.
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

/// The variants of a machine: a name, and what its axes are under, in turns.
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

/// An axis with what is known of it beforehand.
#[derive(Debug)]
pub struct Theory {
    /// Its energy.
    pub energy: DriveEnergy,
    /// Its responses.
    pub response: Response,
    /// Setpoints ahead of the present one that its controller reads.
    pub ahead: usize,
    /// Whether its controller has a guard.
    pub guarded: bool,
    /// Whether friction is compensated.
    pub compensated: bool,
}

/// A machine with controllers.
#[derive(Debug)]
pub struct Variant {
    /// Name of the machine.
    pub machine: String,
    /// Which controllers.
    pub controllers: &'static str,
    /// Its configuration.
    pub config: MachineConfig,
    /// Its joints.
    pub joints: Vec<JointLimits>,
    /// Its axes.
    pub(super) axes: Vec<Theory>,
}

impl Variant {
    fn new(base: &Parameters, name: &'static str, laws: &[Law]) -> Result<Self, FleetError> {
        let machine = base.machine_config()?;
        let of_axis = |(axis, law): (&AxisConfig, &Law)| law.assignments(base, axis);
        let mut parameters = base.clone();
        parameters.set_all(machine.axes().iter().zip(laws.iter().cycle()).flat_map(of_axis).collect())?;
        let config = parameters.machine_config()?;
        let periods = config.periods();
        let longest = MOST_TICKS / periods.ticks_per_position() as usize;
        let theory = |axis: &AxisConfig| {
            let linear = LinearAxis::new(axis, &periods)
                .map_err(|source| MachineError::Axis { axis: axis.name.clone(), source })?;
            Ok(Theory {
                energy: DriveEnergy::new(axis, seconds(periods.current)),
                response: Response::new(&linear, longest),
                ahead: linear.ahead(),
                guarded: linear.is_guarded(),
                compensated: axis.feedforward.friction != 0.0,
            })
        };
        let axes = config.axes().iter().map(theory).collect::<Result<_, MachineError>>()?;
        let joints = joints(&config, "");
        Ok(Variant { machine: config.name().to_owned(), controllers: name, config, joints, axes })
    }

    /// Tsp, ns.
    pub fn period(&self) -> Nanoseconds {
        self.config.periods().position
    }

    /// Ticks of a position period.
    pub fn ticks(&self) -> usize {
        self.config.periods().ticks_per_position() as usize
    }

    /// Most position periods of a trajectory.
    pub fn longest(&self) -> usize {
        MOST_TICKS / self.ticks()
    }
}

/// Machines with all of their controllers; shared by all threads.
#[derive(Debug, Clone)]
pub struct Fleet {
    variants: Arc<[Variant]>,
}

impl Fleet {
    /// The fleet of `machines`.
    ///
    /// # Errors
    /// [`FleetError`].
    pub fn new(machines: &[Parameters]) -> Result<Self, FleetError> {
        let mut variants = Vec::new();
        for machine in machines {
            let config = machine.machine_config()?;
            let ticks = config.periods().ticks_per_position() as usize;
            if ticks * FEWEST_PERIODS > MOST_TICKS {
                return Err(FleetError::Ticks { machine: config.name().to_owned(), ticks });
            }
            for (name, laws) in VARIANTS {
                variants.push(Variant::new(machine, name, laws)?);
            }
        }
        if variants.is_empty() {
            return Err(FleetError::Empty);
        }
        Ok(Fleet { variants: variants.into() })
    }

    /// The machines that come with the program.
    ///
    /// # Errors
    /// None, as the tests show.
    pub fn shipped() -> Result<Self, FleetError> {
        let machines: Result<Vec<_>, _> = Parameters::builtin_names().map(Parameters::builtin).collect();
        Self::new(&machines?)
    }

    /// Its machines.
    pub fn variants(&self) -> &[Variant] {
        &self.variants
    }
}
