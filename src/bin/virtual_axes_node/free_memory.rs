//! Return of free memory to the system.
//!
//! Messages are allocated in one thread and freed in another, in bursts: the middleware discards old samples every 6 s.
//! The C library keeps that memory, unless it is asked to return it.
#![allow(unsafe_code)]

use std::io;
use std::thread;
use std::time::Duration;

/// Time between two returns.
const PERIOD: Duration = Duration::from_secs(1);

/// Starts a thread that returns free memory to the system.
///
/// # Errors
///
/// Returns an error if the system has no thread.
pub fn start_return() -> io::Result<()> {
    let returns = || {
        loop {
            thread::sleep(PERIOD);
            // SAFETY: the function takes no memory of the program; it locks each heap while it returns free pages.
            unsafe { libc::malloc_trim(0) };
        }
    };
    thread::Builder::new().name("free memory".to_owned()).spawn(returns).map(drop)
}
