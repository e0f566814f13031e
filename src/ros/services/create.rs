//! Services under their resolved names.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::ros_interface::{NodeService, Topic};
use crate::validation::args::RosArgs;
use virtual_axes_dds::{Node, Publisher, QoSProfile, Service};

/// Longest time for which a write waits for a slow reader.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);

/// Failure to create a service or one of its topics.
#[derive(Debug, thiserror::Error)]
#[error("service {name} cannot be created: {reason}")]
pub struct ServiceError {
    /// Name of the service.
    pub name: String,
    /// Reason.
    pub reason: String,
}

/// Conflict of two services that are remapped to one name; a request would reach both.
#[derive(Debug, thiserror::Error)]
#[error("-r: services ~/{first} and ~/{second} would both be named {resolved}; remap one of them")]
pub struct ServiceNameConflict {
    /// Label of the first service.
    pub first: &'static str,
    /// Label of the second service.
    pub second: &'static str,
    /// Resolved name.
    pub resolved: String,
}

/// Checks that no two services `~/label` have the same resolved name.
///
/// # Errors
/// [`ServiceNameConflict`] for the first conflict. A name that cannot be resolved fails when its service is created.
pub fn check_names(
    args: &RosArgs,
    labels: impl IntoIterator<Item = &'static str>,
) -> Result<(), ServiceNameConflict> {
    let mut known: HashMap<String, &'static str> = HashMap::new();
    for second in labels {
        let Ok(resolved) = args.resolve_service(&format!("~/{second}")) else { continue };
        match known.entry(resolved) {
            Entry::Vacant(free) => _ = free.insert(second),
            Entry::Occupied(taken) => {
                return Err(ServiceNameConflict {
                    first: taken.get(),
                    second,
                    resolved: taken.key().clone(),
                });
            }
        }
    }
    Ok(())
}

/// Creates the publisher of a topic, reliable and volatile, without a queue.
///
/// # Errors
/// [`ServiceError`] with the name of the topic if it cannot be resolved or created.
pub fn create_publisher<M: Serialize + Send + Sync + 'static>(
    node: &Node,
    args: &RosArgs,
    topic: &Topic,
    depth: usize,
) -> Result<Publisher<M>, ServiceError> {
    let error = |reason: String| ServiceError { name: topic.name.to_owned(), reason };
    let resolved = args.resolve_topic(topic.name).map_err(|e| error(e.to_string()))?;
    let qos = QoSProfile { max_blocking_time: Some(WRITE_TIMEOUT), ..QoSProfile::reliable(depth) };
    node.create_publisher(&resolved, &topic.type_name(), &qos).map_err(error)
}

/// Creates `service`, which keeps `depth` requests.
///
/// # Errors
/// [`ServiceError`] if the name cannot be resolved or the middleware cannot create the service.
pub fn create_service<Q, A>(
    node: &Node,
    args: &RosArgs,
    service: &NodeService,
    depth: usize,
) -> Result<Service<Q, A>, ServiceError>
where
    Q: DeserializeOwned + Send + Sync + 'static,
    A: Serialize + Send + Sync + 'static,
{
    let error = |reason: String| ServiceError { name: service.label.to_owned(), reason };
    let resolved = args.resolve_service(&service.name()).map_err(|e| error(e.to_string()))?;
    node.create_service(&resolved, &service.type_name(), depth).map_err(error)
}
