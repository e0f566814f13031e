//! Fields of an event as text.

use std::fmt::{self, Write as _};

use tracing::Event;
use tracing::field::{Field, Visit};

/// Fields of an event as text: the message, then `name=value` for the others.
#[derive(Default)]
pub(super) struct EventText {
    pub message: String,
    fields: String,
    pub log_target: Option<String>,
}

impl EventText {
    pub fn from_event(event: &Event<'_>) -> Self {
        let mut text = Self::default();
        event.record(&mut text);
        let fields = std::mem::take(&mut text.fields);
        text.message.push_str(&fields);
        text
    }

    /// Returns the target of an event. Records of `log` contain it in a field.
    pub fn target<'a>(&'a self, event: &Event<'a>) -> &'a str {
        self.log_target.as_deref().unwrap_or_else(|| event.metadata().target())
    }
}

impl Visit for EventText {
    fn record_str(&mut self, field: &Field, value: &str) {
        match field.name() {
            "log.target" => self.log_target = Some(value.to_owned()),
            "message" => self.message.push_str(value),
            _ => self.record_debug(field, &value),
        }
    }

    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // Writing to a String does not fail.
        let _ = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name if name.starts_with("log.") => Ok(()),
            name => write!(self.fields, " {name}={value:?}"),
        };
    }
}
