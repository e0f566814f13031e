//! Simulated runs in text: figures, tables, the verdict in one line, warnings on parameters, and the page.

pub mod axis_warnings;
pub mod comparison;
pub mod figure;
pub mod table;
pub mod verdict;

mod page;
mod program_report;
mod simulated_run;

pub use page::SimulationPage;
pub use program_report::{ProgramReport, operations_table, time_shares, tools_table};
pub use simulated_run::{SimulatedRun, controller_name};
