//! Identification of axis parameters from recordings (Prévost section 3).
//!
//! The steps of the paper run in sequence on [`Signals`](crate::recording::Signals): segmentation, gravity,
//! friction, inertia, feedforward, delays. A refinement of the whole closed loop by nonlinear least squares
//! follows. [`Finding`](crate::recording::Finding)s list parameters that the recordings do not determine, and
//! what to record instead.

pub mod campaign;
pub mod summary;

mod axis_identification;
mod backlash;
mod closed_loop;
mod covariance;
mod current_fit;
mod current_logging;
mod delays;
mod experiment;
mod feedforward;
mod feedforward_mode;
mod feedforward_search;
mod findings;
mod fit;
mod friction;
mod gravity;
mod identification;
mod inertia;
mod loop_fit;
mod loop_parameter;
mod loop_problem;
mod loop_ripple;
mod loop_search;
mod loop_values;
mod low_pass;
mod moving_data;
mod options;
mod plant_regression;
mod position_cycles;
mod presliding;
mod production;
mod recorded_feedforward;
mod refine;
mod resample;
mod reversals;
mod route;
mod sanity;
mod segments;
mod setpoints;
mod steps;
mod trace_experiments;
mod transmission;
mod validate;
mod values;

pub use axis_identification::{
    AxisIdentification, AxisIdentificationError, AxisRecordings, AxisValidation, ConditionedRecording,
};
pub use closed_loop::{find_experiments, simulate, simulate_all};
pub use delays::{DelayFit, DelayParameter};
pub use experiment::{CurrentLogging, Experiment, SimulatedExperiment};
pub use feedforward::{FeedforwardFit, FeedforwardRegression, fit_feedforward};
pub use feedforward_mode::FeedforwardMode;
pub use friction::{Breakaway, FrictionFit, FrictionLaw, LawFit, fit_friction};
pub use gravity::{
    GravityCurrent, GravityFit, GravitySource, Standstill, SteadyCurrent, SteadyMeasurements, fit_gravity,
};
pub use identification::Identification;
pub use inertia::{InertiaFit, fit_inertia};
pub use options::{IdentificationInput, IdentificationOptions, RefinementScope};
pub use presliding::PreslidingFit;
pub use refine::{RefinedParameter, RefinedValue, Refinement, refine};
pub(crate) use resample::BandLimitedSpline;
pub use sanity::invalid_agreement;
pub use segments::{MotionSegment, SegmentKind, find_segments};
pub use steps::{identify, identify_with_transmission};
pub use transmission::{ConfidenceInterval, MassesFit, TransmissionFit};
pub use validate::{
    Agreement, Baseline, ExperimentComparison, InverseDynamics, ResidualStatistics, constant_lag, validate,
};
pub use values::{IdentifiedValue, update_parameters};
