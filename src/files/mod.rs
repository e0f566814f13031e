//! Files of set-points and traces.

mod psec_csv;
mod trace_csv;

pub use psec_csv::{PsecError, read_psec};
pub use trace_csv::TraceCsv;
