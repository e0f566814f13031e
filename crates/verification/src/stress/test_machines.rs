//! Machines of the stress test: each machine with every kind of controller.

use std::error::Error;
use std::sync::Arc;

use super::energy::DriveEnergy;
use super::linear_axis::LinearAxis;
use super::response::ImpulseResponses;
use virtual_axes_core::config::{
    Assignment, AxisConfig, ControllerName, MachineConfig, Parameters, Value, ValueSource,
};
use virtual_axes_core::machine::MachineError;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::trajectory::JointLimits;
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Largest number of ticks of a trajectory.
pub const MAX_TICKS: usize = 3072;

/// Machine that cannot be tested, with the reason.
pub type TestMachinesError = Box<dyn Error + Send + Sync>;

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
        let controller =
            |name: ControllerName| set("position_loop.controller", Value::Text(name.to_string()));
        let of_screw = format!("{}.feedforward.torque_kg_m2", axis.name);
        let has_screw = machine.iter().any(|(key, _)| key == of_screw);
        let torque = if has_screw { "feedforward.torque_kg_m2" } else { "feedforward.torque_kg" };
        let off = |key: &str| set(key, Value::Double(0.0));
        match self {
            Law::Cascade => vec![controller(ControllerName::Cascade)],
            Law::NoFeedforward => {
                vec![controller(ControllerName::Cascade), off("feedforward.velocity"), off(torque)]
            }
            Law::VelocityFeedforward => vec![controller(ControllerName::Cascade), off(torque)],
            Law::TorqueFeedforward => vec![controller(ControllerName::Cascade), off("feedforward.velocity")],
            Law::FrictionCompensation => {
                vec![controller(ControllerName::Cascade), set("feedforward.friction", Value::Double(1.0))]
            }
            Law::Gpc => vec![controller(ControllerName::Gpc)],
            Law::Rst => {
                // The proportional gain of the axis, spread over two cycles each of position and setpoint.
                let gain = axis.position_loop.gain;
                let list = |values: &[f64]| Value::DoubleList(values.to_vec());
                vec![
                    controller(ControllerName::Rst),
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

/// Rejects a machine with a property that the independent checks do not contain, which are those of the paper's model.
fn reject_extended(machine: &MachineConfig) -> Result<(), String> {
    let reject = |what: String| Err(format!("{}: {what}", machine.name()));
    let ticks = machine.periods().ticks_per_position() as usize;
    let most = MAX_TICKS / MIN_PERIODS;
    if ticks > most {
        return reject(format!(
            "a position cycle has {ticks} current cycles, at most {most} are allowed in the stress test"
        ));
    }
    if machine.has_coupled_axes() {
        return reject("axes are coupled; remove the parameters workpiece and gantry".to_owned());
    }
    for axis in machine.axes() {
        let keys = match axis {
            _ if axis.transmission.is_some() => "transmission.stiffness and transmission.load",
            _ if axis.presliding.is_some() => "friction.presliding",
            _ if axis.stribeck.current > 0.0 => "friction.stribeck",
            _ if axis.stribeck.viscous > 0.0 => "friction.viscous",
            _ => continue,
        };
        return reject(format!(
            "axis {} is beyond the model of the paper; remove the parameters {keys}",
            axis.name()
        ));
    }
    Ok(())
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
            reject_extended(&config)?;
            for (name, laws) in VARIANTS {
                variants.push(MachineVariant::new(machine, name, laws)?);
            }
        }
        if variants.is_empty() {
            return Err("no machines are given, at least one is required".into());
        }
        Ok(TestMachines { variants: variants.into() })
    }

    /// Creates all variants of the shipped machines.
    ///
    /// # Errors
    /// [`TestMachinesError`] if a shipped machine rejects a controller, which the tests exclude.
    pub fn shipped() -> Result<Self, TestMachinesError> {
        let load = |(name, text): &(&str, &str)| Parameters::from_yaml(text, name);
        let machines = virtual_axes_builtin::MACHINES.iter().map(load).collect::<Result<Vec<_>, _>>()?;
        Self::new(&machines)
    }

    /// Returns the machine variants.
    pub fn variants(&self) -> &[MachineVariant] {
        &self.variants
    }
}
