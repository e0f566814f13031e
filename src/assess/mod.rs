//! How well the axes follow: tracking, contour and circularity errors, currents, saturation.

mod contour;
mod motion;

pub use contour::ContourTracker;
pub use motion::{AxisReport, MotionAssessor, MotionReport};
