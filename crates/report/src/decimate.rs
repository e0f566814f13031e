//! Decimation of long series that keeps their peaks.

use super::chart::Chart;
use super::extent::is_drawable;

/// Most points that are kept of a group of consecutive points: the extremes of x and y, and a gap.
const KEPT_OF_GROUP: usize = 5;
/// Smallest number of points of a series that is never reduced.
const FEWEST: usize = 500;

/// Returns the number of points to which the series of charts are limited, so that they have at most `most` points in all.
pub(super) fn limit<'a>(charts: impl Iterator<Item = &'a Chart> + Clone, most: usize) -> usize {
    let series = charts.flat_map(|chart| &chart.panels).flat_map(|panel| &panel.series);
    let mut limit = most;
    while limit > FEWEST && series.clone().map(|s| s.points.len().min(limit)).sum::<usize>() > most {
        limit /= 2;
    }
    limit
}

/// Returns the indices of at most about `most` points, in order: of each group of consecutive points the smallest and the
/// largest x and y, and a point that cannot be drawn, if there is one.
pub(super) fn kept(points: &[[f64; 2]], most: usize) -> Vec<usize> {
    if points.len() <= most {
        return (0..points.len()).collect();
    }
    let size = points.len().div_ceil((most / KEPT_OF_GROUP).max(1));
    let mut kept = Vec::with_capacity(most + KEPT_OF_GROUP);
    for (number, group) in points.chunks(size).enumerate() {
        let is_drawn = |i: &usize| group[*i].iter().all(|v| is_drawable(*v));
        let mut of_it: Vec<usize> = (0..group.len()).find(|i| !is_drawn(i)).into_iter().collect();
        for axis in 0..2 {
            let order = |i: &usize, j: &usize| group[*i][axis].total_cmp(&group[*j][axis]);
            of_it.extend((0..group.len()).filter(is_drawn).min_by(order));
            of_it.extend((0..group.len()).filter(is_drawn).max_by(order));
        }
        of_it.sort_unstable();
        of_it.dedup();
        kept.extend(of_it.into_iter().map(|i| number * size + i));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn extremes_and_gaps_are_kept(
            values in prop::collection::vec(prop_oneof![9 => -1e3..1e3f64, 1 => Just(f64::NAN)], 1..2000),
            most in 20usize..600,
        ) {
            let points: Vec<[f64; 2]> = values.iter().enumerate().map(|(i, v)| [i as f64, *v]).collect();
            let kept = kept(&points, most);
            prop_assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
            prop_assert!(kept.len() <= most.max(KEPT_OF_GROUP));
            let extreme = |of: fn(f64, f64) -> f64, all: &mut dyn Iterator<Item = f64>| all.fold(f64::NAN, of);
            for of in [f64::min, f64::max] {
                let all = extreme(of, &mut values.iter().copied());
                let seen = extreme(of, &mut kept.iter().map(|i| values[*i]));
                prop_assert!(all == seen || all.is_nan() && seen.is_nan());
            }
            let is_gap = |i: usize| values[i].is_nan();
            prop_assert_eq!((0..values.len()).any(is_gap), kept.iter().any(|i| is_gap(*i)));
        }
    }

    #[test]
    fn a_point_apart_from_a_cloud_is_kept() {
        let mut points: Vec<[f64; 2]> =
            (0..200_000).map(|i| [f64::from(i % 500), f64::from(i / 500)]).collect();
        points.insert(123_456, [800.0, 7.0]);
        let kept = kept(&points, 9000);
        assert!(kept.contains(&123_456) && kept.len() <= 9000 && kept.len() > 2000, "{}", kept.len());
    }
}
