//! The data file of a scenario, as it stands in YAML.

use std::collections::BTreeMap;
use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, Visitor};
use serde_saphyr::Spanned;

/// Values by key, as in `{x_mm: 60, c_deg: 90}`.
pub(super) type Values = BTreeMap<String, Number>;

/// A number; what is none is named in the error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Number(pub f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberVisitor)
    }
}

struct NumberVisitor;

impl Visitor<'_> for NumberVisitor {
    type Value = Number;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number")
    }

    fn visit_i64<E>(self, value: i64) -> Result<Number, E> {
        Ok(Number(value as f64))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Number, E> {
        Ok(Number(value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Number, E> {
        Ok(Number(value))
    }
}

/// A whole scenario.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub description: String,
    #[serde(default)]
    pub source: Option<String>,
    #[serde(default)]
    pub frame: FrameName,
    #[serde(default)]
    pub start: Option<Spanned<Values>>,
    #[serde(default)]
    pub feed_m_min: Option<Number>,
    #[serde(default)]
    pub feed_rpm: Option<Number>,
    #[serde(default)]
    pub limits: Option<Spanned<Values>>,
    #[serde(default)]
    pub rest_s: Option<Number>,
    pub moves: Vec<Spanned<Entry>>,
}

/// What the coordinates of x, y and z are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum FrameName {
    /// Positions of the joints.
    #[default]
    Joints,
    /// The tool tip in the workpiece frame.
    Workpiece,
}

/// One entry of `moves`: one of the first four, and what belongs to it.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Entry {
    pub line: Option<Values>,
    pub arc: Option<ArcEntry>,
    pub spline: Option<Vec<Values>>,
    pub dwell_s: Option<Number>,
    pub feed_m_min: Option<Number>,
    pub feed_rpm: Option<Number>,
    pub corner_m_min: Option<Number>,
    pub corner_rpm: Option<Number>,
    pub ramp_s: Option<Number>,
}

/// A circular arc about `center`, by an angle or by whole turns.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ArcEntry {
    pub center: Values,
    #[serde(default)]
    pub angle_deg: Option<Number>,
    #[serde(default)]
    pub turns: Option<Number>,
    #[serde(default)]
    pub to: Values,
}
