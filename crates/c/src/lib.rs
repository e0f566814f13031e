//! C interface of the virtual axes, for process models, machine controls and other languages.
//!
//! `include/virtual_axes.h` declares it. A C program creates a machine from a machine file, then advances it by position
//! cycles or by any multiple of the current cycle Tsi:
//!
//! ```c
//! #include "virtual_axes.h"
//!
//! VaMachine *machine = NULL;
//! if (va_create("mikron_ucp710", &machine) != VA_OK) { puts(va_last_error()); return 1; }
//! double psec[5] = {0.001, 0, 0, 0, 0}, position[5];
//! for (int cycle = 0; cycle < 167; cycle++) { va_step(machine, psec, 5); }
//! va_positions(machine, position, 5);
//! va_destroy(machine);
//! ```
//!
//! - Every function that can fail returns a [`VaStatus`]; [`va_last_error`] has the reason as text. Nothing is changed
//!   then.
//! - Null pointers, wrong lengths, and setpoints, positions or loads beyond ±10⁶ are errors. No panic crosses the border: [`VaStatus::VaPanic`].
//! - A machine may be used by any thread, but by one at a time. Different machines are independent. The text of the last
//!   error belongs to the calling thread.
//! - Axis quantities are in m or rad, motor quantities in rad/s and N·m, forces in N or N·m; arrays are in the order of the
//!   axes of the machine.
//!
//! This crate contains unsafe code, since pointers of a caller cannot be checked for more than null. Each block says what
//! it relies on.

mod border;
mod machine;
mod signals;
mod state;
mod state_bytes;
mod stepping;

pub use border::{VaStatus, va_last_error};
pub use machine::{
    VaMachine, va_axis_count, va_axis_is_rotary, va_axis_name, va_create, va_create_from_text,
    va_create_with, va_current_period_ns, va_destroy, va_parameter, va_position_period_ns, va_set_parameter,
    va_version,
};
pub use signals::{VaSignals, va_currents, va_positions, va_signals, va_velocities};
pub use state::{VaState, va_destroy_state, va_restore, va_save};
pub use state_bytes::{va_state_read, va_state_size, va_state_write};
pub use stepping::{
    VaDriveMode, va_preview_length, va_reset, va_set_drive_mode, va_set_loads, va_set_preview,
    va_set_velocities, va_step, va_step_for_ns, va_time_ns,
};
