//! Decimation of lines and markers to the resolution of a plot.
//!
//! A signal over time keeps the smallest and the largest value of each pixel column, so that no peak is lost.
//! Then, and for curves in a plane, points on the line between their neighbors are dropped
//! (Ramer–Douglas–Peucker).

use super::scale::is_drawable;

/// A point in pixels.
pub(super) type PixelPoint = [f64; 2];

/// Largest distance of a dropped point from the drawn line, pixels.
const TOLERANCE: f64 = 0.08;
/// Distance below which points of a curve are indistinguishable, pixels.
const SHORTEST_STEP: f64 = 0.25;
/// Maximum number of points of a curve. If a curve has more, the step is doubled up to `LONGEST_STEP`, which
/// preserves the shape; if it still has more, every n-th point is kept.
const MAX_POINTS: usize = 6000;
const LONGEST_STEP: f64 = 4.0;
/// Maximum number of markers; if there are more, markers close to others are dropped.
const MAX_MARKERS: usize = 9000;

/// Returns the decimated line through points, split at points that cannot be drawn.
///
/// If x never decreases, the extremes of each pixel column are kept; otherwise the line is decimated as a
/// curve.
pub(super) fn line(points: &[Option<PixelPoint>]) -> Vec<Vec<PixelPoint>> {
    let known = || points.iter().flatten();
    if known().zip(known().skip(1)).all(|(a, b)| a[0] <= b[0]) {
        let heights: Vec<f64> = points.iter().map(|point| point.map_or(f64::NAN, |p| p[1])).collect();
        let parts = extremes(&heights, |i| points[i].map_or(0, |p| p[0] as i64));
        return parts.into_iter().map(|part| part.into_iter().filter_map(|i| points[i]).collect()).collect();
    }
    // Each point with the number of preceding points that cannot be drawn.
    let mut gaps = 0;
    let mut curve: Vec<(usize, PixelPoint)> = Vec::with_capacity(points.len());
    for point in points {
        match point {
            Some(point) => curve.push((gaps, *point)),
            None => gaps += 1,
        }
    }
    let kept = steps(curve.len(), |i, j, within| apart(curve[i].1, curve[j].1) < within);
    let kept: Vec<(usize, PixelPoint)> = kept.into_iter().map(|i| curve[i]).collect();
    kept.chunk_by(|a, b| a.0 == b.0).map(|part| part.iter().map(|(_, point)| *point).collect()).collect()
}

/// Returns the indices of distinguishable points, in order. Among many points one of each cluster is kept, so
/// that isolated points are never lost.
pub(super) fn separate_points(points: &[PixelPoint]) -> Vec<usize> {
    let mut cell = 1.0;
    loop {
        let mut cells: Vec<([i64; 2], usize)> =
            points.iter().enumerate().map(|(i, p)| (p.map(|v| (v / cell).round() as i64), i)).collect();
        cells.sort_unstable();
        cells.dedup_by_key(|(cell, _)| *cell);
        if cells.len() <= MAX_MARKERS || cell > 1e4 {
            let mut kept: Vec<usize> = cells.into_iter().map(|(_, i)| i).collect();
            kept.sort_unstable();
            return kept;
        }
        cell *= std::f64::consts::SQRT_2;
    }
}

/// Returns the corners of a step plot: each value is held until the next x.
pub(super) fn step_corners(points: &[Option<PixelPoint>]) -> Vec<Option<PixelPoint>> {
    let mut corners: Vec<Option<PixelPoint>> = Vec::with_capacity(2 * points.len());
    for point in points {
        if let (Some([x, _]), Some(Some([_, before]))) = (point, corners.last()) {
            corners.push(Some([*x, *before]));
        }
        corners.push(*point);
    }
    corners
}

/// Returns the distance of two points, pixels.
fn apart(a: PixelPoint, b: PixelPoint) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Returns the indices of the smallest and the largest value in each pixel column, in order, as one list for
/// each part between values that cannot be drawn.
///
/// `column(i)` is the column of sample i and does not decrease. A gap within a column is invisible and is
/// closed.
fn extremes(values: &[f64], column: impl Fn(usize) -> i64) -> Vec<Vec<usize>> {
    let mut parts: Vec<Vec<usize>> = Vec::new();
    // Column, index of its smallest value, index of its largest value.
    let mut open: Option<(i64, usize, usize)> = None;
    let mut gap = true;
    let mut previous = 0;
    for (i, &value) in values.iter().enumerate() {
        if !is_drawable(value) {
            gap = true;
            continue;
        }
        match &mut open {
            Some((c, low, high)) if *c == column(i) => {
                if value < values[*low] {
                    *low = i;
                }
                if value > values[*high] {
                    *high = i;
                }
            }
            _ => {
                close(&mut parts, open, previous);
                if gap {
                    parts.push(vec![i]);
                } else if let Some(part) = parts.last_mut() {
                    part.push(i);
                }
                open = Some((column(i), i, i));
            }
        }
        gap = false;
        previous = i;
    }
    close(&mut parts, open, previous);
    parts
}

/// Appends the extremes and the last sample of a column.
fn close(parts: &mut [Vec<usize>], open: Option<(i64, usize, usize)>, last: usize) {
    let (Some((_, low, high)), Some(part)) = (open, parts.last_mut()) else { return };
    for index in [low.min(high), low.max(high), last] {
        if part.last().is_none_or(|&l| l < index) {
            part.push(index);
        }
    }
}

/// Returns the indices of the points of a curve that differ visibly from the previous one. `same(i, j,
/// distance)` returns true if points i and j are closer than `distance` pixels.
pub(super) fn steps(length: usize, same: impl Fn(usize, usize, f64) -> bool) -> Vec<usize> {
    let mut within = SHORTEST_STEP;
    loop {
        let mut kept: Vec<usize> = Vec::new();
        for i in 0..length {
            if i + 1 == length || kept.last().is_none_or(|&last| !same(last, i, within)) {
                kept.push(i);
            }
        }
        if kept.len() <= MAX_POINTS {
            return kept;
        }
        if within >= LONGEST_STEP {
            let last = kept.pop();
            let every = kept.len().div_ceil(MAX_POINTS - 1);
            return kept.into_iter().step_by(every).chain(last).collect();
        }
        within *= 2.0;
    }
}

/// Removes points that lie on the line (Ramer–Douglas–Peucker).
pub(super) fn simplified(points: &[PixelPoint]) -> Vec<PixelPoint> {
    let Some(last) = points.len().checked_sub(1).filter(|&last| last > 1) else { return points.to_vec() };
    let mut kept = vec![false; points.len()];
    kept[0] = true;
    kept[last] = true;
    let mut pending = vec![(0, last)];
    while let Some((from, to)) = pending.pop() {
        let farthest = (from + 1..to)
            .map(|i| (i, distance(points[i], points[from], points[to])))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((i, d)) = farthest
            && d > TOLERANCE
        {
            kept[i] = true;
            pending.extend([(from, i), (i, to)]);
        }
    }
    points.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(point, _)| *point).collect()
}

/// Returns the distance of `p` from the line segment between `a` and `b`, pixels.
fn distance(p: PixelPoint, a: PixelPoint, b: PixelPoint) -> f64 {
    let (along, off) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length = along[0] * along[0] + along[1] * along[1];
    let dot = along[0] * off[0] + along[1] * off[1];
    let t = if length > 0.0 { (dot / length).clamp(0.0, 1.0) } else { 0.0 };
    (off[0] - t * along[0]).hypot(off[1] - t * along[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_extremes_of_every_column_are_kept(
            values in prop::collection::vec(-1e3..1e3f64, 1..400), per_column in 1usize..50
        ) {
            let parts = extremes(&values, |i| (i / per_column) as i64);
            prop_assert_eq!(parts.len(), 1);
            let kept = &parts[0];
            prop_assert!(kept.windows(2).all(|w| w[0] < w[1]));
            prop_assert!(kept.len() <= 4 * values.len().div_ceil(per_column));
            for (c, column) in values.chunks(per_column).enumerate() {
                let seen = kept.iter().filter(|&&i| i / per_column == c).map(|&i| values[i]);
                let (low, high) = seen.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
                prop_assert_eq!(low, column.iter().copied().fold(f64::MAX, f64::min));
                prop_assert_eq!(high, column.iter().copied().fold(f64::MIN, f64::max));
            }
            prop_assert_eq!((kept[0], kept[kept.len() - 1]), (0, values.len() - 1));
        }

        #[test]
        fn a_dropped_point_lies_on_the_line(points in prop::collection::vec(prop::array::uniform2(-50.0..50.0f64), 2..60)) {
            let line = simplified(&points);
            for p in &points {
                let d = line.windows(2).map(|w| distance(*p, w[0], w[1])).fold(f64::MAX, f64::min);
                prop_assert!(d <= TOLERANCE, "{p:?} is {d} away");
            }
        }

        #[test]
        fn undrawable_values_split_a_line_into_few_parts(
            values in prop::collection::vec(prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(1.0)], 0..400)
        ) {
            let parts = extremes(&values, |i| (i / 10) as i64);
            prop_assert!(parts.len() <= values.len().div_ceil(10));
            prop_assert!(parts.iter().flatten().all(|&i| values[i] == 1.0));
        }
    }

    #[test]
    fn a_gap_breaks_the_line() {
        let values = [1.0, 2.0, f64::NAN, f64::NAN, 3.0, f64::INFINITY];
        assert_eq!(extremes(&values, |i| i as i64), [vec![0, 1], vec![4]]);
        let (a, b, c) = ([0.0, 1.0], [5.0, 2.0], [9.0, 1.0]);
        assert_eq!(line(&[Some(a), Some(b), None, Some(c), None]), [vec![a, b], vec![c]]);
        // A curve whose x decreases.
        assert_eq!(line(&[Some(c), Some(b), None, None, Some(a)]), [vec![c, b], vec![a]]);
    }

    #[test]
    fn a_step_plot_is_horizontal_first_and_ends_at_a_gap() {
        let (a, b, c) = ([0.0, 1.0], [5.0, 2.0], [9.0, 1.0]);
        let corners = step_corners(&[Some(a), Some(b), None, Some(c)]);
        assert_eq!(corners, [Some(a), Some([5.0, 1.0]), Some(b), None, Some(c)]);
    }

    #[test]
    fn an_isolated_point_among_many_is_kept() {
        let mut points: Vec<PixelPoint> =
            (0..200_000).map(|i| [f64::from(i % 500), f64::from(i / 500)]).collect();
        points.insert(123_456, [800.0, 700.0]);
        let kept = separate_points(&points);
        assert!(
            kept.contains(&123_456) && kept.len() <= MAX_MARKERS && kept.len() > MAX_MARKERS / 3,
            "{}",
            kept.len()
        );
        assert!(kept.windows(2).all(|w| w[0] < w[1]));
    }

    #[test]
    fn a_curve_has_a_bounded_number_of_points() {
        let kept = steps(100_000, |i, j, within| ((i as f64) - (j as f64)).abs() < within);
        assert!(kept.len() <= MAX_POINTS && kept.contains(&99_999));
        // A curve that no step length decimates.
        let kept = steps(100_000, |_, _, _| false);
        assert!((MAX_POINTS / 2..=MAX_POINTS).contains(&kept.len()) && kept.contains(&99_999));
    }

    #[test]
    fn a_straight_line_needs_two_points() {
        let points: Vec<PixelPoint> = (0..100).map(|i| [f64::from(i), 2.0 * f64::from(i)]).collect();
        assert_eq!(simplified(&points), [[0.0, 0.0], [99.0, 198.0]]);
    }
}
