//! Runs random trajectories one after another on reused simulations and checks every tick.

use std::sync::Arc;

use blake3::Hasher;

use super::check::{Check, Violation};
use super::drive_checker::FailedCheck;
use super::invariants::{AxisObservation, InvariantChecker};
use super::plan::{TestCommand, TestPlan, TrajectoryKind};
use super::test_machines::{MachineVariant, TestMachines, TestMachinesError};
use virtual_axes_core::machine::SimdWidth;
use virtual_axes_core::simulation::Simulation;
use virtual_axes_core::trajectory::stream::STREAM_PAUSE;
use virtual_axes_core::trajectory::{
    MotionId, Rejection, Start, Trajectory, TrajectoryRequest, ValidationContext,
};

/// Largest number of violations recorded per trajectory.
const MAX_VIOLATIONS: usize = 8;

/// Result of one random trajectory.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TestRecord {
    /// Number of the trajectory.
    pub number: u64,
    /// Index of its machine variant and its kind; `None` if it was rejected.
    pub ran: Option<(usize, TrajectoryKind)>,
    /// Simulated position cycles.
    pub periods: usize,
    /// Observations of each axis.
    pub axes: Vec<AxisObservation>,
    /// True if a load acted.
    pub loaded: bool,
    /// Violated checks.
    pub violations: Vec<Violation>,
    /// BLAKE3 hash of number, machine, kind and periods, and for each axis of the bits of ticks at a limit, peak current,
    /// error, energies and final state.
    pub digest: [u8; 32],
}

impl TestRecord {
    fn hash(&self) -> [u8; 32] {
        let mut hasher = Hasher::new();
        let (variant, kind) = self.ran.map_or((0, u64::MAX), |(index, kind)| (index as u64, kind as u64));
        for word in [self.number, variant, kind, 0, self.periods as u64] {
            hasher.update(&word.to_le_bytes());
        }
        for axis in &self.axes {
            hasher.update(&axis.limited_ticks.to_le_bytes());
            let figures = [axis.peak_current, axis.error, axis.supplied, axis.dissipated, axis.returned];
            for value in figures.iter().chain(&axis.end) {
                hasher.update(&value.to_bits().to_le_bytes());
            }
        }
        *hasher.finalize().as_bytes()
    }
}

/// Simulations of one thread, one per machine variant, with their invariant checkers.
#[derive(Debug)]
pub struct TrajectoryTest {
    machines: TestMachines,
    seed: u64,
    width: SimdWidth,
    simulations: Vec<Option<CheckedSimulation>>,
    motions: u64,
}

impl TrajectoryTest {
    /// Creates a test without simulations; each is created at its first use.
    pub fn new(machines: &TestMachines, seed: u64, width: SimdWidth) -> Self {
        let simulations = machines.variants().iter().map(|_| None).collect();
        TrajectoryTest { machines: machines.clone(), seed, width, simulations, motions: 0 }
    }

    /// Runs trajectory `number` and checks every tick.
    ///
    /// # Errors
    /// [`TestMachinesError`] if its machine cannot be simulated.
    pub fn run(&mut self, number: u64) -> Result<TestRecord, TestMachinesError> {
        let mut violations = Violations { number, found: Vec::new() };
        let record = match TestPlan::new(&self.machines, self.seed, number) {
            Ok(plan) => self.follow(&plan, &mut violations)?,
            Err(rejection) => {
                violations.add_rejection(0, &rejection);
                TestRecord::default()
            }
        };
        let mut record = TestRecord { number, violations: violations.found, ..record };
        record.digest = record.hash();
        Ok(record)
    }

    fn next_motion(&mut self) -> MotionId {
        self.motions += 1;
        MotionId(self.motions)
    }

    /// Runs `plan`. A rejection is a violation, because the plan is within all limits.
    fn follow(
        &mut self,
        plan: &TestPlan,
        violations: &mut Violations,
    ) -> Result<TestRecord, TestMachinesError> {
        let motions = [self.next_motion(), self.next_motion()];
        let variant = &self.machines.variants()[plan.variant];
        let slot = &mut self.simulations[plan.variant];
        let simulation = match slot.take() {
            Some(simulation) => simulation,
            None => CheckedSimulation::new(variant, self.width)?,
        };
        let checked = slot.insert(simulation);
        Ok(checked.follow(plan, variant, motions, violations).unwrap_or_else(|rejection| {
            let tick = checked.checkers.first().map_or(0, InvariantChecker::ticks);
            violations.add_rejection(tick, &rejection);
            TestRecord::default()
        }))
    }
}

/// Simulation of one machine variant with an invariant checker per axis.
#[derive(Debug)]
struct CheckedSimulation {
    simulation: Simulation,
    checkers: Vec<InvariantChecker>,
}

impl CheckedSimulation {
    fn new(variant: &MachineVariant, width: SimdWidth) -> Result<Self, TestMachinesError> {
        let mut simulation = Simulation::new(&variant.config, variant.joints.clone(), 0)?;
        // The checkers compute the figures independently.
        simulation.set_assessing(false);
        simulation.set_simd_width(width);
        let periods = variant.config.periods();
        let axes = variant.config.axes().iter().zip(&variant.axes);
        let checkers = axes.map(|(axis, model)| InvariantChecker::new(axis, &periods, model)).collect();
        Ok(CheckedSimulation { simulation, checkers })
    }

    fn follow(
        &mut self,
        plan: &TestPlan,
        variant: &MachineVariant,
        [motion, stop]: [MotionId; 2],
        violations: &mut Violations,
    ) -> Result<TestRecord, Rejection> {
        self.reset(plan, variant)?;
        let context = ValidationContext {
            joints: &variant.joints,
            period: variant.period(),
            max_points: usize::MAX,
            allow_nonzero_end_velocity: false,
        };
        let checked = |request: TrajectoryRequest| Trajectory::new(request, &context).map(Arc::new);
        if let TestCommand::Follow(request) | TestCommand::Stop(request, _) = &plan.command {
            self.simulation.submit(motion, checked(request.clone())?)?;
        }
        self.simulation.drain_finished().for_each(drop);
        let mut loads = plan.loads.iter().peekable();
        let (mut periods, mut ends) = (0, 0);
        let mut limited = vec![0; self.checkers.len()];
        for k in 0..plan.periods {
            while let Some(load) = loads.next_if(|load| load.at <= k) {
                self.simulation.set_load(load.axis, load.value, load.periods as i64 * variant.period());
            }
            match &plan.command {
                TestCommand::Stop(_, at) if *at == k => {
                    let request = TrajectoryRequest::new(Start::Now, Vec::new());
                    self.simulation.submit(stop, checked(request)?)?;
                }
                TestCommand::Stream(columns) => {
                    for (axis, column) in columns {
                        self.simulation.submit_setpoint(*axis, column[k.min(column.len() - 1)])?;
                    }
                }
                _ => {}
            }
            let ran = self.step(variant, violations);
            ends += self.simulation.drain_finished().filter(|end| end.id == motion).count();
            if ran {
                periods += 1;
                self.check_period(variant, violations, &mut limited);
            }
        }
        let ends_once = matches!(plan.command, TestCommand::Follow(_) | TestCommand::Stop(..));
        if ends != usize::from(ends_once) {
            let tick = periods * variant.ticks();
            violations.add("", tick, (Check::Ended, ends as f64, f64::from(u8::from(ends_once))));
        }
        Ok(self.finish(plan, variant, periods, violations))
    }

    /// Resets simulation and checkers to the start of `plan`.
    fn reset(&mut self, plan: &TestPlan, variant: &MachineVariant) -> Result<(), Rejection> {
        self.checkers.iter_mut().zip(&plan.start).for_each(|(checker, start)| checker.begin(*start));
        self.simulation.reset_to(&plan.start)?;
        if matches!(plan.command, TestCommand::Stream(_)) {
            // A stop in the previous trajectory blocks streams until they have paused.
            for _ in 0..=STREAM_PAUSE / variant.period() + 1 {
                self.simulation.step();
            }
        }
        Ok(())
    }

    /// Simulates one position cycle and checks each tick. Returns false if the simulation did not advance.
    fn step(&mut self, variant: &MachineVariant, violations: &mut Violations) -> bool {
        let CheckedSimulation { simulation, checkers } = self;
        let mut tick = 0;
        simulation.step_with(|machine, _| {
            for (index, checker) in checkers.iter_mut().enumerate() {
                let at = checker.ticks();
                checker.check_tick(machine.axis(index).sample(), [tick == 0, tick == 1], &mut |failed| {
                    violations.add(&variant.joints[index].name, at, failed)
                });
            }
            tick += 1;
        })
    }

    /// Checks the figures of the last position cycle. `limited` counts, per axis, its ticks at a limit after the
    /// position cycle of the sample.
    fn check_period(&mut self, variant: &MachineVariant, violations: &mut Violations, limited: &mut [u64]) {
        let CheckedSimulation { simulation, checkers } = self;
        for (index, checker) in checkers.iter_mut().enumerate() {
            let (name, at) = (variant.joints[index].name.as_str(), checker.ticks());
            let activity = simulation.machine().activity(index);
            checker.end_period(&activity, &mut |failed| violations.add(name, at, failed));
            // The sample of a position cycle reports limits at any tick since the previous instant.
            let sample = &simulation.samples()[index];
            let instant = simulation.machine().axis(index).sample().saturated;
            if sample.saturated != (instant || limited[index] > 0) {
                violations.add(name, at, (Check::Counted, f64::from(u8::from(sample.saturated)), 0.0));
            }
            limited[index] = checker.limited_in_period() - u64::from(instant);
        }
    }

    /// Checks the following errors of all axes and returns the record of the trajectory.
    fn finish(
        &self,
        plan: &TestPlan,
        variant: &MachineVariant,
        periods: usize,
        violations: &mut Violations,
    ) -> TestRecord {
        let is_preview_exact = plan.kind != TrajectoryKind::Stop;
        let mut record = TestRecord {
            ran: Some((plan.variant, plan.kind)),
            periods,
            loaded: !plan.loads.is_empty(),
            ..TestRecord::default()
        };
        for (index, (checker, model)) in self.checkers.iter().zip(&variant.axes).enumerate() {
            let loaded = plan.loads.iter().any(|load| load.axis == index);
            let at = checker.ticks();
            record.axes.push(checker.finish(model, is_preview_exact, loaded, &mut |failed| {
                violations.add(&variant.joints[index].name, at, failed)
            }));
        }
        record
    }
}

/// Collects the violations of one trajectory.
struct Violations {
    number: u64,
    found: Vec<Violation>,
}

impl Violations {
    fn add(&mut self, axis: &str, tick: usize, (check, value, allowed): FailedCheck) {
        if self.found.len() < MAX_VIOLATIONS {
            self.found.push(Violation {
                check,
                number: self.number,
                axis: axis.to_owned(),
                tick,
                value,
                allowed,
            });
        }
    }

    fn add_rejection(&mut self, tick: usize, rejection: &Rejection) {
        let joint = rejection.joint.as_deref().unwrap_or_default();
        self.add(joint, tick, (Check::Accepted(rejection.code), rejection.value, rejection.limit));
    }
}
