//! Dates and times of day in the column of the time.

use std::cell::OnceCell;

use time::format_description::well_known::Iso8601;
use time::{Date, OffsetDateTime, PrimitiveDateTime, Time};

/// Reader of the time stamps of a recording: times count from its first time stamp.
#[derive(Debug, Default)]
pub(super) struct TimestampReader {
    origin: OnceCell<OffsetDateTime>,
}

impl TimestampReader {
    /// Returns the seconds from the first time stamp to `text`, a date and time or a time of day after ISO 8601, also with
    /// a blank between both; `None` for other texts.
    pub fn seconds(&self, text: &str) -> Option<f64> {
        let time = parse(text)?;
        Some((time - *self.origin.get_or_init(|| time)).as_seconds_f64())
    }
}

fn parse(text: &str) -> Option<OffsetDateTime> {
    let text = text.replacen(' ', "T", 1);
    let format = &Iso8601::PARSING;
    let local = || PrimitiveDateTime::parse(&text, format).ok();
    // The format ignores an invalid date before a time of day.
    let of_day = || Time::parse(&text, format).ok().filter(|_| !text.contains('T'));
    let of_day = || Some(PrimitiveDateTime::new(Date::MIN, of_day()?));
    OffsetDateTime::parse(&text, format).ok().or_else(|| Some(local().or_else(of_day)?.assume_utc()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_count_from_the_first() {
        for [first, second] in [
            ["2024-02-29T23:59:59.998", "2024-03-01T00:00:00.0005"],
            ["2024-02-29 23:59:59.998", "2024-03-01 00:00:00.0005"],
            ["2024-02-29T23:59:59.998Z", "2024-03-01T01:00:00.0005+01:00"],
            ["20240229T235959.998", "20240301T000000.0005"],
            ["09:59:59,998", "10:00:00,0005"],
        ] {
            let clock = TimestampReader::default();
            assert_eq!(clock.seconds(first), Some(0.0), "{first}");
            assert_eq!(clock.seconds(second), Some(0.0025), "{second}");
        }
    }

    #[test]
    fn other_texts_are_no_times() {
        for text in ["", "now", "2024-02-30T00:00:00", "25:00:00", "1.5 s", "2024-02-29"] {
            assert_eq!(TimestampReader::default().seconds(text), None, "{text}");
        }
    }
}
