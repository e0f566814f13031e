//! Fixture with a simulated machine, for tests of its commands.

use std::sync::Arc;

use virtual_axes_core::simulation::{MotionEnd, Simulation, joint_limits};
use virtual_axes_core::trajectory::{
    JointLimits, Start, Trajectory, TrajectoryPoint, TrajectoryRequest, ValidationContext,
};
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds};
use virtual_axes_verification::fixtures::machines::{Ballbar, parameters};

pub const TSP: Nanoseconds = 6 * MILLISECOND_NS;
pub const X: usize = 0;
pub const NONE: &[(&str, f64)] = &[];

pub struct SimulationFixture {
    pub simulation: Simulation,
    pub joints: Vec<JointLimits>,
    pub origin: Nanoseconds,
}

impl SimulationFixture {
    pub fn new(changes: &[(&str, f64)], origin: Nanoseconds) -> Self {
        let config = parameters(changes).machine_config().expect("valid");
        let joints = joint_limits(&config, "");
        let simulation = Simulation::new(&config, joints.clone(), origin).expect("can be simulated");
        SimulationFixture { simulation, joints, origin }
    }

    pub fn trajectory(
        &self,
        start: Start,
        names: &[&str],
        points: &[(Nanoseconds, &[f64])],
    ) -> Arc<Trajectory> {
        let mut request = TrajectoryRequest::new(start, names.iter().map(|n| n.to_string()).collect());
        for &(time, positions) in points {
            request
                .push(time, TrajectoryPoint { positions, ..TrajectoryPoint::default() })
                .expect("valid point");
        }
        let context = ValidationContext {
            joints: &self.joints,
            period: TSP,
            max_points: 100_000,
            allow_nonzero_end_velocity: false,
        };
        Arc::new(Trajectory::new(request, &context).expect("within limits"))
    }

    pub fn ballbar(&self, start: Start) -> Arc<Trajectory> {
        let trial = Ballbar::paper();
        let last = (trial.duration() * 1e9 / TSP as f64).ceil() as i64;
        let points: Vec<_> = (0..=last)
            .map(|k| {
                let p = trial.psec(k as f64 * 0.006);
                (k * TSP, [p[0], p[1]])
            })
            .collect();
        let points: Vec<(i64, &[f64])> = points.iter().map(|(t, p)| (*t, &p[..])).collect();
        self.trajectory(start, &["x", "y"], &points)
    }

    /// Steps until no command is active; returns the signals of all axes at each instant and the finished
    /// motions.
    pub fn run(&mut self) -> (Vec<Vec<u64>>, Vec<MotionEnd>) {
        let (mut rows, mut finished) = (Vec::new(), Vec::new());
        while self.simulation.is_busy() {
            self.simulation.step();
            let bits = |s: &virtual_axes_core::machine::AxisSample| {
                [s.psec, s.position, s.velocity, s.current, s.voltage].map(f64::to_bits)
            };
            rows.push(self.simulation.samples().iter().flat_map(bits).collect());
            finished.extend(self.simulation.drain_finished());
            assert!(rows.len() < 100_000, "no end of settling");
        }
        (rows, finished)
    }
}
