//! Runs many trajectories on several threads; the result does not depend on the number of threads.

use std::ops::Range;
use std::panic::resume_unwind;
use std::thread;

use super::summary::StressSummary;
use super::test_machines::{TestMachines, TestMachinesError};
use super::trajectory_test::{TestRecord, TrajectoryTest};
use virtual_axes_core::machine::SimdWidth;

/// Largest number of trajectories that a thread runs before their results are added.
const ROUND: u64 = 1024;

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

/// Runs random trajectories on `machines`.
///
/// # Errors
/// [`TestMachinesError`] if a machine cannot be simulated.
pub fn run(machines: &TestMachines, options: &StressOptions) -> Result<StressSummary, TestMachinesError> {
    let StressOptions { seed, first, count, threads, width } = *options;
    let mut tests: Vec<TrajectoryTest> =
        (0..threads.max(1)).map(|_| TrajectoryTest::new(machines, seed, width)).collect();
    let mut summary = StressSummary::new(machines);
    let mut done = 0;
    while done < count {
        let share = (count - done).div_ceil(tests.len() as u64).min(ROUND);
        let parts: Vec<Result<Vec<TestRecord>, _>> = thread::scope(|scope| {
            let mut begin = done;
            let start = |test: &mut TrajectoryTest, numbers: Range<u64>| {
                numbers.map(|number| test.run(first + number)).collect()
            };
            let running: Vec<_> = tests
                .iter_mut()
                .map(|test| {
                    let numbers = begin..(begin + share).min(count);
                    begin = numbers.end;
                    scope.spawn(move || start(test, numbers))
                })
                .collect();
            running.into_iter().map(|part| part.join().unwrap_or_else(|panic| resume_unwind(panic))).collect()
        });
        for part in parts {
            let records = part?;
            records.iter().for_each(|record| summary.add(machines, record));
            done += records.len() as u64;
        }
    }
    Ok(summary)
}
