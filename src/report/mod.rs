//! A report: one HTML page with plots.
