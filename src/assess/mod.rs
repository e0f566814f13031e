//! How well the axes follow: tracking, contour and circularity errors, currents, saturation.

mod circle;
mod contour;
mod motion;
mod recording;

pub use circle::{BidirectionalReport, CircleAssessor, CircleReport, FullCircle, bidirectional};
pub use contour::ContourTracker;
pub use motion::{AxisReport, MotionAssessor, MotionReport};
pub use recording::{AxisTrace, CircleTrace, Recording, ToolTrace};
