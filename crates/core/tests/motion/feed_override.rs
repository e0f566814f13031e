//! Feed override and feed hold of trajectories: limits at every position cycle, path, end, order of trajectories.

use std::f64::consts::TAU;
use std::sync::Arc;

use proptest::prelude::*;
use virtual_axes_core::config::{AxisKind, LimitsConfig};
use virtual_axes_core::trajectory::{
    JointLimits, MotionId, Start, Timeline, TimelineEvent, Trajectory, TrajectoryPoint, TrajectoryRequest,
    ValidationContext,
};

const TSP: i64 = 2_000_000;
const TSP_S: f64 = 2e-3;
/// Relative tolerance of a limit.
const TOLERANCE: f64 = 1e-6;
/// Ratio to the limits of the planned motions.
const PLANNED_RATIO: f64 = 0.98;
/// Points of a trajectory are this many position cycles apart.
const SPACING: i64 = 2;

fn joints() -> Vec<JointLimits> {
    let joint = |name: &str, velocity, acceleration, jerk| JointLimits {
        name: name.into(),
        kind: AxisKind::Linear,
        limits: LimitsConfig { velocity, acceleration, jerk, travel_min: -1.0, travel_max: 1.0 },
    };
    vec![joint("x", 0.5, 2.5, 50.0), joint("y", 0.3, 2.0, 80.0)]
}

/// Elliptic path with a feed profile from standstill to standstill.
#[derive(Debug, Clone, Copy)]
struct Ellipse {
    semi_axes: [f64; 2],
    /// Angles at start and end, rad.
    angles: [f64; 2],
    /// Fraction of the duration with constant angular speed.
    constant: f64,
    duration: f64,
}

impl Ellipse {
    /// Creates the fastest motion of this shape within [`PLANNED_RATIO`] of the limits.
    fn new(semi_axes: [f64; 2], angles: [f64; 2], constant: f64) -> Self {
        let mut ellipse = Self { semi_axes, angles, constant, duration: 1.0 };
        for _ in 0..60 {
            let ratios = ellipse.ratios();
            let factors = [ratios[0], ratios[1].sqrt(), ratios[2].cbrt()].map(|r| r / PLANNED_RATIO);
            let factor = factors.into_iter().fold(0.0, f64::max);
            ellipse.duration *= factor;
            if (factor - 1.0).abs() < 1e-4 {
                break;
            }
        }
        ellipse
    }

    /// Returns the largest ratios of speed, acceleration and jerk, as differences over position cycles, to the limits.
    fn ratios(&self) -> [f64; 3] {
        let mut worst = [0.0_f64; 3];
        let steps = 2000;
        for i in 0..=steps {
            let end = self.duration * 1.01 * f64::from(i) / f64::from(steps);
            let window: Vec<_> = (0..4).map(|n| self.position(end - f64::from(3 - n) * TSP_S)).collect();
            for (worst, ratio) in worst.iter_mut().zip(ratios(&window)) {
                *worst = worst.max(ratio);
            }
        }
        worst
    }

    /// Returns the angle with its first two derivatives.
    fn angle(&self, time: f64) -> [f64; 3] {
        let [from, to] = self.angles;
        let ramp = 0.5 * (1.0 - self.constant);
        let speed = 1.0 / (1.0 - ramp);
        let t = (time / self.duration).clamp(0.0, 1.0);
        // Speed rises as 10 s³ − 15 s⁴ + 6 s⁵ over a ramp.
        let rise = |s: f64| {
            [
                s.powi(4) * (2.5 + s * (s - 3.0)),
                s.powi(3) * (10.0 + s * (6.0 * s - 15.0)),
                s * s * (30.0 + s * (30.0 * s - 60.0)),
            ]
        };
        let [position, velocity, acceleration] = if t < ramp {
            let [p, v, a] = rise(t / ramp);
            [p * ramp, v, a / ramp]
        } else if t > 1.0 - ramp {
            let [p, v, a] = rise((1.0 - t) / ramp);
            [1.0 / speed - p * ramp, v, -a / ramp]
        } else {
            [t - 0.5 * ramp, 1.0, 0.0]
        };
        let scale = (to - from) * speed;
        [
            from + scale * position,
            scale * velocity / self.duration,
            scale * acceleration / self.duration.powi(2),
        ]
    }

    fn position(&self, time: f64) -> [f64; 2] {
        let (sin, cos) = self.angle(time)[0].sin_cos();
        [self.semi_axes[0] * (cos - 1.0), self.semi_axes[1] * sin]
    }

    /// Returns positions, velocities and accelerations.
    fn state(&self, time: f64) -> [[f64; 2]; 3] {
        let [angle, rate, acceleration] = self.angle(time);
        let (sin, cos) = angle.sin_cos();
        let [a, b] = self.semi_axes;
        [
            [a * (cos - 1.0), b * sin],
            [-a * sin * rate, b * cos * rate],
            [-a * (cos * rate * rate + sin * acceleration), b * (cos * acceleration - sin * rate * rate)],
        ]
    }

    /// Returns the distance of `position` from the ellipse, to first order.
    fn distance(&self, position: &[f64]) -> f64 {
        let [u, v] = [position[0] / self.semi_axes[0] + 1.0, position[1] / self.semi_axes[1]];
        let gradient = (2.0 * u / self.semi_axes[0]).hypot(2.0 * v / self.semi_axes[1]);
        ((u * u + v * v - 1.0) / gradient).abs()
    }

    fn cycles(&self) -> i64 {
        ((self.duration / TSP_S).ceil() as i64 / SPACING + 1) * SPACING
    }

    /// Returns a trajectory of this motion from position cycle `from` of it to `to`.
    fn trajectory(&self, start: Start, from: i64, to: i64) -> Arc<Trajectory> {
        let mut request = TrajectoryRequest::new(start, vec!["x".into(), "y".into()]);
        let mut k = from;
        while k <= to {
            let [positions, velocities, accelerations] = self.state(k as f64 * TSP_S);
            let point = TrajectoryPoint {
                positions: &positions,
                velocities: &velocities,
                accelerations: &accelerations,
                effort: &[],
            };
            request.push((k - from) * TSP, point).unwrap();
            k += SPACING;
        }
        validate(request)
    }

    fn whole(&self) -> Arc<Trajectory> {
        self.trajectory(Start::Now, 0, self.cycles())
    }

    /// Creates a timeline at the start.
    fn timeline(&self) -> Timeline {
        Timeline::new(joints(), TSP, &self.position(0.0)).unwrap()
    }
}

fn validate(request: TrajectoryRequest) -> Arc<Trajectory> {
    let joints = joints();
    let context = ValidationContext {
        joints: &joints,
        period: TSP,
        max_points: 100_000,
        allow_nonzero_end_velocity: true,
    };
    Arc::new(Trajectory::new(request, &context).unwrap())
}

/// Returns the largest ratios of the differences of four setpoints to the limits.
fn ratios<P: AsRef<[f64]>>(window: &[P]) -> [f64; 3] {
    let mut worst = [0.0_f64; 3];
    for (j, joint) in joints().iter().enumerate() {
        let [a, b, c, d] = std::array::from_fn(|i| window[i].as_ref()[j]);
        let rounding = 16.0 * f64::EPSILON * a.abs().max(d.abs());
        let limits = [joint.limits.velocity, joint.limits.acceleration, joint.limits.jerk];
        let differences = [d - c, d - 2.0 * c + b, d - 3.0 * (c - b) - a];
        for order in 0..3 {
            let value = (differences[order].abs() - rounding).max(0.0) / TSP_S.powi(order as i32 + 1);
            worst[order] = worst[order].max(value / limits[order]);
        }
    }
    worst
}

/// Steps until the motion ends, at most `cycles` position cycles, with `control` before each step; returns the
/// setpoints, the first one before the first step.
fn run(
    timeline: &mut Timeline,
    cycles: usize,
    mut control: impl FnMut(usize, &mut Timeline),
) -> Vec<Vec<f64>> {
    let mut setpoints = vec![timeline.psec().to_vec(); 4];
    for cycle in 0..cycles {
        control(cycle, timeline);
        timeline.next();
        setpoints.push(timeline.psec().to_vec());
        if timeline.events().iter().any(|event| matches!(event, TimelineEvent::Completed(_))) {
            break;
        }
    }
    setpoints.extend(vec![timeline.psec().to_vec(); 3]);
    setpoints
}

fn worst_ratio(setpoints: &[Vec<f64>]) -> f64 {
    setpoints.windows(4).flat_map(ratios).fold(0.0, f64::max)
}

/// Returns the first position cycle from which at least 3 setpoints are equal.
fn standstill(setpoints: &[Vec<f64>]) -> Option<usize> {
    setpoints.windows(4).position(|w| w.iter().all(|s| *s == w[0]))
}

fn ellipses() -> impl Strategy<Value = Ellipse> {
    ((-3.0..-0.7f64, -3.0..-0.7f64), (0.0..TAU, 0.3..12.0f64, any::<bool>()), 0.0..0.9f64).prop_map(
        |((a, b), (from, turn, is_forward), constant)| {
            let to = from + if is_forward { turn } else { -turn };
            Ellipse::new([10f64.powf(a), 10f64.powf(b)], [from, to], constant)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, max_shrink_iters: 200, ..ProptestConfig::default() })]

    #[test]
    fn limits_and_path_are_kept_at_random_overrides(
        ellipse in ellipses(),
        overrides in prop::collection::vec(
            (prop_oneof![Just(0.0), Just(1.0), Just(2.0), 0.0..2.0f64], 1usize..150), 1..10
        ),
    ) {
        let values: Vec<f64> = overrides.iter().flat_map(|&(v, n)| std::iter::repeat_n(v, n)).collect();
        let mut timeline = ellipse.timeline();
        timeline.submit(MotionId(1), ellipse.whole(), 0).unwrap();
        let cycles = 2 * ellipse.cycles() as usize + values.len() + 2000;
        let setpoints = run(&mut timeline, cycles, |cycle, timeline| {
            timeline.set_feed_override(values.get(cycle).copied().unwrap_or(1.0)).unwrap();
        });
        let worst = worst_ratio(&setpoints);
        prop_assert!(worst <= 1.0 + TOLERANCE, "{worst} times a limit");
        let deviation = setpoints.iter().map(|s| ellipse.distance(s)).fold(0.0, f64::max);
        prop_assert!(deviation <= 1e-9, "deviation {deviation} m");
        let [end, _, _] = ellipse.state(ellipse.cycles() as f64 * TSP_S);
        prop_assert_eq!(setpoints.last().unwrap().as_slice(), end.as_slice());
    }
}

#[test]
fn a_feed_hold_stops_and_resumes_on_the_path() {
    let ellipse = Ellipse::new([0.1, 0.05], [0.3, 9.0], 0.6);
    let total = ellipse.cycles() as usize;
    for start in (1..total).step_by(29) {
        let mut timeline = ellipse.timeline();
        timeline.submit(MotionId(1), ellipse.whole(), 0).unwrap();
        let hold = 400;
        let setpoints = run(&mut timeline, total + 2 * hold, |cycle, timeline| {
            timeline.set_feed_hold((start..start + hold).contains(&cycle));
        });
        assert!(worst_ratio(&setpoints) <= 1.0 + TOLERANCE, "hold at cycle {start}");
        assert!(setpoints.iter().all(|s| ellipse.distance(s) <= 1e-9), "hold at cycle {start}");
        // Vmax / Amax + Amax / Jmax is 0.25 s, 125 cycles; the path needs part of the acceleration.
        let held = &setpoints[start + 4..(start + 4 + hold).min(setpoints.len())];
        let stopped = standstill(held);
        assert!(stopped.is_some_and(|cycles| cycles < 250), "hold at cycle {start}: {stopped:?}");
        let [end, _, _] = ellipse.state(ellipse.cycles() as f64 * TSP_S);
        assert_eq!(setpoints.last().unwrap(), &end);
    }
}

#[test]
fn the_speed_is_proportional_to_a_constant_override() {
    // 0.05 m/s along 0.1 m at a tenth of the acceleration limit.
    let mut request = TrajectoryRequest::new(Start::Now, vec!["x".into()]);
    for (time, position, velocity) in
        [(0, 0.0, 0.0), (500, 0.0125, 0.05), (2500, 0.1125, 0.05), (3000, 0.125, 0.0)]
    {
        let point = TrajectoryPoint {
            positions: &[position],
            velocities: &[velocity],
            accelerations: &[0.0],
            effort: &[],
        };
        request.push(time * 1_000_000, point).unwrap();
    }
    let trajectory = validate(request);
    for (factor, expected) in [(0.25, 0.0125), (0.5, 0.025), (1.0, 0.05), (1.6, 0.08), (2.0, 0.1)] {
        let mut timeline = Timeline::new(joints(), TSP, &[0.0, 0.0]).unwrap();
        timeline.set_feed_override(factor).unwrap();
        timeline.submit(MotionId(1), Arc::clone(&trajectory), 0).unwrap();
        let setpoints = run(&mut timeline, 20_000, |_, _| {});
        let fastest = setpoints.windows(2).map(|w| (w[1][0] - w[0][0]) / TSP_S).fold(0.0, f64::max);
        assert!((fastest - expected).abs() < 1e-9, "{factor}: {fastest}");
        assert!(worst_ratio(&setpoints) <= 1.0 + TOLERANCE);
        assert_eq!(setpoints.last().unwrap()[0], 0.125);
    }
}

#[test]
fn chunks_at_an_override_join_as_one_trajectory() {
    let ellipse = Ellipse::new([0.08, 0.08], [0.0, 6.0], 0.5);
    let end = ellipse.cycles();
    let middle = end / 2 / SPACING * SPACING;
    let run_chunks = |chunks: &[Arc<Trajectory>]| {
        let mut timeline = ellipse.timeline();
        for (id, chunk) in chunks.iter().enumerate() {
            timeline.submit(MotionId(id as u64), Arc::clone(chunk), 0).unwrap();
        }
        let mut setpoints = Vec::new();
        for cycle in 0..3 * end {
            timeline.set_feed_override(if cycle < 100 { 0.37 } else { 0.8 }).unwrap();
            timeline.next();
            setpoints.push(timeline.psec().to_vec());
        }
        setpoints
    };
    let at = |k: i64| Start::At(k * TSP);
    let one = run_chunks(&[ellipse.trajectory(at(10), 0, end)]);
    let two = run_chunks(&[
        ellipse.trajectory(at(10), 0, middle),
        ellipse.trajectory(at(10 + middle), middle, end),
    ]);
    let difference = one.iter().flatten().zip(two.iter().flatten()).map(|(a, b)| (a - b).abs());
    assert!(difference.fold(0.0, f64::max) < 1e-15);
}

#[test]
fn an_override_of_1_is_bit_identical_also_after_an_interlude() {
    let ellipse = Ellipse::new([0.08, 0.05], [0.0, TAU], 0.5);
    let cycles = ellipse.cycles() as usize + 10;
    let mut plain = ellipse.timeline();
    plain.submit(MotionId(1), ellipse.whole(), 0).unwrap();
    let expected: Vec<_> = (0..cycles).map(|_| (plain.next(), plain.psec().to_vec()).1).collect();
    let mut timeline = ellipse.timeline();
    timeline.submit(MotionId(1), ellipse.whole(), 0).unwrap();
    run(&mut timeline, 10 * cycles, |cycle, timeline| {
        timeline.set_feed_override([0.3, 1.7, 0.0, 0.9][cycle / 50 % 4]).unwrap();
    });
    timeline.set_feed_override(1.0).unwrap();
    timeline.reset(&ellipse.position(0.0)).unwrap();
    timeline.submit(MotionId(2), ellipse.whole(), 0).unwrap();
    let found: Vec<_> = (0..cycles).map(|_| (timeline.next(), timeline.psec().to_vec()).1).collect();
    assert_eq!(found, expected);
}

/// Zigzag with positions only, whose corners exceed the limits.
fn zigzag() -> Arc<Trajectory> {
    let mut request = TrajectoryRequest::new(Start::Now, vec!["x".into(), "y".into()]);
    for i in 0..=200i64 {
        let positions = [i as f64 * 2e-3, if i % 2 == 0 { 0.0 } else { 1e-3 }];
        let point = TrajectoryPoint { positions: &positions, ..TrajectoryPoint::default() };
        request.push(i * 10 * TSP, point).unwrap();
    }
    validate(request)
}

#[test]
fn a_motion_beyond_the_limits_is_held_within_the_limits_along_its_path() {
    let mut timeline = Timeline::new(joints(), TSP, &[0.0, 0.0]).unwrap();
    timeline.submit(MotionId(1), zigzag(), 0).unwrap();
    let setpoints = run(&mut timeline, 4000, |cycle, timeline| {
        timeline.set_feed_hold((500..1000).contains(&cycle));
    });
    // x moves straight at 0.1 m/s; only its start and end are abrupt.
    let x: Vec<f64> = setpoints[10..setpoints.len() - 10].iter().map(|s| s[0]).collect();
    for w in x.windows(4) {
        assert!((w[3] - 2.0 * w[2] + w[1]).abs() / TSP_S.powi(2) <= 2.5 * (1.0 + TOLERANCE));
        assert!((w[3] - 3.0 * (w[2] - w[1]) - w[0]).abs() / TSP_S.powi(3) <= 50.0 * (1.0 + TOLERANCE));
    }
    // 0.1 m/s: 2 √(v / Jmax) is 0.09 s, 45 cycles.
    assert!(standstill(&setpoints[504..]).is_some_and(|cycles| cycles < 90));
    assert_eq!(setpoints.last().unwrap()[0], 0.4);
}

#[test]
fn a_trajectory_submitted_during_a_feed_hold_waits_for_its_end() {
    let ellipse = Ellipse::new([0.05, 0.05], [0.0, 3.0], 0.5);
    let mut timeline = ellipse.timeline();
    timeline.set_feed_hold(true);
    run(&mut timeline, 5, |_, _| {});
    timeline.submit(MotionId(1), ellipse.whole(), 0).unwrap();
    let held = run(&mut timeline, 300, |_, _| {});
    assert!(held.iter().all(|s| *s == held[0]));
    assert!(timeline.is_feed_stopped() && timeline.is_waiting());
    timeline.set_feed_hold(false);
    let setpoints = run(&mut timeline, 10_000, |_, _| {});
    assert!(worst_ratio(&setpoints) <= 1.0 + TOLERANCE);
    let [end, _, _] = ellipse.state(ellipse.cycles() as f64 * TSP_S);
    assert_eq!(setpoints.last().unwrap(), &end);
}

#[test]
fn a_controlled_stop_at_an_override_keeps_the_limits() {
    let ellipse = Ellipse::new([0.1, 0.1], [0.0, 6.0], 0.6);
    for (factor, at) in [(0.4, 400), (0.0, 300), (1.0, 200)] {
        let mut timeline = ellipse.timeline();
        timeline.submit(MotionId(1), ellipse.whole(), 0).unwrap();
        run(&mut timeline, 150, |_, _| {});
        let mut setpoints = run(&mut timeline, at, |_, timeline| timeline.set_feed_override(factor).unwrap());
        setpoints.truncate(setpoints.len() - 3);
        timeline.submit(MotionId(2), validate(TrajectoryRequest::new(Start::Now, vec![])), 0).unwrap();
        let stop = run(&mut timeline, 1000, |_, _| {});
        assert!(stop.len() < 200, "the stop ends");
        setpoints.extend_from_slice(&stop[4..]);
        let [speed, acceleration, _] = setpoints[4..]
            .windows(4)
            .map(ratios)
            .fold([0.0_f64; 3], |w, r| [w[0].max(r[0]), w[1].max(r[1]), w[2].max(r[2])]);
        assert!(speed <= 1.0 + TOLERANCE && acceleration <= 1.01, "{factor}: {speed} {acceleration}");
        assert!(!timeline.is_moving());
    }
}

#[test]
fn an_override_outside_its_range_is_rejected() {
    let mut timeline = Timeline::new(joints(), TSP, &[0.0, 0.0]).unwrap();
    timeline.set_feed_override(0.5).unwrap();
    for value in [-0.1, 2.1, f64::NAN, f64::INFINITY] {
        let error = timeline.set_feed_override(value).unwrap_err();
        let text = format!("feed override {value} must be a number from 0 to 2 (200 %)");
        assert_eq!(error.to_string(), text);
    }
    timeline.next();
    assert_eq!(timeline.feed_rate(), 0.5);
}
