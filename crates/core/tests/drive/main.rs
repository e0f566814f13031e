//! Tests of plant and inner loops: closed forms, C reference, friction, parameter ranges, SIMD bit-identity.

mod analytic;
mod backlash;
mod backlash_energy;
mod bits;
mod current_filter;
mod drive_modes;
mod drives;
mod energy;
mod friction;
mod gantry;
mod gms;
mod gms_equations;
mod gms_machine;
mod iwan;
mod parameter_ranges;
mod partial_cycles;
mod presliding;
mod scalar_c;
mod simd;
mod stored_states;
mod transmission;
mod two_masses;
mod unpowered;
mod workpiece;
