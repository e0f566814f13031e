//! Loops over slices compiled for the widest vectors of the processor.

use pulp::{Arch, Simd, WithSimd};

/// Operation on slices whose loops the compiler vectorizes.
///
/// `run` and everything that it calls must be `#[inline(always)]`: only that is compiled for the instruction sets of
/// the processor.
pub trait SliceOperation {
    /// Result of the operation.
    type Output;

    /// Executes the operation.
    fn run(self) -> Self::Output;
}

struct Dispatched<O>(O);

impl<O: SliceOperation> WithSimd for Dispatched<O> {
    type Output = O::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> O::Output {
        self.0.run()
    }
}

/// Runs `operation`, compiled for the instruction sets that the processor has. Multiply-add is not fused, so the
/// results are bit-identical on every processor.
#[inline]
pub fn vectorize<O: SliceOperation>(operation: O) -> O::Output {
    Arch::new().dispatch(Dispatched(operation))
}
