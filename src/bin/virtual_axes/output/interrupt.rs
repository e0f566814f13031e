//! Handler of SIGINT and SIGTERM: unfinished output files are removed, then the command exits.

use std::io;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Exit status of an interrupted command, the convention of shells for SIGINT.
pub const INTERRUPTED: u8 = 130;
/// Time to remove unfinished files. A command that is blocked on a pipe does not check the flag.
const CLEANUP_TIME: Duration = Duration::from_millis(500);

static RAISED: AtomicBool = AtomicBool::new(false);

/// Installs the handler. If that fails, the default action of the signals remains.
pub fn install_handler() {
    let _ = ctrlc::set_handler(|| {
        RAISED.store(true, Ordering::Relaxed);
        thread::sleep(CLEANUP_TIME);
        process::exit(INTERRUPTED.into());
    });
}

/// Returns true if the command was interrupted.
pub fn is_raised() -> bool {
    RAISED.load(Ordering::Relaxed)
}

/// Returns an error if the command was interrupted, so that the work ends and its files are removed.
pub fn check() -> io::Result<()> {
    // Not ErrorKind::Interrupted, upon which writers repeat the call.
    if is_raised() { Err(io::Error::other("interrupted")) } else { Ok(()) }
}
