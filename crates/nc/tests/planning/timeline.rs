//! Part programs in a timeline, in chunks: limits and path at random feed overrides, preemption, end.

use std::sync::Arc;

use proptest::prelude::*;
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::trajectory::{
    MotionId, RejectionCode, Start, Timeline, TimelineEvent, Trajectory, TrajectoryPoint, TrajectoryRequest,
    ValidationContext,
};
use virtual_axes_nc::motion::PathControl;
use virtual_axes_nc::plan::{PartProgramPlanner, PlanOptions};

use crate::deviation::to_program;
use crate::limits::{Audit, machine, plan};
use crate::programs::{Program, Step, blend};
use crate::random::{controls, draws, program, tolerance};

const PROGRAM: MotionId = MotionId(1);
const OTHER: MotionId = MotionId(2);
/// Position cycles of a chunk.
const CHUNK: u32 = 25;

/// Timeline with a part program that is planned when it needs a chunk.
struct ProgramRun<'a> {
    timeline: Timeline,
    planner: PartProgramPlanner<'a>,
    is_planned: bool,
    setpoints: Vec<Vec<f64>>,
    lines: Vec<usize>,
    events: Vec<TimelineEvent>,
}

impl<'a> ProgramRun<'a> {
    fn new(machine: &MachineConfig, program: &'a Program) -> Self {
        let steps: Box<dyn Iterator<Item = Step>> = Box::new(program.iter());
        let planner = PartProgramPlanner::new(steps, machine, PlanOptions::default()).unwrap();
        let joints = joint_limits(machine, "");
        let home = vec![0.0; joints.len()];
        let mut timeline = Timeline::new(joints, machine.periods().position, &home).unwrap();
        assert_eq!(timeline.begin_motion(PROGRAM), home);
        Self {
            timeline,
            planner,
            is_planned: false,
            setpoints: Vec::new(),
            lines: Vec::new(),
            events: Vec::new(),
        }
    }

    fn step(&mut self) {
        while self.timeline.needs_chunk() && !self.is_planned {
            match self.planner.next_chunk(CHUNK).unwrap() {
                Some(chunk) => assert!(self.timeline.extend_motion(PROGRAM, Arc::new(chunk)).unwrap()),
                None => {
                    self.is_planned = true;
                    assert!(self.timeline.finish_motion(PROGRAM));
                }
            }
        }
        self.timeline.next();
        self.setpoints.push(self.timeline.psec().to_vec());
        self.lines.push(self.timeline.path_place().map_or(0, |place| place.line));
        self.events.extend_from_slice(self.timeline.events());
    }

    fn has_ended(&self) -> bool {
        self.events.iter().any(|event| !matches!(event, TimelineEvent::Started(_)))
    }

    /// Runs to the end with a feed override in each position cycle; 1 after the last one.
    fn run(&mut self, overrides: &[f64]) {
        let mut values = overrides.iter();
        while !self.has_ended() {
            self.timeline.set_feed_override(values.next().copied().unwrap_or(1.0)).unwrap();
            self.step();
            assert!(self.setpoints.len() < 1_000_000, "the program does not end");
        }
    }

    fn audit(&self) -> Audit {
        let mut audit = Audit::new(&machine());
        audit.add(&vec![0.0; self.setpoints[0].len()]);
        self.setpoints.iter().for_each(|setpoint| audit.add(setpoint));
        audit.finish();
        audit
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, max_shrink_iters: 200, ..ProptestConfig::default() })]

    #[test]
    fn limits_and_path_are_kept_at_random_overrides(
        draws in draws(12), feed in -2.5..-0.5f64, control in controls(),
        overrides in prop::collection::vec(
            (prop_oneof![Just(0.0), Just(1.0), Just(2.0), 0.0..2.0f64], 1usize..80), 1..10
        ),
    ) {
        let program = program(&draws, 10f64.powf(feed), control);
        let values: Vec<f64> = overrides.iter().flat_map(|&(v, n)| std::iter::repeat_n(v, n)).collect();
        let machine = machine();
        let mut run = ProgramRun::new(&machine, &program);
        run.run(&values);
        run.audit().assert_kept();
        let motions: Vec<_> = program.motions().collect();
        for (setpoint, &line) in run.setpoints.iter().zip(&run.lines).filter(|(_, line)| **line > 0) {
            let deviation = to_program(&motions, line, setpoint);
            prop_assert!(deviation <= tolerance(control) + 1e-12, "deviation {deviation} in line {line}");
        }
        let last = run.setpoints.last().unwrap();
        prop_assert!(last.iter().zip(&program.at).all(|(a, b)| a == b), "{last:?} {:?}", program.at);
        prop_assert!(run.events.ends_with(&[TimelineEvent::Completed(PROGRAM)]));
    }
}

fn square(control: PathControl) -> Program {
    let mut program = Program::new(0.1, control);
    program.line(0.05, 0.0, 0.0).line(0.05, 0.05, 0.0).arc([0.025, 0.05], std::f64::consts::PI, 0.0);
    program
}

#[test]
fn setpoints_are_those_of_the_planner() {
    for control in [PathControl::ExactStop, blend(50e-6)] {
        let program = square(control);
        let machine = machine();
        let mut run = ProgramRun::new(&machine, &program);
        run.run(&[]);
        let planned = plan(&program).setpoints;
        let begin = run.setpoints.iter().position(|s| s.iter().any(|x| *x != 0.0)).unwrap();
        for (found, expected) in run.setpoints[begin..].iter().zip(&planned[1..]) {
            for (found, expected) in found.iter().zip(expected.psec()) {
                assert!((found - expected).abs() < 1e-14, "{control:?}: {found} {expected}");
            }
        }
    }
}

#[test]
fn a_cancellation_stops_within_the_limits() {
    let program = square(PathControl::ExactStop);
    let machine = machine();
    let mut run = ProgramRun::new(&machine, &program);
    (0..60).for_each(|_| run.step());
    run.timeline.cancel(PROGRAM);
    run.is_planned = true;
    while !run.has_ended() {
        run.step();
        assert!(run.setpoints.len() < 200, "stops within 0.3 s");
    }
    run.audit().assert_kept();
    assert!(run.events.ends_with(&[TimelineEvent::Completed(PROGRAM)]));
    assert!(
        !run.timeline.extend_motion(PROGRAM, chunk_of(&program)).unwrap(),
        "ended motions are not extended"
    );
    assert!(!run.timeline.finish_motion(PROGRAM));
}

fn chunk_of(program: &Program) -> Arc<virtual_axes_nc::plan::PlannedChunk> {
    let mut planner = PartProgramPlanner::new(program.iter(), &machine(), PlanOptions::default()).unwrap();
    Arc::new(planner.next_chunk(CHUNK).unwrap().unwrap())
}

fn trajectory(start: Start, joint: &str, position: f64) -> Arc<Trajectory> {
    let machine = machine();
    let joints = joint_limits(&machine, "");
    let period = machine.periods().position;
    let mut request = TrajectoryRequest::new(start, vec![joint.into()]);
    for (time, position) in [(500_000_000, position), (600_000_000, position)] {
        let point =
            TrajectoryPoint { positions: &[position], velocities: &[0.0], ..TrajectoryPoint::default() };
        request.push(time, point).unwrap();
    }
    let context =
        ValidationContext { joints: &joints, period, max_points: 100, allow_nonzero_end_velocity: false };
    Arc::new(Trajectory::new(request, &context).unwrap())
}

#[test]
fn a_trajectory_of_one_joint_preempts_the_program_and_stops_the_others() {
    let program = square(blend(50e-6));
    let machine = machine();
    let mut run = ProgramRun::new(&machine, &program);
    (0..60).for_each(|_| run.step());
    let before = run.setpoints.last().unwrap().clone();
    run.timeline.submit(OTHER, trajectory(Start::Now, "y", 0.0), 0).unwrap();
    run.is_planned = true;
    (0..200).for_each(|_| run.step());
    let preempted =
        |event: &TimelineEvent| matches!(event, TimelineEvent::Preempted { id: PROGRAM, by: OTHER, .. });
    assert!(run.events.iter().any(preempted), "{:?}", run.events);
    assert!(run.events.contains(&TimelineEvent::Completed(OTHER)));
    let x: Vec<f64> = run.setpoints[56..].iter().map(|s| s[0]).collect();
    let period = virtual_axes_core::units::seconds(machine.periods().position);
    for w in x.windows(3) {
        assert!((w[2] - 2.0 * w[1] + w[0]).abs() / period.powi(2) <= 2.5 * (1.0 + 1e-6));
    }
    assert!(x[x.len() - 1] > before[0] && x[x.len() - 1] == x[x.len() - 50]);
}

#[test]
fn a_trajectory_beyond_the_planned_part_is_rejected() {
    let program = square(blend(50e-6));
    let machine = machine();
    let mut run = ProgramRun::new(&machine, &program);
    (0..60).for_each(|_| run.step());
    let rejection =
        run.timeline.submit(OTHER, trajectory(Start::At(3_600_000_000_000), "x", 0.0), 0).unwrap_err();
    assert_eq!(rejection.code, RejectionCode::Jump);
    assert!(rejection.text.contains("a part program is active"), "{rejection}");
}

#[test]
fn a_program_preempts_a_moving_trajectory_after_a_controlled_stop() {
    let program = square(PathControl::ExactStop);
    let machine = machine();
    let mut run = ProgramRun::new(&machine, &program);
    run.timeline.cancel(PROGRAM);
    run.timeline.submit(OTHER, trajectory(Start::Now, "x", 0.05), 0).unwrap();
    for _ in 0..40 {
        run.timeline.next();
    }
    let rest = run.timeline.begin_motion(MotionId(3));
    let mut setpoints = vec![run.timeline.psec().to_vec()];
    for _ in 0..200 {
        run.timeline.next();
        setpoints.push(run.timeline.psec().to_vec());
    }
    assert_eq!(setpoints.last().unwrap(), &rest, "rests where the program begins");
    assert!(setpoints.windows(2).all(|pair| pair[1][0] >= pair[0][0]));
    assert!(run.timeline.needs_chunk());
}
