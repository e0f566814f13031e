//! Summary of the results of many trajectories.

use std::collections::BTreeMap;

use blake3::Hasher;

use super::check::Violation;
use super::plan::TrajectoryKind;
use super::test_machines::TestMachines;
use super::trajectory_test::TestRecord;
use virtual_axes_core::units::seconds;

/// Smallest error bound of a moving axis, m or rad: at rest the errors are rounding errors.
const MIN_BOUND: f64 = 1e-9;

/// Largest number of recorded violations.
const MAX_VIOLATIONS: usize = 20;

/// Summary of trajectories, accumulated in the order of their numbers.
#[derive(Debug, Clone, Default)]
pub struct StressSummary {
    /// Number of trajectories.
    pub run: u64,
    /// Number of trajectories of each kind.
    pub kinds: BTreeMap<TrajectoryKind, u64>,
    /// Number of trajectories on each machine variant.
    pub variants: Vec<u64>,
    /// Number of trajectories with a load.
    pub loaded: u64,
    /// Number of trajectories that reached a limit.
    pub limited: u64,
    /// Simulated time, s.
    pub time: f64,
    /// Checked ticks, summed over the axes.
    pub ticks: u64,
    /// Checked axes, summed over the trajectories.
    pub axes: u64,
    /// Checked axes with a bound of the following error.
    pub bounded: u64,
    /// Largest error relative to its bound, and the number of its trajectory.
    pub error: (f64, u64),
    /// Largest difference between an error and the linear loop, relative to the allowed rounding error, and the number of
    /// its trajectory.
    pub mismatch: (f64, u64),
    /// Largest energy imbalance of a tick relative to the allowed rounding error, and the number of its trajectory.
    pub imbalance: (f64, u64),
    /// Supplied energy, J.
    pub supplied: f64,
    /// Energy dissipated by friction, J.
    pub dissipated: f64,
    /// Energy returned by friction over ticks with a standstill, J.
    pub returned: f64,
    /// Number of trajectories with violations.
    pub violating: u64,
    /// First violations.
    pub violations: Vec<Violation>,
    hasher: Hasher,
}

impl StressSummary {
    /// Creates an empty summary.
    pub(super) fn new(machines: &TestMachines) -> Self {
        StressSummary { variants: vec![0; machines.variants().len()], ..Self::default() }
    }

    /// Adds the next trajectory.
    pub(super) fn add(&mut self, machines: &TestMachines, record: &TestRecord) {
        self.hasher.update(&record.digest);
        self.run += 1;
        if !record.violations.is_empty() {
            self.violating += 1;
            let free = MAX_VIOLATIONS - self.violations.len();
            self.violations.extend(record.violations.iter().take(free).cloned());
        }
        // A rejected trajectory has no other results.
        let Some((index, kind)) = record.ran else { return };
        let variant = &machines.variants()[index];
        *self.kinds.entry(kind).or_default() += 1;
        self.variants[index] += 1;
        self.loaded += u64::from(record.loaded);
        self.limited += u64::from(record.axes.iter().any(|axis| axis.limited_ticks > 0));
        self.time += record.periods as f64 * seconds(variant.period());
        self.ticks += (record.periods * variant.ticks() * record.axes.len()) as u64;
        let larger = |most: &mut (f64, u64), value: f64| {
            if value > most.0 {
                *most = (value, record.number);
            }
        };
        for axis in &record.axes {
            self.axes += 1;
            if let Some(bound) = axis.bound {
                self.bounded += 1;
                larger(&mut self.error, if bound > MIN_BOUND { axis.error / bound } else { 0.0 });
            }
            larger(&mut self.mismatch, axis.mismatch);
            larger(&mut self.imbalance, axis.imbalance);
            self.supplied += axis.supplied;
            self.dissipated += axis.dissipated;
            self.returned += axis.returned;
        }
    }

    /// Returns the BLAKE3 hash of the digests of the trajectories, in the order of their numbers, as hexadecimal text.
    pub fn digest(&self) -> String {
        self.hasher.finalize().to_hex().to_string()
    }
}
