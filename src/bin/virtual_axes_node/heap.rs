//! One heap for all threads.
//!
//! The GNU C library has a heap for each thread, up to eight for each core, and gives little of one back: messages are
//! made in one thread and freed in another, and a node that runs for days holds several times what it uses
//! (docs/reliability.md). What has to be quick allocates nothing.
#![allow(unsafe_code)]

/// To be called before there is a second thread.
pub fn share() {
    // SAFETY: it takes numbers, and nobody else is allocating.
    let is_set = unsafe { libc::mallopt(libc::M_ARENA_MAX, 1) };
    debug_assert_eq!(is_set, 1);
}
