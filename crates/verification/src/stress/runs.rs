//! Many trajectories over several threads, with one result whatever their number.

use std::collections::BTreeMap;
use std::io;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, SyncSender};
use std::thread;
use std::time::Duration;

use super::bench::{Bench, Record};
use super::fleet::{Fleet, FleetError};
use super::summary::Summary;
use virtual_axes_core::machine::Width;

/// Trajectories that a thread takes at a time.
const TOGETHER: u64 = 64;
/// Such parts that may wait to be taken, for each thread.
const WAITING: usize = 4;
/// How many parts a thread may be ahead of one that is held up: what is ahead is kept.
const AHEAD: u64 = 256;
/// Time between two looks at whether it has come up.
const LOOK: Duration = Duration::from_millis(1);

/// What is to be run.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// What everything random follows from.
    pub seed: u64,
    /// Number of the first trajectory.
    pub first: u64,
    /// How many.
    pub count: u64,
    /// Threads; at least one runs.
    pub threads: usize,
    /// How wide vectors are used.
    pub width: Width,
}

/// Why a run did not come to its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StressError {
    /// A machine cannot be simulated.
    #[error(transparent)]
    Fleet(#[from] FleetError),
    /// The system gives no thread.
    #[error("cannot start a thread: {0}")]
    Thread(io::Error),
    /// Who looks on ended it.
    #[error(transparent)]
    Watch(#[from] io::Error),
}

/// Sets a flag when its thread panics: who waits for that thread stops waiting.
struct Panics<'a>(&'a AtomicBool);

impl Drop for Panics<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

/// Runs trajectories on the machines of `fleet`; `watch` is told now and then how many have been run.
///
/// # Errors
/// [`StressError`].
pub fn run(
    fleet: &Fleet,
    options: &Options,
    mut watch: impl FnMut(u64) -> io::Result<()>,
) -> Result<Summary, StressError> {
    let parts = options.count.div_ceil(TOGETHER);
    let (next, done, stopped) = (AtomicU64::new(0), AtomicU64::new(0), AtomicBool::new(false));
    let threads = options.threads.max(1);
    let (sender, receiver) = mpsc::sync_channel(WAITING * threads);
    let mut summary = Summary::new(fleet);
    let work = |sender: SyncSender<_>| {
        let _panics = Panics(&stopped);
        let mut bench = Bench::new(fleet, options.seed, options.width);
        while !stopped.load(Ordering::Relaxed) {
            let part = next.fetch_add(1, Ordering::Relaxed);
            if part >= parts {
                return;
            }
            // Who has the part that is waited for never waits here.
            while part >= done.load(Ordering::Relaxed) + AHEAD && !stopped.load(Ordering::Relaxed) {
                thread::sleep(LOOK);
            }
            let numbers = part * TOGETHER..((part + 1) * TOGETHER).min(options.count);
            let records = numbers.map(|number| bench.run(options.first.wrapping_add(number)));
            let records: Result<Vec<Record>, FleetError> = records.collect();
            // Nobody takes them when the run has been ended.
            if sender.send((part, records)).is_err() {
                return;
            }
        }
    };
    thread::scope(|scope| {
        let _panics = Panics(&stopped);
        let take = || -> Result<(), StressError> {
            for _ in 0..threads {
                let (sender, work) = (sender.clone(), &work);
                let started = thread::Builder::new().spawn_scoped(scope, move || work(sender));
                started.map_err(StressError::Thread)?;
            }
            drop(sender);
            let mut early = BTreeMap::new();
            let mut due = 0;
            // Goes before the threads are waited for: those that wait to hand theirs over go on.
            for (part, records) in receiver {
                early.insert(part, records?);
                while let Some(records) = early.remove(&due) {
                    records.iter().for_each(|record| summary.add(fleet, record));
                    due += 1;
                }
                done.store(due, Ordering::Relaxed);
                watch((due * TOGETHER).min(options.count))?;
            }
            Ok(())
        };
        let taken = take();
        stopped.store(true, Ordering::Relaxed);
        taken
    })?;
    Ok(summary)
}
