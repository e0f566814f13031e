//! Reproducible random numbers from a seed and a trajectory number.

use blake3::{Hasher, OutputReader};

/// Bytes read from the generator at a time.
const BLOCK: usize = 64;
/// Resolution of random numbers in [0, 1): 2⁻⁵³.
const RESOLUTION: f64 = 1.0 / (1_u64 << 53) as f64;

/// Random numbers of one trajectory: the output of BLAKE3 over seed and number.
///
/// Numbers are derived by additions, multiplications and divisions only, so they are bit-identical on every processor.
pub struct RandomSource {
    source: OutputReader,
    block: [u8; BLOCK],
    used: usize,
}

impl RandomSource {
    /// Creates the generator of trajectory `number` with `seed`.
    pub fn new(seed: u64, number: u64) -> Self {
        let mut hasher = Hasher::new();
        hasher.update(&seed.to_le_bytes()).update(&number.to_le_bytes());
        RandomSource { source: hasher.finalize_xof(), block: [0; BLOCK], used: BLOCK }
    }

    fn word(&mut self) -> u64 {
        if self.used == BLOCK {
            self.source.fill(&mut self.block);
            self.used = 0;
        }
        let mut word = [0; 8];
        word.copy_from_slice(&self.block[self.used..self.used + 8]);
        self.used += 8;
        u64::from_le_bytes(word)
    }

    /// Returns a number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.word() >> 11) as f64 * RESOLUTION
    }

    /// Returns a number in [`low`, `high`).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Returns a number between `low` and `high`, both above 0, uniform in its logarithm.
    pub fn log_between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    /// Returns an integer in 0 … `count` − 1; 0 if `count` is 0.
    pub fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.word()) * count as u128) >> 64) as usize
    }

    /// Returns true with the given probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// Returns −1 or 1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { -1.0 } else { 1.0 }
    }
}

/// Numbers of the random streams of a seed.
pub mod stream {
    /// Periods of a machine.
    pub const PERIODS: u64 = 1;
    /// Knowledge of the periods.
    pub const PERIOD_KNOWLEDGE: u64 = 2;
    /// Moves of a program.
    pub const PROGRAM: u64 = 3;
    /// Stamps and gaps of a trace, common to its axes.
    pub const STAMPS: u64 = 4;
    /// Kind of a trace.
    pub const TRACE_KIND: u64 = 5;
    /// Parameters of an axis, plus its joint index.
    pub const AXIS: u64 = 100;
    /// Guess of an axis, plus its joint index.
    pub const GUESS: u64 = 200;
    /// Noise of an axis, plus its joint index.
    pub const NOISE: u64 = 300;
}
