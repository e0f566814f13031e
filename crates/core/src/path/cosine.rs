//! Feed profile with cosine ramps from rest to rest: feed v/2 (1 − cos(π t/ramp)), constant, and mirrored.

use std::f64::consts::PI;

/// Angle below which x − sin x is computed by its series, because the difference would cancel, rad.
const SERIES_BELOW: f64 = 0.5;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CosineProfile {
    length: f64,
    feed: f64,
    ramp: f64,
    /// Time at constant feed, s.
    cruise_time: f64,
}

/// Returns the length that both ramps need together.
pub(super) fn both_ramps_length(feed: f64, ramp: f64) -> f64 {
    feed * ramp
}

impl CosineProfile {
    /// Creates a profile; `length` must be at least that of both ramps.
    pub fn new(length: f64, feed: f64, ramp: f64) -> Self {
        let cruise_time = ((length - both_ramps_length(feed, ramp)) / feed).max(0.0);
        Self { length, feed, ramp, cruise_time }
    }

    /// Returns the duration, s.
    pub fn duration(&self) -> f64 {
        2.0 * self.ramp + self.cruise_time
    }

    /// Returns the highest speed.
    pub fn highest_speed(&self) -> f64 {
        self.feed
    }

    /// Returns a time at the highest speed, s.
    pub fn time_of_highest_speed(&self) -> f64 {
        0.5 * self.duration()
    }

    /// Returns the distance in a ramp, v/2 (t − ramp/π sin(π t/ramp)).
    fn ramped(&self, t: f64) -> f64 {
        0.5 * self.feed * self.ramp / PI * minus_sine(PI * t / self.ramp)
    }

    /// Returns the distance after `t` seconds.
    pub fn at(&self, t: f64) -> f64 {
        let left = self.duration() - t;
        if t <= 0.0 {
            0.0
        } else if left <= 0.0 {
            self.length
        } else if t < self.ramp {
            self.ramped(t)
        } else if left < self.ramp {
            self.length - self.ramped(left)
        } else {
            0.5 * self.feed * self.ramp + self.feed * (t - self.ramp)
        }
    }
}

/// Returns x − sin x for x ≥ 0.
fn minus_sine(x: f64) -> f64 {
    if x >= SERIES_BELOW {
        return x - x.sin();
    }
    let y = x * x;
    // The next term, x¹⁵/15!, is below 10⁻¹⁴ of the first one.
    x * y / 6.0
        * (1.0 - y / 20.0 * (1.0 - y / 42.0 * (1.0 - y / 72.0 * (1.0 - y / 110.0 * (1.0 - y / 156.0)))))
}
