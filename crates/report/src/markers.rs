//! Markerer shapes of point groups, which differ in shape as well as in color.

use super::decimate::PixelPoint;

/// Half length of the strokes of a cross, pixels.
const HALF_LENGTH: f64 = 4.0;
/// Half the side of a square, pixels; the style sheet sets an equal stroke width.
const HALF_SIDE: f64 = 3.0;

/// Shape of a marker, composed of strokes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Marker {
    /// Disc: a stroke of zero length with round ends.
    Round,
    /// Square: a stroke as long as its width. Strokes of zero length with square ends are not printed.
    Square,
    /// Diagonal cross.
    Cross,
    /// Upright cross.
    Plus,
}

impl Marker {
    const ALL: [Marker; 4] = [Marker::Round, Marker::Square, Marker::Cross, Marker::Plus];

    /// Returns the shape of a group by its index.
    pub(super) fn for_group(group: usize) -> Marker {
        Marker::ALL[group % Marker::ALL.len()]
    }

    /// Returns the CSS class.
    pub(super) fn name(self) -> &'static str {
        match self {
            Marker::Round => "round",
            Marker::Square => "square",
            Marker::Cross => "cross",
            Marker::Plus => "plus",
        }
    }

    /// Returns the shape that a CSS class names; a disc if it names none.
    pub(super) fn from_class(class: &str) -> Marker {
        let is_named = |mark: &Marker| class.split(' ').any(|word| word == mark.name());
        Marker::ALL.into_iter().find(is_named).unwrap_or(Marker::Round)
    }

    /// Returns the strokes around a point, scaled by `size`.
    pub(super) fn strokes(self, [x, y]: PixelPoint, size: f64) -> Vec<Vec<PixelPoint>> {
        let r = HALF_LENGTH * size;
        // Diagonal and upright strokes have equal lengths.
        let d = r * std::f64::consts::FRAC_1_SQRT_2;
        match self {
            Marker::Round => vec![vec![[x, y]]],
            Marker::Square => vec![vec![[x - HALF_SIDE * size, y], [x + HALF_SIDE * size, y]]],
            Marker::Cross => vec![vec![[x - d, y - d], [x + d, y + d]], vec![[x - d, y + d], [x + d, y - d]]],
            Marker::Plus => vec![vec![[x - r, y], [x + r, y]], vec![[x, y - r], [x, y + r]]],
        }
    }
}
