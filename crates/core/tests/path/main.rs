//! Tests of paths, kinematics, scenarios and motion assessment.

mod circularity;
mod closed_form;
mod kinematic_chains;
mod kinematics;
mod path_blocks;
mod path_common;
mod path_program;
mod path_tracker;
mod reference_numbers;
mod scenario_properties;
mod setpoint_tracker;
