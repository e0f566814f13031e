//! Follower of `/clock`: the newest time, the position cycles that are due, and clock jumps.

use virtual_axes_core::units::{Nanoseconds, SECOND_NS};

/// Largest forward step of the clock that is simulated; a larger one is a jump, ns.
///
/// The coarsest clocks in use tick once per second. A bag played at 100 times its rate with 40 messages per second
/// steps by 2.5 s. A machine simulates 10 s in about one second.
pub const MAX_CLOCK_STEP: Nanoseconds = 10 * SECOND_NS;

/// Jump of the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ClockJump {
    /// Number of jumps so far, including the first message.
    pub count: u64,
    /// Time before the jump, ns; `None` for the first message.
    pub from: Option<Nanoseconds>,
    /// Time after the jump, ns.
    pub to: Nanoseconds,
}

/// State of a followed clock.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ClockState {
    /// Newest received time, ns; `None` before the first message.
    pub newest: Option<Nanoseconds>,
    /// Last jump.
    pub jump: ClockJump,
}

/// Time of a followed clock.
#[derive(Debug)]
pub struct ClockFollower {
    period: Nanoseconds,
    state: ClockState,
}

impl ClockFollower {
    /// Creates a follower without a time; `period` is Tsp, ns.
    pub fn new(period: Nanoseconds) -> Self {
        ClockFollower { period, state: ClockState::default() }
    }

    /// Returns the state.
    pub fn state(&self) -> ClockState {
        self.state
    }

    /// Processes a message. With `never_jumps_ahead` a forward step of any size is simulated.
    ///
    /// The follower waits for a clock that is set back by less than a position cycle, because no released instant
    /// has to be repeated.
    pub fn receive(&mut self, time: Nanoseconds, never_jumps_ahead: bool) {
        let Some(newest) = self.state.newest else {
            self.restart(time);
            return;
        };
        let ahead = time.saturating_sub(newest);
        if ahead <= -self.period || (ahead > MAX_CLOCK_STEP && !never_jumps_ahead) {
            self.restart(time);
        } else {
            self.state.newest = Some(newest.max(time));
        }
    }

    fn restart(&mut self, time: Nanoseconds) {
        let ClockState { newest, jump } = self.state;
        self.state.jump = ClockJump { count: jump.count + 1, from: newest, to: time };
        self.state.newest = Some(time);
    }
}

/// Returns the first position cycle that is not before `time`, ns: a multiple of `period`, ns.
pub fn first_instant(time: Nanoseconds, period: Nanoseconds) -> Nanoseconds {
    -(-time).div_euclid(period) * period
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PERIOD: Nanoseconds = 6_000_000;

    /// Returns the instants released by the messages, with a new list after each jump.
    fn releases(messages: &[Nanoseconds]) -> Vec<Vec<Nanoseconds>> {
        let mut follower = ClockFollower::new(PERIOD);
        let mut released: Vec<Vec<Nanoseconds>> = Vec::new();
        let mut next = 0;
        for &message in messages {
            let before = follower.state().jump.count;
            follower.receive(message, false);
            if follower.state().jump.count != before {
                next = first_instant(follower.state().jump.to, PERIOD);
                released.push(Vec::new());
            }
            while next <= follower.state().newest.expect("at least one message") {
                released.last_mut().expect("list of the first message").push(next);
                next += PERIOD;
            }
        }
        released
    }

    #[test]
    fn a_coarse_clock_releases_several_instants_per_message() {
        let coarse = releases(&[0, 100_000_000, 200_000_000]);
        assert_eq!(coarse, [(0..=33).map(|k| k * PERIOD).collect::<Vec<_>>()]);
        let fine: Vec<_> = (0..=18).map(|n| n * 1_000_000).collect();
        assert_eq!(releases(&fine), [vec![0, PERIOD, 2 * PERIOD, 3 * PERIOD]]);
    }

    #[test]
    fn the_first_instant_is_not_before_the_clock() {
        for (time, first) in [(0, 0), (1, PERIOD), (PERIOD, PERIOD), (PERIOD + 1, 2 * PERIOD)] {
            assert_eq!(first_instant(time, PERIOD), first);
        }
    }

    #[test]
    fn a_clock_that_is_set_back_or_far_ahead_has_jumped() {
        let jump = |from, to| {
            let mut follower = ClockFollower::new(PERIOD);
            follower.receive(from, false);
            follower.receive(to, false);
            (follower.state().jump.count == 2).then(|| follower.state().jump)
        };
        let at = 100 * SECOND_NS;
        let jumped = |to| Some(ClockJump { count: 2, from: Some(at), to });
        assert_eq!(jump(at, 0), jumped(0));
        assert_eq!(jump(at, at - PERIOD), jumped(at - PERIOD));
        assert_eq!(jump(at, at - PERIOD + 1), None);
        assert_eq!(jump(at, at), None);
        assert_eq!(jump(at, at + MAX_CLOCK_STEP), None);
        assert_eq!(jump(at, at + MAX_CLOCK_STEP + 1), jumped(at + MAX_CLOCK_STEP + 1));
    }

    #[test]
    fn the_clock_of_a_machine_never_jumps_ahead() {
        let mut follower = ClockFollower::new(PERIOD);
        follower.receive(0, true);
        follower.receive(1000 * SECOND_NS, true);
        assert_eq!((follower.state().jump.count, follower.state().newest), (1, Some(1000 * SECOND_NS)));
    }

    proptest! {
        #[test]
        fn between_jumps_the_time_grid_has_no_gap_and_is_not_ahead_of_the_clock(
            messages in prop::collection::vec(
                prop_oneof![
                    4 => 0..200_000_000_i64,
                    1 => 0..20 * SECOND_NS,
                    1 => Just(0),
                    1 => -30 * SECOND_NS..0,
                ],
                1..60,
            ),
            first in 0..100 * SECOND_NS,
        ) {
            let clock: Vec<_> = std::iter::once(first)
                .chain(messages.iter().scan(first, |time, step| {
                    *time = (*time + step).max(0);
                    Some(*time)
                }))
                .collect();
            let highest = clock.iter().max().expect("at least one");
            for list in releases(&clock) {
                prop_assert!(list.iter().all(|time| time % PERIOD == 0 && time <= highest));
                prop_assert!(list.windows(2).all(|pair| pair[1] - pair[0] == PERIOD));
            }
            // Every instant that the last message makes due has been released.
            let lists = releases(&clock);
            let last = lists.last().and_then(|list| list.last());
            let newest = {
                let mut follower = ClockFollower::new(PERIOD);
                clock.iter().for_each(|&time| follower.receive(time, false));
                follower.state().newest.expect("at least one")
            };
            prop_assert!(last.is_none_or(|last| last + PERIOD > newest));
        }
    }
}
