//! Service `~/query_state`: setpoints planned at a time.

use tokio::sync::{mpsc, oneshot};

use super::create::{ServiceError, create_service};
use crate::ros::axes::{Command, PlannedSetpoints};
use crate::ros_interface::QUERY_STATE;
use crate::validation::args::RosArgs;
use virtual_axes_core::units::seconds;
use virtual_axes_dds::{Node, Service};
use virtual_axes_io::messages::{QueryTrajectoryStateRequest, QueryTrajectoryStateResponse, nanoseconds};

/// Number of requests that may wait.
const DEPTH: usize = 10;

/// Service `~/query_state`.
pub struct QueryStateService(Service<QueryTrajectoryStateRequest, QueryTrajectoryStateResponse>);

impl QueryStateService {
    /// Creates the service.
    ///
    /// # Errors
    /// [`ServiceError`] if the service cannot be created.
    pub fn new(node: &Node, args: &RosArgs) -> Result<Self, ServiceError> {
        create_service(node, args, &QUERY_STATE, DEPTH).map(QueryStateService)
    }

    /// Serves until the node shuts down; `joints` are the names of the joints, with prefix.
    pub async fn serve(self, joints: Vec<String>, commands: mpsc::Sender<Command>) {
        self.0.serve(|request| answer(request, &joints, &commands)).await;
    }
}

/// Returns the response to a request.
async fn answer(
    request: QueryTrajectoryStateRequest,
    joints: &[String],
    commands: &mpsc::Sender<Command>,
) -> QueryTrajectoryStateResponse {
    let time = nanoseconds(&request.time);
    let (done, planned) = oneshot::channel();
    // The channel is closed only at shutdown.
    let _ = commands.send(Command::QueryState(time, done)).await;
    let Ok(PlannedSetpoints { states, is_commanded, has_trajectory }) = planned.await else {
        let message = "the node is shutting down".to_owned();
        return QueryTrajectoryStateResponse { message, ..QueryTrajectoryStateResponse::default() };
    };
    let message = if is_commanded {
        String::new()
    } else if has_trajectory {
        format!("no trajectory commands a joint at {} s", seconds(time))
    } else {
        "no trajectory is active or waiting".to_owned()
    };
    QueryTrajectoryStateResponse {
        success: is_commanded,
        message,
        name: joints.to_vec(),
        position: states.iter().map(|state| state.position).collect(),
        velocity: states.iter().map(|state| state.velocity).collect(),
        acceleration: states.iter().map(|state| state.acceleration).collect(),
    }
}
