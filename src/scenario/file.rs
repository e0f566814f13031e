//! The data file of a scenario, as it stands in YAML.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_saphyr::Spanned;

/// Values by key, as in `{x_mm: 60, c_deg: 90}`.
pub(super) type Values = BTreeMap<String, f64>;

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
    pub feed_m_min: Option<f64>,
    #[serde(default)]
    pub feed_rpm: Option<f64>,
    #[serde(default)]
    pub limits: Option<Spanned<Values>>,
    #[serde(default)]
    pub rest_s: Option<f64>,
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
    pub dwell_s: Option<f64>,
    pub feed_m_min: Option<f64>,
    pub feed_rpm: Option<f64>,
    pub corner_m_min: Option<f64>,
    pub corner_rpm: Option<f64>,
    pub ramp_s: Option<f64>,
}

/// A circular arc about `center`, by an angle or by whole turns.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ArcEntry {
    pub center: Values,
    #[serde(default)]
    pub angle_deg: Option<f64>,
    #[serde(default)]
    pub turns: Option<f64>,
    #[serde(default)]
    pub to: Values,
}
