//! Structure-of-arrays (SoA) types for one axis, several axes in memory, and SIMD vectors.

/// Defines a structure generic over its number type: each field is `N` or another such structure, `Name<N>`.
macro_rules! soa_struct {
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

        #[allow(dead_code, reason = "no structure uses all of them")]
        impl<N> $name<N> {
            /// Returns the structure with `convert` applied to each number.
            #[inline(always)]
            pub(crate) fn map<'a, M>(&'a self, convert: &mut impl FnMut(&'a N) -> M) -> $name<M> {
                $name { $($field: $crate::simd::soa_struct!(@map ($type $($number)?), self.$field, convert),)* }
            }

            /// Calls `act` with each number and its counterpart in `others`.
            #[inline(always)]
            pub(crate) fn zip<M>(&self, others: &mut $name<M>, act: &mut impl FnMut(&N, &mut M)) {
                $($crate::simd::soa_struct!(@zip ($type $($number)?), self.$field, others.$field, act);)*
            }
        }

        #[allow(dead_code, reason = "no structure uses all of them")]
        impl<N: $crate::simd::SimdReal> $name<N> {
            /// Returns `self` in lanes where `mask` holds, else `other`.
            #[inline(always)]
            pub(crate) fn select(&self, mask: N::Mask, mut other: Self) -> Self {
                self.zip(&mut other, &mut |own: &N, other: &mut N| *other = own.select(mask, *other));
                other
            }
        }

        #[allow(dead_code, reason = "no structure uses all of them")]
        impl $name {
            /// Returns a structure with `self` in each of `L` lanes.
            pub(crate) fn fill<const L: usize>(&self) -> $name<[f64; L]> {
                self.map(&mut |value| [*value; L])
            }
        }

        #[allow(dead_code, reason = "no structure uses all of them")]
        impl<const L: usize> $name<[f64; L]> {
            /// Returns the values of one lane, which must be below `L`.
            #[inline(always)]
            pub(crate) fn lane(&self, lane: usize) -> $name {
                self.map(&mut |row| row[lane])
            }

            /// Sets the values of one lane, which must be below `L`.
            #[inline(always)]
            pub(crate) fn set_lane(&mut self, lane: usize, value: &$name) {
                value.zip(self, &mut |value, row| row[lane] = *value);
            }

            /// Loads the group of `N::LANES` lanes with the given index.
            #[inline(always)]
            pub(crate) fn load<S: pulp::Simd, N: $crate::simd::SimdLoad<S>>(
                &self,
                simd: S,
                index: usize,
            ) -> $name<N> {
                self.map(&mut |row| N::load(simd, row, index))
            }

            /// Stores the group of `N::LANES` lanes with the given index.
            #[inline(always)]
            pub(crate) fn store<S: pulp::Simd, N: $crate::simd::SimdLoad<S>>(
                &mut self,
                index: usize,
                value: &$name<N>,
            ) {
                value.zip(self, &mut |value, row| value.store(row, index));
            }
        }
    };
    (@map (N), $field:expr, $convert:ident) => { $convert(&$field) };
    (@map ($type:ident N), $field:expr, $convert:ident) => { $field.map($convert) };
    (@zip (N), $field:expr, $other:expr, $act:ident) => { $act(&$field, &mut $other) };
    (@zip ($type:ident N), $field:expr, $other:expr, $act:ident) => { $field.zip(&mut $other, $act) };
}

pub(crate) use soa_struct;

#[cfg(test)]
mod tests {
    soa_struct! {
        #[derive(Debug, Clone, Copy, PartialEq)]
        struct Inner { number: N, other: N }
    }

    soa_struct! {
        #[derive(Debug, Clone, Copy, PartialEq)]
        struct Outer { inner: Inner<N>, more: N }
    }

    fn value(number: f64) -> Outer {
        Outer { inner: Inner { number, other: number + 0.5 }, more: -number }
    }

    #[test]
    fn set_lane_changes_only_that_lane() {
        let mut lanes = value(1.0).fill::<4>();
        lanes.set_lane(2, &value(2.0));
        assert_eq!([0, 1, 2, 3].map(|lane| lanes.lane(lane)), [1.0, 1.0, 2.0, 1.0].map(value));
        assert_eq!(lanes.inner.number, [1.0, 1.0, 2.0, 1.0]);
    }
}
