//! Ctrl-C and SIGTERM: what is being written is taken away, then the command ends.

use std::io;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Exit status of a command that was interrupted, as shells have it for SIGINT.
pub const INTERRUPTED: u8 = 130;
/// Time to tidy up; a command that waits for a pipe does not look at the flag.
const PATIENCE: Duration = Duration::from_millis(500);

static RAISED: AtomicBool = AtomicBool::new(false);

/// Listens from now on. Where that is not possible, signals end the program as they do by default.
pub fn listen() {
    let _ = ctrlc::set_handler(|| {
        RAISED.store(true, Ordering::Relaxed);
        thread::sleep(PATIENCE);
        process::exit(INTERRUPTED.into());
    });
}

/// Whether the command has been interrupted.
pub fn raised() -> bool {
    RAISED.load(Ordering::Relaxed)
}

/// An error once the command has been interrupted, so that work ends and its files are taken away.
pub fn check() -> io::Result<()> {
    // Not ErrorKind::Interrupted, which writers take for a call to be made again.
    if raised() { Err(io::Error::other("interrupted")) } else { Ok(()) }
}
