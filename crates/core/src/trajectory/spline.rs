//! Spline segments: polynomials of degree 1 (linear), 3 (cubic) or 5 (quintic) between two points, or a step.

use crate::units::{Nanoseconds, seconds};

/// Degree of a spline segment; it follows from the highest derivative given at its points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum SplineDegree {
    /// No interpolation: the next point right after the previous one.
    Step,
    /// Positions only, constant velocity.
    Linear,
    /// Positions and velocities.
    Cubic,
    /// Positions, velocities and accelerations.
    Quintic,
}

/// Position, velocity and acceleration of a joint at one instant.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KinematicState {
    /// Position, m or rad.
    pub position: f64,
    /// Velocity, m/s or rad/s.
    pub velocity: f64,
    /// Acceleration, m/s² or rad/s².
    pub acceleration: f64,
}

impl KinematicState {
    /// Returns the state at rest at `position`, m or rad.
    pub fn at_rest(position: f64) -> Self {
        Self { position, ..Self::default() }
    }
}

/// A polynomial between two states that are `duration` apart, in normalized time s = t/h ∈ \[0, 1]:
///
/// `p(s) = p0 + c1 s + c2 s² + c3 s³ + c4 s⁴ + c5 s⁵`
///
/// Normalized time gives segments of a nanosecond and of an hour the same conditioning. The end
/// positions are returned bit for bit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// p0 and p1, m or rad.
    ends: (f64, f64),
    /// c1…c5, m or rad.
    coefficients: [f64; 5],
    /// h, ns.
    duration: Nanoseconds,
    degree: SplineDegree,
}

impl Segment {
    /// Creates the segment from `start` to `end`, `duration` > 0 ns later.
    pub fn new(
        start: KinematicState,
        end: KinematicState,
        duration: Nanoseconds,
        degree: SplineDegree,
    ) -> Self {
        debug_assert!(duration > 0, "duration must be positive");
        Self {
            ends: (start.position, end.position),
            coefficients: coefficients(&start, &end, seconds(duration), degree),
            duration,
            degree,
        }
    }

    /// Returns the degree of the polynomial.
    pub fn degree(&self) -> SplineDegree {
        self.degree
    }

    /// Returns the position `elapsed` ns after the start, clamped to the segment, m or rad.
    pub fn position(&self, elapsed: Nanoseconds) -> f64 {
        self.position_at(elapsed as f64)
    }

    /// Returns the position `elapsed` ns after the start, with fractions of 1 ns, clamped to the segment, m or rad.
    pub fn position_at(&self, elapsed: f64) -> f64 {
        if elapsed <= 0.0 {
            return self.ends.0;
        }
        if elapsed >= self.duration as f64 {
            return self.ends.1;
        }
        if self.degree == SplineDegree::Step {
            return self.ends.1;
        }
        let [c1, c2, c3, c4, c5] = self.coefficients;
        let s = elapsed / self.duration as f64;
        self.ends.0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    }

    /// Returns the state `elapsed` ns after the start, clamped to the segment. The derivatives are those
    /// of the polynomial; a linear segment has zero acceleration, a step zero velocity.
    pub fn state(&self, elapsed: Nanoseconds) -> KinematicState {
        self.state_at(elapsed as f64)
    }

    /// Returns the state `elapsed` ns after the start, with fractions of 1 ns, as [`state`](Self::state).
    pub fn state_at(&self, elapsed: f64) -> KinematicState {
        let h = seconds(self.duration);
        let [c1, c2, c3, c4, c5] = self.coefficients;
        if self.degree <= SplineDegree::Linear {
            let position = self.position_at(elapsed);
            return KinematicState { position, velocity: c1 / h, acceleration: 0.0 };
        }
        let s = elapsed.clamp(0.0, self.duration as f64) / self.duration as f64;
        let dp = c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)));
        let ddp = 2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5));
        KinematicState { position: self.position_at(elapsed), velocity: dp / h, acceleration: ddp / (h * h) }
    }
}

/// Returns c1…c5, with Δ = p1 − p0, m = v h, q = a h².
fn coefficients(start: &KinematicState, end: &KinematicState, h: f64, degree: SplineDegree) -> [f64; 5] {
    let delta = end.position - start.position;
    let (m0, m1) = (start.velocity * h, end.velocity * h);
    match degree {
        SplineDegree::Step => [0.0; 5],
        SplineDegree::Linear => [delta, 0.0, 0.0, 0.0, 0.0],
        SplineDegree::Cubic => [m0, 3.0 * delta - 2.0 * m0 - m1, m0 + m1 - 2.0 * delta, 0.0, 0.0],
        SplineDegree::Quintic => {
            let (q0, q1) = (start.acceleration * h * h, end.acceleration * h * h);
            [
                m0,
                0.5 * q0,
                10.0 * delta - 6.0 * m0 - 4.0 * m1 - 1.5 * q0 + 0.5 * q1,
                -15.0 * delta + 8.0 * m0 + 7.0 * m1 + 1.5 * q0 - q1,
                6.0 * delta - 3.0 * (m0 + m1) + 0.5 * (q1 - q0),
            ]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::SECOND_NS;

    fn assert_close(a: f64, b: f64, tolerance: f64) {
        assert!((a - b).abs() <= tolerance, "{a} is not {b}");
    }

    #[test]
    fn rest_to_rest_quintic_is_10t3_15t4_6t5() {
        let segment = Segment::new(
            KinematicState::at_rest(0.0),
            KinematicState::at_rest(1.0),
            SECOND_NS,
            SplineDegree::Quintic,
        );
        for ms in 0..=1000 {
            let t = f64::from(ms) * 1e-3;
            let state = segment.state(i64::from(ms) * 1_000_000);
            assert_close(state.position, t.powi(3) * (10.0 - 15.0 * t + 6.0 * t * t), 4e-15);
            assert_close(state.velocity, 30.0 * t * t * (1.0 - t).powi(2), 1e-14);
            assert_close(state.acceleration, 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t), 1e-13);
        }
    }

    #[test]
    fn cubic_and_quintic_reproduce_a_cubic_polynomial() {
        // p = 0.3 − 0.2 t + 0.7 t² − 0.4 t³ on [0, 0.75] s, sampled between the points.
        let exact = |t: f64| KinematicState {
            position: 0.3 + t * (-0.2 + t * (0.7 - t * 0.4)),
            velocity: -0.2 + t * (1.4 - t * 1.2),
            acceleration: 1.4 - t * 2.4,
        };
        for degree in [SplineDegree::Cubic, SplineDegree::Quintic] {
            let segment = Segment::new(exact(0.0), exact(0.75), 750_000_000, degree);
            for ns in (0..=750_000_000).step_by(1_234_567) {
                let (found, wanted) = (segment.state(ns), exact(seconds(ns)));
                assert_close(found.position, wanted.position, 1e-15);
                assert_close(found.velocity, wanted.velocity, 1e-14);
                assert_close(found.acceleration, wanted.acceleration, 1e-13);
            }
        }
    }

    #[test]
    fn a_linear_segment_has_velocity_and_no_acceleration() {
        let segment = Segment::new(
            KinematicState::at_rest(1.0),
            KinematicState::at_rest(-1.0),
            4 * SECOND_NS,
            SplineDegree::Linear,
        );
        assert_eq!(
            segment.state(SECOND_NS),
            KinematicState { position: 0.5, velocity: -0.5, acceleration: 0.0 }
        );
    }

    #[test]
    fn a_step_is_at_the_next_point_right_after_the_previous_one() {
        let ends = (KinematicState::at_rest(1.0), KinematicState::at_rest(-1.0));
        let segment = Segment::new(ends.0, ends.1, SECOND_NS, SplineDegree::Step);
        assert_eq!(segment.state(0), ends.0);
        assert_eq!([1, SECOND_NS, i64::MAX].map(|ns| segment.state(ns)), [ends.1; 3]);
    }

    #[test]
    fn both_ends_are_bit_identical_even_if_the_polynomial_overflows() {
        let wild = KinematicState { position: 0.1, velocity: f64::MAX, acceleration: f64::MAX };
        let segment = Segment::new(wild, KinematicState::at_rest(0.3), i64::MAX, SplineDegree::Quintic);
        assert_eq!(segment.position(0), 0.1);
        assert_eq!(segment.position(i64::MAX), 0.3);
        assert_eq!(segment.state(i64::MAX).position, 0.3);
    }
}
