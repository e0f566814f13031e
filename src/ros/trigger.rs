//! Services of type `std_srvs/Trigger`.

use futures::StreamExt;
use futures::future::BoxFuture;
use futures::stream::FuturesUnordered;
use ros2_client::Node;
use ros2_interfaces_jazzy_serde::std_srvs::srv::{TriggerRequest, TriggerResponse};

use super::args::RosArgs;
use super::renewable::EndpointContext;
use super::response_limiter::ResponseLimiter;
use super::service::{Service, ServiceError};
use crate::interface::NodeService;

/// Number of requests that may wait.
const DEPTH: usize = 10;

/// Service of type `std_srvs/Trigger`.
pub struct TriggerService(Service<TriggerRequest, TriggerResponse>);

impl TriggerService {
    /// Creates `service`.
    ///
    /// # Errors
    /// [`ServiceError`] if the service cannot be created.
    pub fn new(
        node: &mut Node,
        context: &EndpointContext,
        args: &RosArgs,
        service: &NodeService,
    ) -> Result<Self, ServiceError> {
        Service::new(node, context, args, service, DEPTH).map(TriggerService)
    }

    /// Serves until the node shuts down; `act` executes a request and returns the message of its response.
    pub async fn serve<F>(self, act: impl Fn() -> F + Send)
    where
        F: Future<Output = Result<String, String>> + Send,
    {
        let mut requests = self.0.requests();
        // Responses are sent concurrently: a client that has disconnected does not delay the stop of another.
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
