//! How well the axes follow: tracking, contour, orientation and circularity errors, currents,
//! saturation.

mod axis;
mod circle;
mod contour;
mod motion;
mod path_shape;
mod path_tracker;
mod recording;
mod setpoint_tracker;

pub use axis::{AxisAssessor, AxisReport};
pub use circle::{BidirectionalReport, CircleAssessor, CircleReport, FullCircle, bidirectional};
pub use contour::ContourTracker;
pub use motion::{MotionAssessor, MotionReport};
pub use path_tracker::{Deviations, Followed, Nearest, PathTracker};
pub use recording::{AxisTrace, CircleTrace, Recording, ToolTrace};
pub use setpoint_tracker::SetpointTracker;
