//! Participants that return after their lease has expired, and the time of the last discovery.
//!
//! **Symptom:** a subscriber that was stopped for longer than its lease gets no samples after it continues.
//!
//! **Upstream:** RustDDS 0.15.1, `src/discovery/discovery_db.rs` line 154, `update_participant`: the endpoints of a
//! participant that returns are restored to the list of discovered endpoints, but none is matched.
//!
//! **Test:** `test_py/test_faults_subscribers.py`.
//!
//! **Superfluous when** RustDDS matches the restored endpoints.
//!
//! Readers are matched when a local writer of their topic is created, which [`super::writer_rotation`] does for the topics
//! of participants that have returned. Services and transient-local topics are not matched again.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use rustdds::{DomainParticipantStatusEvent, GUID, LostReason};

/// Time after a discovery in which the announcements have been exchanged.
const DISCOVERY_TIME: Duration = Duration::from_secs(5);
/// Largest number of participants with expired lease that are remembered; most of them have been killed.
const MAX_EXPIRED: usize = 1000;

/// Shared record of other participants.
#[derive(Debug, Clone, Default)]
pub(crate) struct RemoteParticipants(Arc<Mutex<Participants>>);

#[derive(Debug, Default)]
struct Participants {
    /// Known participants; true if the lease has expired.
    known: HashMap<GUID, bool>,
    returned: HashSet<GUID>,
    last_discovery: Option<Instant>,
}

impl RemoteParticipants {
    /// Updates the record by a status event, which happened at `now`.
    pub(crate) fn update(&self, event: &DomainParticipantStatusEvent, now: Instant) {
        match event {
            DomainParticipantStatusEvent::ParticipantDiscovered { dpd } => self.lock().insert(dpd.guid, now),
            DomainParticipantStatusEvent::ParticipantLost { id, reason } => {
                let mut participants = self.lock();
                let lost = participants.known.keys().find(|guid| guid.prefix == *id).copied();
                if let Some(guid) = lost {
                    participants.remove(guid, matches!(reason, LostReason::Timeout { .. }));
                }
            }
            _ => {}
        }
    }

    /// Returns true if no participant has been discovered within the last 5 s.
    pub(crate) fn is_settled(&self, now: Instant) -> bool {
        self.lock().last_discovery.is_none_or(|last| now.duration_since(last) >= DISCOVERY_TIME)
    }

    /// Returns the participants that have returned since the last call.
    pub(crate) fn take_returned(&self) -> HashSet<GUID> {
        std::mem::take(&mut self.lock().returned)
    }

    fn lock(&self) -> MutexGuard<'_, Participants> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Participants {
    fn insert(&mut self, guid: GUID, now: Instant) {
        self.last_discovery = Some(now);
        if self.known.insert(guid, false) == Some(true) {
            self.returned.insert(guid);
        }
    }

    fn remove(&mut self, guid: GUID, is_expired: bool) {
        self.returned.remove(&guid);
        if is_expired {
            if self.known.values().filter(|is_expired| **is_expired).count() >= MAX_EXPIRED {
                self.known.retain(|_, is_expired| !*is_expired);
            }
            self.known.insert(guid, true);
        } else {
            self.known.remove(&guid);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guid(n: u16) -> GUID {
        let [high, low] = n.to_be_bytes();
        GUID::from_bytes([1, 0x0f, high, low, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0xc1])
    }

    #[test]
    fn a_participant_returns_only_after_its_lease_has_expired() {
        let now = Instant::now();
        let shared = RemoteParticipants::default();
        shared.lock().insert(guid(1), now);
        shared.lock().insert(guid(2), now);
        shared.lock().insert(guid(3), now);
        shared.lock().remove(guid(1), true);
        shared.lock().remove(guid(2), false);
        assert!(shared.take_returned().is_empty());
        (1..=3).for_each(|n| shared.lock().insert(guid(n), now));
        assert_eq!(shared.take_returned(), HashSet::from([guid(1)]));
        assert!(shared.take_returned().is_empty());
        shared.lock().insert(guid(1), now);
        assert!(shared.take_returned().is_empty());
    }

    #[test]
    fn discovery_is_settled_after_5_s() {
        let now = Instant::now();
        let shared = RemoteParticipants::default();
        assert!(shared.is_settled(now));
        shared.lock().insert(guid(1), now);
        assert!(!shared.is_settled(now + Duration::from_millis(4900)));
        assert!(shared.is_settled(now + Duration::from_secs(5)));
    }

    #[test]
    fn the_number_of_expired_participants_is_bounded() {
        let now = Instant::now();
        let mut participants = Participants::default();
        participants.insert(guid(0), now);
        for n in 1..3000 {
            participants.insert(guid(n), now);
            participants.remove(guid(n), true);
        }
        assert!(participants.known.len() <= MAX_EXPIRED + 1);
        assert!(participants.known.contains_key(&guid(0)));
    }
}
