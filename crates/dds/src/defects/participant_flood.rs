//! Bound on the rate of new participants, before RustDDS matches them.
//!
//! **Symptom:** thousands of forged announcements of participants delay all samples and services by half a minute, and
//! subscribers lose samples.
//!
//! **Upstream:** RustDDS 0.15.1, `src/rtps/dp_event_loop.rs`: `update_participant` adds reader and writer proxies for every
//! announcement, in the thread that also sends samples and repetitions; each one waits behind all announcements.
//!
//! **Test:** `test_forged_participants_do_not_stop_the_axes` of `test_py/test_hostile_datagrams.py`.
//!
//! **Superfluous when** RustDDS bounds the rate at which it accepts participants.
//!
//! [`BURST`] new participants are accepted at once, further ones at [`RATE`]. The announcement of any other is discarded;
//! it is repeated by its participant, within 3 s by Fast DDS.

use std::collections::HashSet;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracing::warn;

use crate::rtps::Guid;
use crate::rtps::datagram;

/// Number of new participants that are accepted at once; large systems of ROS 2 have some hundred processes.
const BURST: f64 = 500.0;
/// Rate of further ones, 1/s.
const RATE: f64 = 50.0;
/// Time for which a participant that does not repeat its announcement is stored at least.
const STORAGE_TIME: Duration = Duration::from_secs(120);
/// Smallest time between two warnings.
const WARNING_PERIOD: Duration = Duration::from_secs(10);

static PARTICIPANTS: Mutex<Option<Participants>> = Mutex::new(None);

/// Returns true if a datagram may be received at the time `now`: false if it announces a participant beyond the rate.
pub(crate) fn may_receive(datagram: &[u8], now: Instant) -> bool {
    datagram::submessages(datagram).filter_map(|submessage| submessage.announced_participant(datagram)).all(
        |guid| {
            let mut participants = PARTICIPANTS.lock().unwrap_or_else(PoisonError::into_inner);
            participants.get_or_insert_with(|| Participants::new(now)).accepts(guid, now)
        },
    )
}

/// Participants that have been accepted, and the number of those that may follow (token bucket).
#[derive(Debug)]
struct Participants {
    /// Announced since `began`.
    known: HashSet<Guid>,
    /// Announced in the period before.
    earlier: HashSet<Guid>,
    began: Instant,
    /// Number of new participants that may be accepted at the time `filled`.
    free: f64,
    filled: Instant,
    warned: Option<Instant>,
}

impl Participants {
    fn new(now: Instant) -> Self {
        Participants {
            known: HashSet::new(),
            earlier: HashSet::new(),
            began: now,
            free: BURST,
            filled: now,
            warned: None,
        }
    }

    /// Returns true for the announcement of a known participant, or of a new one within the rate.
    fn accepts(&mut self, guid: Guid, now: Instant) -> bool {
        if now.saturating_duration_since(self.began) > STORAGE_TIME {
            (self.earlier, self.began) = (std::mem::take(&mut self.known), now);
        }
        if self.known.contains(&guid) {
            return true;
        }
        if !self.earlier.contains(&guid) {
            let passed = now.saturating_duration_since(self.filled).as_secs_f64();
            (self.free, self.filled) = ((self.free + RATE * passed).min(BURST), now);
            if self.free < 1.0 {
                self.warn(now);
                return false;
            }
            self.free -= 1.0;
        }
        self.known.insert(guid)
    }

    fn warn(&mut self, now: Instant) {
        if self.warned.is_none_or(|at| now.saturating_duration_since(at) > WARNING_PERIOD) {
            self.warned = Some(now);
            warn!(
                "more than {BURST} new participants at once: further ones are accepted at {RATE} per second, when they repeat \
                 their announcements"
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guid(index: u32) -> Guid {
        let mut guid = [7; 16];
        guid[8..12].copy_from_slice(&index.to_be_bytes());
        guid
    }

    #[test]
    fn a_flood_is_accepted_up_to_the_burst_then_at_the_rate() {
        let began = Instant::now();
        let mut participants = Participants::new(began);
        // 20 000 within 10 s.
        let accepted = (0..20_000)
            .filter(|&index| participants.accepts(guid(index), began + Duration::from_micros(500) * index));
        assert_eq!(accepted.count(), 500 + 500 - 1);
    }

    #[test]
    fn known_participants_are_accepted_during_a_flood_and_discarded_ones_later() {
        let began = Instant::now();
        let mut participants = Participants::new(began);
        assert!((0..500).all(|index| participants.accepts(guid(index), began)));
        assert!(!participants.accepts(guid(500), began));
        assert!((0..500).all(|index| participants.accepts(guid(index), began)));
        assert!(participants.accepts(guid(500), began + Duration::from_secs(1)));
    }

    #[test]
    fn participants_that_are_silent_are_forgotten() {
        let began = Instant::now();
        let at = |seconds| began + Duration::from_secs(seconds);
        let mut participants = Participants::new(began);
        assert!(participants.accepts(guid(1), at(0)) && participants.accepts(guid(2), at(0)));
        assert!(participants.accepts(guid(1), at(121)) && participants.accepts(guid(1), at(242)));
        assert!(participants.known.contains(&guid(1)) || participants.earlier.contains(&guid(1)));
        assert!(!participants.known.contains(&guid(2)) && !participants.earlier.contains(&guid(2)));
    }
}
