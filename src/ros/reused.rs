//! Values that travel from one thread to another and are used again, so that neither allocates nor frees
//! one per message.

use std::sync::Arc;

/// Values of one sender. Whoever gets one shares it, and gives it back by dropping it.
#[derive(Debug, Default)]
pub struct Reused<T>(Vec<Arc<T>>);

impl<T: Default> Reused<T> {
    /// A value that nobody shares any more, changed by `fill` from whatever it last was; a new one if
    /// all are in use, so that there are as many as have ever been under way at a time.
    pub fn next(&mut self, fill: impl FnOnce(&mut T)) -> Arc<T> {
        let place = match self.0.iter_mut().position(|value| Arc::get_mut(value).is_some()) {
            Some(free) => free,
            None => {
                self.0.push(Arc::default());
                self.0.len() - 1
            }
        };
        let value = &mut self.0[place];
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
    fn a_value_is_used_again_only_when_nobody_shares_it() {
        let mut values = Reused::<Vec<u8>>::default();
        let first = values.next(|value| value.push(1));
        let second = values.next(|value| value.push(2));
        assert_eq!((first.as_slice(), second.as_slice()), (&[1][..], &[2][..]));
        let kept = Arc::as_ptr(&first);
        drop(first);
        let third = values.next(|value| value.push(3));
        assert_eq!((Arc::as_ptr(&third), third.as_slice()), (kept, &[1, 3][..]));
        assert_eq!((values.0.len(), second.as_slice()), (2, &[2][..]));
    }
}
