//! Services: creation, triggers, query of setpoints, parameters, lifecycle.

mod create;
mod lifecycle;
mod parameter_host;
mod parameters;
mod query_state;
mod shortened;
mod trigger;

pub use create::{ServiceError, ServiceNameConflict, check_names};
pub use lifecycle::{LifecycleServer, RequestedTransition, TransitionRequest};
pub use parameter_host::{NodeParameterHost, SetClock, UnconfiguredParameterHost};
pub use parameters::ParameterServices;
pub use query_state::QueryStateService;
pub use trigger::TriggerService;
