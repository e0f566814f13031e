//! Estimate of the contour error from delayed setpoints and measured positions.

/// Number of linear axes of a contour.
pub const CONTOUR_AXES: usize = 3;
/// Setpoints before the delayed one among which the nearest point of the path is searched.
pub const CONTOUR_LOOKBACK: usize = 32;

/// Point or vector with one coordinate per linear axis, m.
pub type ContourVector = [f64; CONTOUR_AXES];

fn combine(a: ContourVector, weight: f64, b: ContourVector) -> ContourVector {
    std::array::from_fn(|axis| a[axis] + weight * b[axis])
}

fn dot(a: ContourVector, b: ContourVector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns the smaller of two second differences; 0 if they are opposite, as beside a corner.
fn common_curvature(a: ContourVector, b: ContourVector) -> ContourVector {
    match () {
        () if dot(a, b) <= 0.0 => [0.0; CONTOUR_AXES],
        () if dot(a, a) < dot(b, b) => a,
        () => b,
    }
}

/// Estimates the contour error: the vector from `position` to the path, without its component along the path, m.
///
/// `setpoint` returns the setpoint j position cycles after the delayed one, for j from −[`CONTOUR_LOOKBACK`] − 2 to 1. The
/// path is a parabola between two setpoints. The segment is the last one whose start is behind the position; the first and
/// the last segment continue beyond their ends. The vector is 0 while the setpoints stand still.
///
/// ```text
/// p(s) = a + s c + s (s − 1)/2 k      c = b − a      s = c · (position − a)/c²      t = dp/ds
/// ε = d − t (d · t)/t²                d = p(s) − position
/// ```
///
/// a and b are the ends of the segment, k is the second difference of the setpoints there.
pub fn contour_error(setpoint: impl Fn(i64) -> ContourVector, position: ContourVector) -> ContourVector {
    let second = |j: i64| combine(combine(setpoint(j + 1), -2.0, setpoint(j)), 1.0, setpoint(j - 1));
    for end in (-(CONTOUR_LOOKBACK as i64)..=0).rev() {
        let (a, b) = (setpoint(end - 1), setpoint(end));
        let chord = combine(b, -1.0, a);
        let square = dot(chord, chord);
        let share = dot(chord, combine(position, -1.0, a)) / square;
        let is_first = end == -(CONTOUR_LOOKBACK as i64);
        // A segment of length 0 has no finite share.
        if !share.is_finite() || (share < 0.0 && !is_first) {
            continue;
        }
        let curvature = common_curvature(second(end - 1), second(end));
        let bend = share.clamp(-1.0, 2.0);
        let point = combine(combine(a, share, chord), bend * (bend - 1.0) / 2.0, curvature);
        let tangent = combine(chord, bend - 0.5, curvature);
        let distance = combine(point, -1.0, position);
        return combine(distance, -dot(distance, tangent) / dot(tangent, tangent).max(square / 4.0), tangent);
    }
    [0.0; CONTOUR_AXES]
}
