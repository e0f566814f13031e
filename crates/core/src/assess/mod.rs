//! Motion assessment: following errors, contour error, orientation error, circularity (ISO 230-4), currents
//! and saturation.

mod axis;
mod circle;
mod contour;
mod curve_cells;
mod deviations;
mod feet;
mod limit_audit;
mod motion;
mod path_shape;
mod path_tracker;
mod recording;
mod setpoint_tracker;
mod standing_turn;
mod tool_angle;

pub use axis::{AxisAssessor, AxisReport};
pub use circle::{BidirectionalReport, CircleAssessor, CircleReport, FullCircle, bidirectional};
pub use deviations::{NearestPoint, PathDeviations};
pub use limit_audit::{AuditedAxis, ExtremePosition, LargestUse, LimitAudit, SetpointPlace};
pub use motion::{MotionAssessor, MotionReport};
pub use path_tracker::PathTracker;
pub use recording::{AxisTrace, CircleTrace, SignalRecording, ToolTrace};
pub use setpoint_tracker::SetpointTracker;
pub use standing_turn::StandingTurn;
