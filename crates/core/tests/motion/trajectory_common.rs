//! Fixture: machine with a linear axis `x` and a rotary axis `c`, and helpers for its trajectories.

use std::sync::Arc;
use virtual_axes_core::config::{AxisKind, LimitsConfig};
use virtual_axes_core::trajectory::ValidationContext;
use virtual_axes_core::trajectory::{
    Admission, JointLimits, MotionId, Rejection, Start, Timeline, TimelineEvent, Trajectory, TrajectoryPoint,
    TrajectoryRequest,
};

/// Position cycle Tsp, ns.
pub const TSP: i64 = 6_000_000;
/// Position cycle Tsp, s.
pub const TSP_S: f64 = 6e-3;
/// Absolute time of instant 0, ns: wall-clock time, not a multiple of Tsp.
pub const ORIGIN: i64 = 1_700_000_000_123_456_789;

pub fn joints() -> Vec<JointLimits> {
    let joint = |name: &str, kind, travel: f64| JointLimits {
        name: name.into(),
        kind,
        limits: LimitsConfig {
            velocity: 0.5,
            acceleration: 2.5,
            jerk: 50.0,
            travel_min: -travel,
            travel_max: travel,
        },
    };
    vec![joint("x", AxisKind::Linear, 0.355), joint("c", AxisKind::Rotary, f64::INFINITY)]
}

pub fn timeline() -> Timeline {
    Timeline::new(joints(), TSP, &[0.0, 0.0]).unwrap()
}

pub fn validate(
    request: TrajectoryRequest,
    allow_nonzero_end_velocity: bool,
) -> Result<Arc<Trajectory>, Rejection> {
    let joints = joints();
    let context =
        ValidationContext { joints: &joints, period: TSP, max_points: 100_000, allow_nonzero_end_velocity };
    Trajectory::new(request, &context).map(Arc::new)
}

/// Returns a start at instant `k`.
pub fn at(k: i64) -> Start {
    Start::At(ORIGIN + k * TSP)
}

/// Creates a request of one joint from points: time in ns; position, and optionally velocity and acceleration.
pub fn request(start: Start, joint: &str, points: &[(i64, &[f64])]) -> TrajectoryRequest {
    let mut request = TrajectoryRequest::new(start, vec![joint.into()]);
    for &(time, values) in points {
        let point = TrajectoryPoint {
            positions: &values[..1],
            velocities: values.get(1..2).unwrap_or(&[]),
            accelerations: values.get(2..3).unwrap_or(&[]),
            effort: &[],
        };
        request.push(time, point).unwrap();
    }
    request
}

/// Creates a validated trajectory of `joint` with points at multiples of Tsp; its end can be in motion.
pub fn path(start: Start, joint: &str, points: &[(i64, &[f64])]) -> Arc<Trajectory> {
    let points: Vec<_> = points.iter().map(|&(k, v)| (k * TSP, v)).collect();
    validate(request(start, joint, &points), true).unwrap()
}

pub fn stop(joints: &[&str]) -> Arc<Trajectory> {
    let names = joints.iter().map(|&name| name.to_owned()).collect();
    validate(TrajectoryRequest::new(Start::Now, names), false).unwrap()
}

pub fn submit(
    timeline: &mut Timeline,
    id: u64,
    trajectory: &Arc<Trajectory>,
) -> Result<Admission, Rejection> {
    timeline.submit(MotionId(id), Arc::clone(trajectory), ORIGIN)
}

/// Steps `count` instants; returns the setpoints of `joint` and all events with their instants.
pub fn run(timeline: &mut Timeline, joint: usize, count: usize) -> (Vec<f64>, Vec<(i64, TimelineEvent)>) {
    let (mut psec, mut events) = (Vec::new(), Vec::new());
    for _ in 0..count {
        let k = timeline.next();
        psec.push(timeline.psec()[joint]);
        events.extend(timeline.events().iter().map(|&event| (k, event)));
    }
    (psec, events)
}
