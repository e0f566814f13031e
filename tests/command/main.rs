//! Tests of the command `virtual_axes` and of its input and output files.

mod bode_command;
mod command;
mod command_campaign;
mod command_common;
mod command_design;
mod examples;
mod files_output;
mod hints;
mod identify_command;
mod identify_elastic;
mod identify_next;
mod identify_options;
mod identify_traces;
mod interface;
mod learn_command;
mod limit_audit;
mod output_form;
mod own_machines;
mod part_programs;
mod program_setup;
mod reference;
mod run_part_program;
mod tune_command;
mod validation_properties;
mod warnings;
mod worst_line;
