//! ROS 2 interface of the node: topics, services, the action, parameters, log and clock.
//!
//! `pace` runs the thread that owns the simulation and the clock; in real time it never waits for the network.
//! Everything else runs on tokio and exchanges data with that thread through bounded channels.
//!
//! Workarounds for interoperability with Fast DDS and for limits of RustDDS, each described in its module
//! (overview: docs/internals/middleware.md):
//!
//! | module | RTPS submessage | purpose |
//! |---|---|---|
//! | `heartbeat_request` | ACKNACK, NACK_FRAG, HEARTBEAT | requests a HEARTBEAT and the first sample of a publisher that was matched late |
//! | `stalled_readers` | GAP | unblocks a writer stalled by a reader whose ACKNACKs acknowledge nothing |
//! | `dispose` | DATA with PID_KEY_HASH | disposes of the participant or a writer |
//! | `large_response` | DATA, GAP | delivers service responses longer than the path's MTU |
//! | `announcement_eviction` | DATA with key | discovers a participant again that returns after its lease has expired |
//! | `static_peers` | those of RustDDS | announces the participant to other hosts without multicast |
//! | `discovery_gate` | – | delays discovery until all endpoints exist |
//! | `renewal` | – | releases the memory of departed endpoints |
//! | `writer_rotation` | – | bounds the memory of a volatile writer; matches the readers of a returned participant |

mod action;
mod announced_writers;
mod announcement_eviction;
mod arc_pool;
mod axes_interface;
mod clock;
mod convert;
mod diagnostics;
pub mod discovery_gate;
mod discovery_message;
mod dispose;
mod duplicate_node_name;
mod endpoints;
pub mod environment;
mod fan_out;
mod goal_event;
mod health;
mod heartbeat_request;
mod inputs;
mod large_response;
mod lifecycle;
pub mod log;
mod matched_subscriptions;
pub mod node;
mod outputs;
mod overflow;
mod own_participants;
mod pace;
mod parameter_host;
pub mod parameter_services;
pub mod participant;
mod process_memory;
mod program;
mod query_state;
mod readers;
mod recorder;
mod remote_endpoints;
mod remote_participants;
mod renewable;
mod renewal;
mod response_limiter;
mod results;
pub mod rosout;
mod rtps;
pub mod security;
mod service;
mod service_endpoints;
mod setpoints;
mod stalled_readers;
mod static_peers;
mod stream;
mod throttle;
mod tool;
mod topic_writers;
mod topics;
mod trigger;
mod writer_rotation;

use crate::ingress::{args, names};
