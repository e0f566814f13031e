//! The tool in the workpiece frame: its pose with each frame of samples, and the paths that its tip has
//! taken and should have taken.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use nalgebra::UnitQuaternion;
use ros2_client::MessageTypeName;
use ros2_interfaces_jazzy_serde::geometry_msgs::msg::PoseStamped;
use ros2_interfaces_jazzy_serde::nav_msgs::msg::Path;
use tokio::time::{Instant, MissedTickBehavior};

use super::endpoints::{EndpointError, Endpoints, Publisher};
use super::outputs::{Output, OutputFactory, OverflowPolicy};
use super::pace::Frame;
use virtual_axes_core::config::ToolConfig;
use virtual_axes_core::kinematics::{Kinematics, ToolPose};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::messages;

/// From one pose of a path to the next at least, m: below what can be seen of a machine on a screen.
const SPACING: f64 = 1e-4;
/// Or the tool has turned by this, rad: 0.1 mm at 100 mm of tool.
const TURN: f64 = 1e-3;
/// A path that does not change is repeated as often as this, for readers that came later.
const REPEAT: Duration = Duration::from_secs(2);

/// The topics of the tool.
pub struct ToolTopics {
    pose: Publisher<PoseStamped>,
    path: Publisher<Path>,
    setpoint: Publisher<Path>,
    kinematics: Kinematics,
    /// Resolved names.
    pub names: Vec<String>,
}

impl ToolTopics {
    /// Creates them, for a machine with joints that move the tool relative to the workpiece.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic that the middleware refuses.
    pub fn create(
        endpoints: &mut Endpoints<'_>,
        kinematics: Kinematics,
    ) -> Result<Option<Self>, EndpointError> {
        if !kinematics.has_linear_axis() && !kinematics.has_rotary_axis() {
            return Ok(None);
        }
        let path_type = || MessageTypeName::new("nav_msgs", "Path");
        let (pose, pose_name) =
            endpoints.publisher("~/tool_pose", MessageTypeName::new("geometry_msgs", "PoseStamped"))?;
        let (path, path_name) = endpoints.publisher("~/tool_path", path_type())?;
        let (setpoint, setpoint_name) = endpoints.publisher("~/tool_path_setpoint", path_type())?;
        let names = vec![pose_name, path_name, setpoint_name];
        Ok(Some(ToolTopics { pose, path, setpoint, kinematics, names }))
    }

    /// Starts what publishes on them.
    pub fn start(
        self,
        publishing: &mut OutputFactory,
        config: ToolConfig,
        overflow: OverflowPolicy,
    ) -> ToolOutput {
        let trace = Arc::new(Mutex::new(Trace::new(config.path_length)));
        if let Some(rate) = config.path_rate {
            // A task of their own waits for slow readers of the paths; the axes do not.
            let outputs =
                [self.path, self.setpoint].map(|path| publishing.start(path, OverflowPolicy::Block));
            let paths = Paths { trace: Arc::clone(&trace), frame: config.frame.clone(), outputs };
            publishing.tasks.spawn(paths.run(Duration::from_secs_f64(1.0 / rate)));
        }
        let pose = publishing.start(self.pose, overflow);
        ToolOutput { pose, kinematics: self.kinematics, frame: config.frame, trace }
    }
}

/// What is published of the tool.
pub struct ToolOutput {
    pose: Output<PoseStamped>,
    kinematics: Kinematics,
    frame: String,
    trace: Arc<Mutex<Trace>>,
}

impl ToolOutput {
    /// Takes the samples of an instant, and publishes the pose if it is to be.
    pub async fn take(&self, frame: &Frame, publish: bool) {
        let actual = self.place(frame, |sample| sample.position);
        let setpoint = self.place(frame, |sample| sample.delayed_psec);
        lock(&self.trace).take(frame.resets, Moment { time: frame.time, actual, setpoint });
        if publish && self.pose.has_subscriptions() {
            self.pose.send(actual.message(frame.time, &self.frame)).await;
        }
    }

    fn place(&self, frame: &Frame, position: impl Fn(&AxisSample) -> f64) -> Place {
        let joints: Vec<f64> = frame.samples.iter().map(position).collect();
        Place { pose: self.kinematics.forward(&joints), orientation: self.kinematics.orientation(&joints) }
    }
}

/// The tool at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Place {
    pose: ToolPose,
    orientation: UnitQuaternion<f64>,
}

impl Place {
    fn message(&self, time: Nanoseconds, frame: &str) -> PoseStamped {
        messages::pose_stamped(time, frame, &self.pose.tip, &self.orientation)
    }

    fn is_far_from(&self, other: &Self) -> bool {
        (self.pose.tip - other.pose.tip).norm() >= SPACING
            || (self.pose.axis - other.pose.axis).norm() >= TURN
    }
}

/// Where the tool is, and where the position controllers were asked to bring it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Moment {
    time: Nanoseconds,
    actual: Place,
    setpoint: Place,
}

/// The newest part of both paths; a pose of one has its counterpart of the same instant in the other.
#[derive(Debug)]
struct Trace {
    kept: VecDeque<Moment>,
    /// Where the tool is now, kept or not.
    newest: Option<Moment>,
    length: usize,
    resets: u64,
    /// Whether a pose has been kept, or all forgotten, since the paths were last read.
    changed: bool,
}

impl Trace {
    fn new(length: usize) -> Self {
        Trace { kept: VecDeque::new(), newest: None, length, resets: 0, changed: false }
    }

    /// Goes on; after a reset, or where time goes backwards, from nothing.
    fn take(&mut self, resets: u64, moment: Moment) {
        if resets != self.resets || self.newest.is_some_and(|newest| newest.time >= moment.time) {
            self.kept.clear();
        }
        self.resets = resets;
        self.newest = Some(moment);
        let far = self.kept.back().is_none_or(|last| {
            moment.actual.is_far_from(&last.actual) || moment.setpoint.is_far_from(&last.setpoint)
        });
        if far {
            // The newest stands behind those that are kept.
            if self.kept.len() + 1 >= self.length {
                self.kept.pop_front();
            }
            self.kept.push_back(moment);
            self.changed = true;
        }
    }

    /// Actual and setpoint, oldest first.
    fn read(&mut self) -> Vec<Moment> {
        self.changed = false;
        let newest = self.newest.filter(|newest| self.kept.back() != Some(newest));
        self.kept.iter().copied().chain(newest).collect()
    }
}

/// Nothing panics while it holds the lock; what is inside is whole in any case.
fn lock(trace: &Mutex<Trace>) -> MutexGuard<'_, Trace> {
    trace.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What publishes both paths.
struct Paths {
    trace: Arc<Mutex<Trace>>,
    frame: String,
    /// Of the actual path and of the setpoints'.
    outputs: [Output<Path>; 2],
}

impl Paths {
    async fn run(self, period: Duration) {
        let mut timer = tokio::time::interval(period);
        timer.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut last: Option<Instant> = None;
        loop {
            let now = timer.tick().await;
            if !self.outputs.iter().any(Output::has_subscriptions) {
                continue;
            }
            let is_due = last.is_none_or(|last| now - last >= REPEAT);
            let moments = {
                let mut trace = lock(&self.trace);
                if trace.newest.is_none() || !(trace.changed || is_due) {
                    continue;
                }
                trace.read()
            };
            last = Some(now);
            let places: [fn(&Moment) -> Place; 2] = [|moment| moment.actual, |moment| moment.setpoint];
            for (output, place) in self.outputs.iter().zip(places) {
                let poses = moments.iter().map(|moment| place(moment).message(moment.time, &self.frame));
                output.send(messages::path(&self.frame, poses.collect())).await;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn at(time: Nanoseconds, x: f64) -> Moment {
        let pose = ToolPose { tip: Vector3::new(x, 0.0, 0.0), axis: Vector3::z() };
        let place = Place { pose, orientation: UnitQuaternion::identity() };
        Moment { time, actual: place, setpoint: place }
    }

    fn times(trace: &mut Trace) -> Vec<Nanoseconds> {
        trace.read().iter().map(|moment| moment.time).collect()
    }

    #[test]
    fn a_tool_that_stands_adds_nothing_but_where_it_is() {
        let mut trace = Trace::new(10);
        for time in 0..100 {
            trace.take(0, at(time, 0.1 * SPACING * (time % 2) as f64));
        }
        assert_eq!(times(&mut trace), [0, 99]);
        trace.take(0, at(100, 0.0));
        assert!(!trace.changed, "an unchanged path is not worth publishing");
    }

    #[test]
    fn the_oldest_poses_give_way() {
        let mut trace = Trace::new(4);
        for time in 0..50 {
            trace.take(0, at(time, time as f64 * 2.0 * SPACING));
            assert!(trace.read().len() <= 4);
        }
        assert_eq!(times(&mut trace), [47, 48, 49]);
    }

    #[test]
    fn a_reset_and_a_clock_that_jumps_back_begin_anew() {
        let mut trace = Trace::new(10);
        (0..5).for_each(|time| trace.take(0, at(time, time as f64)));
        trace.take(1, at(5, 0.0));
        assert_eq!(times(&mut trace), [5]);
        trace.take(1, at(6, 1.0));
        trace.take(1, at(2, 1.0));
        assert_eq!(times(&mut trace), [2]);
    }
}
