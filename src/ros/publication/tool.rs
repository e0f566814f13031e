//! Tool in the workpiece frame: its pose at each frame of samples, and the actual and setpoint paths of its tip.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use nalgebra::UnitQuaternion;
use ros2_interfaces_jazzy_serde::geometry_msgs::msg::PoseStamped;
use ros2_interfaces_jazzy_serde::nav_msgs::msg::Path;
use tokio::time::{Instant, MissedTickBehavior};

use crate::ros::axes::SampleFrame;
use crate::ros::topics::{EndpointError, Output, OverflowPolicy, TopicFactory};
use crate::ros_interface::{TOOL_PATH, TOOL_PATH_SETPOINT, TOOL_POSE};
use virtual_axes_core::config::ToolConfig;
use virtual_axes_core::kinematics::{Kinematics, ToolPose};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::messages;

/// Smallest distance between poses of a path, m: below the resolution of a machine on a screen.
const MIN_SPACING: f64 = 1e-4;
/// Smallest rotation between poses of a path, rad: 0.1 mm at a tool length of 100 mm.
const MIN_ROTATION: f64 = 1e-3;
/// Period at which an unchanged path is repeated for late joiners.
const REPEAT_PERIOD: Duration = Duration::from_secs(2);

/// Output of the tool's pose, and recording of its paths.
pub struct ToolOutput {
    pose: Output<PoseStamped>,
    kinematics: Kinematics,
    frame: String,
    history: Arc<Mutex<PathHistory>>,
}

impl ToolOutput {
    /// Creates the topics, and starts the task that publishes the paths; returns `None` if no joint moves the tool relative
    /// to the workpiece.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic that cannot be created.
    pub fn create(
        topics: &mut TopicFactory<'_>,
        kinematics: Kinematics,
        config: ToolConfig,
        overflow: OverflowPolicy,
    ) -> Result<Option<Self>, EndpointError> {
        if !kinematics.has_linear_axis() && !kinematics.has_rotary_axis() {
            return Ok(None);
        }
        let pose = topics.output(&TOOL_POSE, overflow)?;
        // A separate task waits for slow readers of the paths; the axes do not wait.
        let mut path = |topic| topics.output(topic, OverflowPolicy::Block);
        let outputs = [path(&TOOL_PATH)?, path(&TOOL_PATH_SETPOINT)?];
        let history = Arc::new(Mutex::new(PathHistory::new(config.path_length)));
        if let Some(rate) = config.path_rate {
            let publisher =
                PathPublisher { history: Arc::clone(&history), frame: config.frame.clone(), outputs };
            topics.tasks.spawn(publisher.run(Duration::from_secs_f64(1.0 / rate)));
        }
        Ok(Some(ToolOutput { pose, kinematics, frame: config.frame, history }))
    }

    /// Adds the samples of an instant to the paths, and publishes the pose if `is_due`.
    pub async fn update(&self, frame: &SampleFrame, is_due: bool) {
        let actual = self.pose(frame, |sample| sample.position);
        let setpoint = self.pose(frame, |sample| sample.delayed_psec);
        lock(&self.history).add(frame.resets, ToolPosePair { time: frame.time, actual, setpoint });
        if is_due && self.pose.has_subscriptions() {
            self.pose.send(actual.message(frame.time, &self.frame)).await;
        }
    }

    fn pose(&self, frame: &SampleFrame, position: impl Fn(&AxisSample) -> f64) -> OrientedToolPose {
        let joints: Vec<f64> = frame.samples.iter().map(position).collect();
        OrientedToolPose {
            pose: self.kinematics.forward(&joints),
            orientation: self.kinematics.orientation(&joints),
        }
    }
}

/// Pose of the tool with its orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
struct OrientedToolPose {
    pose: ToolPose,
    orientation: UnitQuaternion<f64>,
}

impl OrientedToolPose {
    fn message(&self, time: Nanoseconds, frame: &str) -> PoseStamped {
        messages::pose_stamped(time, frame, &self.pose.tip, &self.orientation)
    }

    fn is_far_from(&self, other: &Self) -> bool {
        (self.pose.tip - other.pose.tip).norm() >= MIN_SPACING
            || (self.pose.axis - other.pose.axis).norm() >= MIN_ROTATION
    }
}

/// Actual and setpoint pose of the tool at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ToolPosePair {
    time: Nanoseconds,
    actual: OrientedToolPose,
    setpoint: OrientedToolPose,
}

/// Newest part of the actual and the setpoint path, with poses of the same instants.
#[derive(Debug)]
struct PathHistory {
    kept: VecDeque<ToolPosePair>,
    /// Newest poses, which may be too close to the last kept ones to be kept.
    newest: Option<ToolPosePair>,
    length: usize,
    resets: u64,
    /// True if a pose has been added or the paths cleared since they were last read.
    is_changed: bool,
}

impl PathHistory {
    fn new(length: usize) -> Self {
        PathHistory { kept: VecDeque::new(), newest: None, length, resets: 0, is_changed: false }
    }

    /// Adds the poses of an instant. Clears the paths after a reset or if time goes backwards.
    fn add(&mut self, resets: u64, poses: ToolPosePair) {
        if resets != self.resets || self.newest.is_some_and(|newest| newest.time >= poses.time) {
            self.kept.clear();
        }
        self.resets = resets;
        self.newest = Some(poses);
        let is_far = self.kept.back().is_none_or(|last| {
            poses.actual.is_far_from(&last.actual) || poses.setpoint.is_far_from(&last.setpoint)
        });
        if is_far {
            // The newest poses are appended to the kept ones.
            if self.kept.len() + 1 >= self.length {
                self.kept.pop_front();
            }
            self.kept.push_back(poses);
            self.is_changed = true;
        }
    }

    /// Returns the poses of both paths, oldest first.
    fn read(&mut self) -> Vec<ToolPosePair> {
        self.is_changed = false;
        let newest = self.newest.filter(|newest| self.kept.back() != Some(newest));
        self.kept.iter().copied().chain(newest).collect()
    }
}

/// Locks the paths. No code panics while it holds the lock, so a poisoned lock is valid.
fn lock(history: &Mutex<PathHistory>) -> MutexGuard<'_, PathHistory> {
    history.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Publisher of both paths.
struct PathPublisher {
    history: Arc<Mutex<PathHistory>>,
    frame: String,
    /// Outputs of the actual and the setpoint path.
    outputs: [Output<Path>; 2],
}

impl PathPublisher {
    async fn run(self, period: Duration) {
        let mut timer = tokio::time::interval(period);
        timer.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut last: Option<Instant> = None;
        loop {
            let now = timer.tick().await;
            if !self.outputs.iter().any(Output::has_subscriptions) {
                continue;
            }
            let is_due = last.is_none_or(|last| now - last >= REPEAT_PERIOD);
            let pairs = {
                let mut history = lock(&self.history);
                if history.newest.is_none() || !(history.is_changed || is_due) {
                    continue;
                }
                history.read()
            };
            last = Some(now);
            let selectors: [fn(&ToolPosePair) -> OrientedToolPose; 2] =
                [|poses| poses.actual, |poses| poses.setpoint];
            for (output, select) in self.outputs.iter().zip(selectors) {
                let poses = pairs.iter().map(|poses| select(poses).message(poses.time, &self.frame));
                output.send(messages::path(&self.frame, poses.collect())).await;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn at(time: Nanoseconds, x: f64) -> ToolPosePair {
        let pose = ToolPose { tip: Vector3::new(x, 0.0, 0.0), axis: Vector3::z() };
        let pose = OrientedToolPose { pose, orientation: UnitQuaternion::identity() };
        ToolPosePair { time, actual: pose, setpoint: pose }
    }

    fn times(history: &mut PathHistory) -> Vec<Nanoseconds> {
        history.read().iter().map(|poses| poses.time).collect()
    }

    #[test]
    fn a_stationary_tool_adds_no_pose_but_its_newest() {
        let mut history = PathHistory::new(10);
        for time in 0..100 {
            history.add(0, at(time, 0.1 * MIN_SPACING * (time % 2) as f64));
        }
        assert_eq!(times(&mut history), [0, 99]);
        history.add(0, at(100, 0.0));
        assert!(!history.is_changed, "an unchanged path is not published");
    }

    #[test]
    fn the_oldest_poses_are_dropped() {
        let mut history = PathHistory::new(4);
        for time in 0..50 {
            history.add(0, at(time, time as f64 * 2.0 * MIN_SPACING));
            assert!(history.read().len() <= 4);
        }
        assert_eq!(times(&mut history), [47, 48, 49]);
    }

    #[test]
    fn a_reset_or_a_backward_clock_jump_clears_the_paths() {
        let mut history = PathHistory::new(10);
        (0..5).for_each(|time| history.add(0, at(time, time as f64)));
        history.add(1, at(5, 0.0));
        assert_eq!(times(&mut history), [5]);
        history.add(1, at(6, 1.0));
        history.add(1, at(2, 1.0));
        assert_eq!(times(&mut history), [2]);
    }
}
