//! Descriptive statistics: mean, root mean square, median and quantiles.
//!
//! Each function returns `None` without a value.

/// Returns the arithmetic mean.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Returns the root mean square (RMS).
pub fn rms(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (sum, count) =
        values.into_iter().fold((0.0, 0), |(sum, count), value| (sum + value * value, count + 1));
    rms_of_sum(sum, count)
}

/// Returns the root mean square (RMS) of `count` values with the given sum of squares.
pub fn rms_of_sum(sum_of_squares: f64, count: u64) -> Option<f64> {
    (count > 0).then(|| (sum_of_squares / count as f64).sqrt())
}

/// Returns the median, for an even number of values the upper one of both middle values; reorders `values`.
///
/// ```
/// use virtual_axes_core::statistics::median;
///
/// assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
/// assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), Some(3.0));
/// assert_eq!(median(&mut []), None);
/// ```
pub fn median(values: &mut [f64]) -> Option<f64> {
    quantile(values, 0.5)
}

/// Returns the quantile `fraction`, 0 to 1: the value of nearest rank, without interpolation; reorders `values`.
pub fn quantile(values: &mut [f64], fraction: f64) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let rank = ((values.len() - 1) as f64 * fraction).round() as usize;
    Some(*values.select_nth_unstable_by(rank, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_no_value_are_none() {
        assert_eq!((mean(&[]), rms([]), rms_of_sum(0.0, 0)), (None, None, None));
        assert_eq!((median(&mut []), quantile(&mut [], 0.9)), (None, None));
    }

    #[test]
    fn median_has_rank_of_half_the_count() {
        for count in 1..50 {
            let mut values: Vec<f64> = (0..count).rev().map(f64::from).collect();
            assert_eq!(median(&mut values), Some(f64::from(count / 2)), "{count} values");
        }
    }

    #[test]
    fn mean_and_rms_of_known_values() {
        assert_eq!(mean(&[1.0, 2.0, 6.0]), Some(3.0));
        assert_eq!(rms([3.0, -4.0, 0.0, 0.0]), Some(2.5));
        assert_eq!(quantile(&mut [0.0, 10.0, 20.0, 30.0], 0.9), Some(30.0));
    }
}
