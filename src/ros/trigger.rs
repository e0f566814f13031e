//! The services `~/stop` and `~/reset`.

use futures::StreamExt;
use futures::future::BoxFuture;
use futures::stream::FuturesUnordered;
use ros2_client::{Context, Node, ServiceTypeName};
use ros2_interfaces_jazzy_serde::std_srvs::srv::{TriggerRequest, TriggerResponse};

use super::args::RosArgs;
use super::response_limiter::ResponseLimiter;
use super::service::{Service, ServiceError};

/// Takes the axes home.
pub const RESET: &str = "reset";
/// Stops the axes within their limits.
pub const STOP: &str = "stop";
/// Requests that may wait.
const DEPTH: usize = 10;

/// A `std_srvs/Trigger` service.
pub struct Trigger(Service<TriggerRequest, TriggerResponse>);

impl Trigger {
    /// The service `~/label`.
    ///
    /// # Errors
    /// [`ServiceError`] when the middleware refuses it.
    pub fn new(
        node: &mut Node,
        context: &Context,
        args: &RosArgs,
        label: &'static str,
    ) -> Result<Self, ServiceError> {
        let type_name = ServiceTypeName::new("std_srvs", "Trigger");
        Service::new(node, context, args, label, &type_name, DEPTH).map(Trigger)
    }

    /// Serves until the node shuts down: `act` does what is asked and says what it did.
    pub async fn serve<F>(self, act: impl Fn() -> F + Send)
    where
        F: Future<Output = Result<String, String>> + Send,
    {
        let mut requests = self.0.requests();
        // Responses are sent side by side: a client that is gone holds up no other's stop.
        let mut responses: FuturesUnordered<BoxFuture<'_, ()>> = FuturesUnordered::new();
        let limiter = ResponseLimiter::default();
        loop {
            tokio::select! {
                biased;
                Some(()) = responses.next(), if !responses.is_empty() => {}
                Some((permit, request)) = limiter.next(&mut requests) => match request {
                    Ok((id, _)) => {
                        let (success, message) = match act().await {
                            Ok(message) => (true, message),
                            Err(message) => (false, message),
                        };
                        responses.push(self.0.respond(id, TriggerResponse { success, message }, permit));
                    }
                    Err(reason) => tracing::warn!("{reason}"),
                },
                else => break,
            }
        }
    }
}
