//! TODO

mod command;
mod command_campaign;
mod command_common;
mod command_design;
mod ingress_properties;
mod files_output;
mod identify_command;
mod readme;
mod tune_command;
