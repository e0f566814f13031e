//! Buffers of numbers for vector instructions.

use std::ops::{Deref, DerefMut};

/// Size of the largest vector, bytes: an access at a multiple of it does not cross a line of the cache.
const ALIGNMENT: usize = 64;
/// Numbers in the largest vector.
pub const LANES: usize = ALIGNMENT / size_of::<f64>();

/// Numbers in memory that begins at a multiple of 64 bytes and is filled up to whole vectors.
///
/// A loop over [`lanes`](Self::lanes) with local copies is a series of vector instructions: the compiler needs no loop
/// for the rest of a vector, and no comparison of addresses.
#[derive(Debug, Default)]
pub struct AlignedBuffer {
    memory: Vec<f64>,
    /// Index of the first number in `memory`.
    first: usize,
    length: usize,
}

impl AlignedBuffer {
    /// Creates `length` numbers 0.
    pub fn new(length: usize) -> Self {
        let memory = vec![0.0; length.next_multiple_of(LANES) + LANES - 1];
        let first = memory.as_ptr().align_offset(ALIGNMENT).min(LANES - 1);
        AlignedBuffer { memory, first, length }
    }

    /// Returns the values in vectors; values beyond the length are undetermined.
    #[inline(always)]
    pub fn lanes(&self) -> &[[f64; LANES]] {
        self.memory[self.first..].as_chunks().0
    }

    /// Returns the values in vectors, as [`lanes`](Self::lanes).
    #[inline(always)]
    pub fn lanes_mut(&mut self) -> &mut [[f64; LANES]] {
        self.memory[self.first..].as_chunks_mut().0
    }

    /// Sets the number of values; with another number all of them are 0.
    pub fn resize(&mut self, length: usize) {
        if length != self.length {
            *self = Self::new(length);
        }
    }
}

impl Clone for AlignedBuffer {
    fn clone(&self) -> Self {
        let mut copy = Self::new(self.length);
        copy.copy_from_slice(self);
        copy
    }
}

impl Deref for AlignedBuffer {
    type Target = [f64];

    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.memory[self.first..self.first + self.length]
    }
}

impl DerefMut for AlignedBuffer {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.memory[self.first..self.first + self.length]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_and_their_copies_begin_at_a_multiple_of_64_bytes() {
        for length in [0, 1, 7, 8, 48, 1000] {
            let mut buffer = AlignedBuffer::new(length);
            for (value, number) in buffer.iter_mut().zip(0_u32..) {
                *value = f64::from(number);
            }
            for buffer in [buffer.clone(), buffer] {
                assert_eq!((buffer.len(), buffer.as_ptr().addr() % ALIGNMENT), (length, 0));
                assert!(buffer.iter().zip(0_u32..).all(|(value, number)| *value == f64::from(number)));
            }
        }
        let mut buffer = AlignedBuffer::default();
        buffer.resize(3);
        assert_eq!(*buffer, [0.0; 3]);
    }

    #[test]
    fn lanes_contain_all_values() {
        for length in [0, 1, 8, 9, 48] {
            let mut buffer = AlignedBuffer::new(length);
            buffer.fill(1.0);
            let count = length.div_ceil(LANES);
            assert_eq!(buffer.lanes()[..count].as_flattened().iter().sum::<f64>(), length as f64);
            buffer.lanes_mut()[..count].fill([2.0; LANES]);
            assert!(buffer.iter().all(|value| *value == 2.0));
        }
    }
}
