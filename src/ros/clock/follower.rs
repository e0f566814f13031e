//! A clock that is followed: which position instants it makes due, and when it has jumped.

use virtual_axes_core::units::{Nanoseconds, SECOND_NS};

/// A clock that goes further than this from one message to the next has jumped; less is a stretch of
/// time to be simulated. The coarsest clocks in use tick once a second, and a recording played a
/// hundred times faster with 40 messages a second goes 2.5 s at a time; a machine computes this much
/// in about a second.
pub const LONGEST_STRETCH: Nanoseconds = 10 * SECOND_NS;

/// Where the clock last began anew.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Jump {
    /// How often it has, its first message included.
    pub count: u64,
    /// What it was before, ns; none the first time.
    pub from: Option<Nanoseconds>,
    /// What it was then, ns.
    pub to: Nanoseconds,
}

/// The clock as its messages tell it.
#[derive(Debug)]
pub struct Follower {
    period: Nanoseconds,
    newest: Option<Nanoseconds>,
    jump: Jump,
}

impl Follower {
    /// One that has no time yet, for position instants `period` ns apart.
    pub fn new(period: Nanoseconds) -> Self {
        Follower { period, newest: None, jump: Jump::default() }
    }

    /// The newest time, ns; none before the first message.
    pub fn newest(&self) -> Option<Nanoseconds> {
        self.newest
    }

    /// Where it last began anew.
    pub fn jump(&self) -> Jump {
        self.jump
    }

    /// Follows on from a clock of the node's own that stands at `time` ns.
    pub fn follow_on_from(&mut self, time: Nanoseconds) {
        self.newest = Some(self.newest.map_or(time, |newest| newest.max(time)));
    }

    /// Takes a message. `stretches` says that its sender never jumps ahead, however far it goes.
    ///
    /// A clock set back by less than a position period is waited for: nothing that has been released
    /// needs to be taken back.
    pub fn take(&mut self, time: Nanoseconds, stretches: bool) {
        let Some(newest) = self.newest else {
            self.begin_anew(time);
            return;
        };
        let ahead = time.saturating_sub(newest);
        if ahead <= -self.period || (ahead > LONGEST_STRETCH && !stretches) {
            self.begin_anew(time);
        } else {
            self.newest = Some(newest.max(time));
        }
    }

    fn begin_anew(&mut self, time: Nanoseconds) {
        self.jump = Jump { count: self.jump.count + 1, from: self.newest, to: time };
        self.newest = Some(time);
    }
}

/// The first position instant of a grid of `period` ns through 0 that is not before `time`, ns.
pub fn first_instant(time: Nanoseconds, period: Nanoseconds) -> Nanoseconds {
    -(-time).div_euclid(period) * period
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PERIOD: Nanoseconds = 6_000_000;

    /// Takes the messages, and collects the instants that are released after each; a jump begins a
    /// list of its own.
    fn releases(messages: &[Nanoseconds]) -> Vec<Vec<Nanoseconds>> {
        let mut follower = Follower::new(PERIOD);
        let mut released: Vec<Vec<Nanoseconds>> = Vec::new();
        let mut next = 0;
        for &message in messages {
            let before = follower.jump().count;
            follower.take(message, false);
            if follower.jump().count != before {
                next = first_instant(follower.jump().to, PERIOD);
                released.push(Vec::new());
            }
            while next <= follower.newest().expect("a message has come") {
                released.last_mut().expect("the first message begins a list").push(next);
                next += PERIOD;
            }
        }
        released
    }

    #[test]
    fn a_coarse_clock_releases_many_instants_at_once_a_fine_one_now_and_then() {
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
    fn a_clock_that_goes_back_or_far_ahead_begins_anew() {
        let jump = |from, to| {
            let mut follower = Follower::new(PERIOD);
            follower.take(from, false);
            follower.take(to, false);
            (follower.jump().count == 2).then(|| follower.jump())
        };
        let at = 100 * SECOND_NS;
        let begun = |to| Some(Jump { count: 2, from: Some(at), to });
        assert_eq!(jump(at, 0), begun(0));
        assert_eq!(jump(at, at - PERIOD), begun(at - PERIOD));
        assert_eq!(jump(at, at - PERIOD + 1), None);
        assert_eq!(jump(at, at), None);
        assert_eq!(jump(at, at + LONGEST_STRETCH), None);
        assert_eq!(jump(at, at + LONGEST_STRETCH + 1), begun(at + LONGEST_STRETCH + 1));
    }

    #[test]
    fn a_machine_never_jumps_ahead() {
        let mut follower = Follower::new(PERIOD);
        follower.take(0, true);
        follower.take(1000 * SECOND_NS, true);
        assert_eq!((follower.jump().count, follower.newest()), (1, Some(1000 * SECOND_NS)));
    }

    proptest! {
        #[test]
        fn between_jumps_the_grid_is_unbroken_and_never_ahead_of_the_clock(
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
                let mut follower = Follower::new(PERIOD);
                clock.iter().for_each(|&time| follower.take(time, false));
                follower.newest().expect("at least one")
            };
            prop_assert!(last.is_none_or(|last| last + PERIOD > newest));
        }
    }
}
