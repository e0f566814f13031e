//! YAML with line numbers in its errors.

use serde::de::DeserializeOwned;
use serde_saphyr::{Error, NonFiniteFloatPolicy};

use super::{nearest, nearest_name, shortened};

/// Longest text that is read, bytes: half an hour of five axes, point by point.
pub(super) const LONGEST: u64 = 64 << 20;

/// Least bound on nodes: a stream and a document are counted too.
const FEWEST: usize = 1 << 10;

/// The documents of a text; empty ones are left out.
///
/// # Errors
/// The line, 0 where it is not known, and what is wrong there.
pub(super) fn documents<T: DeserializeOwned>(text: &str) -> Result<Vec<T>, (u64, String)> {
    // A node takes a byte at least: the text's length, which is bounded, bounds them all.
    let length = text.len().max(FEWEST);
    let budget = serde_saphyr::budget! {
        max_events: length.saturating_mul(2),
        max_nodes: length,
        max_total_scalar_bytes: length,
        max_documents: length,
    };
    let options = serde_saphyr::options! {
        // In YAML 1.1 `y` is true; here it is the name of an axis.
        strict_booleans: true,
        // Let through, to be refused together with the point.
        non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
        with_snippet: false,
        budget: budget,
    };
    serde_saphyr::from_multiple_with_options(text, options).map_err(|error| {
        let line = error.location().map_or(0, |location| location.line());
        let (error, alias) = match error.without_snippet() {
            Error::AliasError { error, locations, .. } => (&**error, locations.defined_location.line()),
            error => (error, line),
        };
        let mut reason = message(error);
        // Of what stands there, such a message says nothing.
        if reason.starts_with("expected ")
            && let Some(text) = (line as usize).checked_sub(1).and_then(|row| text.lines().nth(row))
        {
            reason += &format!(": {}", shortened(text.trim()));
        }
        if alias != line {
            reason += &format!(" (what the alias stands for is in line {alias})");
        }
        (line, reason)
    })
}

/// What the reader says, without the position.
fn message(error: &Error) -> String {
    match error {
        Error::SerdeUnknownField { field, expected, .. } => format!(
            "unknown field {}; there are {}{}",
            shortened(field),
            expected.join(", "),
            nearest_name(&nearest(field, expected.iter().copied()))
        ),
        Error::DuplicateMappingKey { key, .. } => {
            format!("{} stands twice in one mapping", key.as_deref().map_or("a key".to_owned(), shortened))
        }
        error => {
            let text = error.to_string();
            let message = text.rsplit_once(" at line ").map_or(text.as_str(), |(message, _)| message);
            let message = message.trim_start_matches("error: ");
            match message {
                "expected sequence start" => "expected a list".to_owned(),
                "expected mapping start" => "expected a mapping".to_owned(),
                message => shortened(message),
            }
        }
    }
}
