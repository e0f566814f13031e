//! Points of rational B-splines.

use crate::motion::Nurbs;

/// Returns the point of a clamped rational B-spline with uniform inner knots at parameter `t` from 0 to 1, by de Boor's
/// algorithm in homogeneous coordinates.
pub(super) fn point(nurbs: &Nurbs, t: f64) -> [f64; 2] {
    let count = nurbs.control.len();
    if count == 0 {
        return [f64::NAN; 2];
    }
    let degree = nurbs.order.clamp(2, count.max(2)).saturating_sub(1).min(count - 1);
    let spans = count - degree;
    let u = (t * spans as f64).clamp(0.0, spans as f64);
    let span = (u as usize).min(spans - 1);
    let knot = |i: usize| (i as f64 - degree as f64).clamp(0.0, spans as f64);
    let mut points: Vec<[f64; 3]> = (span..=span + degree)
        .map(|i| {
            let ([x, y], w) = nurbs.control[i];
            [x * w, y * w, w]
        })
        .collect();
    for r in 1..=degree {
        for j in (r..=degree).rev() {
            let (low, high) = (knot(span + j), knot(span + j + degree + 1 - r));
            let alpha = if high > low { (u - low) / (high - low) } else { 0.0 };
            let (before, here) = (points[j - 1], points[j]);
            points[j] = std::array::from_fn(|k| before[k] + (here[k] - before[k]) * alpha);
        }
    }
    let [x, y, w] = points[degree];
    [x / w, y / w]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Plane;

    #[test]
    fn a_quarter_circle_is_exact() {
        let w = 0.5_f64.sqrt();
        let control = vec![([1.0, 0.0], 1.0), ([1.0, 1.0], w), ([0.0, 1.0], 1.0)];
        let nurbs = Nurbs { plane: Plane::Xy, order: 3, control };
        for i in 0..=10 {
            let [x, y] = point(&nurbs, f64::from(i) / 10.0);
            assert!((x.hypot(y) - 1.0).abs() < 1e-15);
        }
    }
}
