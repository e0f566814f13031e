//! How much trajectories may take up together, under way or waiting.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use virtual_axes_core::trajectory::{Code, Rejection, Trajectory};

/// Trajectories of the largest allowed length that are held together: one under way, one that takes over, and
/// as many on their way.
const LONGEST_TOGETHER: usize = 4;
/// Most trajectories that are held together, whatever their lengths: 1024 may wait for each of five joints, and
/// as many goals.
const MOST_TOGETHER: usize = 8192;
/// More for controlled stops, which have no points and end at once: they must not wait for what they are to stop.
const SPARE_FOR_STOPS: usize = 1024;

/// The trajectories that exist, of whatever source. Each counts until the last one who needs it has dropped it.
#[derive(Debug)]
pub struct Held {
    most_points: usize,
    /// Each with its number of points; the oldest first.
    list: Mutex<Vec<(Weak<Trajectory>, usize)>>,
}

impl Held {
    /// Nothing yet, where one trajectory may have up to `max_points` points.
    pub fn new(max_points: usize) -> Self {
        Held { most_points: max_points.saturating_mul(LONGEST_TOGETHER), list: Mutex::default() }
    }

    /// Takes a trajectory in.
    ///
    /// # Errors
    /// [`Code::QueueFull`] with what there would be and what is allowed.
    pub fn take(&self, trajectory: Trajectory) -> Result<Arc<Trajectory>, Rejection> {
        let mut list = self.list.lock().unwrap_or_else(PoisonError::into_inner);
        list.retain(|(held, _)| held.strong_count() > 0);
        let full = |what: &str, found: usize, most: usize| {
            let text = format!(
                "with it there would be {found} {what} under way and waiting; {most} are allowed together"
            );
            Err(Rejection::new(Code::QueueFull, text).numbers(found as f64, most as f64))
        };
        let most = MOST_TOGETHER + if trajectory.points() == 0 { SPARE_FOR_STOPS } else { 0 };
        if list.len() >= most {
            return full("trajectories", list.len() + 1, most);
        }
        let points = list.iter().map(|(_, points)| points).sum::<usize>() + trajectory.points();
        if points > self.most_points {
            return full("points of trajectories", points, self.most_points);
        }
        let count = trajectory.points();
        let trajectory = Arc::new(trajectory);
        list.push((Arc::downgrade(&trajectory), count));
        Ok(trajectory)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_axes_core::config::Parameters;
    use virtual_axes_core::simulation;
    use virtual_axes_core::trajectory::{Context, Request, Row, Start};

    fn trajectory(points: usize) -> Trajectory {
        let parameters = Parameters::embedded_default().expect("the default machine");
        let joints = simulation::joints(&parameters.machine_config().expect("the default machine"), "");
        let period = 6_000_000;
        let mut request = Request::new(Start::Now, vec!["x".into()]);
        for point in 0..points {
            let row = Row { positions: &[0.0], ..Row::default() };
            request.push(point as i64 * period, row).expect("a good point");
        }
        let context =
            Context { joints: &joints, period, max_points: 1000, allow_nonzero_end_velocity: false };
        Trajectory::new(request, &context).expect("a good trajectory")
    }

    /// 1024 trajectories of a million points may have waited for each joint: hundreds of gigabytes.
    #[test]
    fn trajectories_that_wait_are_bounded_in_the_sum_of_their_points() {
        let held = Held::new(10);
        let mut waiting: Vec<_> = (0..4).map(|_| held.take(trajectory(10)).expect("room")).collect();
        let refused = held.take(trajectory(1)).expect_err("no room");
        assert_eq!((refused.code, refused.value, refused.limit), (Code::QueueFull, 41.0, 40.0));
        assert!(refused.text.contains("41 points") && refused.text.contains("40 are allowed"), "{refused}");
        // Somebody else still has it.
        let under_way = Arc::clone(&waiting[0]);
        waiting.remove(0);
        assert!(held.take(trajectory(1)).is_err());
        drop(under_way);
        assert!(held.take(trajectory(10)).is_ok());
        // A controlled stop has none.
        assert!(held.take(trajectory(0)).is_ok());
    }

    #[test]
    fn trajectories_are_bounded_in_number_whatever_their_lengths() {
        let held = Held::new(10_000);
        let one = trajectory(1);
        let mut waiting: Vec<_> = (0..MOST_TOGETHER).map(|_| held.take(one.clone()).expect("room")).collect();
        let refused = held.take(one.clone()).expect_err("no room");
        assert_eq!((refused.code, refused.limit), (Code::QueueFull, MOST_TOGETHER as f64));
        let stops: Vec<_> = (0..SPARE_FOR_STOPS).map(|_| held.take(trajectory(0)).expect("room")).collect();
        assert!(held.take(trajectory(0)).is_err());
        drop(stops);
        waiting.pop();
        assert!(held.take(one).is_ok());
    }
}
