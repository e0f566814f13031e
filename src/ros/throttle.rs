//! A log that is not flooded.

use virtual_axes_core::units::{Nanoseconds, SECOND_NS};

/// How often the log tells of the same thing at most.
const LOG_PERIOD: Nanoseconds = SECOND_NS;
/// Things that are remembered; of more, the oldest is told again.
const MOST_THINGS: usize = 64;

/// What was told when; `T` says what it is about.
#[derive(Debug)]
pub struct Throttle<T> {
    told: Vec<(T, Nanoseconds)>,
}

impl<T> Default for Throttle<T> {
    fn default() -> Self {
        Throttle { told: Vec::new() }
    }
}

impl<T: PartialEq> Throttle<T> {
    /// Whether `thing` has not been told for a second at `now` (ns); it counts as told then. A clock
    /// that was set back tells anew.
    pub fn is_due(&mut self, thing: T, now: Nanoseconds) -> bool {
        let Some((_, told)) = self.told.iter_mut().find(|(known, _)| *known == thing) else {
            if self.told.len() == MOST_THINGS {
                self.told.remove(0);
            }
            self.told.push((thing, now));
            return true;
        };
        let is_due = now - *told >= LOG_PERIOD || now < *told;
        if is_due {
            *told = now;
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_thing_is_told_once_a_second() {
        let mut log = Throttle::default();
        assert!(log.is_due("jump", 0));
        assert!(!log.is_due("jump", SECOND_NS - 1));
        assert!(log.is_due("stroke", SECOND_NS - 1));
        assert!(log.is_due("jump", SECOND_NS));
        assert!(!log.is_due("jump", 2 * SECOND_NS - 1));
        assert!(log.is_due("jump", 0), "the clock was set back");
    }

    #[test]
    fn things_without_end_do_not_fill_the_memory() {
        let mut log = Throttle::default();
        for thing in 0..10 * MOST_THINGS {
            assert!(log.is_due(thing, 0));
        }
        assert_eq!(log.told.len(), MOST_THINGS);
    }
}
