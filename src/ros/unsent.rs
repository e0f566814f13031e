//! How many requests are worked on before their responses have been sent: more wait in the middleware, which
//! keeps as many as the service is deep.

use std::sync::Arc;

use futures::{Stream, StreamExt};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Most responses that wait to be sent: as many requests as a client of rmw's parameter services may send at once.
const MOST: usize = 1000;

/// A response's place among those that wait; none where the request that it answers was counted otherwise.
pub type Place = Option<OwnedSemaphorePermit>;

/// The places of the responses of some services.
pub struct Unsent(Arc<Semaphore>);

impl Default for Unsent {
    fn default() -> Self {
        Unsent(Arc::new(Semaphore::new(MOST)))
    }
}

impl Unsent {
    /// The next request, once there is a place for its response. To be dropped before it is done loses nothing.
    pub async fn next<S: Stream + Unpin>(&self, requests: &mut S) -> Option<(Place, S::Item)> {
        let place = Arc::clone(&self.0).acquire_owned().await.ok();
        Some((place, requests.next().await?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::{FutureExt, stream};

    /// Each holds its response, and waits a second for a client that is not known.
    #[test]
    fn requests_without_end_do_not_fill_the_memory_with_responses() {
        let unsent = Unsent::default();
        let mut requests = stream::repeat(7);
        let mut next = || unsent.next(&mut requests).now_or_never().flatten();
        let mut places: Vec<Place> =
            std::iter::from_fn(|| next().map(|(place, _)| place)).take(2 * MOST).collect();
        assert_eq!(places.len(), MOST);
        places.pop();
        assert!(next().is_some_and(|(place, request)| place.is_some() && request == 7));
    }
}
