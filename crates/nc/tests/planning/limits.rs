//! Limits of the axes at every position cycle, as differences of the setpoints.

use virtual_axes_core::config::{MachineConfig, Parameters, ValueSource};
use virtual_axes_core::units::seconds;
use virtual_axes_nc::plan::{FeedPlanError, PartProgramPlanner, PlanOptions, PlannedSetpoint};

use crate::programs::{Program, Step};

/// Relative tolerance of a limit.
pub const TOLERANCE: f64 = 1e-6;

pub fn machine() -> MachineConfig {
    Parameters::embedded_default().unwrap().machine_config().unwrap()
}

/// Returns the machine with linear motors and position cycles of 1 ms.
pub fn linear_motor_machine() -> MachineConfig {
    Parameters::load("linear_motor_center", virtual_axes_builtin::MACHINES).unwrap().machine_config().unwrap()
}

/// Returns the default machine with position cycles of 1 ms.
pub fn fine_machine() -> MachineConfig {
    let mut parameters = Parameters::embedded_default().unwrap();
    parameters.set_text("periods.position_ms=1.0", &ValueSource::named("test")).unwrap();
    parameters.machine_config().unwrap()
}

/// Largest ratio of a difference of the setpoints to its limit.
pub struct Audit {
    machine: MachineConfig,
    window: Vec<Vec<f64>>,
    time: f64,
    pub worst: f64,
    pub text: String,
    pub cycles: usize,
}

impl Audit {
    pub fn new(machine: &MachineConfig) -> Self {
        let machine = machine.clone();
        Self { machine, window: vec![], time: 0.0, worst: 0.0, text: String::new(), cycles: 0 }
    }

    /// Adds the setpoints of the next cycle; before the first one the machine rests.
    pub fn add(&mut self, psec: &[f64]) {
        let period = seconds(self.machine.periods().position);
        if self.window.is_empty() {
            self.window = vec![psec.to_vec(); 4];
        }
        self.window.rotate_left(1);
        self.window[3] = psec.to_vec();
        self.cycles += 1;
        self.time += period;
        for (j, axis) in self.machine.axes().iter().enumerate() {
            let [a, b, c, d] = std::array::from_fn(|i| self.window[i][j]);
            // Rounding of the four positions.
            let rounding = 16.0 * f64::EPSILON * a.abs().max(d.abs());
            let limits = axis.limits();
            let orders = [
                ("speed", d - c, limits.velocity, 1),
                ("acceleration", d - 2.0 * c + b, limits.acceleration, 2),
                ("jerk", d - 3.0 * (c - b) - a, limits.jerk, 3),
            ];
            for (name, difference, limit, order) in orders {
                let ratio = (difference.abs() - rounding).max(0.0) / period.powi(order) / limit;
                if ratio > self.worst {
                    self.worst = ratio;
                    self.text = format!("{} {name} {ratio} times the limit at {} s", axis.name(), self.time);
                }
            }
        }
    }

    /// Adds the standstill after the end.
    pub fn finish(&mut self) {
        if let Some(last) = self.window.last().cloned() {
            (0..3).for_each(|_| self.add(&last));
        }
    }

    pub fn assert_kept(&self) {
        assert!(self.worst <= 1.0 + TOLERANCE, "{}", self.text);
    }
}

/// Result of a program.
pub struct Outcome {
    pub setpoints: Vec<PlannedSetpoint>,
    pub path_time: f64,
    pub audit: Audit,
}

pub fn plan_with(
    program: &Program,
    options: PlanOptions,
    feed_override: impl FnMut(usize) -> f64,
) -> Result<Outcome, FeedPlanError> {
    plan_on(&machine(), program, options, feed_override)
}

pub fn plan_on(
    machine: &MachineConfig,
    program: &Program,
    options: PlanOptions,
    mut feed_override: impl FnMut(usize) -> f64,
) -> Result<Outcome, FeedPlanError> {
    let steps: Box<dyn Iterator<Item = Step>> = Box::new(program.iter());
    let mut planner = PartProgramPlanner::new(steps, machine, options)?;
    let mut audit = Audit::new(machine);
    let mut setpoints = Vec::new();
    while let Some(setpoint) = planner.next_setpoint(feed_override(setpoints.len()))? {
        audit.add(setpoint.psec());
        setpoints.push(setpoint);
        assert!(setpoints.len() < 2_000_000, "the program does not end");
    }
    audit.finish();
    Ok(Outcome { setpoints, path_time: planner.path_time(), audit })
}

pub fn plan(program: &Program) -> Outcome {
    plan_with(program, PlanOptions::default(), |_| 1.0).unwrap()
}
