//! Endpoints that move to another participant of this process without loss ([`super::renewal`]).
//!
//! Requests and messages that arrive at both participants are processed once: the reader of the previous participant is
//! emptied before the next one is read, and samples that the previous one has delivered are dropped.

use std::collections::HashMap;
use std::ops::Deref;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use futures::future::{BoxFuture, ready};
use futures::{FutureExt, Stream, stream};
use ros2_client::{Context, Node};
use tokio::sync::watch;

use super::rtps::Guid;

/// Largest number of publishers whose newest sample is remembered; the one without samples for longest is forgotten.
const MAX_PUBLISHERS: usize = 1024;

/// Largest number of items read from a predecessor after the switch. Those that have arrived later are at the successor
/// too, and the largest default depth is 1000.
const MAX_DRAINED: usize = 1024;

/// Endpoint that can be moved to another participant, in the order of these functions.
pub(super) trait RenewableEndpoint: Send + Sync {
    /// Creates the successor, of `node` in `context`. Returns the reason of the middleware if that fails.
    fn prepare(&self, node: &mut Node, context: &Context) -> Result<(), String>;

    /// Writes the messages kept for late joiners to the successor.
    fn replay(&self) -> BoxFuture<'_, ()> {
        ready(()).boxed()
    }

    /// Uses the successor from now on; the predecessor exists until it is released.
    fn switch(&self) -> BoxFuture<'_, ()>;

    /// Returns true while a reader or a pending write uses the predecessor.
    fn is_predecessor_in_use(&self) -> bool;

    /// Drops the successor, or after the switch the predecessor.
    fn release(&self);
}

/// ROS context in which the node creates its endpoints, with a list of those that are moved at a renewal.
pub struct EndpointContext {
    context: Context,
    endpoints: Mutex<Vec<Arc<dyn RenewableEndpoint>>>,
}

impl EndpointContext {
    /// Creates an empty list for `context`.
    pub(super) fn new(context: Context) -> Self {
        EndpointContext { context, endpoints: Mutex::default() }
    }

    /// Adds an endpoint that is moved at a renewal.
    pub(super) fn add(&self, endpoint: Arc<dyn RenewableEndpoint>) {
        self.endpoints.lock().unwrap_or_else(PoisonError::into_inner).push(endpoint);
    }

    /// Returns the context and the list.
    pub(super) fn into_parts(self) -> (Context, Vec<Arc<dyn RenewableEndpoint>>) {
        (self.context, self.endpoints.into_inner().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Deref for EndpointContext {
    type Target = Context;

    fn deref(&self) -> &Context {
        &self.context
    }
}

/// Function that creates an endpoint of a node in a context.
type Create<E> = Box<dyn Fn(&mut Node, &Context) -> Result<E, String> + Send + Sync>;

/// Endpoint without history, and the function that creates its successor.
pub(super) struct Renewable<E> {
    current: watch::Sender<Generation<E>>,
    /// Successor until the switch, predecessor after it.
    other: Mutex<Option<Arc<E>>>,
    create: Create<E>,
}

/// Endpoint with the number of renewals before it.
struct Generation<E> {
    endpoint: Arc<E>,
    number: u64,
}

impl<E> Clone for Generation<E> {
    fn clone(&self) -> Self {
        Generation { endpoint: Arc::clone(&self.endpoint), number: self.number }
    }
}

impl<E: Send + Sync + 'static> Renewable<E> {
    /// Creates the first endpoint by `create`, and adds it to `context`.
    pub(super) fn create(
        node: &mut Node,
        context: &EndpointContext,
        create: impl Fn(&mut Node, &Context) -> Result<E, String> + Send + Sync + 'static,
    ) -> Result<Arc<Self>, String> {
        let endpoint = Arc::new(create(node, context)?);
        let renewable = Arc::new(Self::new(endpoint, Box::new(create)));
        context.add(Arc::clone(&renewable) as Arc<dyn RenewableEndpoint>);
        Ok(renewable)
    }

    fn new(endpoint: Arc<E>, create: Create<E>) -> Self {
        let current = watch::Sender::new(Generation { endpoint, number: 0 });
        Renewable { current, other: Mutex::new(None), create }
    }

    /// Returns the current endpoint.
    pub(super) fn current(&self) -> Arc<E> {
        Arc::clone(&self.current.borrow().endpoint)
    }

    fn lock_other(&self) -> MutexGuard<'_, Option<Arc<E>>> {
        self.other.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the items that `take` gets from the endpoint, each with the number of renewals before it.
    ///
    /// After a switch, the predecessor is read until it is empty, but at most [`MAX_DRAINED`] items.
    pub(super) fn items<T, F: Future<Output = T>>(
        &self,
        take: impl Fn(Arc<E>) -> F,
    ) -> impl Stream<Item = (u64, T)> {
        let mut current = self.current.subscribe();
        let first = current.borrow_and_update().clone();
        stream::unfold(
            (first, current, 0, take),
            |(mut generation, mut current, mut drained, take)| async move {
                loop {
                    if drained >= MAX_DRAINED {
                        (generation, drained) = (current.borrow_and_update().clone(), 0);
                    }
                    tokio::select! {
                        biased;
                        item = take(Arc::clone(&generation.endpoint)) => {
                            drained += usize::from(current.has_changed().unwrap_or(false));
                            let item = (generation.number, item);
                            return Some((item, (generation, current, drained, take)));
                        }
                        // The sender lives as long as the endpoint.
                        Ok(()) = current.changed() => {
                            (generation, drained) = (current.borrow_and_update().clone(), 0);
                        }
                    }
                }
            },
        )
    }

    fn set_other(&self, successor: E) {
        *self.lock_other() = Some(Arc::new(successor));
    }

    fn exchange(&self) {
        let mut other = self.lock_other();
        if let Some(endpoint) = other.take() {
            let number = self.current.borrow().number + 1;
            *other = Some(self.current.send_replace(Generation { endpoint, number }).endpoint);
        }
    }
}

impl<E: Send + Sync + 'static> RenewableEndpoint for Renewable<E> {
    fn prepare(&self, node: &mut Node, context: &Context) -> Result<(), String> {
        self.set_other((self.create)(node, context)?);
        Ok(())
    }

    fn switch(&self) -> BoxFuture<'_, ()> {
        self.exchange();
        ready(()).boxed()
    }

    fn is_predecessor_in_use(&self) -> bool {
        self.lock_other().as_ref().is_some_and(|endpoint| Arc::strong_count(endpoint) > 1)
    }

    fn release(&self) {
        let other = self.lock_other().take();
        drop(other);
    }
}

/// Newest sample of each publisher or client, to drop those that a previous reader has delivered.
#[derive(Debug, Default)]
pub(super) struct DeliveredSamples {
    newest: HashMap<Guid, Newest>,
    /// Number of samples so far.
    count: u64,
}

#[derive(Debug)]
struct Newest {
    /// Number of renewals before the reader.
    reader: u64,
    /// Largest sequence number.
    number: i64,
    /// Largest sequence number that a previous reader has delivered.
    delivered: i64,
    /// Value of the count at the last sample.
    last: u64,
}

impl DeliveredSamples {
    /// Records sample `number` of `publisher`, from the reader after `reader` renewals. Returns false if a previous
    /// reader has delivered it.
    pub(super) fn insert(&mut self, publisher: Guid, number: i64, reader: u64) -> bool {
        self.count += 1;
        if self.newest.len() >= MAX_PUBLISHERS && !self.newest.contains_key(&publisher) {
            let oldest = self.newest.iter().min_by_key(|(_, newest)| newest.last).map(|(guid, _)| *guid);
            oldest.map(|guid| self.newest.remove(&guid));
        }
        let none = Newest { reader, number: i64::MIN, delivered: i64::MIN, last: 0 };
        let newest = self.newest.entry(publisher).or_insert(none);
        newest.last = self.count;
        if newest.reader < reader {
            newest.reader = reader;
            newest.delivered = newest.number;
        }
        newest.number = newest.number.max(number);
        number > newest.delivered
    }
}

#[cfg(test)]
mod tests {
    use futures::StreamExt;
    use tokio::sync::mpsc;

    use super::*;

    type Queue = tokio::sync::Mutex<mpsc::UnboundedReceiver<i64>>;

    fn queue(numbers: &[i64]) -> (mpsc::UnboundedSender<i64>, Queue) {
        let (sender, receiver) = mpsc::unbounded_channel();
        numbers.iter().for_each(|number| sender.send(*number).expect("open"));
        (sender, Queue::new(receiver))
    }

    #[tokio::test]
    async fn samples_of_two_overlapping_readers_are_delivered_once_and_in_order() {
        // The second reader lacks the samples before its creation, the first those after its end.
        let (_first_in, first) = queue(&[1, 2, 3, 4]);
        let (second_in, second) = queue(&[3, 4, 5]);
        let renewable = Renewable::new(Arc::new(first), Box::new(|_, _| Err(String::new())));
        let take = async |queue: Arc<Queue>| queue.lock().await.recv().await.expect("open");
        let mut items = std::pin::pin!(renewable.items(take));
        let mut delivered = DeliveredSamples::default();
        let mut numbers = Vec::new();
        let mut next = async |count: usize| {
            while numbers.len() < count {
                let (reader, number) = items.next().await.expect("endless");
                if delivered.insert([7; 16], number, reader) {
                    numbers.push(number);
                }
            }
            numbers.clone()
        };
        assert_eq!(next(2).await, [1, 2]);
        renewable.set_other(second);
        assert_eq!(next(3).await, [1, 2, 3]);
        renewable.exchange();
        assert!(renewable.is_predecessor_in_use());
        second_in.send(6).expect("open");
        assert_eq!(next(6).await, [1, 2, 3, 4, 5, 6]);
        assert!(!renewable.is_predecessor_in_use());
    }

    #[tokio::test]
    async fn a_predecessor_with_endless_samples_is_left() {
        let (_first_in, first) = queue(&(0..3 * MAX_DRAINED as i64).collect::<Vec<_>>());
        let (_second_in, second) = queue(&[-1]);
        let renewable = Renewable::new(Arc::new(first), Box::new(|_, _| Err(String::new())));
        let take = async |queue: Arc<Queue>| queue.lock().await.recv().await.expect("open");
        let mut items = std::pin::pin!(renewable.items(take));
        assert_eq!(items.next().await, Some((0, 0)));
        renewable.set_other(second);
        renewable.exchange();
        let numbers: Vec<i64> = items.take(1 + MAX_DRAINED).map(|(_, number)| number).collect().await;
        assert_eq!(numbers[MAX_DRAINED - 1..], [MAX_DRAINED as i64, -1]);
    }

    #[test]
    fn samples_out_of_order_from_one_reader_are_delivered() {
        let mut delivered = DeliveredSamples::default();
        assert!(delivered.insert([1; 16], 5, 0) && delivered.insert([1; 16], 4, 0));
        // The next reader gets sample 1 of a publisher again, also after a later one.
        assert!(!delivered.insert([1; 16], 1, 1) && !delivered.insert([1; 16], 5, 1));
        assert!(delivered.insert([1; 16], 6, 1) && !delivered.insert([1; 16], 5, 1));
        assert!(delivered.insert([2; 16], 1, 1));
        assert!(!delivered.insert([1; 16], 6, 3) && delivered.insert([1; 16], 7, 3));
    }

    #[test]
    fn the_number_of_remembered_publishers_is_bounded() {
        let mut delivered = DeliveredSamples::default();
        let guid = |number: usize| {
            let mut guid = [0; 16];
            guid[..8].copy_from_slice(&number.to_le_bytes());
            guid
        };
        for number in 0..3 * MAX_PUBLISHERS {
            delivered.insert(guid(0), number as i64, 0);
            delivered.insert(guid(1 + number), 1, 0);
        }
        assert_eq!(delivered.newest.len(), MAX_PUBLISHERS);
        assert!(!delivered.insert(guid(0), 5, 1), "a publisher with recent samples is remembered");
    }
}
