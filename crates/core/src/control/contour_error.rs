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
/// path is a parabola between two setpoints. The segment is that with the nearest chord; the first and the last one
/// continue beyond their ends. The vector is 0 while the setpoints stand still.
///
/// ```text
/// p(s) = a + s c + s (s − 1)/2 k      c = b − a      s = c · (position − a)/c²      t = dp/ds
/// ε = d − t (d · t)/t²                d = p(s) − position
/// ```
///
/// a and b are the ends of the segment, k is the second difference of the setpoints there.
pub fn contour_error(setpoint: impl Fn(i64) -> ContourVector, position: ContourVector) -> ContourVector {
    let Some(Segment { end, start, chord, square, share, .. }) = nearest_segment(&setpoint, position) else {
        return [0.0; CONTOUR_AXES];
    };
    let second = |j: i64| combine(combine(setpoint(j + 1), -2.0, setpoint(j)), 1.0, setpoint(j - 1));
    let curvature = common_curvature(second(end - 1), second(end));
    let bend = share.clamp(-1.0, 2.0);
    let point = combine(combine(start, share, chord), bend * (bend - 1.0) / 2.0, curvature);
    let tangent = combine(chord, bend - 0.5, curvature);
    let distance = combine(point, -1.0, position);
    combine(distance, -dot(distance, tangent) / dot(tangent, tangent).max(square / 4.0), tangent)
}

/// Chord between two setpoints, and the foot of the perpendicular from a position.
struct Segment {
    /// Setpoint at the end, position cycles after the delayed one.
    end: i64,
    start: ContourVector,
    chord: ContourVector,
    /// Square of the length of the chord, m².
    square: f64,
    /// Foot of the perpendicular: 0 at the start, 1 at the end.
    share: f64,
    /// Square of the distance of the position, m².
    distance: f64,
}

/// Returns the segment nearest to a position, the later one of several; `None` if the setpoints stand still.
fn nearest_segment(setpoint: impl Fn(i64) -> ContourVector, position: ContourVector) -> Option<Segment> {
    let oldest = -(CONTOUR_LOOKBACK as i64);
    let mut nearest: Option<Segment> = None;
    let mut b = setpoint(0);
    for end in (oldest..=0).rev() {
        let start = setpoint(end - 1);
        let chord = combine(b, -1.0, start);
        let square = dot(chord, chord);
        let from_start = combine(position, -1.0, start);
        let share = dot(chord, from_start) / square;
        b = start;
        // A segment of length 0 has no finite share.
        if !share.is_finite() {
            continue;
        }
        let is_last = nearest.is_none();
        let least = if end == oldest { f64::NEG_INFINITY } else { 0.0 };
        let most = if is_last { f64::INFINITY } else { 1.0 };
        let away = combine(from_start, -share.clamp(least, most), chord);
        let distance = dot(away, away);
        if nearest.as_ref().is_none_or(|nearest| distance < nearest.distance) {
            nearest = Some(Segment { end, start, chord, square, share, distance });
        }
    }
    nearest
}
