//! Replacement of `epoll_wait` that returns no events instead of EINTR, and that delays discovery while the node starts.
//!
//! **Symptom:** a node that was stopped and continues (Ctrl-Z and `fg`, SIGSTOP and SIGCONT, a debugger, a frozen container,
//! the suspend of a laptop) does not communicate any more: Linux interrupts `epoll_wait` then (signal(7)).
//!
//! **Upstream:** RustDDS 0.15.1, `src/rtps/dp_event_loop.rs` line 306 and `src/discovery/discovery.rs` line 734: the threads end
//! at any error of `poll`.
//!
//! **Test:** `test_py/test_faults_process.py`.
//!
//! **Superfluous when** RustDDS repeats an interrupted `poll`, and the gate of `virtual_axes_dds` is.
//!
//! The linker prefers the `epoll_wait` of the program to that of the C library.
#![allow(unsafe_code)]

use std::ffi::c_int;
use std::io::{Error, ErrorKind};
use std::ptr;

use libc::epoll_event;
use virtual_axes_dds::pass_discovery_gate;

/// Size of the kernel's signal set, bytes.
const SIGNAL_SET_BYTES: usize = 8;

/// Waits as `epoll_wait` of the C library does, except that an interrupted call returns 0 events, and that the
/// threads of the middleware first pass the gate.
///
/// # Safety
/// `events` must be valid for writes of `max_events` elements, as for the function of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn epoll_wait(
    epoll: c_int,
    events: *mut epoll_event,
    max_events: c_int,
    timeout_ms: c_int,
) -> c_int {
    if !pass_discovery_gate() {
        return 0;
    }
    let no_mask = ptr::null::<libc::sigset_t>();
    // SAFETY: the kernel takes the same arguments and checks them; no signal is masked.
    let count = unsafe {
        libc::syscall(libc::SYS_epoll_pwait, epoll, events, max_events, timeout_ms, no_mask, SIGNAL_SET_BYTES)
    };
    if count < 0 && Error::last_os_error().kind() == ErrorKind::Interrupted {
        return 0;
    }
    c_int::try_from(count).unwrap_or(-1)
}
