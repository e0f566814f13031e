//! Limit on the number of responses that wait to be sent.
//!
//! Further requests stay in the middleware, which keeps as many as the depth of the service.

use std::sync::Arc;

use futures::{Stream, StreamExt};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Largest number of responses that wait to be sent: the number of requests that a client of rmw's parameter services
/// may send at once.
const MAX_RESPONSES: usize = 1000;

/// Permit of a response that waits to be sent; `None` if its request is counted elsewhere.
pub type ResponsePermit = Option<OwnedSemaphorePermit>;

/// Semaphore for the waiting responses of one or more services.
pub struct ResponseLimiter(Arc<Semaphore>);

impl Default for ResponseLimiter {
    fn default() -> Self {
        ResponseLimiter(Arc::new(Semaphore::new(MAX_RESPONSES)))
    }
}

impl ResponseLimiter {
    /// Returns the next request as soon as a permit for its response is free. Cancel-safe.
    pub async fn next<S: Stream + Unpin>(&self, requests: &mut S) -> Option<(ResponsePermit, S::Item)> {
        let permit = Arc::clone(&self.0).acquire_owned().await.ok();
        Some((permit, requests.next().await?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::{FutureExt, stream};

    /// A response waits for a second for a client that is not discovered.
    #[test]
    fn the_number_of_waiting_responses_is_bounded() {
        let limiter = ResponseLimiter::default();
        let mut requests = stream::repeat(7);
        let mut next = || limiter.next(&mut requests).now_or_never().flatten();
        let mut permits: Vec<ResponsePermit> =
            std::iter::from_fn(|| next().map(|(permit, _)| permit)).take(2 * MAX_RESPONSES).collect();
        assert_eq!(permits.len(), MAX_RESPONSES);
        permits.pop();
        assert!(next().is_some_and(|(permit, request)| permit.is_some() && request == 7));
    }
}
