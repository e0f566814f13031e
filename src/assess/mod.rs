//! How well the axes follow: tracking, contour and circularity errors, currents, saturation.

mod contour;
mod motion;
mod path_shape;
mod path_tracker;
mod recording;

pub use contour::ContourTracker;
pub use motion::{AxisReport, MotionAssessor, MotionReport};
pub use path_tracker::{Nearest, PathTracker};
pub use recording::{AxisTrace, CircleTrace, Recording, ToolTrace};
