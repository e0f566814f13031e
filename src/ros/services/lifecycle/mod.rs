//! Lifecycle of a managed node: its services and the topic of its transitions.

mod server;
mod states;

pub use server::{LifecycleServer, TransitionRequest};
pub use states::RequestedTransition;
