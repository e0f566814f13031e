//! Replacement of `epoll_wait` that returns no events instead of EINTR, and that delays discovery while the node starts
//! ([`discovery_gate`]).
//!
//! Linux interrupts `epoll_wait` when a stopped process continues (signal(7)): after Ctrl-Z and `fg`, SIGSTOP and
//! SIGCONT, a debugger, a frozen container, or the suspend of a laptop. Threads of the middleware (RustDDS 0.15.1,
//! `dp_event_loop` and `discovery`) treat EINTR as a fatal error and end. The node would continue without any
//! communication. The linker prefers the `epoll_wait` of the program to that of the C library.
#![allow(unsafe_code)]

use std::ffi::c_int;
use std::io::{Error, ErrorKind};
use std::ptr;

use libc::epoll_event;
use virtual_axes::ros::discovery_gate;

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
    if !discovery_gate::pass() {
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
