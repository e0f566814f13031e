//! A log that whoever floods the node does not flood too.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracing::callsite::Identifier;

/// The span of time in which lines are counted.
const WINDOW: Duration = Duration::from_secs(1);
/// Lines of one kind in it, far more than anybody reads.
const LINES: u32 = 50;
/// Kinds that are told apart; there are a few hundred places that log.
const MOST_KINDS: usize = 1024;

/// Where a line comes from: the place in the program, and the target of what comes through `log`.
pub(super) type Kind = (Identifier, String);

/// What becomes of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// It is shown.
    Shown,
    /// It is shown, and so many before it were not.
    ShownAfter(u64),
    /// It is the first that is left out.
    FirstLeftOut,
    /// It is left out.
    LeftOut,
}

/// Counts lines of each kind.
#[derive(Debug, Default)]
pub(super) struct Limiter {
    windows: Mutex<HashMap<Kind, Window>>,
}

#[derive(Debug)]
struct Window {
    began: Instant,
    lines: u32,
    left_out: u64,
}

impl Limiter {
    /// Whether a line of this kind is shown at `now`.
    pub(super) fn judge(&self, kind: Kind, now: Instant) -> Verdict {
        let mut windows = self.windows.lock().unwrap_or_else(PoisonError::into_inner);
        if windows.len() >= MOST_KINDS && !windows.contains_key(&kind) {
            windows.clear();
        }
        let window = windows.entry(kind).or_insert(Window { began: now, lines: 0, left_out: 0 });
        if now.saturating_duration_since(window.began) >= WINDOW {
            let left_out = window.left_out;
            *window = Window { began: now, lines: 1, left_out: 0 };
            return if left_out == 0 { Verdict::Shown } else { Verdict::ShownAfter(left_out) };
        }
        window.lines = window.lines.saturating_add(1);
        if window.lines <= LINES {
            return Verdict::Shown;
        }
        window.left_out += 1;
        if window.left_out == 1 { Verdict::FirstLeftOut } else { Verdict::LeftOut }
    }
}

/// What is shown in place of the first line that is left out.
pub(super) fn begins(line: &str) -> String {
    format!("more than {LINES} lines of this kind in a second, the rest of them is left out: {line}")
}

/// Likewise where the next line is shown.
pub(super) fn ends(left_out: u64, line: &str) -> String {
    format!("{line} ({left_out} lines of this kind before it were left out)")
}

#[cfg(test)]
mod tests {
    use tracing::Callsite;
    use tracing::metadata::Metadata;

    use super::*;

    struct Place;
    static PLACE: Place = Place;
    impl Callsite for Place {
        fn set_interest(&self, _: tracing::subscriber::Interest) {}
        fn metadata(&self) -> &Metadata<'_> {
            unreachable!("only its address counts")
        }
    }

    #[test]
    fn a_flood_is_cut_told_of_once_and_counted() {
        let limiter = Limiter::default();
        let kind = |target: &str| (Identifier(&PLACE), target.to_owned());
        let begin = Instant::now();
        for _ in 0..LINES {
            assert_eq!(limiter.judge(kind("flood"), begin), Verdict::Shown);
        }
        assert_eq!(limiter.judge(kind("flood"), begin), Verdict::FirstLeftOut);
        for _ in 0..9 {
            assert_eq!(limiter.judge(kind("flood"), begin), Verdict::LeftOut);
        }
        assert_eq!(limiter.judge(kind("other"), begin), Verdict::Shown);
        assert_eq!(limiter.judge(kind("flood"), begin + WINDOW), Verdict::ShownAfter(10));
        assert_eq!(limiter.judge(kind("flood"), begin + WINDOW), Verdict::Shown);
    }

    #[test]
    fn kinds_without_end_do_not_fill_the_memory() {
        let limiter = Limiter::default();
        for n in 0..3 * MOST_KINDS {
            limiter.judge((Identifier(&PLACE), n.to_string()), Instant::now());
        }
        assert!(limiter.windows.lock().expect("nobody panicked").len() <= MOST_KINDS);
    }
}
