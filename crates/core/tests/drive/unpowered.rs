//! Machines with axes that nothing drives, for the mechanics alone.

use std::sync::Arc;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::machine::{Machine, MachineParameters};
use virtual_axes_verification::fixtures::machines::configured_with;

/// Returns a machine at rest.
pub fn machine(config: &MachineConfig) -> Machine {
    Machine::new(Arc::new(MachineParameters::new(config).expect("can be discretized")))
}

/// Returns the default machine with two axes without friction and current, with more `changes`.
pub fn unpowered(axes: [&str; 2], changes: &[&str]) -> MachineConfig {
    const FREE: [&str; 9] = [
        "friction.a=0",
        "friction.c=0",
        "friction.i0=0",
        "motor.torque_constant_nm_a=1e-9",
        "motor.emf_constant_v_s_rad=0",
        "position_loop.gain=0",
        "velocity_loop.gain=0",
        "current_loop.gain=0",
        "feedforward.velocity=0",
    ];
    let of_axes = Vec::from_iter(axes.iter().flat_map(|axis| FREE.map(|text| format!("{axis}.{text}"))));
    let changes = of_axes.iter().map(String::as_str).chain(changes.iter().copied());
    configured_with("mikron_ucp710", &[], &Vec::from_iter(changes))
}
