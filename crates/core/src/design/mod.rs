//! Design of position controllers from a prediction model: P, PI, PID, pole placement, generalized predictive control
//! (GPC), stability and margins; frequency responses; filters of iterative learning control.

mod error;
mod frequency_response;
mod gpc;
mod learning;
mod margins;
mod model;
mod pid;
mod pole_placement;
mod poles;
pub(crate) mod polynomial;

pub use error::DesignError;
pub(crate) use frequency_response::StateSpace;
pub use frequency_response::{
    ControlLoop, FrequencyResponse, LoopResponse, continuous_phases, magnitudes_db,
};
pub use gpc::{ControlWeight, GpcTuning, gpc};
pub use learning::{Contraction, ImpulseResponse, LEARNING_GAIN, LearningFilter, LearningTuning};
pub use margins::{LoopMargins, Margins, margins};
pub use model::PredictionModel;
pub use pid::{MAX_GAIN, PidTuning, p_controller, pi_controller, pid_controller};
pub use pole_placement::{PolePlacement, pole_pair, pole_placement};
pub use poles::{check_stable, has_stable_poles, poles, require_stable};
