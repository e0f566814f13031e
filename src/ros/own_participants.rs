//! Participants of this process: the current one and, during a renewal, the next or the previous one.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ros2_client::Context;
use rustdds::{DomainParticipant, RTPSEntity};

use super::environment::DiscoveryRange;
use super::participant::{Participant, ParticipantError};

/// Shared participants of this process, which are disposed of by [`Self::shutdown`].
#[derive(Debug, Clone)]
pub struct OwnParticipants(Arc<Mutex<State>>);

#[derive(Debug)]
struct State {
    current: Option<Participant>,
    /// Next participant until the switch, previous one after it.
    other: Option<Participant>,
    /// GUID prefixes (RTPS 2.5, 9.3.1) of all participants since the start.
    prefixes: Vec<[u8; 12]>,
}

impl State {
    fn add_prefix(&mut self, participant: &Participant) {
        let prefix = |guid: [u8; 16]| std::array::from_fn(|i| guid[i]);
        self.prefixes.extend(participant.dds().map(|dds| prefix(dds.guid().to_bytes())));
    }
}

impl OwnParticipants {
    /// Creates the record with the first participant.
    pub(super) fn new(first: Participant) -> Self {
        let mut state = State { current: None, other: None, prefixes: Vec::new() };
        state.add_prefix(&first);
        state.current = Some(first);
        OwnParticipants(Arc::new(Mutex::new(state)))
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the current DDS participant, or `None` after the shutdown. Do not keep it over a renewal.
    pub(super) fn current(&self) -> Option<DomainParticipant> {
        self.lock().current.as_ref().and_then(|participant| participant.dds().cloned())
    }

    /// Creates a ROS context on the current participant.
    ///
    /// # Errors
    /// [`ParticipantError::Context`] after the shutdown, or if the context cannot be created.
    pub(super) fn context(&self) -> Result<Context, ParticipantError> {
        self.lock().current.as_ref().ok_or_else(closed)?.context()
    }

    /// Returns the network range in which the participants are announced.
    pub(super) fn range(&self) -> DiscoveryRange {
        self.lock().current.as_ref().map_or(DiscoveryRange::Off, Participant::range)
    }

    /// Returns the hosts to which the participants are announced by name.
    pub(super) fn static_peers(&self) -> Vec<String> {
        self.lock()
            .current
            .as_ref()
            .map(|participant| participant.static_peers().to_vec())
            .unwrap_or_default()
    }

    /// Returns true if the GUID belongs to a participant of this process, present or past.
    pub(super) fn contains(&self, guid: &[u8; 16]) -> bool {
        self.contains_prefix(&guid[..12])
    }

    /// Returns true if the GUID prefix belongs to a participant of this process, present or past.
    pub(super) fn contains_prefix(&self, prefix: &[u8]) -> bool {
        self.lock().prefixes.iter().any(|own| own == prefix)
    }

    /// Opens the next participant. Returns a ROS context on it.
    ///
    /// # Errors
    /// [`ParticipantError`] if the middleware cannot create it, or after the shutdown.
    pub(super) fn open_next(&self) -> Result<Context, ParticipantError> {
        let mut state = self.lock();
        let next = state.current.as_ref().ok_or_else(closed)?.open_another()?;
        let context = next.context()?;
        state.add_prefix(&next);
        state.other = Some(next);
        Ok(context)
    }

    /// Makes the next participant the current one, and the current one the previous.
    pub(super) fn switch(&self) {
        let state = &mut *self.lock();
        std::mem::swap(&mut state.current, &mut state.other);
    }

    /// Disposes of the next participant, or after the switch of the previous one; takes about 40 ms.
    ///
    /// Drop its endpoints and contexts before.
    pub(super) fn close_other(&self) {
        let other = self.lock().other.take();
        drop(other);
    }

    /// Disposes of all participants.
    pub(super) fn shutdown(&self) {
        self.close_other();
        let current = self.lock().current.take();
        drop(current);
    }
}

fn closed() -> ParticipantError {
    ParticipantError::Context { reason: "the participant is shut down".to_owned() }
}
