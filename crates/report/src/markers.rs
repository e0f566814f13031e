//! Marks of points: groups differ in shape as well as in color.

use super::decimate::PixelPoint;

/// How far the strokes of a cross reach from its middle, pixels.
const REACH: f64 = 4.0;
/// Half the side of a square, pixels; the page's style makes its stroke as broad.
const HALF_SIDE: f64 = 3.0;

/// The shape of a point, made of strokes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mark {
    /// A disc: a stroke of no length with round ends.
    Round,
    /// A stroke as long as it is broad: one of no length with square ends is not drawn on paper.
    Square,
    /// Two strokes, aslant.
    Cross,
    /// Two strokes, upright.
    Plus,
}

impl Mark {
    const ALL: [Mark; 4] = [Mark::Round, Mark::Square, Mark::Cross, Mark::Plus];

    /// That of a group of points, by its number.
    pub(super) fn of(group: usize) -> Mark {
        Mark::ALL[group % Mark::ALL.len()]
    }

    /// Its name in the page's style.
    pub(super) fn name(self) -> &'static str {
        match self {
            Mark::Round => "round",
            Mark::Square => "square",
            Mark::Cross => "cross",
            Mark::Plus => "plus",
        }
    }

    /// The one that a class names.
    pub(super) fn of_class(class: &str) -> Mark {
        let is_named = |mark: &Mark| class.split(' ').any(|word| word == mark.name());
        Mark::ALL.into_iter().find(is_named).unwrap_or(Mark::Round)
    }

    /// Its strokes about a point, at natural size or smaller.
    pub(super) fn strokes(self, [x, y]: PixelPoint, size: f64) -> Vec<Vec<PixelPoint>> {
        let r = REACH * size;
        // An arm aslant is as long as an upright one.
        let d = r * std::f64::consts::FRAC_1_SQRT_2;
        match self {
            Mark::Round => vec![vec![[x, y]]],
            Mark::Square => vec![vec![[x - HALF_SIDE * size, y], [x + HALF_SIDE * size, y]]],
            Mark::Cross => vec![vec![[x - d, y - d], [x + d, y + d]], vec![[x - d, y + d], [x + d, y - d]]],
            Mark::Plus => vec![vec![[x - r, y], [x + r, y]], vec![[x, y - r], [x, y + r]]],
        }
    }
}
