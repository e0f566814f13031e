//! Identified values of the elastic transmission.

use super::super::identification::Identification;
use super::{INTERVAL, ValueSink};
use virtual_axes_core::units::{DEGREE, MICROMETER, NEWTON_PER_MICROMETER};

impl Identification {
    /// Adds stiffness, damping, inertia of the load, backlash and the place of the friction; what the recordings do not determine is unchanged.
    pub(super) fn push_transmission(&self, put: &mut ValueSink<'_>) {
        let Some(fit) = &self.transmission else { return };
        let Some(masses) = &fit.masses else { return };
        let source = || "motion of motor and load".to_owned();
        let mut both = |linear: (&str, f64), rotary: (&str, f64), value: f64, error: f64| {
            for (key, unit) in [linear, rotary] {
                put(&[key], value / unit, Some(error / unit), None, source());
            }
        };
        both(
            ("transmission.stiffness_n_um", NEWTON_PER_MICROMETER),
            ("transmission.stiffness_nm_rad", 1.0),
            masses.stiffness.value,
            masses.stiffness.error(),
        );
        if let Some(damping) = &masses.damping {
            both(
                ("transmission.damping_n_s_m", 1.0),
                ("transmission.damping_nm_s_rad", 1.0),
                damping.value,
                damping.error(),
            );
        }
        both(
            ("transmission.load_mass_kg", 1.0),
            ("transmission.load_inertia_kg_m2", 1.0),
            masses.load.value,
            masses.load.error(),
        );
        // A gap that is excluded has the width 0.
        let gap = fit.backlash.map(|gap| (gap.value, gap.error()));
        if let Some((width, error)) = gap.or(fit.excluded_backlash.map(|bound| (0.0, bound / INTERVAL))) {
            both(
                ("transmission.backlash_um", MICROMETER),
                ("transmission.backlash_deg", DEGREE),
                width,
                error,
            );
        }
        // An axis with presliding has all of its friction at the motor.
        let share = masses.load_friction.filter(|_| self.axis.presliding.is_none());
        if let (Some(value), Some(share)) = (masses.load_friction_share(), share) {
            put(&["transmission.load_friction"], value, Some(share.error()), None, source());
        }
    }
}
