//! Identification of drive parameters from recordings, and tuning of controllers.

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod identify;
pub mod recording;
pub mod tune;
