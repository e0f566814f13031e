//! `~/trajectory_result`: what became of each trajectory, so that its publisher finds its own.

use std::collections::HashMap;
use std::sync::Arc;

use ros2_client::MessageInfo;
use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Time;
use tokio::sync::Mutex;
use tracing::{info, warn};

use super::convert::{header, stamp};
use super::outputs::Output;
use super::pace::{Accepted, Report};
use crate::assess::AxisReport;
use crate::messages::{Source, Status, TrajectoryResult};
use crate::simulation::{Abort, MotionEnd, Outcome};
use crate::trajectory::{MotionId, Rejection, Trajectory};
use crate::units::{Nanoseconds, seconds};

/// Where a trajectory came from.
#[derive(Debug, Clone, PartialEq)]
pub struct Origin {
    /// `header.stamp` as it came.
    pub stamp: Time,
    /// The middleware's, per publisher.
    pub sequence_number: u64,
    /// The middleware's id of the publisher.
    pub publisher_gid: [u8; 16],
}

impl Origin {
    /// Origin of a message on `psec`.
    pub fn of(stamp: &Time, info: &MessageInfo) -> Self {
        Origin {
            stamp: stamp.clone(),
            sequence_number: u64::try_from(info.sequence_number()).unwrap_or(0),
            publisher_gid: info.publisher_gid().to_bytes16(),
        }
    }

    fn result(&self, time: Nanoseconds, status: Status) -> TrajectoryResult {
        TrajectoryResult {
            header: header(time),
            source: Source::Topic as u8,
            trajectory_stamp: self.stamp.clone(),
            sequence_number: self.sequence_number,
            publisher_gid: self.publisher_gid,
            status: status as u8,
            ..TrajectoryResult::default()
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
    joints: Vec<String>,
    known: Mutex<HashMap<MotionId, Known>>,
}

impl Results {
    /// Results of a machine with `joints`.
    pub fn new(output: Output<TrajectoryResult>, joints: Vec<String>) -> Self {
        Results { output, joints, known: Mutex::new(HashMap::new()) }
    }

    /// Remembers where a trajectory came from, before the simulation is asked.
    pub async fn expect(&self, id: MotionId, origin: Origin, trajectory: Arc<Trajectory>) {
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
                }
            }
            Report::Ended(end) => self.ended(end).await,
        }
    }

    /// Publishes a refusal at `time` (ns).
    pub async fn rejected(&self, origin: &Origin, time: Nanoseconds, rejection: &Rejection) {
        warn!("trajectory {} refused: {rejection}", origin.sequence_number);
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

    async fn accepted(&self, id: MotionId, time: Nanoseconds, accepted: Accepted) {
        let start = stamp(accepted.start);
        let origin = {
            let mut known = self.known.lock().await;
            let Some(known) = known.get_mut(&id) else { return };
            known.start = start.clone();
            known.origin.clone()
        };
        let text = if accepted.joined_late {
            let late = seconds(time - accepted.start);
            let text = format!("joined {late} s after its start");
            warn!("trajectory {}: {text}", origin.sequence_number);
            text
        } else {
            info!("trajectory {} accepted", origin.sequence_number);
            String::new()
        };
        self.output.send(TrajectoryResult { start, text, ..origin.result(time, Status::Accepted) }).await;
    }

    async fn ended(&self, end: MotionEnd) {
        let mut known_list = self.known.lock().await;
        let Some(known) = known_list.remove(&end.id) else { return };
        let (status, text) = match end.outcome {
            Outcome::Completed => (Status::Completed, String::new()),
            Outcome::Displaced { by } => {
                let by = known_list.get(&by).map_or(0, |k| k.origin.sequence_number);
                (Status::Displaced, format!("axes were taken over by trajectory {by}"))
            }
            Outcome::Stopped => (Status::Stopped, "controlled stop".to_owned()),
            Outcome::Cancelled => (Status::Stopped, "cancelled".to_owned()),
            Outcome::PathTolerance(violation) | Outcome::GoalTolerance(violation) => {
                (Status::Aborted, format!("{violation:?}"))
            }
            Outcome::Aborted(Abort::Reset) => (Status::Aborted, "reset".to_owned()),
            Outcome::Aborted(Abort::ClockJump { from, to }) => {
                let (from, to) = (seconds(from), seconds(to));
                (Status::Aborted, format!("the clock jumped from {from:.3} s to {to:.3} s"))
            }
        };
        drop(known_list);
        info!("trajectory {}: {status:?}", known.origin.sequence_number);
        let column = |value: fn(&AxisReport) -> f64| end.report.axes.iter().map(value).collect();
        let name = end.places.iter().filter_map(|&p| self.joints.get(p).cloned()).collect();
        self.output
            .send(TrajectoryResult {
                start: known.start,
                text,
                name,
                max_tracking_error: column(|a| a.max_tracking_error),
                rms_tracking_error: column(|a| a.rms_tracking_error),
                max_synchronized_tracking_error: column(|a| a.max_synchronized_tracking_error),
                rms_synchronized_tracking_error: column(|a| a.rms_synchronized_tracking_error),
                max_contour_error: end.report.max_contour_error.unwrap_or(f64::NAN),
                rms_contour_error: end.report.rms_contour_error.unwrap_or(f64::NAN),
                peak_current: column(|a| a.peak_current),
                saturation_time: column(|a| a.saturation_time),
                ..known.origin.result(end.time, status)
            })
            .await;
    }
}
