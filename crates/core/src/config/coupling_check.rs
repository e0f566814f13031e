//! Validation of the couplings between axes: workpiece on two tables, gantry, cross-coupled control.

use super::check::{CrossChecks, missing};
use super::error::{ConfigError, ValueSource};
use super::machine::AxisKind;
use super::plant_keys::backlash_suffix;
use super::value::Value;

pub(super) const WORKPIECE_MASS: &str = "workpiece.mass_kg";
pub(super) const CENTER_OF_MASS: [&str; 3] =
    ["workpiece.center_of_mass_x_mm", "workpiece.center_of_mass_y_mm", "workpiece.center_of_mass_z_mm"];
pub(super) const MOMENTS: [&str; 3] =
    ["workpiece.inertia_x_kg_m2", "workpiece.inertia_y_kg_m2", "workpiece.inertia_z_kg_m2"];
pub(super) const GANTRY_AXES: &str = "gantry.axes";
pub(super) const GANTRY_STIFFNESS: &str = "gantry.stiffness_n_um";
pub(super) const CONTOUR_GAIN: &str = "contour_control.gain";
pub(super) const GANTRY_DAMPING: &str = "gantry.damping_n_s_m";

impl CrossChecks<'_> {
    fn is_nonzero(&self, key: &str) -> bool {
        self.number(key).is_some_and(|value| value != 0.0)
    }

    /// Checks that a workpiece has a mass, possible moments of inertia and two tables to lie on.
    pub(super) fn check_workpiece(&self, origin: &ValueSource) -> Result<(), ConfigError> {
        if !self.is_nonzero(WORKPIECE_MASS) {
            let other = CENTER_OF_MASS.into_iter().chain(MOMENTS).find(|key| self.is_nonzero(key));
            return match other {
                Some(key) => {
                    Err(missing(origin, WORKPIECE_MASS, format!("expected it above 0 beside {key}")))
                }
                None => Ok(()),
            };
        }
        let has_table = |name: &str| {
            self.layout
                .joints
                .iter()
                .any(|joint| joint.axis == AxisKind::Rotary && joint.name.eq_ignore_ascii_case(name))
        };
        if !has_table("a") || !has_table("c") {
            let allowed = "be 0 on a machine without rotary joints a and c, which carry the workpiece";
            return Err(self.rejection(&[WORKPIECE_MASS], allowed.to_owned()));
        }
        let is_table = |name: &str| ["a", "c"].iter().any(|table| name.eq_ignore_ascii_case(table));
        self.check_coupled_transmissions(WORKPIECE_MASS, is_table)?;
        let moments = MOMENTS.map(|key| self.number(key).unwrap_or_default());
        let sum: f64 = moments.iter().sum();
        if moments.iter().any(|moment| *moment > (sum - moment) * (1.0 + 1e-9)) {
            let allowed = format!("keep each of {} at most the sum of the other two", MOMENTS.join(", "));
            return Err(self.rejection(&MOMENTS, allowed));
        }
        Ok(())
    }

    /// Checks that a gantry has two linear joints and a stiffness.
    pub(super) fn check_gantry(&self, origin: &ValueSource) -> Result<(), ConfigError> {
        let Some(entry) = self.entries.get(GANTRY_AXES) else {
            return match [GANTRY_STIFFNESS, GANTRY_DAMPING].into_iter().find(|key| self.is_nonzero(key)) {
                Some(key) => {
                    Err(missing(origin, GANTRY_AXES, format!("expected two linear joints beside {key}")))
                }
                None => Ok(()),
            };
        };
        let is_linear = |name: &String| {
            self.layout.joints.iter().any(|joint| joint.axis == AxisKind::Linear && joint.name == *name)
        };
        let is_pair = match &entry.value {
            Value::TextList(names) => {
                matches!(&names[..], [first, second] if first != second) && names.iter().all(is_linear)
            }
            _ => false,
        };
        if !is_pair {
            let linear = self.layout.joints.iter().filter(|joint| joint.axis == AxisKind::Linear);
            let names: Vec<&str> = linear.map(|joint| joint.name.as_str()).collect();
            let allowed = format!("contain two different linear joints, found linear: {}", names.join(", "));
            return Err(self.rejection(&[GANTRY_AXES], allowed));
        }
        if !self.is_nonzero(GANTRY_STIFFNESS) {
            let wanted = format!("expected it above 0 beside {GANTRY_AXES}");
            return Err(missing(origin, GANTRY_STIFFNESS, wanted));
        }
        let Value::TextList(names) = &entry.value else { return Ok(()) };
        self.check_coupled_transmissions(GANTRY_AXES, |name| names.iter().any(|own| own == name))
    }

    /// Checks that cross-coupled control has two of the linear axes x, y and z, and acts on both sides of a gantry or none.
    pub(super) fn check_contour_control(&self) -> Result<(), ConfigError> {
        if !self.is_nonzero(CONTOUR_GAIN) {
            return Ok(());
        }
        let is_coordinate = |name: &str| ["x", "y", "z"].iter().any(|axis| name.eq_ignore_ascii_case(axis));
        let linear = self.layout.joints.iter().filter(|joint| joint.axis == AxisKind::Linear);
        if linear.filter(|joint| is_coordinate(&joint.name)).count() < 2 {
            let allowed = "be 0 on a machine without two of the linear joints x, y and z";
            return Err(self.rejection(&[CONTOUR_GAIN], allowed.to_owned()));
        }
        match self.entries.get(GANTRY_AXES).map(|entry| &entry.value) {
            Some(Value::TextList(names)) if names.iter().any(|name| is_coordinate(name)) => {
                let allowed = format!("not be given together: {CONTOUR_GAIN} and {GANTRY_AXES}");
                Err(self.rejection(&[CONTOUR_GAIN, GANTRY_AXES], allowed))
            }
            _ => Ok(()),
        }
    }

    /// Checks that coupled joints have no transmission that is stepped from event to event: its motion within a tick is not a
    /// smooth function of the force of the coupling, so that the force would not be found.
    fn check_coupled_transmissions(
        &self,
        coupling: &str,
        is_coupled: impl Fn(&str) -> bool,
    ) -> Result<(), ConfigError> {
        let coupled = self.layout.joints.iter().filter(|joint| is_coupled(&joint.name));
        let keys = coupled.flat_map(|joint| {
            [backlash_suffix(joint.axis), "transmission.load_friction", "structure.frequency_hz"]
                .map(|suffix| format!("{}.{suffix}", joint.name))
        });
        match keys.into_iter().find(|key| self.is_nonzero(key)) {
            Some(key) => {
                Err(self.rejection(&[&key, coupling], format!("not be given together: {key} and {coupling}")))
            }
            None => Ok(()),
        }
    }
}
