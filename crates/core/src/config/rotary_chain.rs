//! Order of the rotary axes in the kinematic chain.

use super::declaration::{CheckedValues, Definitions, Field, JointVariant};
use super::definition::AxisKind;

/// Linear axes in the list of the chain.
pub(super) const LINEAR: &str = "xyz";

crate::named_values! {
    /// Rotary axis by its direction.
    pub enum RotaryName {
        /// About X.
        A = "a",
        /// About Y.
        B = "b",
        /// About Z.
        C = "c",
    }
}

impl RotaryName {
    /// Returns the axis with a name in upper or lower case.
    pub(super) fn of(name: &str) -> Option<Self> {
        Self::from_name(&name.to_ascii_lowercase())
    }
}

/// Rotary axes of the kinematic chain from the workpiece to the tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RotaryChain {
    /// Rotary axes in the order of the chain; `None` is fixed.
    pub axes: [Option<RotaryName>; 2],
    /// Number of entries of `axes` that are tables; the others are heads.
    pub tables: usize,
}

impl Default for RotaryChain {
    /// Returns the chain workpiece–C–A–X/Y/Z–tool.
    fn default() -> Self {
        RotaryChain { axes: [Some(RotaryName::C), Some(RotaryName::A)], tables: 2 }
    }
}

impl RotaryChain {
    /// Returns the chain with the axes in the list, or by default with the tables C and A, or B without A.
    pub(super) fn read(values: &CheckedValues<'_>, rows: Definitions) -> Option<Self> {
        let has = |name: &str| values.joints.iter().any(|joint| is_rotary(joint, name));
        let Some(list) = <Vec<String>>::read(values, rows) else {
            let tilting = if has("b") && !has("a") { RotaryName::B } else { RotaryName::A };
            return Some(RotaryChain { axes: [Some(RotaryName::C), Some(tilting)], tables: 2 });
        };
        let mut parts = list.split(|name| name.eq_ignore_ascii_case(LINEAR));
        let mut of_part = || parts.next().unwrap_or_default().iter().filter_map(|name| RotaryName::of(name));
        let tables: Vec<RotaryName> = of_part().collect();
        let mut axes: Vec<Option<RotaryName>> = tables.iter().copied().chain(of_part()).map(Some).collect();
        // A single axis that tilts comes second, behind a fixed one.
        let missing = 2_usize.saturating_sub(axes.len());
        let is_fixed_first = axes != [Some(RotaryName::C)];
        for _ in 0..missing {
            axes.insert(if is_fixed_first { 0 } else { axes.len() }, None);
        }
        let tables =
            if tables.is_empty() { 0 } else { tables.len() + if is_fixed_first { missing } else { 0 } };
        Some(RotaryChain { axes: axes.try_into().ok()?, tables })
    }
}

/// Returns true if a joint is rotary and has a name, in upper or lower case.
pub(super) fn is_rotary(joint: &JointVariant, name: &str) -> bool {
    joint.axis == AxisKind::Rotary && joint.name.eq_ignore_ascii_case(name)
}
