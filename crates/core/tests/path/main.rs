//! Tests of paths, kinematics, scenarios and motion assessment.

mod circularity;
mod closed_form;
mod kinematics;
mod path_blocks;
mod path_common;
mod path_program;
mod path_tracker;
mod reference_numbers;
mod scenario_properties;
mod scenarios;
mod setpoint_tracker;
