//! Admission control: bounds of the number of trajectories and points that are active or waiting.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use virtual_axes_core::trajectory::{Rejection, RejectionCode, Trajectory};

/// Admitted points as a multiple of the largest trajectory: an active one, its successor, and two in
/// transfer.
const MAX_LARGEST_TRAJECTORIES: usize = 4;
/// Largest number of admitted trajectories of any length: 1024 waiting for each of five joints, and as many
/// goals.
const MAX_TRAJECTORIES: usize = 8192;
/// Additional admitted controlled stops. They have no points and end soon, and must not be rejected because
/// of the trajectories that they stop.
const EXTRA_STOPS: usize = 1024;

/// Bound on the admitted trajectories of all sources.
///
/// A trajectory counts until its last `Arc` is dropped.
#[derive(Debug)]
pub struct AdmissionControl {
    max_points: usize,
    /// Admitted trajectories with their numbers of points, oldest first.
    admitted: Mutex<Vec<(Weak<Trajectory>, usize)>>,
}

impl AdmissionControl {
    /// Creates an empty admission control for trajectories of at most `max_points` points each.
    pub fn new(max_points: usize) -> Self {
        let max_points = max_points.saturating_mul(MAX_LARGEST_TRAJECTORIES);
        AdmissionControl { max_points, admitted: Mutex::default() }
    }

    /// Admits a trajectory.
    ///
    /// # Errors
    /// [`RejectionCode::QueueFull`] with the resulting number of trajectories or points and its limit.
    pub fn admit(&self, trajectory: Trajectory) -> Result<Arc<Trajectory>, Rejection> {
        let mut admitted = self.admitted.lock().unwrap_or_else(PoisonError::into_inner);
        admitted.retain(|(trajectory, _)| trajectory.strong_count() > 0);
        let full = |what: &str, found: usize, limit: usize| {
            let text = format!(
                "{found} {what} would be active or waiting; at most {limit} are allowed, retry after some have ended"
            );
            Err(Rejection::new(RejectionCode::QueueFull, text).numbers(found as f64, limit as f64))
        };
        let limit = MAX_TRAJECTORIES + if trajectory.points() == 0 { EXTRA_STOPS } else { 0 };
        if admitted.len() >= limit {
            return full("trajectories", admitted.len() + 1, limit);
        }
        let points = admitted.iter().map(|(_, points)| points).sum::<usize>() + trajectory.points();
        if points > self.max_points {
            return full("points", points, self.max_points);
        }
        let count = trajectory.points();
        let trajectory = Arc::new(trajectory);
        admitted.push((Arc::downgrade(&trajectory), count));
        Ok(trajectory)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_axes_core::config::Parameters;
    use virtual_axes_core::simulation;
    use virtual_axes_core::trajectory::{Start, TrajectoryPoint, TrajectoryRequest, ValidationContext};

    fn trajectory(points: usize) -> Trajectory {
        let parameters = Parameters::embedded_default().expect("default machine");
        let joints = simulation::joint_limits(&parameters.machine_config().expect("default machine"), "");
        let period = 6_000_000;
        let mut request = TrajectoryRequest::new(Start::Now, vec!["x".into()]);
        for index in 0..points {
            let point = TrajectoryPoint { positions: &[0.0], ..TrajectoryPoint::default() };
            request.push(index as i64 * period, point).expect("valid point");
        }
        let context = ValidationContext {
            joints: &joints,
            period,
            max_points: 1000,
            allow_nonzero_end_velocity: false,
        };
        Trajectory::new(request, &context).expect("valid trajectory")
    }

    /// Without a bound, 1024 trajectories of a million points wait for each joint: hundreds of gigabytes.
    #[test]
    fn the_total_number_of_points_is_bounded() {
        let control = AdmissionControl::new(10);
        let mut waiting: Vec<_> = (0..4).map(|_| control.admit(trajectory(10)).expect("admitted")).collect();
        let rejection = control.admit(trajectory(1)).expect_err("rejected");
        assert_eq!(
            (rejection.code, rejection.value, rejection.limit),
            (RejectionCode::QueueFull, 41.0, 40.0)
        );
        assert!(
            rejection.text.contains("41 points") && rejection.text.contains("at most 40 are allowed"),
            "{rejection}"
        );
        // Another owner still holds it.
        let active = Arc::clone(&waiting[0]);
        waiting.remove(0);
        assert!(control.admit(trajectory(1)).is_err());
        drop(active);
        assert!(control.admit(trajectory(10)).is_ok());
        // A controlled stop has no points.
        assert!(control.admit(trajectory(0)).is_ok());
    }

    #[test]
    fn the_number_of_trajectories_is_bounded_for_any_length() {
        let control = AdmissionControl::new(10_000);
        let one = trajectory(1);
        let mut waiting: Vec<_> =
            (0..MAX_TRAJECTORIES).map(|_| control.admit(one.clone()).expect("admitted")).collect();
        let rejection = control.admit(one.clone()).expect_err("rejected");
        assert_eq!((rejection.code, rejection.limit), (RejectionCode::QueueFull, MAX_TRAJECTORIES as f64));
        let stops: Vec<_> =
            (0..EXTRA_STOPS).map(|_| control.admit(trajectory(0)).expect("admitted")).collect();
        assert!(control.admit(trajectory(0)).is_err());
        drop(stops);
        waiting.pop();
        assert!(control.admit(one).is_ok());
    }
}
