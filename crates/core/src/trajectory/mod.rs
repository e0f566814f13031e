//! Trajectories: from requested points to one position setpoint (PSEC) per position cycle and joint.
//!
//! A [`TrajectoryRequest`] contains the values of a request. [`Trajectory::new`] validates it against the
//! machine in the thread of the caller; this is the expensive part. The [`Timeline`] belongs to the
//! real-time thread: it accepts validated trajectories, checks only the junction with the commanded
//! setpoints, replaces or preempts earlier trajectories, and returns the setpoints of one position
//! instant after another. Rejected trajectories (NaN, outside the travel limits, excessive speed, jump)
//! get a [`Rejection`] with a [`RejectionCode`].
//!
//! Modules import only from modules above them:
//!
//! | module | contents |
//! |---|---|
//! | `rejection` | rejection codes and texts |
//! | `event` | events of motions |
//! | `spline` | segments of degree 1, 3 and 5 |
//! | `limits` | checks against the limits of a joint |
//! | `stop` | controlled stop |
//! | `request` | requested points |
//! | `joint_trajectory` | validated trajectory |
//! | `validation` | validation of a request |
//! | `feed_override`, `path_time` | control of the feed override, path time |
//! | `chunk` | chunk of a motion that is planned while it runs |
//! | `plan` | plan of one joint, and its queue |
//! | `motion_table` | accepted motions |
//! | `preview`, `stream_gate`, `stream` | streamed setpoints |
//! | `path_clock`, `timeline` | path time, queues and setpoints of all joints |
//! | `ahead` | feed override, setpoints planned ahead |
//! | `cancel`, `submit`, `motion_chunks` | cancellation and acceptance; motions that are planned while they run |

pub mod event;
pub mod feed_override;
pub mod limits;
pub mod rejection;
pub mod request;
pub mod spline;
pub mod stop;
pub mod stream;
pub mod timeline;

mod ahead;
mod cancel;
mod chunk;
mod joint_trajectory;
mod motion_chunks;
mod motion_table;
mod path_clock;
mod path_time;
mod plan;
mod preview;
mod stream_gate;
mod submit;
mod validation;

pub use cancel::CancelOutcome;
pub use chunk::{MotionChunk, PathPlace};
pub use event::{JointSet, MotionId, TimelineEvent};
pub use feed_override::{InvalidFeedOverride, MAX_FEED_OVERRIDE, check_feed_override};
pub use joint_trajectory::Trajectory;
pub use limits::JointLimits;

pub use rejection::{Rejection, RejectionCode};
pub use request::{Start, TrajectoryPoint, TrajectoryRequest};
pub use spline::KinematicState;
pub use stream::{STREAM_JITTER, StreamCounts, StreamEnd};
pub use submit::Admission;
pub use timeline::{Timeline, TimelineError};
pub use validation::ValidationContext;
