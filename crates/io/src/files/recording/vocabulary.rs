//! Words in the headers of recordings, English and German.

use std::collections::HashMap;
use std::sync::LazyLock;

use super::axis_match::machine_axis_letter;

/// Quantity that a word names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum HeaderQuantity {
    Position,
    Velocity,
    Current,
    Torque,
    /// Position of the motor minus that of the load.
    WindUp,
    Time,
    /// Number of a sample or cycle.
    Counter,
}

/// Meaning of a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WordMeaning {
    Quantity(HeaderQuantity),
    Setpoint,
    Actual,
    /// Position setpoint.
    Psec,
    Feedforward,
    /// Velocity feedforward signal.
    Vffws,
    /// Torque feedforward signal.
    Tffws,
    Motor,
    /// Load: beside a position or velocity the side of the load, otherwise a load or a power.
    Load,
    /// Filler without a meaning of its own.
    Filler,
    /// Signal that is no channel of a recording, with its description.
    Other(&'static str),
}

use HeaderQuantity::{Counter, Current, Position, Time, Torque, Velocity, WindUp};
use WordMeaning::{Actual, Feedforward, Filler, Load, Motor, Other, Psec, Setpoint, Tffws, Vffws};

/// Words by meaning.
const WORDS: &[(WordMeaning, &[&str])] = &[
    (WordMeaning::Quantity(Position), &["position", "positions", "pos", "lage", "winkel", "angle"]),
    (WordMeaning::Quantity(Velocity), &["velocity", "vel", "velo", "speed", "geschwindigkeit", "drehzahl"]),
    (WordMeaning::Quantity(Current), &["current", "curr", "strom", "iq"]),
    (WordMeaning::Quantity(Torque), &["torque", "trq", "moment", "drehmoment", "force", "kraft"]),
    // The first word of "wind_up" and "wind-up".
    (WordMeaning::Quantity(WindUp), &["wind", "windup"]),
    (WordMeaning::Quantity(Time), &["time", "zeit", "timestamp", "datetime", "zeitstempel"]),
    (WordMeaning::Quantity(Counter), &["sample", "samples", "cycle", "cycles"]),
    (
        Setpoint,
        &[
            "setpoint",
            "set",
            "commanded",
            "command",
            "cmd",
            "desired",
            "des",
            "target",
            "soll",
            "sollwert",
            "reference",
            "ref",
            "nominal",
            "demand",
        ],
    ),
    (
        Actual,
        &["actual", "act", "ist", "istwert", "measured", "meas", "encoder", "enc", "geber", "feedback", "fb"],
    ),
    (Psec, &["psec"]),
    (Feedforward, &["feedforward", "ffw", "vorsteuerung", "forward"]),
    (Vffws, &["vffws"]),
    (Tffws, &["tffws"]),
    (Motor, &["motor", "mot"]),
    (Load, &["load"]),
    // "joint_states" and "joint telemetry" are topics, not axes.
    (Filler, &["wert", "value", "val", "states", "telemetry"]),
    (
        Other("an error or a deviation"),
        &[
            "error",
            "err",
            "following",
            "lag",
            "difference",
            "diff",
            "deviation",
            "dev",
            "abweichung",
            "schleppfehler",
            "regeldifferenz",
            "delta",
        ],
    ),
    (Other("an acceleration or a jerk"), &["acceleration", "acc", "accel", "beschleunigung", "jerk", "ruck"]),
    (Other("a load or a power"), &["auslastung", "power", "leistung"]),
    (Other("a limit"), &["limit", "limits", "max", "maximum"]),
    (Other("a voltage"), &["voltage", "spannung"]),
    (Other("a temperature"), &["temperature", "temp", "temperatur"]),
    (Other("a state"), &["status", "state", "mode", "flag", "override"]),
    (Other("no torque-producing current"), &["phase", "flux", "dclink", "bus"]),
    (Other("a friction"), &["friction", "reibung"]),
    (Other("an offset"), &["offset", "correction", "compensation"]),
    (Other("a count of increments"), &["counts", "increments", "inc"]),
];

/// Words too short for compounds.
const SHORT_WORDS: &[(WordMeaning, &str)] = &[
    (WordMeaning::Quantity(Time), "t"),
    (WordMeaning::Quantity(Current), "i"),
    (Feedforward, "ff"),
    (Other("no torque-producing current"), "id"),
];

/// Letters of axes.
const AXIS_LETTERS: &str = "xyzabcuvw";
/// Minimum length of a part of a compound.
const MIN_PART: usize = 3;
/// Maximum length of a compound, bytes.
const MAX_COMPOUND: usize = 30;
/// Length of the longest text between two parts, bytes.
const MAX_JOINT: usize = 2;
/// Length of the longest word, bytes.
const MAX_WORD: usize = 16;

/// Meanings by word.
static MEANINGS: LazyLock<HashMap<&'static str, WordMeaning>> = LazyLock::new(|| {
    let words = WORDS.iter().flat_map(|(meaning, words)| words.iter().map(|word| (*word, *meaning)));
    words.chain(SHORT_WORDS.iter().map(|(meaning, word)| (*word, *meaning))).collect()
});

/// Returns the meaning of a word in lower case.
pub(super) fn meaning(word: &str) -> Option<WordMeaning> {
    if word.len() > MAX_WORD {
        return None;
    }
    MEANINGS.get(word).copied()
}

/// Returns the name of the axis if the word is one: `x`, `x1`, `mx1`, `ax1`, `sp`, `sp1`, `spindle`.
pub(super) fn axis_name(word: &str) -> Option<String> {
    let name = word.trim_end_matches(|c: char| c.is_ascii_digit());
    let has_few_digits = word.len() - name.len() <= 2;
    let is_letter = name.len() == 1 && AXIS_LETTERS.contains(name);
    let is_spindle = matches!(name, "sp" | "spindle" | "spindel");
    let is_machine_axis = machine_axis_letter(word).is_some();
    ((is_letter || is_spindle || is_machine_axis) && has_few_digits).then(|| word.to_owned())
}

/// Returns true if the word announces the number or name of an axis.
pub(super) fn announces_axis(word: &str) -> bool {
    matches!(word, "axis" | "achse" | "ax" | "joint")
}

/// Splits a compound (`lageistwert`, `actpos`, `posx`, `pos1`) into its meanings and the axis it names; `None` if any part
/// is unknown.
pub(super) fn compound(word: &str) -> Option<(Vec<WordMeaning>, Option<String>)> {
    if word.len() > MAX_COMPOUND || !word.is_ascii() {
        return None;
    }
    let letters = word.trim_end_matches(|c: char| c.is_ascii_digit());
    if letters.is_empty() {
        return None;
    }
    let digits = word.get(letters.len()..).filter(|digits| digits.len() <= 2)?;
    let number = || (!digits.is_empty()).then(|| digits.to_owned());
    if announces_axis(letters) || letters == "j" {
        return number().map(|number| (Vec::new(), Some(number)));
    }
    if let Some(meaning) = meaning(letters) {
        // The number of an encoder is not that of an axis.
        return Some((vec![meaning], if matches!(meaning, Actual) { None } else { number() }));
    }
    if let Some(meanings) = parts(letters) {
        return Some((meanings, number()));
    }
    let with_letter = |rest: &str, letter: &str| {
        let meanings = meaning(rest).map(|meaning| vec![meaning]).or_else(|| parts(rest))?;
        AXIS_LETTERS.contains(letter).then(|| (meanings, Some(format!("{letter}{digits}"))))
    };
    let (first, last) = (letters.get(..1)?, letters.get(letters.len() - 1..)?);
    let from_end = letters.get(..letters.len() - 1).filter(|rest| rest.len() >= MIN_PART);
    let from_start = letters.get(1..).filter(|rest| rest.len() >= MIN_PART);
    from_end
        .and_then(|rest| with_letter(rest, last))
        .or_else(|| from_start.and_then(|rest| with_letter(rest, first)))
}

/// Splits a word into known words, with `s` or `en` between them.
fn parts(word: &str) -> Option<Vec<WordMeaning>> {
    // Shortest lists of parts that end at each byte.
    let mut best: Vec<Option<Vec<WordMeaning>>> = vec![None; word.len() + 1];
    *best.first_mut()? = Some(Vec::new());
    for end in MIN_PART..=word.len() {
        let mut found: Option<Vec<WordMeaning>> = None;
        for start in end.saturating_sub(MAX_WORD + MAX_JOINT)..=end - MIN_PART {
            let Some(before) = best.get(start).and_then(Option::as_ref) else { continue };
            let Some(part) = word.get(start..end) else { continue };
            let joint = if start == 0 { &[""][..] } else { &["", "s", "en"] };
            let bare = joint.iter().find_map(|joint| {
                let rest = part.strip_prefix(joint)?;
                (rest.len() >= MIN_PART).then(|| meaning(rest)).flatten()
            });
            let Some(meaning) = bare else { continue };
            if found.as_ref().is_none_or(|found| before.len() + 1 < found.len()) {
                found = Some([before.as_slice(), &[meaning]].concat());
            }
        }
        if let Some(slot) = best.get_mut(end) {
            *slot = found;
        }
    }
    best.pop().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compounds_are_split_into_known_words() {
        let meanings =
            |word: &str| compound(word).map(|(meanings, axis)| (meanings, axis.unwrap_or_default()));
        let position = WordMeaning::Quantity(Position);
        let none = String::new();
        assert_eq!(meanings("lageistwert"), Some((vec![position, WordMeaning::Actual], none.clone())));
        assert_eq!(
            meanings("istgeschwindigkeit"),
            Some((vec![Actual, WordMeaning::Quantity(Velocity)], none.clone()))
        );
        assert_eq!(meanings("positionssollwert"), Some((vec![position, Setpoint], none.clone())));
        assert_eq!(
            meanings("momentenvorsteuerung"),
            Some((vec![WordMeaning::Quantity(Torque), Feedforward], none.clone()))
        );
        assert_eq!(meanings("actposx"), Some((vec![Actual, position], "x".to_owned())));
        assert_eq!(meanings("xpos"), Some((vec![position], "x".to_owned())));
        assert_eq!(meanings("pos1"), Some((vec![position], "1".to_owned())));
        assert_eq!(meanings("enc2"), Some((vec![Actual], none)));
        for unknown in ["distance", "resistance", "history", "offsets", "xyz", "", "äöü", "feedrate", "timer"]
        {
            assert_eq!(compound(unknown), None, "{unknown}");
        }
    }

    #[test]
    fn no_word_is_longer_than_the_limit() {
        assert!(MEANINGS.keys().all(|word| word.len() <= MAX_WORD && *word == word.to_lowercase()));
        let count = WORDS.iter().map(|(_, words)| words.len()).sum::<usize>() + SHORT_WORDS.len();
        assert_eq!(MEANINGS.len(), count, "each word has one meaning");
    }

    #[test]
    fn axis_names_are_letters_with_up_to_two_digits() {
        for name in ["x", "x1", "c12", "mx1", "ax1", "sp", "sp1", "spindle"] {
            assert_eq!(axis_name(name).as_deref(), Some(name));
        }
        for word in ["t", "x123", "xy", "", "1", "mx", "ax", "mx123", "max1"] {
            assert_eq!(axis_name(word), None, "{word}");
        }
    }
}
