//! What many trajectories come to.

use std::collections::BTreeMap;

use blake3::Hasher;

use super::bench::Record;
use super::fault::Fault;
use super::fleet::Fleet;
use super::plan::Kind;
use virtual_axes_core::units::seconds;

/// Bounds of errors below it, m or rad, are those of axes that rest: what errors are there is rounding.
const SEEN: f64 = 1e-9;

/// Faults that are kept, of all that are found.
const KEPT: usize = 20;

/// What trajectories came to, in the order of their numbers.
#[derive(Debug, Clone)]
pub struct Summary {
    /// How many ran.
    pub run: u64,
    /// How many of each kind ran.
    pub kinds: BTreeMap<Kind, u64>,
    /// How many ran on each variant of the fleet.
    pub variants: Vec<u64>,
    /// How many met a load.
    pub loaded: u64,
    /// How many reached a limit.
    pub limited: u64,
    /// Simulated time, s.
    pub time: f64,
    /// Ticks of axes that were looked at.
    pub ticks: u64,
    /// Axes, one by one.
    pub axes: u64,
    /// Of these, those whose error has a bound.
    pub bounded: u64,
    /// Largest error relative to its bound, and the trajectory.
    pub error: (f64, u64),
    /// Largest difference between an error and that of the linear loop, relative to what rounding is allowed, and
    /// the trajectory.
    pub mismatch: (f64, u64),
    /// Largest imbalance of energy in a tick, relative to what rounding is allowed, and the trajectory.
    pub imbalance: (f64, u64),
    /// Energy that came in, J.
    pub supplied: f64,
    /// Energy that friction took, J.
    pub dissipated: f64,
    /// Energy that friction gave back over ticks of a standstill, J.
    pub returned: f64,
    /// Trajectories with faults.
    pub faulty: u64,
    /// The first faults.
    pub faults: Vec<Fault>,
    hasher: Hasher,
}

impl Summary {
    /// Of nothing yet.
    pub(super) fn new(fleet: &Fleet) -> Self {
        Summary {
            run: 0,
            kinds: BTreeMap::new(),
            variants: vec![0; fleet.variants().len()],
            loaded: 0,
            limited: 0,
            time: 0.0,
            ticks: 0,
            axes: 0,
            bounded: 0,
            error: (0.0, 0),
            mismatch: (0.0, 0),
            imbalance: (0.0, 0),
            supplied: 0.0,
            dissipated: 0.0,
            returned: 0.0,
            faulty: 0,
            faults: Vec::new(),
            hasher: Hasher::new(),
        }
    }

    /// Adds the trajectory that comes next.
    pub(super) fn add(&mut self, fleet: &Fleet, record: &Record) {
        self.hasher.update(&record.digest);
        self.run += 1;
        if !record.faults.is_empty() {
            self.faulty += 1;
            let room = KEPT - self.faults.len();
            self.faults.extend(record.faults.iter().take(room).cloned());
        }
        // One that was refused has no more than that to tell.
        let Some((place, kind)) = record.ran else { return };
        let variant = &fleet.variants()[place];
        *self.kinds.entry(kind).or_default() += 1;
        self.variants[place] += 1;
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
                larger(&mut self.error, if bound > SEEN { axis.error / bound } else { 0.0 });
            }
            larger(&mut self.mismatch, axis.mismatch);
            larger(&mut self.imbalance, axis.imbalance);
            self.supplied += axis.supplied;
            self.dissipated += axis.dissipated;
            self.returned += axis.returned;
        }
    }

    /// BLAKE3 over the digests of the trajectories, in the order of their numbers.
    pub fn digest(&self) -> String {
        self.hasher.finalize().to_hex().to_string()
    }
}
