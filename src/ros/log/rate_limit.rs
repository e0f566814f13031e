//! Rate limit of log lines, so that a flood of messages to the node does not flood its log.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracing::callsite::Identifier;

/// Period in which lines are counted.
const WINDOW: Duration = Duration::from_secs(1);
/// Largest number of lines of one kind per [`WINDOW`].
const MAX_LINES: u32 = 50;
/// Largest number of kinds that are counted separately; the program has a few hundred log statements.
const MAX_KINDS: usize = 1024;

/// Kind of a log line: log statement, and target for records of `log`.
pub(super) type LineKind = (Identifier, String);

/// Decision about a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RateDecision {
    /// The line is shown.
    Shown,
    /// The line is shown after the given number of lines was left out.
    ShownAfter(u64),
    /// The line is the first that is left out.
    FirstLeftOut,
    /// The line is left out.
    LeftOut,
}

/// Counter of lines by kind.
#[derive(Debug, Default)]
pub(super) struct LineRateLimiter {
    windows: Mutex<HashMap<LineKind, Window>>,
}

#[derive(Debug)]
struct Window {
    began: Instant,
    lines: u32,
    left_out: u64,
}

impl LineRateLimiter {
    /// Decides if a line of this kind is shown at `now`, and counts it.
    pub(super) fn check(&self, kind: LineKind, now: Instant) -> RateDecision {
        let mut windows = self.windows.lock().unwrap_or_else(PoisonError::into_inner);
        if windows.len() >= MAX_KINDS && !windows.contains_key(&kind) {
            windows.clear();
        }
        let window = windows.entry(kind).or_insert(Window { began: now, lines: 0, left_out: 0 });
        if now.saturating_duration_since(window.began) >= WINDOW {
            let left_out = window.left_out;
            *window = Window { began: now, lines: 1, left_out: 0 };
            return if left_out == 0 { RateDecision::Shown } else { RateDecision::ShownAfter(left_out) };
        }
        window.lines = window.lines.saturating_add(1);
        if window.lines <= MAX_LINES {
            return RateDecision::Shown;
        }
        window.left_out += 1;
        if window.left_out == 1 { RateDecision::FirstLeftOut } else { RateDecision::LeftOut }
    }
}

/// Returns the text shown instead of the first line that is left out.
pub(super) fn suppressed(line: &str) -> String {
    format!("more than {MAX_LINES} lines of this kind in a second; further ones are left out: {line}")
}

/// Returns the text of the first line that is shown again.
pub(super) fn resumed(left_out: u64, line: &str) -> String {
    format!("{line} ({left_out} lines of this kind before it were left out)")
}

#[cfg(test)]
mod tests {
    use tracing::Callsite;
    use tracing::metadata::Metadata;

    use super::*;

    struct TestCallsite;
    static CALLSITE: TestCallsite = TestCallsite;
    impl Callsite for TestCallsite {
        fn set_interest(&self, _: tracing::subscriber::Interest) {}
        fn metadata(&self) -> &Metadata<'_> {
            unreachable!("only the address is used")
        }
    }

    #[test]
    fn a_flood_is_limited_reported_once_and_counted() {
        let limiter = LineRateLimiter::default();
        let kind = |target: &str| (Identifier(&CALLSITE), target.to_owned());
        let begin = Instant::now();
        for _ in 0..MAX_LINES {
            assert_eq!(limiter.check(kind("flood"), begin), RateDecision::Shown);
        }
        assert_eq!(limiter.check(kind("flood"), begin), RateDecision::FirstLeftOut);
        for _ in 0..9 {
            assert_eq!(limiter.check(kind("flood"), begin), RateDecision::LeftOut);
        }
        assert_eq!(limiter.check(kind("other"), begin), RateDecision::Shown);
        assert_eq!(limiter.check(kind("flood"), begin + WINDOW), RateDecision::ShownAfter(10));
        assert_eq!(limiter.check(kind("flood"), begin + WINDOW), RateDecision::Shown);
    }

    #[test]
    fn the_number_of_kinds_is_bounded() {
        let limiter = LineRateLimiter::default();
        for n in 0..3 * MAX_KINDS {
            limiter.check((Identifier(&CALLSITE), n.to_string()), Instant::now());
        }
        assert!(limiter.windows.lock().expect("not poisoned").len() <= MAX_KINDS);
    }
}
