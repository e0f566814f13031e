//! A wait for the network that was interrupted has ended, and found nothing.
//!
//! Linux interrupts `epoll_wait` when a process that was stopped goes on (signal(7)): after Ctrl-Z and `fg`,
//! SIGSTOP and SIGCONT, a debugger, a frozen container, the sleep of a laptop. The middleware's threads
//! (RustDDS 0.15.1, `dp_event_loop` and `discovery`) take that for the end of the world and end: the node would go on,
//! deaf and dumb. The program's own `epoll_wait` is found before that of the C library.
#![allow(unsafe_code)]

use std::ffi::c_int;
use std::io::{Error, ErrorKind};
use std::ptr;

use libc::epoll_event;

/// Bytes of the kernel's set of signals, of which none is masked here.
const SIGNAL_SET_BYTES: usize = 8;

/// `epoll_wait` of the C library, but that an interrupted one gives no events: its callers look what is due then.
///
/// # Safety
/// As of the C library's: `events` has room for `most`.
#[unsafe(no_mangle)]
unsafe extern "C" fn epoll_wait(
    epoll: c_int,
    events: *mut epoll_event,
    most: c_int,
    timeout_ms: c_int,
) -> c_int {
    let no_mask = ptr::null::<libc::sigset_t>();
    // SAFETY: the kernel takes the same arguments, and checks them.
    let found = unsafe {
        libc::syscall(libc::SYS_epoll_pwait, epoll, events, most, timeout_ms, no_mask, SIGNAL_SET_BYTES)
    };
    if found < 0 && Error::last_os_error().kind() == ErrorKind::Interrupted {
        return 0;
    }
    c_int::try_from(found).unwrap_or(-1)
}
