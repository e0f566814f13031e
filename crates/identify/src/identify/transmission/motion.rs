//! Motion of motor and load in recordings with both encoders.

use crate::recording::{FilteredSignal, GaussianFilter, SignalSpan, Signals};
use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::drive::Friction;

/// Speed below which friction may hold the load, m/s or rad/s.
const STICKING: f64 = 2e-4;
/// Filtered direction of motion without reversal.
const ONE_DIRECTION: f64 = 0.999;
/// Smallest step of a position relative to its range; smaller ones are rounding errors.
const ROUNDING: f64 = 1e-9;

/// Motion of motor and load in a section of a recording; all signals at the axis, with the same filter.
#[derive(Debug, Clone)]
pub(super) struct TwoEncoderMotion {
    filter: GaussianFilter,
    /// Number of samples at both ends that the filter continues beyond the section.
    margin: usize,
    /// Recorded position of the motor minus that of the load, m or rad.
    pub twist: Vec<f64>,
    /// Filtered velocity and acceleration of the motor, SI.
    pub motor: FilteredSignal,
    /// Position, filtered velocity and acceleration of the load, SI.
    pub load: FilteredSignal,
    /// Direction of the load's motion, filtered.
    pub direction: Vec<f64>,
    /// Filtered current as force on the axis, N or N·m; NaN where it does not count; none without a current.
    pub force: Option<Vec<f64>>,
    /// Friction of the machine file at the velocities of motor and load, filtered, N or N·m.
    pub friction: Vec<f64>,
    pub load_friction: Vec<f64>,
    /// Standard deviation of the filtered twist by the encoders, m or rad.
    pub noise: f64,
}

impl TwoEncoderMotion {
    /// Evaluates a section; none without the position of the motor, or if it is too short.
    pub fn new(span: &SignalSpan, signals: &Signals, axis: &AxisConfig) -> Option<Self> {
        let filter = GaussianFilter::new(signals.cutoff, signals.period);
        let recorded = span.motor_position.as_ref()?;
        let margin = filter.radius();
        if recorded.len() <= 4 * margin {
            return None;
        }
        let motor = filter.apply(recorded);
        let load = filter.apply(&span.position);
        let direction = |motion: &FilteredSignal| {
            filter.apply(&motion.first.iter().map(|v| sign(*v)).collect::<Vec<_>>()).value
        };
        let (direction, of_motor) = (direction(&load), direction(&motor));
        let law = Friction::of_axis(axis, axis.motor.torque_constant / axis.transmission_ratio);
        let per_axis = 1.0 / axis.transmission_ratio;
        let friction = |velocities: &[f64]| {
            let at = |v: &f64| sign(*v) * law.bound(v.abs() * per_axis);
            filter.apply(&velocities.iter().map(at).collect::<Vec<_>>()).value
        };
        let per_current = axis.motor.torque_constant / axis.transmission_ratio;
        let largest = super::super::inertia::SATURATED * axis.motor.max_current;
        let counts = |i: usize| {
            is_steady(of_motor[i], motor.first[i])
                && is_steady(direction[i], load.first[i])
                && span.current.as_ref().is_none_or(|current| current[i].abs() < largest)
        };
        let force = span.smooth_current.as_ref().map(|current| {
            let at = |(i, x): (usize, &f64)| if counts(i) { x * per_current } else { f64::NAN };
            current.iter().enumerate().map(at).collect()
        });
        let twist = recorded.iter().zip(&span.position).map(|(motor, load)| motor - load).collect();
        let gain = filter.noise_gain();
        let noise = gain * (increment(recorded).hypot(increment(&span.position)) / 12_f64.sqrt());
        Some(TwoEncoderMotion {
            friction: friction(&motor.first),
            load_friction: friction(&load.first),
            direction,
            filter,
            margin,
            twist,
            motor,
            load,
            force,
            noise,
        })
    }

    /// Returns true if the positions of motor and load differ by rounding errors only.
    pub fn is_without_twist(&self) -> bool {
        let range = self.load.value.iter().fold(0.0_f64, |most, x| most.max((x - self.load.value[0]).abs()));
        self.twist.iter().all(|twist| twist.abs() <= ROUNDING * range)
    }

    /// Returns the motion with a twist at the instants of the load's position, which is older than that of the motor by
    /// `delay` seconds.
    pub fn without_delay(&self, delay: f64) -> Self {
        let twist = self.twist.iter().zip(&self.load.first).map(|(twist, speed)| twist - delay * speed);
        TwoEncoderMotion { twist: twist.collect(), ..self.clone() }
    }

    /// Returns the indices of the samples that count.
    pub fn samples(&self) -> std::ops::Range<usize> {
        self.margin..self.twist.len() - self.margin
    }

    /// Returns true if the load moves in one direction all over the filter.
    pub fn is_moving(&self, index: usize) -> bool {
        is_steady(self.direction[index], self.load.first[index])
    }

    /// Returns the filtered twist beyond a gap of width `backlash` about `middle`, with its derivative, and its filtered
    /// derivatives by `middle` and by half of the `backlash`.
    pub fn contact(&self, middle: f64, backlash: f64) -> [Vec<f64>; 4] {
        let half = backlash / 2.0;
        let beyond = |x: &f64| (x - middle) - (x - middle).clamp(-half, half);
        let side = |x: &f64| if (x - middle).abs() > half { (x - middle).signum() } else { 0.0 };
        let contact = self.filter.apply(&self.twist.iter().map(beyond).collect::<Vec<_>>());
        let sides: Vec<f64> = self.twist.iter().map(side).collect();
        let touches: Vec<f64> = sides.iter().map(|x| -x.abs()).collect();
        let opposed: Vec<f64> = sides.iter().map(|x| -x).collect();
        [contact.value, contact.first, self.filter.apply(&touches).value, self.filter.apply(&opposed).value]
    }
}

/// Returns true for a filtered direction without reversal, at a velocity above the sticking of friction.
fn is_steady(direction: f64, velocity: f64) -> bool {
    direction.abs() > ONE_DIRECTION && velocity.abs() > STICKING
}

fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}

/// Returns the smallest step of a recorded position, the increment of its encoder, m or rad.
pub(super) fn increment(position: &[f64]) -> f64 {
    let range = position.iter().fold(0.0_f64, |most, x| most.max((x - position[0]).abs()));
    let steps = position.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let least = steps.filter(|step| *step > ROUNDING * range).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}
