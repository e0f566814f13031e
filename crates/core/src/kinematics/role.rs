//! Roles of joints in the kinematic chain.

use crate::config::{AxisKind, RotaryName};

crate::named_values! {
    /// Role of a joint in the kinematic chain, with the name of the joint.
    pub enum AxisRole {
        /// Linear axis that moves the tool along X.
        X = "x",
        /// Linear axis that moves the tool along Y.
        Y = "y",
        /// Linear axis that moves the tool along Z.
        Z = "z",
        /// Rotary axis about X.
        A = "a",
        /// Rotary axis about Y.
        B = "b",
        /// Rotary axis about Z.
        C = "c",
    }
}

impl AxisRole {
    /// Linear roles, in the order of coordinates.
    pub const LINEAR: [AxisRole; 3] = [AxisRole::X, AxisRole::Y, AxisRole::Z];

    /// Returns the axis type for the role.
    pub fn kind(self) -> AxisKind {
        match self {
            AxisRole::X | AxisRole::Y | AxisRole::Z => AxisKind::Linear,
            AxisRole::A | AxisRole::B | AxisRole::C => AxisKind::Rotary,
        }
    }

    /// Returns true if a joint of this name and type can have the role; the first such joint of a machine has it.
    pub fn matches(self, name: &str, kind: AxisKind) -> bool {
        kind == self.kind() && name.eq_ignore_ascii_case(self.name())
    }
}

impl From<RotaryName> for AxisRole {
    fn from(name: RotaryName) -> Self {
        match name {
            RotaryName::A => AxisRole::A,
            RotaryName::B => AxisRole::B,
            RotaryName::C => AxisRole::C,
        }
    }
}
