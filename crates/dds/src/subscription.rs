//! Subscription to a topic.

use futures::{Stream, StreamExt, stream};
use serde::de::DeserializeOwned;

use crate::defects::reception_order::in_reception_order;
use crate::rtps::Guid as Gid;

/// Origin of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageInfo {
    /// Identifier of the publisher.
    pub publisher_gid: Gid,
    /// Number of the message among those of the publisher.
    pub sequence_number: i64,
}

/// Subscription to a topic.
pub struct Subscription<M: DeserializeOwned + 'static>(ros2_client::Subscription<M>);

impl<M: DeserializeOwned + Send + Sync + 'static> Subscription<M> {
    pub(crate) fn new(network: ros2_client::Subscription<M>) -> Self {
        Subscription(network)
    }

    /// Returns the messages in order of reception. An item is an error if a message could not be decoded.
    pub fn messages(&self) -> impl Stream<Item = Result<(M, MessageInfo), String>> + Send + '_ {
        let received =
            stream::unfold(&self.0, |network| async move { Some((network.async_take().await, network)) });
        in_reception_order(received).map(|received| {
            let (message, info) = received.map_err(|error| format!("{error:?}"))?;
            let info = MessageInfo {
                publisher_gid: info.publisher_gid().to_bytes16(),
                sequence_number: info.sequence_number(),
            };
            Ok((message, info))
        })
    }
}
