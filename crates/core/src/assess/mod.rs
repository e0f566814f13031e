//! Motion assessment: following errors, contour error, orientation error, circularity (ISO 230-4), currents
//! and saturation.

mod axis;
mod circle;
mod contour;
mod curve_cells;
mod motion;
mod path_shape;
mod path_tracker;
mod recording;
mod setpoint_tracker;
mod tool_angle;

pub use axis::{AxisAssessor, AxisReport};
pub use circle::{BidirectionalReport, CircleAssessor, CircleReport, FullCircle, bidirectional};
pub use contour::ContourTracker;
pub use motion::{MotionAssessor, MotionReport};
pub use path_tracker::{FollowResult, NearestPoint, PathDeviations, PathTracker};
pub use recording::{AxisTrace, CircleTrace, SignalRecording, ToolTrace};
pub use setpoint_tracker::SetpointTracker;
