//! Rate limit of log messages: one per second for each subject.

use virtual_axes_core::units::{Nanoseconds, SECOND_NS};

/// Shortest time between two log messages about the same subject, ns.
const LOG_PERIOD: Nanoseconds = SECOND_NS;
/// Largest number of remembered subjects; the oldest is forgotten for a new one.
const MAX_SUBJECTS: usize = 64;

/// Times of the last log messages by subject `T`.
#[derive(Debug)]
pub struct Throttle<T> {
    logged: Vec<(T, Nanoseconds)>,
}

impl<T> Default for Throttle<T> {
    fn default() -> Self {
        Throttle { logged: Vec::new() }
    }
}

impl<T: PartialEq> Throttle<T> {
    /// Returns true if no message about `subject` was logged in the second before `now` (ns), and records it as
    /// logged then.
    ///
    /// Also returns true if the clock was set back.
    pub fn is_due(&mut self, subject: T, now: Nanoseconds) -> bool {
        let Some((_, logged)) = self.logged.iter_mut().find(|(known, _)| *known == subject) else {
            if self.logged.len() == MAX_SUBJECTS {
                self.logged.remove(0);
            }
            self.logged.push((subject, now));
            return true;
        };
        let is_due = now - *logged >= LOG_PERIOD || now < *logged;
        if is_due {
            *logged = now;
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_subject_is_logged_once_per_second() {
        let mut log = Throttle::default();
        assert!(log.is_due("jump", 0));
        assert!(!log.is_due("jump", SECOND_NS - 1));
        assert!(log.is_due("limit", SECOND_NS - 1));
        assert!(log.is_due("jump", SECOND_NS));
        assert!(!log.is_due("jump", 2 * SECOND_NS - 1));
        assert!(log.is_due("jump", 0), "the clock was set back");
    }

    #[test]
    fn the_number_of_remembered_subjects_is_bounded() {
        let mut log = Throttle::default();
        for subject in 0..10 * MAX_SUBJECTS {
            assert!(log.is_due(subject, 0));
        }
        assert_eq!(log.logged.len(), MAX_SUBJECTS);
    }
}
