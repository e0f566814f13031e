//! Controlled stop: time-optimal deceleration to rest within acceleration and jerk limits.

use super::spline::KinematicState;
use crate::config::LimitsConfig;
use rsruckig::prelude::{
    ControlInterface, DataArrayOrVec, InputParameter, Profile, Ruckig, ThrowErrorHandler, Trajectory,
};

/// Largest number of phases of a stop: jerk, constant acceleration, opposite jerk.
const PHASES: usize = 3;

/// Phase of constant jerk.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Phase {
    /// Duration, s.
    duration: f64,
    start: KinematicState,
    /// Jerk, m/s³ or rad/s³.
    jerk: f64,
}

impl Phase {
    fn state(&self, t: f64) -> KinematicState {
        let KinematicState { position, velocity, acceleration } = self.start;
        KinematicState {
            position: position + t * (velocity + t * (acceleration / 2.0 + t * self.jerk / 6.0)),
            velocity: velocity + t * (acceleration + t * self.jerk / 2.0),
            acceleration: acceleration + t * self.jerk,
        }
    }
}

/// Planned controlled stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    phases: [Phase; PHASES],
    end: f64,
    duration: f64,
    range: (f64, f64),
}

impl Stop {
    /// Returns the time until rest, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Returns the state `t` seconds after the start; at rest after [`Stop::duration`]. A stop that
    /// would exceed the travel limits ends at the limit.
    pub fn state(&self, t: f64) -> KinematicState {
        let state = self.unlimited_state(t);
        let (min, max) = self.range;
        if state.position < min {
            KinematicState::at_rest(min)
        } else if state.position > max {
            KinematicState::at_rest(max)
        } else {
            state
        }
    }

    fn unlimited_state(&self, t: f64) -> KinematicState {
        let mut elapsed = t.max(0.0);
        for phase in &self.phases {
            if elapsed < phase.duration {
                return phase.state(elapsed);
            }
            elapsed -= phase.duration;
        }
        KinematicState::at_rest(self.end)
    }
}

/// Planner of controlled stops with preallocated working memory.
#[derive(Debug, Clone)]
pub struct StopPlanner {
    ruckig: Ruckig<1, ThrowErrorHandler>,
    input: InputParameter<1>,
    output: Trajectory<1>,
}

impl Default for StopPlanner {
    fn default() -> Self {
        let mut input = InputParameter::new(None);
        input.control_interface = ControlInterface::Velocity;
        Self {
            // The cycle time is used in the online mode of the planner only.
            ruckig: Ruckig::new(None, 1.0),
            input,
            output: Trajectory::new(None),
        }
    }
}

impl StopPlanner {
    /// Plans the stop from `state` within `limits`.
    ///
    /// Trajectories are checked for speed, not for acceleration. If `state` exceeds the limits, or
    /// would exceed Vmax because of the jerk limit, the stop begins at the nearest valid state: a
    /// jerk-limited return from 100 m/s² at 50 m/s³ would gain 100 m/s.
    pub fn plan(&mut self, state: KinematicState, limits: &LimitsConfig) -> Stop {
        let state = clamp_state(state, limits);
        self.input.current_position = DataArrayOrVec::Stack([state.position]);
        self.input.current_velocity = DataArrayOrVec::Stack([state.velocity]);
        self.input.current_acceleration = DataArrayOrVec::Stack([state.acceleration]);
        self.input.max_acceleration = DataArrayOrVec::Stack([limits.acceleration]);
        self.input.max_jerk = DataArrayOrVec::Stack([limits.jerk]);
        let planned = self.ruckig.calculate(&self.input, &mut self.output).is_ok();
        let phases = planned
            .then(|| stop_phases(&self.output.profiles[0][0]))
            .flatten()
            .unwrap_or_else(|| constant_deceleration(state, limits));
        let last = phases[PHASES - 1];
        // A stop does not move an axis that is outside its travel limits back into them.
        let range = (limits.travel_min.min(state.position), limits.travel_max.max(state.position));
        Stop {
            end: last.state(last.duration).position.clamp(range.0, range.1),
            duration: phases.iter().map(|phase| phase.duration).sum(),
            phases,
            range,
        }
    }
}

/// Returns the state nearest to `state` from which a stop within the limits exists.
fn clamp_state(state: KinematicState, limits: &LimitsConfig) -> KinematicState {
    let velocity = state.velocity.clamp(-limits.velocity, limits.velocity);
    // Reducing the acceleration to zero at Jmax changes the speed by a²/(2 Jmax).
    let headroom = |speed: f64| (2.0 * limits.jerk * (limits.velocity - speed).max(0.0)).sqrt();
    KinematicState {
        position: state.position,
        velocity,
        acceleration: state
            .acceleration
            .min(limits.acceleration)
            .min(headroom(velocity))
            .max(-limits.acceleration)
            .max(-headroom(-velocity)),
    }
}

/// Returns the phases of a planned profile; `None` if it does not consist of the three phases of a stop.
fn stop_phases(profile: &Profile) -> Option<[Phase; PHASES]> {
    let mut phases = [Phase::default(); PHASES];
    if profile.brake.duration > 0.0 || profile.t[PHASES..].iter().any(|&t| t > 0.0) {
        return None;
    }
    for (i, phase) in phases.iter_mut().enumerate() {
        *phase = Phase {
            duration: profile.t[i],
            start: KinematicState {
                position: profile.p[i],
                velocity: profile.v[i],
                acceleration: profile.a[i],
            },
            jerk: profile.j[i],
        };
    }
    let finite = |phase: &Phase| {
        let KinematicState { position, velocity, acceleration } = phase.start;
        (phase.duration + position + velocity + acceleration + phase.jerk).is_finite()
    };
    phases.iter().all(finite).then_some(phases)
}

/// Returns the fallback stop for a failed plan: a step to Amax, which exceeds the jerk limit only.
fn constant_deceleration(state: KinematicState, limits: &LimitsConfig) -> [Phase; PHASES] {
    let braking = Phase {
        duration: state.velocity.abs() / limits.acceleration,
        start: KinematicState { acceleration: -limits.acceleration.copysign(state.velocity), ..state },
        jerk: 0.0,
    };
    let rest = Phase {
        duration: 0.0,
        start: KinematicState::at_rest(braking.state(braking.duration).position),
        jerk: 0.0,
    };
    [braking, rest, rest]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn limits() -> LimitsConfig {
        LimitsConfig {
            velocity: 0.5,
            acceleration: 2.5,
            jerk: 50.0,
            travel_min: f64::NEG_INFINITY,
            travel_max: f64::INFINITY,
        }
    }

    #[test]
    fn a_stop_from_constant_velocity_takes_v_over_a_plus_a_over_j() {
        let state = KinematicState { position: 0.1, velocity: 0.5, acceleration: 0.0 };
        let stop = StopPlanner::default().plan(state, &limits());
        assert!((stop.duration() - (0.5 / 2.5 + 2.5 / 50.0)).abs() < 1e-12);
        // Mean velocity of a symmetric stop is half the initial one.
        let end = 0.1 + 0.25 * stop.duration();
        assert!((stop.state(f64::INFINITY).position - end).abs() < 1e-12);
    }

    #[test]
    fn a_stop_at_rest_has_no_duration() {
        let stop = StopPlanner::default().plan(KinematicState::at_rest(0.2), &limits());
        assert_eq!(stop.duration(), 0.0);
        assert_eq!(stop.state(1.0), KinematicState::at_rest(0.2));
    }

    #[test]
    fn a_stop_stays_within_the_travel_limits() {
        let narrow = LimitsConfig { travel_max: 0.11, ..limits() };
        let state = KinematicState { position: 0.1, velocity: 0.5, acceleration: 0.0 };
        let stop = StopPlanner::default().plan(state, &narrow);
        for ms in 0..400 {
            assert!(stop.state(f64::from(ms) * 1e-3).position <= 0.11);
        }
        assert_eq!(stop.state(1.0), KinematicState::at_rest(0.11));
    }

    #[test]
    fn an_axis_outside_its_travel_limits_is_not_moved_back() {
        let narrow = LimitsConfig { travel_max: 0.0, ..limits() };
        let stop = StopPlanner::default().plan(KinematicState::at_rest(0.1), &narrow);
        assert_eq!(stop.state(0.0), KinematicState::at_rest(0.1));
    }

    #[test]
    fn the_fallback_comes_to_rest() {
        let state = KinematicState { position: 0.0, velocity: -0.5, acceleration: 1.0 };
        let [braking, rest, _] = constant_deceleration(state, &limits());
        assert!(braking.state(braking.duration).velocity.abs() < 1e-15);
        assert!((rest.start.position + 0.05).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn any_state_comes_to_rest_within_the_limits(
            velocity in prop_oneof![-0.5..0.5, -1e-9..1e-9, -9.0..9.0f64],
            acceleration in prop_oneof![-2.5..2.5, -1e-9..1e-9, -900.0..900.0f64],
            jerk in 0.1..1e5f64,
        ) {
            let limits = LimitsConfig { jerk, ..limits() };
            let mut planner = StopPlanner::default();
            let stop = planner.plan(KinematicState { position: 0.0, velocity, acceleration }, &limits);
            let steps = 2000;
            for i in 0..=steps {
                let t = stop.duration() * f64::from(i) / f64::from(steps);
                let state = stop.state(t);
                prop_assert!(state.velocity.abs() <= limits.velocity * (1.0 + 1e-9));
                prop_assert!(state.acceleration.abs() <= limits.acceleration * (1.0 + 1e-9));
            }
            for phase in stop.phases {
                prop_assert!(phase.jerk.abs() <= jerk * (1.0 + 1e-9), "the fallback was used");
            }
            let last = stop.phases[PHASES - 1];
            let end = last.state(last.duration);
            prop_assert!(end.velocity.abs() < 1e-8 && end.acceleration.abs() < 1e-8);
        }
    }
}
