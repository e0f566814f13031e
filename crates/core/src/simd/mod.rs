//! SIMD arithmetic over axes: several axes per instruction, one axis per lane.
//!
//! The code of a current cycle is written once, generic over [`SimdReal`]: an `f64` for one axis, or a [`Vector`]
//! with one lane per axis. The macro `soa_struct` declares structure-of-arrays types: `Motor` holds one axis,
//! `Motor<[f64; L]>` holds `L` axes in memory, `Motor<Vector<S>>` holds the lanes of one SIMD register. Each
//! operation gives bit-identical results in all three.

mod aligned;
mod dispatch;
mod real;
mod soa;
mod unroll;
mod vector;

pub use aligned::{Aligned, LANES};
pub use dispatch::{SliceOperation, vectorize};
pub use real::{SimdReal, clamp_abs};
pub(crate) use soa::soa_struct;
pub use unroll::Unroll2;
pub use vector::{SimdLoad, Vector};

#[cfg(test)]
mod tests {
    use pulp::{Arch, Simd, WithSimd};

    use super::*;

    /// Values with special rules in comparison, minimum and maximum.
    const SPECIAL: [f64; 8] = [0.0, -0.0, 1.5, -2.5, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-320];

    fn all_operations<N: SimdReal>(a: N, b: N) -> [N; 11] {
        let (below, not_above) = (a.select(a.simd_lt(b), b + b), a.select(a.simd_le(b), b + b));
        let product = a.mul_add(b, -a);
        let power = (a + a.splat(3.0)).times_power_of_two(a.splat(6_755_399_441_055_734.0));
        [a + b, a - b, a * b, product, a.abs(), a.min(b), a.max(b), below, not_above, clamp_abs(a, b), power]
    }

    struct CompareWithScalar;

    impl WithSimd for CompareWithScalar {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            for turn in 0..SPECIAL.len() {
                let mut turned = SPECIAL;
                turned.rotate_left(turn);
                for index in 0..SPECIAL.len() / Vector::<S>::LANES {
                    let (a, b) = (Vector::load(simd, &SPECIAL, index), Vector::load(simd, &turned, index));
                    for (k, found) in all_operations(a, b).into_iter().enumerate() {
                        let mut row = [0.0; 8];
                        found.store(&mut row, index);
                        for lane in (index * Vector::<S>::LANES..).take(Vector::<S>::LANES) {
                            let single = all_operations(SPECIAL[lane], turned[lane])[k];
                            let same = row[lane].to_bits() == single.to_bits()
                                || row[lane].is_nan() && single.is_nan();
                            assert!(same, "{k}: {} and not {single}", row[lane]);
                        }
                    }
                    let above =
                        (0..Vector::<S>::LANES).any(|k| SPECIAL[index * Vector::<S>::LANES + k] > 1.0);
                    assert_eq!(a.any_gt(1.0), above);
                }
            }
        }
    }

    #[test]
    fn vector_operations_are_bit_identical_to_scalar_operations() {
        Arch::new().dispatch(CompareWithScalar);
        // A processor with 8-lane vectors also has 4-lane vectors.
        #[cfg(target_arch = "x86_64")]
        if let Some(four) = pulp::x86::V3::try_new() {
            Simd::vectorize(four, CompareWithScalar);
        }
        Arch::Scalar.dispatch(CompareWithScalar);
    }
}
