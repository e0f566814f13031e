//! Services of type `std_srvs/Trigger`.

use futures::FutureExt;
use ros2_interfaces_jazzy_serde::std_srvs::srv::{TriggerRequest, TriggerResponse};

use super::create::{ServiceError, create_service};
use crate::ros_interface::NodeService;
use crate::validation::args::RosArgs;
use virtual_axes_dds::{Node, Service};

/// Number of requests that may wait.
const DEPTH: usize = 10;

/// Service of type `std_srvs/Trigger`.
pub struct TriggerService(Service<TriggerRequest, TriggerResponse>);

impl TriggerService {
    /// Creates `service`.
    ///
    /// # Errors
    /// [`ServiceError`] if the service cannot be created.
    pub fn new(node: &Node, args: &RosArgs, service: &NodeService) -> Result<Self, ServiceError> {
        create_service(node, args, service, DEPTH).map(TriggerService)
    }

    /// Serves until the node shuts down; `act` executes a request and returns the message of its response.
    pub async fn serve<F>(self, act: impl Fn() -> F + Send)
    where
        F: Future<Output = Result<String, String>> + Send,
    {
        let respond = |response: Result<String, String>| {
            let success = response.is_ok();
            TriggerResponse { success, message: response.unwrap_or_else(|reason| reason) }
        };
        self.0.serve(move |_| act().map(respond)).await;
    }
}
