//! Detection of channel, unit and axis from the words of a header: `Actual position X (mm)`, `pos_x_mm`,
//! `Lageistwert [mm]`.

use super::found_column::{ColumnUnit, FoundColumn, UnitSource};
use super::header_unit::{HeaderUnit, split_brackets};
use super::sinumerik_signal::{edge_signal, trace_signal};
use super::unit::{Channel, Unit};
use super::vocabulary::{HeaderQuantity, WordMeaning, announces_axis, axis_name, compound, meaning};

/// Maximum length of a header whose words are searched, bytes.
const MAX_HEADER: usize = 300;
/// Maximum number of columns whose headers are interpreted.
const MAX_COLUMNS: usize = 1000;

/// Takes the position of a motor for that of its axis if the columns have no other one.
fn resolve_motor_positions(columns: &mut [FoundColumn]) {
    let positions = columns.iter().filter(|column| column.channel == Some(Channel::Position));
    let axes: Vec<Option<String>> = positions.map(|column| column.axis.clone()).collect();
    for column in columns {
        if column.channel == Some(Channel::MotorPosition) && !axes.contains(&column.axis) {
            column.channel = Some(Channel::Position);
        }
    }
}

/// Facts that the words of a header state.
#[derive(Debug, Default)]
struct Facts {
    quantity: Option<HeaderQuantity>,
    is_setpoint: bool,
    is_actual: bool,
    is_feedforward: bool,
    is_motor: bool,
    is_load: bool,
    other: Option<&'static str>,
    axis: Option<String>,
    /// Letter `v` beside the name of an axis.
    has_v: bool,
    /// Words with a meaning, for the reason.
    words: Vec<String>,
    /// True behind the word for an encoder, whose number is not that of an axis.
    is_behind_encoder: bool,
}

/// Returns the meanings of columns from their headers.
pub(super) fn detect_columns(headers: &[String]) -> Vec<FoundColumn> {
    let of = |(text, number): (&String, usize)| {
        if number > MAX_COLUMNS {
            return FoundColumn::unknown(number, text, "behind the first 1000 columns");
        }
        let signal = edge_signal(number, text).or_else(|| trace_signal(number, text));
        signal.unwrap_or_else(|| detect(number, text))
    };
    let mut columns: Vec<FoundColumn> = headers.iter().zip(1..).map(of).collect();
    resolve_axis_a(&mut columns);
    resolve_motor_positions(&mut columns);
    columns
}

/// Returns the meaning of a column from its header.
pub(super) fn detect(number: usize, header: &str) -> FoundColumn {
    if header.len() > MAX_HEADER {
        return FoundColumn::unknown(number, header, "the header is too long");
    }
    // YAML or JSON.
    if header.contains(['{', '}']) {
        return FoundColumn::unknown(number, header, "no known word");
    }
    if header == Channel::Torque.name() {
        let unit = Some(ColumnUnit(UnitSource::Assumed(Channel::Torque)));
        return FoundColumn {
            channel: Some(Channel::Torque),
            unit,
            ..FoundColumn::unknown(number, header, "the usual header of the torque beside the current")
        };
    }
    let (rest, mut unit) = split_brackets(header);
    let mut pieces: Vec<&str> =
        rest.split(|c: char| !c.is_alphanumeric()).filter(|p| !p.is_empty()).collect();
    let mut facts = Facts::from_pieces(&pieces);
    if unit == HeaderUnit::Missing
        && let Some((found, count)) = unit_suffix(&pieces, &facts)
    {
        unit = HeaderUnit::Known(found);
        pieces.truncate(pieces.len().saturating_sub(count));
        facts = Facts::from_pieces(&pieces);
    }
    facts.into_column(number, header, unit)
}

/// Relates `current_A` to an axis `a` if other columns name that axis.
fn resolve_axis_a(columns: &mut [FoundColumn]) {
    let has_axis_a = columns.iter().any(|column| column.axis.as_deref() == Some("a"));
    let others = columns.iter().filter(|column| column.channel == Some(Channel::Current)).count();
    if !has_axis_a || others < 2 {
        return;
    }
    for column in columns {
        let is_bare = column.channel == Some(Channel::Current) && column.axis.is_none();
        if is_bare && column.header.ends_with('A') {
            column.axis = Some("a".to_owned());
            column.unit = Some(ColumnUnit(UnitSource::Assumed(Channel::Current)));
        }
    }
}

/// Returns the unit of the last words and their number, if the channel allows it.
fn unit_suffix(pieces: &[&str], facts: &Facts) -> Option<(Unit, usize)> {
    let allowed = |unit: Unit| facts.allows(unit).then_some(unit);
    let length = pieces.len();
    if let [_, .., first, "per", last] = pieces {
        return Unit::from_header(&format!("{first}/{last}")).and_then(allowed).map(|unit| (unit, 3));
    }
    if let [_, .., first, last] = pieces
        && length > 2
    {
        let joined = [format!("{first}/{last}"), format!("{first} {last}")];
        let found = joined.iter().find_map(|text| Unit::from_header(text).and_then(allowed));
        if let Some(unit) = found {
            return Some((unit, 2));
        }
    }
    let last = pieces.last().filter(|_| length > 1)?;
    // "current_a" is that of the axis a.
    if *last == "a" {
        let others = Facts::from_pieces(pieces.get(..length - 1)?);
        return (others.axis.is_some() && others.quantity == Some(HeaderQuantity::Current))
            .then(|| Unit::from_header("A"))
            .flatten()
            .map(|unit| (unit, 1));
    }
    Unit::from_header(last).and_then(allowed).map(|unit| (unit, 1))
}

/// Splits `ActPos` into `Act` and `Pos`, and `PSECPos` into `PSEC` and `Pos`.
fn camel_words(piece: &str) -> Vec<String> {
    let characters: Vec<char> = piece.chars().collect();
    let mut words = Vec::new();
    let mut word = String::new();
    for (k, c) in characters.iter().enumerate() {
        let before = k.checked_sub(1).and_then(|k| characters.get(k));
        let after = characters.get(k + 1);
        let is_start = c.is_uppercase()
            && before.is_some_and(|before| {
                !before.is_uppercase() || after.is_some_and(|after| after.is_lowercase())
            });
        if is_start && !word.is_empty() {
            words.push(std::mem::take(&mut word));
        }
        word.extend(c.to_lowercase());
    }
    words.push(word);
    words
}

impl Facts {
    fn from_pieces(pieces: &[&str]) -> Self {
        let mut facts = Facts::default();
        let mut is_announced = false;
        for piece in pieces {
            let whole = piece.to_lowercase();
            let is_known =
                meaning(&whole).is_some() || axis_name(&whole).is_some() || compound(&whole).is_some();
            let words = if is_known { vec![whole] } else { camel_words(piece) };
            for word in words {
                facts.add(&word, is_announced);
                is_announced = announces_axis(&word);
                facts.is_behind_encoder = matches!(word.as_str(), "encoder" | "enc" | "geber");
            }
        }
        if facts.quantity.is_none() && facts.has_v && facts.axis.is_some() {
            facts.quantity = Some(HeaderQuantity::Velocity);
            facts.words.push("v".to_owned());
        }
        facts
    }

    fn add(&mut self, word: &str, is_announced: bool) {
        let is_number = word.len() <= 2 && !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit());
        if let Some(meaning) = meaning(word) {
            self.learn(meaning, word);
        } else if let Some(name) = axis_name(word) {
            if self.axis.is_some() && self.axis.as_deref() == Some("v") {
                self.has_v = true;
                self.axis = Some(name);
            } else if self.axis.is_some() && name == "v" {
                self.has_v = true;
            } else {
                self.axis = Some(self.axis.take().filter(|axis| !is_digits(axis)).unwrap_or(name));
            }
        } else if is_number && self.is_behind_encoder {
            self.is_actual = true;
        } else if is_number || is_announced {
            self.axis.get_or_insert_with(|| word.to_owned());
        } else if let Some((meanings, axis)) = compound(word) {
            for meaning in meanings {
                self.learn(meaning, word);
            }
            if let Some(axis) = axis {
                self.axis.get_or_insert(axis);
            }
        }
    }

    fn learn(&mut self, meaning: WordMeaning, word: &str) {
        match meaning {
            // "sample time" is a time, "cycle 3 position" a position.
            WordMeaning::Quantity(quantity) => {
                let is_weaker = quantity == HeaderQuantity::Counter && self.quantity.is_some();
                if !is_weaker {
                    self.quantity = Some(quantity);
                }
            }
            WordMeaning::Setpoint => self.is_setpoint = true,
            WordMeaning::Actual => self.is_actual = true,
            WordMeaning::Psec => (self.quantity, self.is_setpoint) = (Some(HeaderQuantity::Position), true),
            WordMeaning::Feedforward => self.is_feedforward = true,
            WordMeaning::Vffws => {
                (self.quantity, self.is_feedforward) = (Some(HeaderQuantity::Velocity), true)
            }
            WordMeaning::Tffws => (self.quantity, self.is_feedforward) = (Some(HeaderQuantity::Torque), true),
            WordMeaning::Motor => self.is_motor = true,
            WordMeaning::Load => self.is_load = true,
            WordMeaning::Filler => return,
            WordMeaning::Other(what) => self.other = Some(what),
        }
        if self.words.last().is_none_or(|last| last != word) {
            self.words.push(word.to_owned());
        }
    }

    /// Returns the channel, or the reason that the column is none.
    fn channel(&self, unit: &HeaderUnit) -> Result<Channel, String> {
        if let Some(what) = self.other {
            return Err(format!("{}: {what}", self.quoted()));
        }
        let is_motion = matches!(self.quantity, Some(HeaderQuantity::Position | HeaderQuantity::Velocity));
        if self.is_load && (self.is_motor || !is_motion) {
            return Err(format!("{}: a load or a power", self.quoted()));
        }
        let is_length =
            matches!(unit, HeaderUnit::Known(unit) if Channel::Position.symbols().contains(&unit.symbol));
        let is_role = self.is_setpoint || self.is_actual;
        let quantity = match self.quantity {
            None if is_role && (is_length || self.has_letter_of_axis()) => HeaderQuantity::Position,
            None if is_role => {
                return Err(format!("{}: no word for position, velocity or current", self.quoted()));
            }
            None if self.axis.is_some() => {
                return Err("the header names an axis, but no signal".to_owned());
            }
            None => return Err("no known word".to_owned()),
            Some(quantity) => quantity,
        };
        match quantity {
            HeaderQuantity::Time | HeaderQuantity::Counter => Ok(Channel::Time),
            HeaderQuantity::Velocity if self.is_feedforward => Ok(Channel::VelocityFeedforward),
            HeaderQuantity::Torque | HeaderQuantity::Current if self.is_feedforward => {
                Ok(Channel::TorqueFeedforward)
            }
            _ if self.is_feedforward => Err(format!("{}: feedforward of no known signal", self.quoted())),
            _ if self.is_setpoint && self.is_actual => {
                Err(format!("{}: both setpoint and actual value", self.quoted()))
            }
            HeaderQuantity::Position if self.is_setpoint => Ok(Channel::Psec),
            _ if self.is_setpoint => Err(format!("{}: a setpoint, not an actual value", self.quoted())),
            HeaderQuantity::Position if self.is_motor => Ok(Channel::MotorPosition),
            HeaderQuantity::Position => Ok(Channel::Position),
            HeaderQuantity::WindUp => Ok(Channel::WindUp),
            HeaderQuantity::Velocity if self.is_motor => {
                Err(format!("{}: the speed of the motor, not of the axis", self.quoted()))
            }
            HeaderQuantity::Velocity => Ok(Channel::Velocity),
            HeaderQuantity::Current => Ok(Channel::Current),
            HeaderQuantity::Torque => match unit {
                HeaderUnit::Known(_) => Ok(Channel::Current),
                HeaderUnit::Unknown(unit) => Err(format!(
                    "{}: a torque in the unknown unit {unit}; map it by --column 'current=COLUMN[UNIT]' with a factor, for example \
                     [0.1 N.m]",
                    self.quoted()
                )),
                HeaderUnit::Missing => Err(format!(
                    "{}: a torque without unit; map it by --column 'current=COLUMN[N.m]'",
                    self.quoted()
                )),
            },
        }
    }

    /// Returns true for an axis with a letter other than v, which can be a velocity: `x_cmd` is a position.
    fn has_letter_of_axis(&self) -> bool {
        self.axis.as_deref().is_some_and(|axis| !axis.starts_with(['v', 's']) && !is_digits(axis))
    }

    /// Interprets `v [mm/s]` as a velocity.
    fn interpret_v(&mut self, unit: &HeaderUnit) {
        let is_speed = |unit: &Unit| Channel::Velocity.symbols().contains(&unit.symbol);
        let is_v = self.quantity.is_none() && self.axis.as_deref() == Some("v");
        if let (true, HeaderUnit::Known(unit)) = (is_v, unit)
            && is_speed(unit)
        {
            (self.quantity, self.axis) = (Some(HeaderQuantity::Velocity), None);
            self.words.push("v".to_owned());
        }
    }

    /// Returns true if `unit` is one of the channel that the words name.
    fn allows(&self, unit: Unit) -> bool {
        if self.quantity.is_none() && self.axis.as_deref() == Some("v") {
            return Channel::Velocity.symbols().contains(&unit.symbol);
        }
        let channel = self.channel(&HeaderUnit::Known(unit));
        channel.is_ok_and(|channel| channel.symbols().contains(&unit.symbol))
    }

    fn quoted(&self) -> String {
        format!("\"{}\"", self.words.join(" "))
    }

    fn into_column(mut self, number: usize, header: &str, unit: HeaderUnit) -> FoundColumn {
        self.interpret_v(&unit);
        let channel = self.channel(&unit);
        let mut column = FoundColumn::unknown(number, header, "");
        column.axis = self.axis.clone();
        match channel {
            Err(reason) => column.reason = reason,
            Ok(channel) => {
                let is_counter = self.quantity == Some(HeaderQuantity::Counter);
                column.channel = Some(channel);
                column.reason = format!("{} in the header", self.quoted());
                column.unit = Some(match unit {
                    _ if is_counter => ColumnUnit(UnitSource::Samples),
                    HeaderUnit::Missing => ColumnUnit(UnitSource::Assumed(channel)),
                    HeaderUnit::Known(unit) => ColumnUnit(UnitSource::Known(unit)),
                    HeaderUnit::Unknown(text) => ColumnUnit(UnitSource::Unknown(text)),
                });
                // A torque is used if there is no current.
                column.is_secondary = is_counter
                    || self.quantity == Some(HeaderQuantity::Torque) && channel == Channel::Current;
                if channel == Channel::Time {
                    column.axis = None;
                }
            }
        }
        column
    }
}

/// Returns true if the text consists of digits.
fn is_digits(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}
