//! Results of trajectories (`~/trajectory_result`), each with the identity of its trajectory.

use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;

use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Time;
use tokio::sync::{Mutex, mpsc};
use tracing::{info, warn};

use crate::ros::axes::{Accepted, ProgramRunFigures, SimulationReport};
use crate::ros::topics::Output;
use crate::validation::{AdmissionControl, GoalId};
use virtual_axes_core::assess::AxisReport;
use virtual_axes_core::simulation::{AbortReason, MotionEnd, MotionOutcome, Quantity, ToleranceViolation};
use virtual_axes_core::trajectory::{JointLimits, JointSet, MotionId, Rejection, StreamEnd, Trajectory};
use virtual_axes_core::units::{Nanoseconds, Rounded, seconds};
use virtual_axes_dds::MessageInfo;
use virtual_axes_io::messages::{Source, Status, TrajectoryResult, header, stamp};

/// Event of an action goal that was submitted to the simulation.
#[derive(Debug)]
pub enum GoalEvent {
    /// The simulation accepted the motion.
    Started,
    /// The simulation rejected the motion.
    Rejected(Rejection),
    /// The motion ended, with the figures of a part program and a description of the outcome.
    Ended(Box<MotionEnd>, ProgramRunFigures, String),
}

/// Returns the name of a goal in messages: `goal` and its UUID in hexadecimal digits.
pub fn goal_name(id: &GoalId) -> String {
    let hex: String = id.iter().map(|octet| format!("{octet:02x}")).collect();
    format!("goal {hex}")
}

/// Origin of a trajectory.
#[derive(Debug, Clone, PartialEq)]
pub enum Origin {
    /// Message on the topic `psec`.
    Topic {
        /// `header.stamp` of the message, unchanged.
        stamp: Time,
        /// DDS sequence number of the publisher's message.
        sequence_number: u64,
        /// Global identifier (GID) of the publisher.
        publisher_gid: [u8; 16],
    },
    /// Goal of the action.
    Action {
        /// `header.stamp` of its trajectory, unchanged.
        stamp: Time,
        /// Identifier of the goal.
        goal_id: GoalId,
    },
    /// Goal of the action that runs a part program.
    Program {
        /// Identifier of the goal.
        goal_id: GoalId,
    },
}

/// Formats the origin for messages.
impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Origin::Topic { sequence_number, .. } => write!(f, "trajectory {sequence_number} of psec"),
            Origin::Action { goal_id, .. } | Origin::Program { goal_id } => f.write_str(&goal_name(goal_id)),
        }
    }
}

impl Origin {
    /// Creates the origin of a message on `psec`.
    pub fn from_message(stamp: &Time, info: &MessageInfo) -> Self {
        Origin::Topic {
            stamp: stamp.clone(),
            sequence_number: u64::try_from(info.sequence_number).unwrap_or(0),
            publisher_gid: info.publisher_gid,
        }
    }

    fn result(&self, time: Nanoseconds, status: Status) -> TrajectoryResult {
        let result =
            TrajectoryResult { header: header(time), status: status as u8, ..TrajectoryResult::default() };
        match self.clone() {
            Origin::Topic { stamp, sequence_number, publisher_gid } => TrajectoryResult {
                source: Source::Topic as u8,
                trajectory_stamp: stamp,
                sequence_number,
                publisher_gid,
                ..result
            },
            Origin::Action { stamp, goal_id } => {
                TrajectoryResult { source: Source::Action as u8, trajectory_stamp: stamp, goal_id, ..result }
            }
            Origin::Program { goal_id } => {
                TrajectoryResult { source: Source::Program as u8, goal_id, ..result }
            }
        }
    }
}

/// Trajectory that has been submitted to the simulation and has not ended.
struct ActiveTrajectory {
    origin: Origin,
    start: Time,
    /// Reference that keeps the axes' thread from freeing the trajectory.
    _trajectory: Option<Arc<Trajectory>>,
}

/// Publisher of results, with the origins of the trajectories that have not ended.
pub struct TrajectoryResults {
    output: Output<TrajectoryResult>,
    joints: Vec<JointLimits>,
    /// Sender of goal events, at most two for each goal.
    goal_events: mpsc::UnboundedSender<(GoalId, GoalEvent)>,
    /// Sender of events of part programs, at most two for each goal.
    program_events: mpsc::UnboundedSender<(GoalId, GoalEvent)>,
    active: Mutex<HashMap<MotionId, ActiveTrajectory>>,
    admission: AdmissionControl,
}

impl TrajectoryResults {
    /// Creates the results of a machine with `joints`, which also sends the events of action goals to `goal_events` and
    /// `program_events`.
    /// A trajectory has at most `max_points` points.
    pub fn new(
        output: Output<TrajectoryResult>,
        joints: Vec<JointLimits>,
        goal_events: mpsc::UnboundedSender<(GoalId, GoalEvent)>,
        program_events: mpsc::UnboundedSender<(GoalId, GoalEvent)>,
        max_points: usize,
    ) -> Self {
        TrajectoryResults {
            output,
            joints,
            goal_events,
            program_events,
            active: Mutex::new(HashMap::new()),
            admission: AdmissionControl::new(max_points),
        }
    }

    /// Admits a trajectory of any origin; see [`AdmissionControl::admit`].
    ///
    /// # Errors
    /// [`RejectionCode::QueueFull`](virtual_axes_core::trajectory::RejectionCode::QueueFull) if too many trajectories
    /// or points are active or waiting.
    pub fn admit(&self, trajectory: Trajectory) -> Result<Arc<Trajectory>, Rejection> {
        self.admission.admit(trajectory)
    }

    /// Stores the origin of a trajectory, or of a part program; called before its submission.
    pub async fn register(&self, id: MotionId, origin: Origin, trajectory: Option<Arc<Trajectory>>) {
        let active = ActiveTrajectory { origin, start: Time::default(), _trajectory: trajectory };
        self.active.lock().await.insert(id, active);
    }

    /// Publishes the result of a report and sends its goal event.
    pub async fn publish(&self, report: SimulationReport) {
        match report {
            SimulationReport::Decision(id, time, Ok(accepted)) => {
                self.publish_acceptance(id, time, accepted).await
            }
            SimulationReport::Decision(id, time, Err(rejection)) => {
                let trajectory = self.active.lock().await.remove(&id);
                if let Some(trajectory) = trajectory {
                    self.publish_rejection(&trajectory.origin, time, &rejection).await;
                    self.send_event(&trajectory.origin, || GoalEvent::Rejected(rejection));
                }
            }
            SimulationReport::MotionEnded(end) => self.publish_end(end, None).await,
            SimulationReport::ProgramEnded(end, figures) => self.publish_end(end, Some(figures)).await,
            SimulationReport::StreamEnded(time, end, joints, unread) => {
                self.publish_stream_end(time, end, joints).await;
                drop(unread);
            }
        }
    }

    /// Publishes a rejection at `time`, ns.
    pub async fn publish_rejection(&self, origin: &Origin, time: Nanoseconds, rejection: &Rejection) {
        warn!("{origin} rejected: {rejection}");
        let index = rejection.index.and_then(|index| i32::try_from(index).ok());
        self.output
            .send(TrajectoryResult {
                code: rejection.code as u16,
                joint: rejection.joint.clone().unwrap_or_default(),
                point_index: index.unwrap_or(-1),
                value: rejection.value,
                limit: rejection.limit,
                text: rejection.text.clone(),
                ..origin.result(time, Status::Rejected)
            })
            .await;
    }

    /// Sends an event of the goal with this origin; a trajectory of a topic has no goal.
    fn send_event(&self, origin: &Origin, event: impl FnOnce() -> GoalEvent) {
        let _ = match origin {
            Origin::Action { goal_id, .. } => self.goal_events.send((*goal_id, event())),
            Origin::Program { goal_id } => self.program_events.send((*goal_id, event())),
            Origin::Topic { .. } => Ok(()),
        };
    }

    /// Returns the text of a violated `path` or `goal` tolerance.
    fn violation_text(&self, tolerance: &str, violation: &ToleranceViolation) -> String {
        let ToleranceViolation { axis_index, quantity, error, limit } = *violation;
        let (name, unit) = self.joints.get(axis_index).map_or(("", ""), |j| (j.name.as_str(), j.unit()));
        let (quantity, per) = match quantity {
            Quantity::Position => ("position", ""),
            Quantity::Velocity => ("velocity", "/s"),
            Quantity::Acceleration => ("acceleration", "/s²"),
        };
        format!(
            "joint {name}: {quantity} error {} {unit}{per} exceeds the {tolerance} tolerance {} {unit}{per}",
            Rounded(error),
            Rounded(limit)
        )
    }

    async fn publish_acceptance(&self, id: MotionId, time: Nanoseconds, accepted: Accepted) {
        let start = stamp(accepted.start);
        let origin = {
            let mut active = self.active.lock().await;
            let Some(trajectory) = active.get_mut(&id) else { return };
            trajectory.start = start.clone();
            trajectory.origin.clone()
        };
        self.send_event(&origin, || GoalEvent::Started);
        let text = if accepted.is_late {
            let late = Rounded(seconds(time - accepted.start));
            let text = format!("received {late} s after its start time; it is followed from now on");
            warn!("{origin}: {text}");
            text
        } else {
            info!("{origin} accepted");
            String::new()
        };
        self.output.send(TrajectoryResult { start, text, ..origin.result(time, Status::Accepted) }).await;
    }

    /// Publishes the end of a stream on some joints.
    async fn publish_stream_end(&self, time: Nanoseconds, end: StreamEnd, joints: JointSet) {
        let (status, text) = match end {
            StreamEnd::Preempted(by) => (Status::Preempted, preemption_text(&*self.active.lock().await, by)),
            StreamEnd::Stopped(_) => {
                let text = "controlled stop; the stream is ignored until it pauses";
                (Status::Stopped, text.to_owned())
            }
            StreamEnd::Reset => (Status::Aborted, "reset".to_owned()),
            StreamEnd::ClockJump => (Status::Aborted, "the clock jumped".to_owned()),
        };
        let name: Vec<_> =
            joints.iter().filter_map(|index| Some(self.joints.get(index)?.name.clone())).collect();
        info!("stream of {}: {status:?}, {text}", name.join(", "));
        self.output
            .send(TrajectoryResult {
                header: header(time),
                source: Source::Stream as u8,
                status: status as u8,
                text,
                name,
                ..TrajectoryResult::default()
            })
            .await;
    }

    async fn publish_end(&self, end: MotionEnd, program: Option<ProgramRunFigures>) {
        let mut active = self.active.lock().await;
        let Some(trajectory) = active.remove(&end.id) else { return };
        let (status, text) = match end.outcome {
            MotionOutcome::Completed => (Status::Completed, String::new()),
            MotionOutcome::Preempted { by } => (Status::Preempted, preemption_text(&active, by)),
            MotionOutcome::Stopped => (Status::Stopped, "controlled stop".to_owned()),
            MotionOutcome::Canceled => (Status::Stopped, "canceled".to_owned()),
            MotionOutcome::PathTolerance(violation) => {
                (Status::Aborted, self.violation_text("path", &violation))
            }
            MotionOutcome::GoalTolerance(violation) => {
                (Status::Aborted, self.violation_text("goal", &violation))
            }
            MotionOutcome::Aborted(AbortReason::Reset) => (Status::Aborted, "reset".to_owned()),
            MotionOutcome::Aborted(AbortReason::ClockChange) => {
                (Status::Aborted, "use_sim_time was set: the time is that of /clock".to_owned())
            }
            MotionOutcome::Aborted(AbortReason::ClockJump { from, to }) => {
                let (from, to) = (seconds(from), seconds(to));
                (Status::Aborted, format!("the clock jumped from {from:.3} s to {to:.3} s"))
            }
        };
        drop(active);
        let separator = if text.is_empty() { "" } else { ", " };
        let line = format!("{}: {status:?}{separator}{text}", trajectory.origin);
        if status == Status::Aborted {
            warn!("{line}")
        } else {
            info!("{line}")
        }
        self.send_event(&trajectory.origin, || {
            GoalEvent::Ended(Box::new(end.clone()), program.unwrap_or_default(), text.clone())
        });
        let column = |value: fn(&AxisReport) -> f64| end.report.axes.iter().map(value).collect();
        let name =
            end.axis_indices.iter().filter_map(|&index| Some(self.joints.get(index)?.name.clone())).collect();
        self.output
            .send(TrajectoryResult {
                start: trajectory.start,
                text,
                name,
                max_tracking_error: column(|a| a.max_following_error),
                rms_tracking_error: column(|a| a.rms_following_error),
                max_synchronized_tracking_error: column(|a| a.max_delay_compensated_following_error),
                rms_synchronized_tracking_error: column(|a| a.rms_delay_compensated_following_error),
                max_contour_error: end.report.max_contour_error.unwrap_or(f64::NAN),
                rms_contour_error: end.report.rms_contour_error.unwrap_or(f64::NAN),
                peak_current: column(|a| a.peak_current),
                saturation_time: column(|a| a.saturation_time),
                ..trajectory.origin.result(end.time, status)
            })
            .await;
    }
}

/// Returns the text for a motion or stream that is preempted by the motion `by`.
fn preemption_text(active: &HashMap<MotionId, ActiveTrajectory>, by: MotionId) -> String {
    let by = active.get(&by).map_or_else(|| "another trajectory".to_owned(), |t| t.origin.to_string());
    format!("preempted by {by}")
}
