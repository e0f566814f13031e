//! Values of several axes side by side, so that one instruction acts on many of them.
//!
//! A type that is a [`Lane`] has a twin in which each of its numbers is an array over the lanes. Loops over
//! lanes take a value out, act on it as if it were alone, and put it back; the compiler makes vector
//! instructions of them.

use std::fmt::Debug;

/// A value that can stand beside others of its kind.
pub trait Lane: Copy {
    /// `L` of them, number by number.
    type Lanes<const L: usize>: Clone + Debug + PartialEq;

    /// The same value in every lane.
    fn fill<const L: usize>(self) -> Self::Lanes<L>;

    /// The value of one lane, which must be below `L`.
    fn get<const L: usize>(lanes: &Self::Lanes<L>, lane: usize) -> Self;

    /// Puts the value into one lane, which must be below `L`.
    fn set<const L: usize>(self, lanes: &mut Self::Lanes<L>, lane: usize);
}

impl Lane for f64 {
    type Lanes<const L: usize> = [f64; L];

    #[inline(always)]
    fn fill<const L: usize>(self) -> [f64; L] {
        [self; L]
    }

    #[inline(always)]
    fn get<const L: usize>(lanes: &[f64; L], lane: usize) -> f64 {
        lanes[lane]
    }

    #[inline(always)]
    fn set<const L: usize>(self, lanes: &mut [f64; L], lane: usize) {
        lanes[lane] = self;
    }
}

impl Lane for u64 {
    type Lanes<const L: usize> = [u64; L];

    #[inline(always)]
    fn fill<const L: usize>(self) -> [u64; L] {
        [self; L]
    }

    #[inline(always)]
    fn get<const L: usize>(lanes: &[u64; L], lane: usize) -> u64 {
        lanes[lane]
    }

    #[inline(always)]
    fn set<const L: usize>(self, lanes: &mut [u64; L], lane: usize) {
        lanes[lane] = self;
    }
}

/// As wide as a number, so that both fill the same vectors.
impl Lane for bool {
    type Lanes<const L: usize> = [u64; L];

    #[inline(always)]
    fn fill<const L: usize>(self) -> [u64; L] {
        [u64::from(self); L]
    }

    #[inline(always)]
    fn get<const L: usize>(lanes: &[u64; L], lane: usize) -> bool {
        lanes[lane] != 0
    }

    #[inline(always)]
    fn set<const L: usize>(self, lanes: &mut [u64; L], lane: usize) {
        lanes[lane] = u64::from(self);
    }
}

/// `value` within ±`limit`, in a form that is two instructions on many lanes; NaN stays what it is.
#[inline(always)]
pub fn limited(value: f64, limit: f64) -> f64 {
    let below = if value > limit { limit } else { value };
    if below < -limit { -limit } else { below }
}

/// `a` where `condition` holds, else `b`, both of which are read: where they stand in memory, a plain `if`
/// becomes a choice of the place to read, which is none that a vector has.
#[inline(always)]
pub fn select(condition: bool, a: f64, b: f64) -> f64 {
    let mask = u64::from(condition).wrapping_neg();
    f64::from_bits((a.to_bits() & mask) | (b.to_bits() & !mask))
}

/// Defines a structure of lane values, and its twin as the second name.
macro_rules! lanes {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident as $twin:ident {
            $($(#[$field_meta:meta])* $field_vis:vis $field:ident: $type:ty),* $(,)?
        }
    ) => {
        $(#[$meta])*
        $vis struct $name {
            $($(#[$field_meta])* $field_vis $field: $type,)*
        }

        #[doc = concat!("[`", stringify!($name), "`] of `L` axes side by side.")]
        #[derive(Debug, Clone, PartialEq)]
        $vis struct $twin<const L: usize> {
            $($(#[$field_meta])* $field_vis $field: <$type as $crate::lanes::Lane>::Lanes<L>,)*
        }

        impl $crate::lanes::Lane for $name {
            type Lanes<const L: usize> = $twin<L>;

            #[inline(always)]
            fn fill<const L: usize>(self) -> $twin<L> {
                $twin { $($field: $crate::lanes::Lane::fill(self.$field),)* }
            }

            #[inline(always)]
            fn get<const L: usize>(lanes: &$twin<L>, lane: usize) -> Self {
                $name { $($field: <$type as $crate::lanes::Lane>::get(&lanes.$field, lane),)* }
            }

            #[inline(always)]
            fn set<const L: usize>(self, lanes: &mut $twin<L>, lane: usize) {
                $(self.$field.set(&mut lanes.$field, lane);)*
            }
        }
    };
}

pub(crate) use lanes;

#[cfg(test)]
mod tests {
    use super::*;

    lanes! {
        #[derive(Debug, Clone, Copy, PartialEq)]
        struct Inner as InnerLanes { number: f64, flag: bool }
    }

    lanes! {
        #[derive(Debug, Clone, Copy, PartialEq)]
        struct Outer as OuterLanes { inner: Inner, more: f64 }
    }

    #[test]
    fn what_is_put_into_a_lane_is_found_there_and_nowhere_else() {
        let value = |number: f64, flag| Outer { inner: Inner { number, flag }, more: -number };
        let mut lanes = value(1.0, false).fill::<4>();
        value(2.0, true).set(&mut lanes, 2);
        let found = [0, 1, 2, 3].map(|lane| Outer::get(&lanes, lane));
        assert_eq!(found, [value(1.0, false), value(1.0, false), value(2.0, true), value(1.0, false)]);
        assert_eq!(lanes.inner.number, [1.0, 1.0, 2.0, 1.0]);
    }
}
