//! Gate that delays discovery until the node has created its endpoints.
//!
//! **Symptom:** a Fast DDS participant that starts at the same time as two nodes may lack some of their endpoints for ever.
//!
//! **Upstream:** RustDDS 0.15.1, `src/discovery/discovery.rs` lines 1810 and 1911: endpoints are announced one by one at
//! their creation, without a timestamp. Fast DDS 2.14, `History::get_change_nts`: of announcements without timestamps that
//! wait for an earlier one, those of one participant hide those of another, and are acknowledged all the same.
//!
//! **Test:** `test_py/test_simultaneous_start.py`.
//!
//! **Superfluous when** RustDDS writes these announcements with timestamps.
//!
//! No participant is matched before all endpoints are in the history of the discovery writers, from which they are
//! requested in order:
//!
//! | state | discovery thread | event loop |
//! |---|---|---|
//! | closed | is held: no announcement | creates the endpoints, receives nothing |
//! | announcing | announces participant and endpoints | receives nothing, so no other participant is known |
//! | open | free | free |
//!
//! RustDDS has no interface for this. Its two threads, recognized by their names, pass the gate where they wait for
//! events, in the `epoll_wait` of `virtual_axes_node`. In other programs, and in systems without epoll, the gate has
//! no effect.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// Name of the discovery thread of RustDDS 0.15.
const DISCOVERY_THREAD: &str = "RustDDS discovery thread";
/// Beginning of the name of RustDDS 0.15's thread that sends and receives.
const EVENT_LOOP_THREAD: &str = "RustDDS Participant ";
/// Period of the event loop while it receives nothing.
const EVENT_LOOP_PERIOD: Duration = Duration::from_micros(200);
/// Timeout for each step of the opening, and longest time for which the discovery thread is held.
const TIMEOUT: Duration = Duration::from_secs(5);

static GATE: Gate = Gate::new();

/// Closed gate of this process; opens on drop, within some 2 ms.
///
/// Drop it before the participant, which waits for its threads.
#[derive(Debug)]
pub struct ClosedGate(());

impl ClosedGate {
    /// Closes the gate. Call it before the participant is created.
    #[expect(clippy::new_without_default, reason = "it has an effect")]
    pub fn new() -> Self {
        GATE.close();
        ClosedGate(())
    }
}

impl Drop for ClosedGate {
    fn drop(&mut self) {
        GATE.open();
    }
}

/// Passes the gate before a thread waits for events. Returns false if the thread must continue without events.
pub fn pass() -> bool {
    let thread = thread::current();
    let name = thread.name().unwrap_or_default();
    if name == DISCOVERY_THREAD {
        GATE.pass_discovery();
        true
    } else {
        !name.starts_with(EVENT_LOOP_THREAD) || GATE.pass_event_loop()
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Closed,
    Announcing,
    Open,
}

#[derive(Debug)]
struct State {
    phase: Phase,
    /// Number of times that the discovery thread has come to the gate.
    discovery: u64,
    /// Number of times that the event loop has come to the gate.
    event_loop: u64,
}

#[derive(Debug)]
struct Gate {
    state: Mutex<State>,
    changed: Condvar,
}

impl Gate {
    const fn new() -> Self {
        let state = State { phase: Phase::Open, discovery: 0, event_loop: 0 };
        Gate { state: Mutex::new(state), changed: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn close(&self) {
        *self.lock() = State { phase: Phase::Closed, discovery: 0, event_loop: 0 };
    }

    /// Opens the gate. Without threads at the gate, this takes no time.
    fn open(&self) {
        if self.lock().event_loop > 0 {
            // The event loop reports the endpoints to the discovery thread, which writes their announcements, which
            // the event loop takes over.
            self.wait_for_passes(|state| state.event_loop, 2);
            self.wait_until(|state| state.discovery > 0);
            self.set_phase(Phase::Announcing);
            self.wait_for_passes(|state| state.discovery, 1);
            self.wait_for_passes(|state| state.event_loop, 2);
        }
        self.set_phase(Phase::Open);
    }

    fn set_phase(&self, phase: Phase) {
        self.lock().phase = phase;
        self.changed.notify_all();
    }

    /// Waits until a thread has come to the gate `more` times more: with 2, it has completed a whole cycle of its work
    /// that began after the call.
    fn wait_for_passes(&self, count: impl Fn(&State) -> u64, more: u64) {
        let seen = count(&self.lock());
        self.wait_until(|state| count(state) >= seen + more);
    }

    fn wait_until(&self, condition: impl Fn(&State) -> bool) {
        let state = self.lock();
        drop(self.changed.wait_timeout_while(state, TIMEOUT, |state| !condition(state)));
    }

    /// Passes the discovery thread.
    fn pass_discovery(&self) {
        let mut state = self.lock();
        if state.phase != Phase::Open {
            state.discovery += 1;
            self.changed.notify_all();
            drop(self.changed.wait_timeout_while(state, TIMEOUT, |state| state.phase == Phase::Closed));
        }
    }

    /// Passes the event loop. Returns false while the gate is not open.
    fn pass_event_loop(&self) -> bool {
        let mut state = self.lock();
        let is_open = state.phase == Phase::Open;
        if !is_open {
            state.event_loop += 1;
            self.changed.notify_all();
            drop(state);
            thread::sleep(EVENT_LOOP_PERIOD);
        }
        is_open
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

    use super::*;

    /// Threads at a gate, as RustDDS has them: the event loop reports endpoints to the discovery thread.
    #[derive(Default)]
    struct Threads {
        created: AtomicUsize,
        reported: AtomicUsize,
        announced: AtomicUsize,
        receives: AtomicBool,
        ended: AtomicBool,
    }

    #[test]
    fn nothing_is_received_before_all_endpoints_are_announced() {
        let gate = Arc::new(Gate::new());
        let threads = Arc::new(Threads::default());
        gate.close();
        let run = |cycle: fn(&Gate, &Threads)| {
            let (gate, threads) = (Arc::clone(&gate), Arc::clone(&threads));
            thread::spawn(move || {
                while !threads.ended.load(Ordering::SeqCst) {
                    cycle(&gate, &threads);
                }
            })
        };
        let event_loop = run(|gate, threads| {
            let receives = gate.pass_event_loop();
            threads.receives.store(receives, Ordering::SeqCst);
            let announced = threads.announced.load(Ordering::SeqCst);
            assert!(!receives || announced == 20, "received with {announced} endpoints announced");
            threads.reported.store(threads.created.load(Ordering::SeqCst), Ordering::SeqCst);
        });
        let discovery = run(|gate, threads| {
            gate.pass_discovery();
            let reported = threads.reported.load(Ordering::SeqCst);
            assert!(reported == 20, "announced with {reported} endpoints reported");
            threads.announced.store(reported, Ordering::SeqCst);
        });
        for _ in 0..20 {
            threads.created.fetch_add(1, Ordering::SeqCst);
            thread::sleep(Duration::from_millis(1));
        }
        assert!(!threads.receives.load(Ordering::SeqCst));
        gate.open();
        while !threads.receives.load(Ordering::SeqCst) && !event_loop.is_finished() {
            thread::sleep(Duration::from_millis(1));
        }
        threads.ended.store(true, Ordering::SeqCst);
        event_loop.join().unwrap();
        discovery.join().unwrap();
    }

    #[test]
    fn a_gate_without_threads_opens_at_once() {
        let began = std::time::Instant::now();
        let gate = Gate::new();
        gate.close();
        gate.open();
        assert!(gate.pass_event_loop());
        assert!(began.elapsed() < TIMEOUT);
    }
}
