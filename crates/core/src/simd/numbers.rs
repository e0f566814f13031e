//! Structures of numbers.

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
                $name { $($field: $crate::simd::numbers!(@each ($type $($number)?), self.$field, of),)* }
            }

            /// Acts on each number and its place in `others`.
            #[inline(always)]
            pub(crate) fn zip<M>(&self, others: &mut $name<M>, act: &mut impl FnMut(&N, &mut M)) {
                $($crate::simd::numbers!(@zip ($type $($number)?), self.$field, others.$field, act);)*
            }
        }

        #[allow(dead_code, reason = "each structure is used in its own way")]
        impl<N: $crate::simd::Number> $name<N> {
            /// `other` where the mask holds, else itself.
            #[inline(always)]
            pub(crate) fn or(&self, mut other: Self, mask: N::Mask) -> Self {
                self.zip(&mut other, &mut |own: &N, other: &mut N| *other = other.select(mask, *own));
                other
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
            pub(crate) fn fetch<S: pulp::Simd, N: $crate::simd::Fetch<S>>(
                &self,
                simd: S,
                place: usize,
            ) -> $name<N> {
                self.each(&mut |row| N::fetch(simd, row, place))
            }

            /// Puts them there.
            #[inline(always)]
            pub(crate) fn put<S: pulp::Simd, N: $crate::simd::Fetch<S>>(
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
}
