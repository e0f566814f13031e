//! Tests of position controllers: design, margins, predictive control, bumpless transfer.

mod bumpless_transfer;
mod contour;
mod design_common;
mod design_controllers;
mod design_margins;
mod design_poles;
mod frequency_response;
mod gpc;
mod learning;
mod predictive;
mod predictive_recovery;
