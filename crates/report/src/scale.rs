//! Ranges of signals, and linear and logarithmic scales with round ticks.

use super::text;
use super::unit::DisplayUnit;

/// Largest magnitude of a value that is drawn, SI units. Larger values are omitted like NaN, so that
/// differences cannot overflow.
const LARGEST: f64 = 1e12;

/// Returns true if a value can be drawn.
pub(super) fn is_drawable(value: f64) -> bool {
    value.abs() <= LARGEST
}

/// Range from the smallest to the largest value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    pub min: f64,
    pub max: f64,
}

impl Extent {
    /// Returns the range of the drawable values; `None` if there are none.
    pub(super) fn of(values: impl IntoIterator<Item = f64>) -> Option<Extent> {
        values.into_iter().filter(|v| is_drawable(*v)).fold(None, |extent, value| {
            Some(extent.map_or(Extent { min: value, max: value }, |e: Extent| e.including(value)))
        })
    }

    /// Returns the range extended to include `value`.
    pub(super) fn including(self, value: f64) -> Extent {
        Extent { min: self.min.min(value), max: self.max.max(value) }
    }

    /// Returns the union of two ranges.
    pub(super) fn join(a: Option<Extent>, b: Option<Extent>) -> Option<Extent> {
        match (a, b) {
            (Some(a), Some(b)) => Some(a.including(b.min).including(b.max)),
            (one, other) => one.or(other),
        }
    }

    /// Returns max − min.
    pub(super) fn span(&self) -> f64 {
        self.max - self.min
    }

    /// Returns the middle of the range.
    pub(super) fn middle(&self) -> f64 {
        self.min + self.span() / 2.0
    }

    /// Returns the largest magnitude.
    pub(super) fn peak(&self) -> f64 {
        self.min.abs().max(self.max.abs())
    }

    /// Returns the range widened around its middle to at least `span`.
    pub(super) fn at_least(self, span: f64) -> Extent {
        if self.span() >= span {
            return self;
        }
        let middle = self.middle();
        Extent { min: middle - span / 2.0, max: middle + span / 2.0 }
    }

    /// Returns the range widened at both ends by a fraction of its span.
    pub(super) fn with_margin(self, fraction: f64) -> Extent {
        let margin = fraction * self.span();
        Extent { min: self.min - margin, max: self.max + margin }
    }

    /// Converts the range from SI units to `unit`.
    pub(super) fn in_unit(self, unit: &DisplayUnit) -> Extent {
        Extent { min: self.min / unit.size, max: self.max / unit.size }
    }
}

/// Number of the form 1, 2 or 5 times a power of ten.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RoundNumber {
    mantissa: f64,
    exponent: i32,
}

impl RoundNumber {
    /// Returns the smallest round number that is not below `value` (> 0).
    pub(super) fn up(value: f64) -> RoundNumber {
        let exponent = value.log10().floor() as i32;
        // A rounding error of log10 must not increase the step tenfold.
        let exact = value / 10f64.powi(exponent) * (1.0 - 1e-9);
        match [1.0, 2.0, 5.0].into_iter().find(|m| exact <= *m) {
            Some(mantissa) => RoundNumber { mantissa, exponent },
            None => RoundNumber { mantissa: 1.0, exponent: exponent + 1 },
        }
    }

    /// Returns the largest round number that is not above `value` (> 0).
    pub(super) fn down(value: f64) -> RoundNumber {
        let exponent = value.log10().floor() as i32;
        let exact = value / 10f64.powi(exponent) * (1.0 + 1e-9);
        let mantissa = [5.0, 2.0, 1.0].into_iter().find(|m| exact >= *m).unwrap_or(1.0);
        RoundNumber { mantissa, exponent }
    }

    /// Returns the value.
    pub(super) fn value(&self) -> f64 {
        self.times(1.0)
    }

    /// Returns `count` times the number, correctly rounded even for negative powers of ten.
    fn times(&self, count: f64) -> f64 {
        match self.exponent {
            0.. => count * self.mantissa * 10f64.powi(self.exponent),
            _ => count * self.mantissa / 10f64.powi(-self.exponent),
        }
    }

    /// Returns the number of decimals of its multiples.
    pub(super) fn decimals(&self) -> usize {
        (-self.exponent).max(0) as usize
    }
}

/// Scale with round ticks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    pub extent: Extent,
    step: RoundNumber,
    /// True if values are common logarithms.
    has_logarithms: bool,
}

impl Scale {
    /// Creates a scale of exactly `extent`, with about `count` tick intervals.
    pub(super) fn within(extent: Extent, least_range: f64, count: f64) -> Scale {
        // A range below the resolution of f64 would have repeated ticks.
        let extent = extent.at_least(least_range.max(extent.peak() * 1e-9));
        Scale { extent, step: RoundNumber::up(extent.span() / count), has_logarithms: false }
    }

    /// Creates a scale of `extent` widened to end on ticks.
    pub(super) fn outward(extent: Extent, least_range: f64, count: f64) -> Scale {
        let Scale { extent, step, .. } = Scale::within(extent, least_range, count);
        // A value beyond a tick by rounding only does not add another tick.
        let slack = 1e-6;
        let min = step.times((extent.min / step.value() + slack).floor());
        let max = step.times((extent.max / step.value() - slack).ceil());
        Scale { extent: Extent { min, max }, step, has_logarithms: false }
    }

    /// Returns the distance of two ticks.
    pub(super) fn step(&self) -> f64 {
        self.step.value()
    }

    /// Returns the scale with ticks for values that are common logarithms.
    pub(super) fn of_logarithms(self) -> Scale {
        Scale { has_logarithms: true, ..self }
    }

    /// Returns the values of the ticks and their labels; ticks of a logarithmic scale between powers of ten have none,
    /// except 2 and 5 if the range is short.
    pub(super) fn ticks(&self) -> impl Iterator<Item = (f64, String)> {
        if self.has_logarithms { self.logarithmic_ticks() } else { self.linear_ticks() }.into_iter()
    }

    fn linear_ticks(&self) -> Vec<(f64, String)> {
        let step = self.step;
        let first = (self.extent.min / step.value() - 1e-6).ceil();
        let count = ((self.extent.max / step.value() + 1e-6).floor() - first).max(0.0) as u32;
        let tick = |i: u32| {
            let value = step.times(first + f64::from(i));
            (value, text::number(value, step.decimals()))
        };
        (0..=count).map(tick).collect()
    }

    fn logarithmic_ticks(&self) -> Vec<(f64, String)> {
        /// Number of decades up to which 2 and 5 have labels.
        const SHORT: f64 = 1.5;
        let Extent { min, max } = self.extent;
        let is_labeled =
            |mantissa: u32| mantissa == 1 || self.extent.span() < SHORT && [2, 5].contains(&mantissa);
        let tick = |exponent: i32, mantissa: u32| {
            let power = RoundNumber { mantissa: 1.0, exponent };
            let value = power.times(f64::from(mantissa));
            let label =
                if is_labeled(mantissa) { text::number(value, power.decimals()) } else { String::new() };
            (value.log10(), label)
        };
        let ticks = (min.floor() as i32..=max.floor() as i32)
            .flat_map(|exponent| (1..10).map(move |mantissa| tick(exponent, mantissa)));
        ticks.filter(|(value, _)| (min - 1e-9..=max + 1e-9).contains(value)).collect()
    }

    /// Returns the function that maps the range to `from` … `to`, pixels.
    pub(super) fn onto(&self, from: f64, to: f64) -> impl Fn(f64) -> f64 + Copy {
        let Extent { min, .. } = self.extent;
        let per_unit = (to - from) / self.extent.span();
        move |value| from + (value - min) * per_unit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn labels(min: f64, max: f64, count: f64) -> Vec<String> {
        Scale::outward(Extent { min, max }, 1e-9, count).ticks().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(labels(-0.283, 0.049, 4.0), ["−0.3", "−0.2", "−0.1", "0.0", "0.1"]);
        assert_eq!(
            labels(0.0, 9500.0, 5.0),
            ["0", "2\u{202f}000", "4\u{202f}000", "6\u{202f}000", "8\u{202f}000", "10\u{202f}000"]
        );
        assert_eq!(labels(0.0, 10.0, 10.0).len(), 11);
        assert_eq!(labels(0.0, 0.3, 3.0), ["0.0", "0.1", "0.2", "0.3"]);
    }

    #[test]
    fn ticks_of_a_logarithmic_scale_are_at_all_digits_and_labeled_at_powers_of_ten() {
        let scale = Scale::within(Extent { min: -1.0, max: 4000_f64.log10() }, 1e-3, 9.0).of_logarithms();
        let ticks: Vec<(f64, String)> = scale.ticks().collect();
        let labeled: Vec<&str> =
            ticks.iter().map(|(_, label)| label.as_str()).filter(|l| !l.is_empty()).collect();
        assert_eq!(labeled, ["0.1", "1", "10", "100", "1\u{202f}000"]);
        // 9 in each of 4 decades, and 1000, 2000, 3000 and 4000.
        assert_eq!(ticks.len(), 4 * 9 + 4);
        assert!(ticks.windows(2).all(|pair| pair[0].0 < pair[1].0));
        let short = Scale::within(Extent { min: 1.0, max: 2.0 }, 1e-3, 9.0).of_logarithms();
        let labeled: Vec<String> = short.ticks().map(|(_, label)| label).filter(|l| !l.is_empty()).collect();
        assert_eq!(labeled, ["10", "20", "50", "100"]);
    }

    #[test]
    fn a_constant_signal_has_a_nonzero_range() {
        let scale = Scale::outward(Extent { min: 5.0, max: 5.0 }, 0.1, 5.0);
        assert!(scale.extent.span() >= 0.1 && scale.ticks().count() >= 2);
        let scale = Scale::outward(Extent { min: LARGEST, max: LARGEST }, 0.1, 5.0);
        assert!(scale.ticks().count() >= 2);
    }

    #[test]
    fn magnifications_are_round() {
        assert_eq!(RoundNumber::down(437.0).value(), 200.0);
        assert_eq!(RoundNumber::down(1000.0).value(), 1000.0);
        assert_eq!(RoundNumber::down(999.0).value(), 500.0);
        assert_eq!(RoundNumber::up(0.1).value(), 0.1);
        assert_eq!(RoundNumber::up(0.11).value(), 0.2);
    }

    proptest! {
        #[test]
        fn ticks_are_few_distinct_and_span_the_values(a in -1e12..1e12f64, exponent in -15..12, count in 2.0..12.0f64) {
            let extent = Extent::of([a, a + 10f64.powi(exponent)]).expect("drawable");
            let scale = Scale::outward(extent, 1e-6, count);
            let ticks: Vec<_> = scale.ticks().collect();
            prop_assert!(ticks.len() >= 2 && ticks.len() as f64 <= count + 3.0, "{} ticks", ticks.len());
            let slack = scale.step() * 1e-5;
            prop_assert!(scale.extent.min <= extent.min + slack && extent.max <= scale.extent.max + slack);
            for pair in ticks.windows(2) {
                prop_assert!(pair[0].0 < pair[1].0 && pair[0].1 != pair[1].1, "{pair:?}");
            }
        }
    }
}
