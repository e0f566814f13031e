//! Iterative learning control: setpoints that compensate the repeatable errors of a motion.
//!
//! [`learn`] runs a [`Workload`](crate::tune::Workload), filters the error of each axis with its
//! [`LearningFilter`](virtual_axes_core::design::LearningFilter), adds the result to the programmed setpoints and runs
//! again. The filters are designed on the nominal plant of each axis; the runs are those of the plant with its deviation.

mod axis;
mod error;
mod iterations;
mod learner;
mod setpoint_limits;

pub use axis::{AxisContraction, LearningAxis};
pub use error::LearningError;
pub use iterations::{LearningEnd, LearningResult, MAX_ITERATIONS, learn};
pub use learner::{LearningAxisError, LearningIteration, LearningOptions};
pub use setpoint_limits::{SetpointExcess, SetpointQuantity};
