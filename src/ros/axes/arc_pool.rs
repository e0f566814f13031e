//! Pool of shared values that pass from one thread to another without allocation per message.

use std::sync::Arc;

/// Pool of one sender. A receiver returns a value by dropping its `Arc`.
#[derive(Debug, Default)]
pub struct ArcPool<T>(Vec<Arc<T>>);

impl<T: Default> ArcPool<T> {
    /// Returns a value without other owners after `fill` has changed it.
    ///
    /// `fill` gets the previous contents. A new value is created if all are in use, so the pool grows to the largest
    /// number of values in use at a time.
    pub fn acquire(&mut self, fill: impl FnOnce(&mut T)) -> Arc<T> {
        let index = match self.0.iter_mut().position(|value| Arc::get_mut(value).is_some()) {
            Some(free) => free,
            None => {
                self.0.push(Arc::default());
                self.0.len() - 1
            }
        };
        let value = &mut self.0[index];
        if let Some(own) = Arc::get_mut(value) {
            fill(own);
        }
        Arc::clone(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_reused_only_after_all_receivers_have_dropped_it() {
        let mut pool = ArcPool::<Vec<u8>>::default();
        let first = pool.acquire(|value| value.push(1));
        let second = pool.acquire(|value| value.push(2));
        assert_eq!((first.as_slice(), second.as_slice()), (&[1][..], &[2][..]));
        let kept = Arc::as_ptr(&first);
        drop(first);
        let third = pool.acquire(|value| value.push(3));
        assert_eq!((Arc::as_ptr(&third), third.as_slice()), (kept, &[1, 3][..]));
        assert_eq!((pool.0.len(), second.as_slice()), (2, &[2][..]));
    }
}
