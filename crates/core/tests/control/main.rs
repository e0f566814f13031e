//! TODO

mod design_common;
mod design_controllers;
mod design_margins;
mod design_poles;
mod gpc;
mod predictive;
mod predictive_recovery;
mod predictive_switch;
