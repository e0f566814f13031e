//! What the diagnostics say about a recording.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::{DiagnosticStatus, KeyValue};

use super::Shared;

/// Bytes of a megabyte.
pub(super) const MEGABYTE: u64 = 1_000_000;

/// A count as it is now.
pub(super) fn number(count: &AtomicU64) -> u64 {
    count.load(Ordering::Relaxed)
}

/// Looks at a recording from time to time.
pub struct RecordingStatus {
    shared: Arc<Shared>,
    /// Messages that had been left out when it was looked at before.
    left_out: u64,
}

impl RecordingStatus {
    pub(super) fn new(shared: Arc<Shared>) -> Self {
        RecordingStatus { shared, left_out: 0 }
    }

    /// How the recording is, on behalf of `node` and its machine.
    pub fn message(&mut self, node: &str, machine: &str) -> DiagnosticStatus {
        let shared = &self.shared;
        let left_out = number(&shared.left_out);
        let before = std::mem::replace(&mut self.left_out, left_out);
        let ended = shared.ended.get();
        let (level, message) = match ended {
            Some(reason) => (DiagnosticStatus::WARN, format!("recording has ended: {reason}")),
            None if left_out > before => {
                let text = "messages are left out: the file is written too slowly".to_owned();
                (DiagnosticStatus::WARN, text)
            }
            None => (DiagnosticStatus::OK, "recording".to_owned()),
        };
        let value = |key: &str, value: String| KeyValue { key: key.to_owned(), value };
        let values = vec![
            value("file", shared.path.clone()),
            value("recording", ended.is_none().to_string()),
            value("size_mb", format!("{:.3}", number(&shared.bytes) as f64 / MEGABYTE as f64)),
            value("messages", number(&shared.messages).to_string()),
            value("left_out", left_out.to_string()),
        ];
        let (name, hardware_id) = (format!("{node}: recording"), machine.to_owned());
        DiagnosticStatus { level, name, message, hardware_id, values }
    }
}
