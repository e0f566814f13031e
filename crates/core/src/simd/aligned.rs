//! Alignment of values for vector instructions.

/// Size of the largest vector, bytes: an access at a multiple of it does not cross a line of the cache.
const ALIGNMENT: usize = 64;
/// Numbers in the largest vector.
pub const LANES: usize = ALIGNMENT / size_of::<f64>();

/// Value aligned to a cache line of 64 bytes, the size of the largest SIMD vector.
#[derive(Debug, Clone, PartialEq)]
#[repr(align(64))]
pub struct Aligned<T>(pub T);
