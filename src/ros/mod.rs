//! The ROS 2 side: the door through which messages come in, and the thread that paces the machine.
//!
//! `pace` owns the simulation and the clock and never waits for the network in real time; the rest
//! runs on tokio and talks to it through bounded channels.

mod action;
mod ask_again;
mod clock;
mod convert;
mod deaf;
mod diagnostics;
mod endpoints;
pub mod environment;
mod fan_out;
mod footprint;
mod goodbye;
mod heard;
mod inputs;
mod large_response;
pub mod log;
mod namesake;
pub mod node;
mod outputs;
mod pace;
mod parameter_host;
pub mod parameter_services;
pub mod participant;
mod readers;
mod recorder;
mod results;
mod reused;
pub mod rosout;
mod rtps;
pub mod security;
mod service;
mod setpoints;
mod stream;
mod throttle;
mod tool;
mod topics;
mod trigger;
mod unsent;
mod writers;

use crate::door::{args, names};
