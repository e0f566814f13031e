//! Controlled stop: the fastest way to rest within acceleration and jerk.

use super::spline::State;
use crate::config::LimitsConfig;
use rsruckig::prelude::{
    ControlInterface, DataArrayOrVec, InputParameter, Profile, Ruckig, ThrowErrorHandler, Trajectory,
};

/// Jerk, constant acceleration, jerk back: no stop has more phases.
const PHASES: usize = 3;

/// Constant jerk for a while.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Phase {
    /// s.
    duration: f64,
    start: State,
    /// m/s³ or rad/s³.
    jerk: f64,
}

impl Phase {
    fn state(&self, t: f64) -> State {
        let State { position, velocity, acceleration } = self.start;
        State {
            position: position + t * (velocity + t * (acceleration / 2.0 + t * self.jerk / 6.0)),
            velocity: velocity + t * (acceleration + t * self.jerk / 2.0),
            acceleration: acceleration + t * self.jerk,
        }
    }
}

/// A planned stop, to be evaluated at any time after its beginning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    phases: [Phase; PHASES],
    end: f64,
    duration: f64,
    range: (f64, f64),
}

impl Stop {
    /// Time until rest, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// State `t` seconds after the beginning; at rest after [`Stop::duration`]. Where the way to
    /// rest would leave the stroke, the axis stands at the end of the stroke.
    pub fn state(&self, t: f64) -> State {
        let state = self.free_state(t);
        let (min, max) = self.range;
        if state.position < min {
            State::rest(min)
        } else if state.position > max {
            State::rest(max)
        } else {
            state
        }
    }

    fn free_state(&self, t: f64) -> State {
        let mut elapsed = t.max(0.0);
        for phase in &self.phases {
            if elapsed < phase.duration {
                return phase.state(elapsed);
            }
            elapsed -= phase.duration;
        }
        State::rest(self.end)
    }
}

/// Plans stops; holds the working memory of the planner, so that planning does not allocate.
#[derive(Debug)]
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
            // The cycle time matters to the planner's online mode only.
            ruckig: Ruckig::new(None, 1.0),
            input,
            output: Trajectory::new(None),
        }
    }
}

impl StopPlanner {
    /// The stop from `state` within `limits`.
    ///
    /// Trajectories are checked for speed, not for acceleration. Where `state` breaks the limits,
    /// or must break Vmax within the jerk limit, the stop begins with the nearest state that does
    /// not: a jerk-limited return from 100 m/s² at 50 m/s³ would gain 100 m/s on the way.
    pub fn plan(&mut self, state: State, limits: &LimitsConfig) -> Stop {
        let state = within(state, limits);
        self.input.current_position = DataArrayOrVec::Stack([state.position]);
        self.input.current_velocity = DataArrayOrVec::Stack([state.velocity]);
        self.input.current_acceleration = DataArrayOrVec::Stack([state.acceleration]);
        self.input.max_acceleration = DataArrayOrVec::Stack([limits.acceleration]);
        self.input.max_jerk = DataArrayOrVec::Stack([limits.jerk]);
        let planned = self.ruckig.calculate(&self.input, &mut self.output).is_ok();
        let phases = planned
            .then(|| phases_of(&self.output.profiles[0][0]))
            .flatten()
            .unwrap_or_else(|| constant_deceleration(state, limits));
        let last = phases[PHASES - 1];
        // An axis outside its stroke is not thrown back into it by a stop.
        let range = (limits.stroke_min.min(state.position), limits.stroke_max.max(state.position));
        Stop {
            end: last.state(last.duration).position.clamp(range.0, range.1),
            duration: phases.iter().map(|phase| phase.duration).sum(),
            phases,
            range,
        }
    }
}

/// The state nearest to `state` from which a stop within the limits exists.
fn within(state: State, limits: &LimitsConfig) -> State {
    let velocity = state.velocity.clamp(-limits.velocity, limits.velocity);
    // Returning the acceleration to zero at Jmax gains a²/(2 Jmax).
    let headroom = |speed: f64| (2.0 * limits.jerk * (limits.velocity - speed).max(0.0)).sqrt();
    State {
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

/// The phases of a planner's profile, or nothing if it is not the three phases of a stop.
fn phases_of(profile: &Profile) -> Option<[Phase; PHASES]> {
    let mut phases = [Phase::default(); PHASES];
    if profile.brake.duration > 0.0 || profile.t[PHASES..].iter().any(|&t| t > 0.0) {
        return None;
    }
    for (i, phase) in phases.iter_mut().enumerate() {
        *phase = Phase {
            duration: profile.t[i],
            start: State { position: profile.p[i], velocity: profile.v[i], acceleration: profile.a[i] },
            jerk: profile.j[i],
        };
    }
    let finite = |phase: &Phase| {
        let State { position, velocity, acceleration } = phase.start;
        (phase.duration + position + velocity + acceleration + phase.jerk).is_finite()
    };
    phases.iter().all(finite).then_some(phases)
}

/// The stop that is left when the planner finds none: a step to Amax, which breaks jerk alone.
fn constant_deceleration(state: State, limits: &LimitsConfig) -> [Phase; PHASES] {
    let braking = Phase {
        duration: state.velocity.abs() / limits.acceleration,
        start: State { acceleration: -limits.acceleration.copysign(state.velocity), ..state },
        jerk: 0.0,
    };
    let rest =
        Phase { duration: 0.0, start: State::rest(braking.state(braking.duration).position), jerk: 0.0 };
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
            stroke_min: f64::NEG_INFINITY,
            stroke_max: f64::INFINITY,
        }
    }

    #[test]
    fn a_stop_from_constant_velocity_takes_v_over_a_plus_a_over_j() {
        let state = State { position: 0.1, velocity: 0.5, acceleration: 0.0 };
        let stop = StopPlanner::default().plan(state, &limits());
        assert!((stop.duration() - (0.5 / 2.5 + 2.5 / 50.0)).abs() < 1e-12);
        // Mean velocity of a symmetric stop is half the initial one.
        let end = 0.1 + 0.25 * stop.duration();
        assert!((stop.state(f64::INFINITY).position - end).abs() < 1e-12);
    }

    #[test]
    fn a_stop_at_rest_is_over_and_stays() {
        let stop = StopPlanner::default().plan(State::rest(0.2), &limits());
        assert_eq!(stop.duration(), 0.0);
        assert_eq!(stop.state(1.0), State::rest(0.2));
    }

    #[test]
    fn a_stop_does_not_leave_the_stroke() {
        let narrow = LimitsConfig { stroke_max: 0.11, ..limits() };
        let state = State { position: 0.1, velocity: 0.5, acceleration: 0.0 };
        let stop = StopPlanner::default().plan(state, &narrow);
        for ms in 0..400 {
            assert!(stop.state(f64::from(ms) * 1e-3).position <= 0.11);
        }
        assert_eq!(stop.state(1.0), State::rest(0.11));
    }

    #[test]
    fn an_axis_outside_its_stroke_is_not_thrown_back() {
        let narrow = LimitsConfig { stroke_max: 0.0, ..limits() };
        let stop = StopPlanner::default().plan(State::rest(0.1), &narrow);
        assert_eq!(stop.state(0.0), State::rest(0.1));
    }

    #[test]
    fn the_fallback_stops_too() {
        let state = State { position: 0.0, velocity: -0.5, acceleration: 1.0 };
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
            let stop = planner.plan(State { position: 0.0, velocity, acceleration }, &limits);
            let steps = 2000;
            for i in 0..=steps {
                let t = stop.duration() * f64::from(i) / f64::from(steps);
                let state = stop.state(t);
                prop_assert!(state.velocity.abs() <= limits.velocity * (1.0 + 1e-9));
                prop_assert!(state.acceleration.abs() <= limits.acceleration * (1.0 + 1e-9));
            }
            for phase in stop.phases {
                prop_assert!(phase.jerk.abs() <= jerk * (1.0 + 1e-9), "fell back");
            }
            let last = stop.phases[PHASES - 1];
            let end = last.state(last.duration);
            prop_assert!(end.velocity.abs() < 1e-8 && end.acceleration.abs() < 1e-8);
        }
    }
}
