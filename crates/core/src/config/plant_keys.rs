//! Keys and units of plant parameters that depend on the type of the axis.

use super::machine::AxisKind;
use crate::units::{DEGREE, MICROMETER, NEWTON_PER_MICROMETER};

/// Returns the keys of stiffness, damping and load inertia of an elastic transmission, without the name of the axis.
pub(super) fn transmission_suffixes(axis: AxisKind) -> [&'static str; 3] {
    match axis {
        AxisKind::Linear => {
            ["transmission.stiffness_n_um", "transmission.damping_n_s_m", "transmission.load_mass_kg"]
        }
        AxisKind::Rotary => [
            "transmission.stiffness_nm_rad",
            "transmission.damping_nm_s_rad",
            "transmission.load_inertia_kg_m2",
        ],
    }
}

/// Returns the key of the inertia of the structure, without the name of the axis.
pub(super) fn structure_suffix(axis: AxisKind) -> &'static str {
    match axis {
        AxisKind::Linear => "structure.mass_kg",
        AxisKind::Rotary => "structure.inertia_kg_m2",
    }
}

/// Returns the key of the backlash, without the name of the axis.
pub(super) fn backlash_suffix(axis: AxisKind) -> &'static str {
    match axis {
        AxisKind::Linear => "transmission.backlash_um",
        AxisKind::Rotary => "transmission.backlash_deg",
    }
}

/// Returns the key of the width of the backlash compensation, without the name of the axis.
pub(super) fn compensation_suffix(axis: AxisKind) -> &'static str {
    match axis {
        AxisKind::Linear => "backlash_compensation.width_um",
        AxisKind::Rotary => "backlash_compensation.width_deg",
    }
}

/// Returns the unit of the width of a gap, m or rad.
pub(super) fn gap_unit(axis: AxisKind) -> f64 {
    match axis {
        AxisKind::Linear => MICROMETER,
        AxisKind::Rotary => DEGREE,
    }
}

/// Returns the keys of stiffness and damping of the presliding, without the name of the axis.
pub(super) fn presliding_suffixes(axis: AxisKind) -> [&'static str; 2] {
    match axis {
        AxisKind::Linear => ["friction.presliding_stiffness_n_um", "friction.presliding_damping_n_s_m"],
        AxisKind::Rotary => ["friction.presliding_stiffness_nm_rad", "friction.presliding_damping_nm_s_rad"],
    }
}

/// Key of the number of elements of the presliding, without the name of the axis.
pub(super) const PRESLIDING_ELEMENTS: &str = "friction.presliding_elements";

/// Returns the key of the attraction of the elements of the presliding, without the name of the axis.
pub(super) fn attraction_suffix(axis: AxisKind) -> &'static str {
    match axis {
        AxisKind::Linear => "friction.presliding_attraction_n_s",
        AxisKind::Rotary => "friction.presliding_attraction_nm_s",
    }
}

/// Returns the unit of a stiffness at an axis, N/m or N·m/rad.
pub(super) fn stiffness_unit(axis: AxisKind) -> f64 {
    match axis {
        AxisKind::Linear => NEWTON_PER_MICROMETER,
        AxisKind::Rotary => 1.0,
    }
}
