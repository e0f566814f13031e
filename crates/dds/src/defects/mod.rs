//! Defects of the middleware, each with its remedy: symptom, place upstream, test that fails without the remedy, and the
//! condition under which it is superfluous. docs/internals/middleware.md is the index.

mod announced_writers;
pub(crate) mod announcement_eviction;
pub(crate) mod client_discovery;
pub(crate) mod datagram_bounds;
pub(crate) mod discovery_gate;
pub(crate) mod dispose;
pub(crate) mod heartbeat_request;
pub(crate) mod large_response;
pub(crate) mod late_readers;
pub(crate) mod participant_flood;
pub(crate) mod reception_order;
pub(crate) mod returned_participants;
mod stalled_readers;
pub(crate) mod static_peers;
pub(crate) mod writer_rotation;
