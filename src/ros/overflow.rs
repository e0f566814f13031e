//! Policy for full queues of outgoing messages.

/// Policy for a queue that is full because its subscribers are slow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OverflowPolicy {
    /// The message is dropped and counted; used where the axes follow the wall clock.
    Drop,
    /// The sender waits; used where the axes run as fast as subscribers can receive.
    Block,
    /// The sender waits for at most 1 s. After a timeout messages are dropped and counted until the queue has space
    /// again, so that a stalled subscriber is waited for only once.
    BlockWithTimeout,
}
