//! Runs many trajectories on several threads; the result does not depend on the number of threads.

use std::collections::BTreeMap;
use std::io;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, SyncSender};
use std::thread;
use std::time::Duration;

use super::summary::StressSummary;
use super::test_machines::{TestMachines, TestMachinesError};
use super::trajectory_test::{TestRecord, TrajectoryTest};
use virtual_axes_core::machine::SimdWidth;

/// Trajectories of a batch.
const BATCH: u64 = 64;
/// Capacity of the result channel per thread, batches.
const QUEUED: usize = 4;
/// Largest lead of a thread over the oldest incomplete batch: results in between are buffered.
const MAX_LEAD: u64 = 256;
/// Polling interval while a thread waits for the oldest batch.
const POLL: Duration = Duration::from_millis(1);

/// Options of a stress run.
#[derive(Debug, Clone, Copy)]
pub struct StressOptions {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of the first trajectory.
    pub first: u64,
    /// Number of trajectories.
    pub count: u64,
    /// Number of threads; at least one is started.
    pub threads: usize,
    /// SIMD width.
    pub width: SimdWidth,
}

/// Error that ends a stress test.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StressError {
    /// A machine cannot be simulated.
    #[error(transparent)]
    TestMachines(#[from] TestMachinesError),
    /// A thread cannot be started.
    #[error("cannot start a thread: {0}")]
    Thread(io::Error),
    /// The progress callback returned an error.
    #[error(transparent)]
    Watch(#[from] io::Error),
}

/// Sets a flag when its thread panics, so that other threads stop waiting for it.
struct Panics<'a>(&'a AtomicBool);

impl Drop for Panics<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

/// Runs random trajectories on `machines` and passes the number of completed ones to `watch`.
///
/// # Errors
/// [`StressError`] if a machine cannot be simulated, a thread cannot be started, or `watch` returns an error.
pub fn run(
    machines: &TestMachines,
    options: &StressOptions,
    mut watch: impl FnMut(u64) -> io::Result<()>,
) -> Result<StressSummary, StressError> {
    let batches = options.count.div_ceil(BATCH);
    let (next, done, stopped) = (AtomicU64::new(0), AtomicU64::new(0), AtomicBool::new(false));
    let threads = options.threads.max(1);
    let (sender, receiver) = mpsc::sync_channel(QUEUED * threads);
    let mut summary = StressSummary::new(machines);
    let work = |sender: SyncSender<_>| {
        let _panics = Panics(&stopped);
        let mut test = TrajectoryTest::new(machines, options.seed, options.width);
        while !stopped.load(Ordering::Relaxed) {
            let batch = next.fetch_add(1, Ordering::Relaxed);
            if batch >= batches {
                return;
            }
            // The thread with the oldest batch never waits here.
            while batch >= done.load(Ordering::Relaxed) + MAX_LEAD && !stopped.load(Ordering::Relaxed) {
                thread::sleep(POLL);
            }
            let numbers = batch * BATCH..((batch + 1) * BATCH).min(options.count);
            let records = numbers.map(|number| test.run(options.first.wrapping_add(number)));
            let records: Result<Vec<TestRecord>, TestMachinesError> = records.collect();
            // The receiver is closed after an error.
            if sender.send((batch, records)).is_err() {
                return;
            }
        }
    };
    thread::scope(|scope| {
        let _panics = Panics(&stopped);
        let collect = || -> Result<(), StressError> {
            for _ in 0..threads {
                let (sender, work) = (sender.clone(), &work);
                let started = thread::Builder::new().spawn_scoped(scope, move || work(sender));
                started.map_err(StressError::Thread)?;
            }
            drop(sender);
            let mut early = BTreeMap::new();
            let mut due = 0;
            // The receiver is dropped before the threads are joined, so that blocked senders return.
            for (batch, records) in receiver {
                early.insert(batch, records?);
                while let Some(records) = early.remove(&due) {
                    records.iter().for_each(|record| summary.add(machines, record));
                    due += 1;
                }
                done.store(due, Ordering::Relaxed);
                watch((due * BATCH).min(options.count))?;
            }
            Ok(())
        };
        let result = collect();
        stopped.store(true, Ordering::Relaxed);
        result
    })?;
    Ok(summary)
}
