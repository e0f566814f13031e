//! Scenarios: trials described in data files.
