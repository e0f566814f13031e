//! Tests of report pages.

mod report_common;
mod report_compare;
mod report_document;
mod report_identification;
mod report_page;
