//! `~/trajectory_result`: what became of each trajectory, so that its publisher finds its own.

use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;

use ros2_client::MessageInfo;
use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Time;
use tokio::sync::{Mutex, mpsc};
use tracing::{info, warn};

use super::action::{GoalEvent, GoalId, goal_name};
use super::convert::{header, stamp};
use super::outputs::Output;
use super::pace::{Accepted, Report};
use crate::ingress::AdmissionControl;
use virtual_axes_core::assess::AxisReport;
use virtual_axes_core::simulation::{AbortReason, MotionEnd, MotionOutcome, Quantity, ToleranceViolation};
use virtual_axes_core::trajectory::{JointLimits, JointSet, MotionId, Rejection, StreamEnd, Trajectory};
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_io::messages::{Source, Status, TrajectoryResult};

/// Where a trajectory came from.
#[derive(Debug, Clone, PartialEq)]
pub enum Origin {
    /// The topic `psec`.
    Topic {
        /// `header.stamp` as it came.
        stamp: Time,
        /// The middleware's, per publisher.
        sequence_number: u64,
        /// The middleware's id of the publisher.
        publisher_gid: [u8; 16],
    },
    /// A goal of the action.
    Action {
        /// `header.stamp` of its trajectory as it came.
        stamp: Time,
        /// Its name.
        goal_id: GoalId,
    },
}

/// As texts name it.
impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Origin::Topic { sequence_number, .. } => write!(f, "trajectory {sequence_number} of psec"),
            Origin::Action { goal_id, .. } => f.write_str(&goal_name(goal_id)),
        }
    }
}

impl Origin {
    /// Origin of a message on `psec`.
    pub fn of(stamp: &Time, info: &MessageInfo) -> Self {
        Origin::Topic {
            stamp: stamp.clone(),
            sequence_number: u64::try_from(info.sequence_number()).unwrap_or(0),
            publisher_gid: info.publisher_gid().to_bytes16(),
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
        }
    }
}

/// A trajectory that has been handed to the simulation.
struct Known {
    origin: Origin,
    start: Time,
    /// Held here so that the thread of the simulation does not have to free it.
    _trajectory: Arc<Trajectory>,
}

/// Publishes results, and remembers the trajectories that have none yet.
pub struct Results {
    output: Output<TrajectoryResult>,
    joints: Vec<JointLimits>,
    /// What becomes of goals; at most two events for each.
    goals: mpsc::UnboundedSender<GoalEvent>,
    known: Mutex<HashMap<MotionId, Known>>,
    admission: AdmissionControl,
}

impl Results {
    /// Results of a machine with `joints`; those of action goals go to `goals` too. One trajectory has at most
    /// `max_points` points.
    pub fn new(
        output: Output<TrajectoryResult>,
        joints: Vec<JointLimits>,
        goals: mpsc::UnboundedSender<GoalEvent>,
        max_points: usize,
    ) -> Self {
        Results {
            output,
            joints,
            goals,
            known: Mutex::new(HashMap::new()),
            admission: AdmissionControl::new(max_points),
        }
    }

    /// Takes a trajectory in, whatever source it has, while there is room for it.
    ///
    /// # Errors
    /// As [`AdmissionControl::admit`].
    pub fn hold(&self, trajectory: Trajectory) -> Result<Arc<Trajectory>, Rejection> {
        self.admission.admit(trajectory)
    }

    /// Remembers where a trajectory came from, before the simulation is asked.
    pub async fn remember(&self, id: MotionId, origin: Origin, trajectory: Arc<Trajectory>) {
        let known = Known { origin, start: Time::default(), _trajectory: trajectory };
        self.known.lock().await.insert(id, known);
    }

    /// Publishes what the simulation reports.
    pub async fn report(&self, report: Report) {
        match report {
            Report::Decided(id, time, Ok(accepted)) => self.accepted(id, time, accepted).await,
            Report::Decided(id, time, Err(rejection)) => {
                let known = self.known.lock().await.remove(&id);
                if let Some(known) = known {
                    self.rejected(&known.origin, time, &rejection).await;
                    if let Origin::Action { goal_id, .. } = known.origin {
                        self.tell(GoalEvent::Refused(goal_id, rejection));
                    }
                }
            }
            Report::Ended(end) => self.ended(end).await,
            Report::StreamEnded(time, end, joints, on_its_way) => {
                self.stream_ended(time, end, joints).await;
                drop(on_its_way);
            }
        }
    }

    /// Publishes a refusal at `time` (ns).
    pub async fn rejected(&self, origin: &Origin, time: Nanoseconds, rejection: &Rejection) {
        warn!("{origin} refused: {rejection}");
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

    /// Passes an event on; nobody hears it when the node shuts down.
    fn tell(&self, event: GoalEvent) {
        let _ = self.goals.send(event);
    }

    /// Which tolerance was not kept: `path` or `goal`.
    fn violation(&self, tolerance: &str, violation: &ToleranceViolation) -> String {
        let ToleranceViolation { axis_index, quantity, error, limit } = *violation;
        let (name, unit) = self.joints.get(axis_index).map_or(("", ""), |j| (j.name.as_str(), j.unit()));
        let (what, per) = match quantity {
            Quantity::Position => ("position", ""),
            Quantity::Velocity => ("velocity", "/s"),
            Quantity::Acceleration => ("acceleration", "/s²"),
        };
        format!(
            "joint {name}: {what} error {error} {unit}{per} exceeds the {tolerance} tolerance {limit} {unit}{per}"
        )
    }

    async fn accepted(&self, id: MotionId, time: Nanoseconds, accepted: Accepted) {
        let start = stamp(accepted.start);
        let origin = {
            let mut known = self.known.lock().await;
            let Some(known) = known.get_mut(&id) else { return };
            known.start = start.clone();
            known.origin.clone()
        };
        if let Origin::Action { goal_id, .. } = origin {
            self.tell(GoalEvent::Started(goal_id));
        }
        let text = if accepted.is_late {
            let late = seconds(time - accepted.start);
            let text = format!("joined {late} s after its start");
            warn!("{origin}: {text}");
            text
        } else {
            info!("{origin} accepted");
            String::new()
        };
        self.output.send(TrajectoryResult { start, text, ..origin.result(time, Status::Accepted) }).await;
    }

    /// Publishes what took joints away from a stream.
    async fn stream_ended(&self, time: Nanoseconds, end: StreamEnd, joints: JointSet) {
        let (status, text) = match end {
            StreamEnd::Preempted(by) => (Status::Preempted, taken_over(&*self.known.lock().await, by)),
            StreamEnd::Stopped(_) => {
                let text = "controlled stop; the stream is ignored until it pauses";
                (Status::Stopped, text.to_owned())
            }
            StreamEnd::Reset => (Status::Aborted, "reset".to_owned()),
            StreamEnd::ClockJump => (Status::Aborted, "the clock jumped".to_owned()),
        };
        let name: Vec<_> =
            joints.iter().filter_map(|place| Some(self.joints.get(place)?.name.clone())).collect();
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

    async fn ended(&self, end: MotionEnd) {
        let mut known_list = self.known.lock().await;
        let Some(known) = known_list.remove(&end.id) else { return };
        let (status, text) = match end.outcome {
            MotionOutcome::Completed => (Status::Completed, String::new()),
            MotionOutcome::Preempted { by } => (Status::Preempted, taken_over(&known_list, by)),
            MotionOutcome::Stopped => (Status::Stopped, "controlled stop".to_owned()),
            MotionOutcome::Canceled => (Status::Stopped, "canceled".to_owned()),
            MotionOutcome::PathTolerance(violation) => (Status::Aborted, self.violation("path", &violation)),
            MotionOutcome::GoalTolerance(violation) => (Status::Aborted, self.violation("goal", &violation)),
            MotionOutcome::Aborted(AbortReason::Reset) => (Status::Aborted, "reset".to_owned()),
            MotionOutcome::Aborted(AbortReason::ClockJump { from, to }) => {
                let (from, to) = (seconds(from), seconds(to));
                (Status::Aborted, format!("the clock jumped from {from:.3} s to {to:.3} s"))
            }
        };
        drop(known_list);
        let told = format!("{}: {status:?}{}{text}", known.origin, if text.is_empty() { "" } else { ", " });
        if status == Status::Aborted {
            warn!("{told}")
        } else {
            info!("{told}")
        }
        if let Origin::Action { goal_id, .. } = known.origin {
            self.tell(GoalEvent::Ended(goal_id, end.outcome, text.clone()));
        }
        let column = |value: fn(&AxisReport) -> f64| end.report.axes.iter().map(value).collect();
        let name = end.axis_indices.iter().filter_map(|&p| Some(self.joints.get(p)?.name.clone())).collect();
        self.output
            .send(TrajectoryResult {
                start: known.start,
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
                ..known.origin.result(end.time, status)
            })
            .await;
    }
}

/// What is told to a displaced one.
fn taken_over(known: &HashMap<MotionId, Known>, by: MotionId) -> String {
    let by = known.get(&by).map_or_else(|| "another trajectory".to_owned(), |k| k.origin.to_string());
    format!("axes were taken over by {by}")
}
