//! YAML format of a scenario file.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_saphyr::Spanned;

use crate::path::Frame;
use crate::yaml::YamlNumber;

/// Numbers by key, as in `{x_mm: 60, c_deg: 90}`.
pub(super) type KeyedNumbers = BTreeMap<String, YamlNumber>;

/// Content of a scenario file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ScenarioFile {
    pub description: String,
    #[serde(default)]
    pub source: Option<String>,
    #[serde(default)]
    pub frame: Frame,
    #[serde(default)]
    pub start: Option<Spanned<KeyedNumbers>>,
    #[serde(default)]
    pub feed_m_min: Option<YamlNumber>,
    #[serde(default)]
    pub feed_rpm: Option<YamlNumber>,
    #[serde(default)]
    pub limits: Option<Spanned<KeyedNumbers>>,
    #[serde(default)]
    pub rest_s: Option<YamlNumber>,
    pub moves: Vec<Spanned<MoveEntry>>,
}

/// Entry of `moves`: exactly one of `line`, `arc`, `spline` and `dwell_s`, and its options.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct MoveEntry {
    pub line: Option<KeyedNumbers>,
    pub arc: Option<ArcEntry>,
    pub spline: Option<Vec<KeyedNumbers>>,
    pub dwell_s: Option<YamlNumber>,
    pub feed_m_min: Option<YamlNumber>,
    pub feed_rpm: Option<YamlNumber>,
    pub corner_m_min: Option<YamlNumber>,
    pub corner_rpm: Option<YamlNumber>,
    pub ramp_s: Option<YamlNumber>,
}

impl MoveEntry {
    /// Returns the options with their keys.
    pub fn options(&self) -> [(&'static str, Option<YamlNumber>); 5] {
        [
            ("feed_m_min", self.feed_m_min),
            ("feed_rpm", self.feed_rpm),
            ("corner_m_min", self.corner_m_min),
            ("corner_rpm", self.corner_rpm),
            ("ramp_s", self.ramp_s),
        ]
    }
}

/// Circular arc about `center`, given by its angle or by its number of turns.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ArcEntry {
    pub center: KeyedNumbers,
    #[serde(default)]
    pub angle_deg: Option<YamlNumber>,
    #[serde(default)]
    pub turns: Option<YamlNumber>,
    #[serde(default)]
    pub to: KeyedNumbers,
}
