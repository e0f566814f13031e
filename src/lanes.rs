//! Numbers of several axes side by side, so that one instruction acts on many of them.
//!
//! What is reckoned in every tick is written once, over a [`Number`]: an `f64`, or a [`Vector`] that holds
//! those of several axes. A structure of numbers is declared by the macro `numbers`: `Motor` is that of one axis,
//! `Motor<[f64; L]>` are those of `L` axes as they stand in memory, `Motor<Vector<S>>` those of a few of them
//! as they are reckoned with. Each operation gives the same bits in all three.

use std::fmt::Debug;
use std::ops::{Add, Mul, Neg, Sub};

use pulp::Simd;

/// What the recurrence of an axis is reckoned in.
pub trait Number:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// Where a comparison holds.
    type Mask: Copy;

    /// A constant.
    fn constant(self, value: f64) -> Self;

    /// `self · factor + addend`, rounded once.
    fn mul_add(self, factor: Self, addend: Self) -> Self;

    /// |self|.
    fn abs(self) -> Self;

    /// `self` where it is smaller, else `other`: also where one of the two is not a number.
    fn min(self, other: Self) -> Self;

    /// `self` where it is larger, else `other`: also where one of the two is not a number.
    fn max(self, other: Self) -> Self;

    /// Where `self` is smaller.
    fn less(self, other: Self) -> Self::Mask;

    /// `self` where the mask holds, else `other`.
    fn select(self, mask: Self::Mask, other: Self) -> Self;

    /// Whether it is larger than `limit` anywhere.
    fn exceeds(self, limit: f64) -> bool;

    /// `self · 2^k`, where `integer` is 1.5·2⁵² + k: k stands in its lowest bits. The product must be a normal
    /// number.
    fn times_power_of_two(self, integer: Self) -> Self;
}

/// Bits of the fraction of an f64.
const FRACTION_BITS: u32 = 52;
/// Numbers in the largest vector that there is.
const MAX_LANES: usize = 8;

impl Number for f64 {
    type Mask = bool;

    #[inline(always)]
    fn constant(self, value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn mul_add(self, factor: f64, addend: f64) -> f64 {
        f64::mul_add(self, factor, addend)
    }

    #[inline(always)]
    fn abs(self) -> f64 {
        f64::abs(self)
    }

    #[inline(always)]
    fn min(self, other: f64) -> f64 {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn max(self, other: f64) -> f64 {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn less(self, other: f64) -> bool {
        self < other
    }

    #[inline(always)]
    fn select(self, mask: bool, other: f64) -> f64 {
        if mask { self } else { other }
    }

    #[inline(always)]
    fn exceeds(self, limit: f64) -> bool {
        self > limit
    }

    #[inline(always)]
    fn times_power_of_two(self, integer: f64) -> f64 {
        // k is added to the exponent.
        f64::from_bits(self.to_bits().wrapping_add(integer.to_bits() << FRACTION_BITS))
    }
}

/// As many numbers as a register of the processor holds; none of them lies across two lines of its cache.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub struct Vector<S: Simd> {
    simd: S,
    value: S::f64s,
}

/// Numbers that stand side by side in memory.
pub trait Fetch<S: Simd>: Number {
    /// How many they are.
    const LANES: usize;

    /// Those at `place` of a row, counted in as many; zeros beyond its end.
    fn fetch<const L: usize>(simd: S, row: &[f64; L], place: usize) -> Self;

    /// Puts them there; nowhere beyond the end.
    fn put<const L: usize>(self, row: &mut [f64; L], place: usize);
}

impl<S: Simd> Fetch<S> for Vector<S> {
    const LANES: usize = S::F64_LANES;

    #[inline(always)]
    fn fetch<const L: usize>(simd: S, row: &[f64; L], place: usize) -> Self {
        let (vectors, _) = S::as_simd_f64s(row);
        Vector { simd, value: vectors.get(place).copied().unwrap_or(simd.splat_f64s(0.0)) }
    }

    #[inline(always)]
    fn put<const L: usize>(self, row: &mut [f64; L], place: usize) {
        let (vectors, _) = S::as_mut_simd_f64s(row);
        if let Some(vector) = vectors.get_mut(place) {
            *vector = self.value;
        }
    }
}

impl<S: Simd, N: Fetch<S>> Fetch<S> for Twice<N> {
    const LANES: usize = 2 * N::LANES;

    #[inline(always)]
    fn fetch<const L: usize>(simd: S, row: &[f64; L], place: usize) -> Self {
        Twice(N::fetch(simd, row, 2 * place), N::fetch(simd, row, 2 * place + 1))
    }

    #[inline(always)]
    fn put<const L: usize>(self, row: &mut [f64; L], place: usize) {
        self.0.put(row, 2 * place);
        self.1.put(row, 2 * place + 1);
    }
}

impl<S: Simd> Vector<S> {
    #[inline(always)]
    fn with(self, value: S::f64s) -> Self {
        Vector { value, ..self }
    }
}

impl<S: Simd> Add for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(self.simd.add_f64s(self.value, other.value))
    }
}

impl<S: Simd> Sub for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(self.simd.sub_f64s(self.value, other.value))
    }
}

impl<S: Simd> Mul for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(self.simd.mul_f64s(self.value, other.value))
    }
}

impl<S: Simd> Neg for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.simd.neg_f64s(self.value))
    }
}

impl<S: Simd> Number for Vector<S> {
    type Mask = S::m64s;

    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        self.with(self.simd.splat_f64s(value))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self.with(self.simd.mul_add_f64s(self.value, factor.value, addend.value))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.with(self.simd.abs_f64s(self.value))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // Vectors of x86 do just this; a single number is compared, since `f64::min` has other rules.
        if S::IS_SCALAR {
            return self.select(self.less(other), other);
        }
        self.with(self.simd.min_f64s(self.value, other.value))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if S::IS_SCALAR {
            return self.select(other.less(self), other);
        }
        self.with(self.simd.max_f64s(self.value, other.value))
    }

    #[inline(always)]
    fn less(self, other: Self) -> S::m64s {
        self.simd.less_than_f64s(self.value, other.value)
    }

    #[inline(always)]
    fn select(self, mask: S::m64s, other: Self) -> Self {
        self.with(self.simd.select_f64s(mask, self.value, other.value))
    }

    #[inline(always)]
    fn exceeds(self, limit: f64) -> bool {
        let above = self.constant(limit).less(self);
        self.simd.first_true_m64s(above) < Self::LANES
    }

    #[inline(always)]
    fn times_power_of_two(self, integer: Self) -> Self {
        let (mut powers, mut integers) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
        self.put(&mut powers, 0);
        integer.put(&mut integers, 0);
        for (power, integer) in powers.iter_mut().zip(integers) {
            *power = power.times_power_of_two(integer);
        }
        Self::fetch(self.simd, &powers, 0)
    }
}

/// Two at once: while one waits for itself, the other is worked on.
#[derive(Debug, Clone, Copy)]
pub struct Twice<N>(N, N);

impl<N: Number> Add for Twice<N> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Twice(self.0 + other.0, self.1 + other.1)
    }
}

impl<N: Number> Sub for Twice<N> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Twice(self.0 - other.0, self.1 - other.1)
    }
}

impl<N: Number> Mul for Twice<N> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Twice(self.0 * other.0, self.1 * other.1)
    }
}

impl<N: Number> Neg for Twice<N> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Twice(-self.0, -self.1)
    }
}

impl<N: Number> Number for Twice<N> {
    type Mask = (N::Mask, N::Mask);

    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Twice(self.0.constant(value), self.1.constant(value))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Twice(self.0.mul_add(factor.0, addend.0), self.1.mul_add(factor.1, addend.1))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Twice(self.0.abs(), self.1.abs())
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Twice(self.0.min(other.0), self.1.min(other.1))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Twice(self.0.max(other.0), self.1.max(other.1))
    }

    #[inline(always)]
    fn less(self, other: Self) -> Self::Mask {
        (self.0.less(other.0), self.1.less(other.1))
    }

    #[inline(always)]
    fn select(self, mask: Self::Mask, other: Self) -> Self {
        Twice(self.0.select(mask.0, other.0), self.1.select(mask.1, other.1))
    }

    #[inline(always)]
    fn exceeds(self, limit: f64) -> bool {
        self.0.exceeds(limit) | self.1.exceeds(limit)
    }

    #[inline(always)]
    fn times_power_of_two(self, integer: Self) -> Self {
        Twice(self.0.times_power_of_two(integer.0), self.1.times_power_of_two(integer.1))
    }
}

/// `value` within ±`limit`; NaN stays what it is.
#[inline(always)]
pub fn limited<N: Number>(value: N, limit: N) -> N {
    (-limit).max(limit.min(value))
}

/// Defines a structure of numbers: each field is a number, `N`, or another such structure, `Name<N>`.
macro_rules! numbers {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident {
            $($(#[$field_meta:meta])* $field_vis:vis $field:ident: $type:ident $(<$number:ident>)?),* $(,)?
        }
    ) => {
        $(#[$meta])*
        $vis struct $name<N = f64> {
            $($(#[$field_meta])* $field_vis $field: $type $(<$number>)?,)*
        }

        #[allow(dead_code, reason = "each structure is used in its own way")]
        impl<N> $name<N> {
            /// The same of another kind: what `of` makes of each number.
            #[inline(always)]
            pub(crate) fn each<'a, M>(&'a self, of: &mut impl FnMut(&'a N) -> M) -> $name<M> {
                $name { $($field: $crate::lanes::numbers!(@each ($type $($number)?), self.$field, of),)* }
            }

            /// Acts on each number and its place in `others`.
            #[inline(always)]
            pub(crate) fn zip<M>(&self, others: &mut $name<M>, act: &mut impl FnMut(&N, &mut M)) {
                $($crate::lanes::numbers!(@zip ($type $($number)?), self.$field, others.$field, act);)*
            }
        }

        #[allow(dead_code, reason = "each structure is used in its own way")]
        impl $name {
            /// The same in `L` lanes.
            pub(crate) fn fill<const L: usize>(&self) -> $name<[f64; L]> {
                self.each(&mut |value| [*value; L])
            }
        }

        #[allow(dead_code, reason = "each structure is used in its own way")]
        impl<const L: usize> $name<[f64; L]> {
            /// What stands in one lane, which must be below `L`.
            #[inline(always)]
            pub(crate) fn lane(&self, lane: usize) -> $name {
                self.each(&mut |row| row[lane])
            }

            /// Puts it into one lane, which must be below `L`.
            #[inline(always)]
            pub(crate) fn set_lane(&mut self, lane: usize, value: &$name) {
                value.zip(self, &mut |value, row| row[lane] = *value);
            }

            /// The lanes at `place`, counted in as many as `N` are.
            #[inline(always)]
            pub(crate) fn fetch<S: pulp::Simd, N: $crate::lanes::Fetch<S>>(
                &self,
                simd: S,
                place: usize,
            ) -> $name<N> {
                self.each(&mut |row| N::fetch(simd, row, place))
            }

            /// Puts them there.
            #[inline(always)]
            pub(crate) fn put<S: pulp::Simd, N: $crate::lanes::Fetch<S>>(
                &mut self,
                place: usize,
                value: &$name<N>,
            ) {
                value.zip(self, &mut |value, row| value.put(row, place));
            }
        }
    };
    (@each (N), $field:expr, $of:ident) => { $of(&$field) };
    (@each ($type:ident N), $field:expr, $of:ident) => { $field.each($of) };
    (@zip (N), $field:expr, $other:expr, $act:ident) => { $act(&$field, &mut $other) };
    (@zip ($type:ident N), $field:expr, $other:expr, $act:ident) => { $field.zip(&mut $other, $act) };
}

pub(crate) use numbers;

#[cfg(test)]
mod tests {
    use pulp::{Arch, WithSimd};

    use super::*;

    numbers! {
        #[derive(Debug, Clone, Copy, PartialEq)]
        struct Inner { number: N, other: N }
    }

    numbers! {
        #[derive(Debug, Clone, Copy, PartialEq)]
        struct Outer { inner: Inner<N>, more: N }
    }

    fn value(number: f64) -> Outer {
        Outer { inner: Inner { number, other: number + 0.5 }, more: -number }
    }

    #[test]
    fn what_is_put_into_a_lane_is_found_there_and_nowhere_else() {
        let mut lanes = value(1.0).fill::<4>();
        lanes.set_lane(2, &value(2.0));
        assert_eq!([0, 1, 2, 3].map(|lane| lanes.lane(lane)), [1.0, 1.0, 2.0, 1.0].map(value));
        assert_eq!(lanes.inner.number, [1.0, 1.0, 2.0, 1.0]);
    }

    /// Values whose minimum, maximum and bounds have rules of their own.
    const ODD: [f64; 8] = [0.0, -0.0, 1.5, -2.5, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-320];

    fn all<N: Number>(a: N, b: N) -> [N; 10] {
        let chosen = a.select(a.less(b), b + b);
        let product = a.mul_add(b, -a);
        let power = (a + a.constant(3.0)).times_power_of_two(a.constant(6_755_399_441_055_734.0));
        [a + b, a - b, a * b, product, a.abs(), a.min(b), a.max(b), chosen, limited(a, b), power]
    }

    struct Everything;

    impl WithSimd for Everything {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            for turn in 0..ODD.len() {
                let mut turned = ODD;
                turned.rotate_left(turn);
                for place in 0..ODD.len() / Vector::<S>::LANES {
                    let (a, b) = (Vector::fetch(simd, &ODD, place), Vector::fetch(simd, &turned, place));
                    for (k, found) in all(a, b).into_iter().enumerate() {
                        let mut row = [0.0; 8];
                        found.put(&mut row, place);
                        for lane in (place * Vector::<S>::LANES..).take(Vector::<S>::LANES) {
                            let single = all(ODD[lane], turned[lane])[k];
                            let same = row[lane].to_bits() == single.to_bits()
                                || row[lane].is_nan() && single.is_nan();
                            assert!(same, "{k}: {} and not {single}", row[lane]);
                        }
                    }
                    let above = (0..Vector::<S>::LANES).any(|k| ODD[place * Vector::<S>::LANES + k] > 1.0);
                    assert_eq!(a.exceeds(1.0), above);
                }
            }
        }
    }

    #[test]
    fn vectors_reckon_as_single_numbers_do() {
        Arch::new().dispatch(Everything);
        Arch::Scalar.dispatch(Everything);
    }
}
