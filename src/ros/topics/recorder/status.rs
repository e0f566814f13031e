//! Diagnostics of a recording.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::{DiagnosticStatus, KeyValue};

use super::shared::Shared;
use crate::ros_interface::diagnostics::{self as keys, DiagnosticKey};

/// Bytes per megabyte.
pub(super) const MEGABYTE: u64 = 1_000_000;

/// Returns the current value of a counter.
pub(super) fn number(count: &AtomicU64) -> u64 {
    count.load(Ordering::Relaxed)
}

/// Source of the diagnostics of a recording.
pub struct RecordingStatus {
    shared: Arc<Shared>,
    /// Number of messages left out at the previous call.
    left_out: u64,
}

impl RecordingStatus {
    pub(super) fn new(shared: Arc<Shared>) -> Self {
        RecordingStatus { shared, left_out: 0 }
    }

    /// Returns the diagnostic status of the recording, with the names of `node` and its machine.
    pub fn message(&mut self, node: &str, machine: &str) -> DiagnosticStatus {
        let shared = &self.shared;
        let left_out = number(&shared.left_out);
        let before = std::mem::replace(&mut self.left_out, left_out);
        let ended = shared.end_reason.get();
        let (level, message) = match ended {
            Some(reason) => (DiagnosticStatus::WARN, format!("recording has ended: {reason}")),
            None if left_out > before => {
                let text = "messages are left out: the file is written too slowly".to_owned();
                (DiagnosticStatus::WARN, text)
            }
            None => (DiagnosticStatus::OK, "recording".to_owned()),
        };
        let value = |key: DiagnosticKey, value: String| KeyValue { key: key.key.to_owned(), value };
        let values = vec![
            value(keys::FILE, shared.path.clone()),
            value(keys::RECORDING, ended.is_none().to_string()),
            value(keys::SIZE_MB, format!("{:.3}", number(&shared.bytes) as f64 / MEGABYTE as f64)),
            value(keys::MESSAGES, number(&shared.messages).to_string()),
            value(keys::LEFT_OUT, left_out.to_string()),
        ];
        let (name, hardware_id) = (format!("{node}: recording"), machine.to_owned());
        DiagnosticStatus { level, name, message, hardware_id, values }
    }
}
