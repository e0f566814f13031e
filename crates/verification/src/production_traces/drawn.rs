//! Random parameters of a hidden axis.

use std::f64::consts::TAU;

use virtual_axes_core::config::{
    AxisConfig, AxisKind, BacklashCompensationConfig, DelaysConfig, DeviationConfig, FeedforwardConfig,
    FrictionConfig, GravityConfig, LimitsConfig, MotorConfig, Periods, PiConfig, PositionControllerConfig,
    PositionFeedback, PositionLoopConfig, StribeckConfig,
};
use virtual_axes_core::units::{
    METER_PER_MINUTE, MICROSECOND_NS, MILLIMETER, MILLISECOND_NS, Nanoseconds, POSITION_GAIN,
};

use crate::random::RandomSource;

/// Screw leads, mm.
const LEADS: [f64; 7] = [10.0, 12.0, 16.0, 20.0, 25.0, 30.0, 40.0];
/// Range of the moving mass that a screw lead and an inertia can stand for, kg.
const MASS: [f64; 2] = [300.0, 3000.0];
/// Range of Jeq, kg·m².
pub(super) const INERTIA: [f64; 2] = [0.005, 0.06];
/// Voltage limit: 600 V bus / √6.
const MAX_VOLTAGE: f64 = 245.0;
/// Ratio of back-EMF constant to torque constant, values per phase and rms.
pub(super) const EMF_RATIO: f64 = 1.0 / 3.0;
/// Voltage for the steps of the current setpoint during acceleration, V.
const STEP_VOLTAGE: f64 = 50.0;
/// Electrical time constant L / R, s.
const ELECTRICAL_TIME: f64 = 0.015;
/// Largest inductance, H.
const MAX_INDUCTANCE: f64 = 8.5e-3;
/// Travel limit in both directions, m.
const TRAVEL: f64 = 1.0;

/// Orientation of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxisOrientation {
    /// Horizontal axis without weight.
    Horizontal,
    /// Vertical axis with a weight of 3000 to 6000 N.
    Vertical,
}

/// Draws the periods of a control: Tsp of 1, 2 or 6 ms with usual velocity and current cycles.
pub(super) fn draw_periods(random: &mut RandomSource) -> Periods {
    let (position, velocity, current) = match random.below(3) {
        0 => (1.0, 125.0, 62.5),
        1 => (2.0, 125.0, 62.5),
        _ => (6.0, 250.0, 125.0),
    };
    Periods {
        position: nanoseconds(position, MILLISECOND_NS),
        velocity: nanoseconds(velocity, MICROSECOND_NS),
        current: nanoseconds(current, MICROSECOND_NS),
    }
}

fn nanoseconds(value: f64, unit: Nanoseconds) -> Nanoseconds {
    (value * unit as f64).round() as Nanoseconds
}

fn draw_delay(random: &mut RandomSource, low: f64, high: f64) -> Nanoseconds {
    nanoseconds(random.between(low, high), MILLISECOND_NS)
}

/// Mechanical quantities of an axis, from which motor and loops derive.
struct Mechanics {
    inertia: f64,
    /// Transmission ratio r, m/rad.
    ratio: f64,
    limits: LimitsConfig,
    weight: f64,
    /// Torque of the friction amplitude a, N·m.
    friction: f64,
}

impl Mechanics {
    fn draw(random: &mut RandomSource, orientation: AxisOrientation) -> Self {
        let inertia = INERTIA[0] * (INERTIA[1] / INERTIA[0]).powf(random.unit());
        let ratios: Vec<f64> = LEADS
            .iter()
            .map(|lead| lead * MILLIMETER / TAU)
            .filter(|ratio| (MASS[0]..=MASS[1]).contains(&(inertia / (ratio * ratio))))
            .collect();
        // Every inertia of the range has at least two leads.
        let ratio = ratios[random.below(ratios.len())];
        let acceleration = random.between(3.0, 6.0);
        let limits = LimitsConfig {
            velocity: random.between(22.0, 36.0) * METER_PER_MINUTE,
            acceleration,
            jerk: acceleration / random.between(0.04, 0.1),
            travel_min: -TRAVEL,
            travel_max: TRAVEL,
        };
        let weight = match orientation {
            AxisOrientation::Horizontal => 0.0,
            AxisOrientation::Vertical => random.between(3000.0, 6000.0),
        };
        let friction = random.between(300.0, 1000.0) * ratio;
        Mechanics { inertia, ratio, limits, weight, friction }
    }
}

/// Draws the parameters of an axis; the current cycle, velocity cycle and position cycle are `periods`.
pub(super) fn draw_axis(
    random: &mut RandomSource,
    name: &str,
    orientation: AxisOrientation,
    periods: &Periods,
) -> AxisConfig {
    let mechanics = Mechanics::draw(random, orientation);
    let max_speed = mechanics.limits.velocity / mechanics.ratio;
    let torque_constant = random.between(0.35, 0.5) * MAX_VOLTAGE / EMF_RATIO / max_speed;
    let friction = draw_friction(random, mechanics.friction / torque_constant);
    let velocity_bandwidth = if periods.position > 2 * MILLISECOND_NS {
        random.between(170.0, 240.0)
    } else {
        random.between(200.0, 350.0)
    };
    let current_bandwidth = random.between(1400.0, 1700.0);
    let velocity_loop = PiConfig {
        gain: velocity_bandwidth * mechanics.inertia,
        integral_time: random.between(1.0, 2.0) / velocity_bandwidth,
    };
    let accelerating = mechanics.inertia * mechanics.limits.acceleration / mechanics.ratio / torque_constant;
    // A setpoint step per position cycle changes the current setpoint by this amount.
    let step = accelerating * velocity_bandwidth * periods.position as f64 * 1e-9;
    let inductance = (STEP_VOLTAGE / (current_bandwidth * step)).min(MAX_INDUCTANCE);
    let at_rapid = friction.a * (friction.b * mechanics.limits.velocity / METER_PER_MINUTE).exp();
    let holding = mechanics.weight * mechanics.ratio / torque_constant;
    let motor = MotorConfig {
        inertia: mechanics.inertia,
        torque_constant,
        emf_constant: torque_constant * EMF_RATIO,
        resistance: inductance / ELECTRICAL_TIME,
        inductance,
        max_current: random.between(2.5, 3.0) * (accelerating + at_rapid) + holding,
        max_voltage: MAX_VOLTAGE,
        max_speed: 1.2 * max_speed,
    };
    let alpha = draw_delay(random, 6.0, 15.0);
    let alpha_ms = alpha as f64 / MILLISECOND_NS as f64;
    AxisConfig {
        name: name.to_owned(),
        kind: AxisKind::Linear,
        transmission: None,
        stribeck: StribeckConfig::default(),
        presliding: None,
        transmission_ratio: mechanics.ratio,
        motor,
        friction,
        gravity: GravityConfig { weight: mechanics.weight, tilt: 0.0, phase: 0.0 },
        position_loop: PositionLoopConfig {
            feedback: PositionFeedback::Motor,
            gain: random.between(1.5, 3.5) * POSITION_GAIN,
            controller: PositionControllerConfig::Cascade,
            backlash_compensation: BacklashCompensationConfig::default(),
            allow_unstable: false,
        },
        velocity_loop,
        current_filters: [None, None],
        current_loop: PiConfig { gain: current_bandwidth * inductance, integral_time: 2e-3 },
        feedforward: FeedforwardConfig { velocity: 1.0, torque: mechanics.inertia, friction: 0.0 },
        delays: DelaysConfig {
            alpha,
            beta: draw_delay(random, 2.0, alpha_ms),
            gamma: draw_delay(random, 0.0, alpha_ms),
            friction: 0,
        },
        deviation: DeviationConfig { inertia: 1.0, friction: 1.0, torque_constant: 1.0 },
        limits: mechanics.limits,
    }
}

/// Draws a friction law with the amplitude `a` in A and the proportions of the axes in Prévost Appendix 2.
fn draw_friction(random: &mut RandomSource, a: f64) -> FrictionConfig {
    let c = -a * random.between(0.25, 0.45);
    FrictionConfig {
        a,
        b: random.between(0.012, 0.020),
        c,
        d: -random.between(0.25, 0.45),
        i0: (a + c) * random.between(0.95, 1.15),
    }
}
