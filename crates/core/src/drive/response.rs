//! Closed-form response of a motor (second-order system) over one tick: impulse, step and ramp response.
//!
//! Scaling and squaring of a matrix exponential keeps its largest entries accurate and loses the small ones of a winding
//! with a time constant much shorter than a tick. The closed form computes each entry from terms that do not cancel,
//! except where the entry itself is near 0.

/// Largest |pole| × tick for which the power series is used: its terms decrease from the first one on.
const MAX_SERIES_POLE: f64 = 1.0;
/// Number of terms of the series: for poles within [`MAX_SERIES_POLE`] the remainder is below 10⁻¹⁷ of the first term.
const SERIES_TERMS: usize = 24;
/// |Slow pole| × tick from which 1 − e^… is computed without cancellation. Below it the fast pole is at least 0.2 away,
/// since both together are more than [`MAX_SERIES_POLE`].
const MIN_SETTLED_POLE: f64 = 0.4;

/// Response of `g″ + a g′ + k g = 0` to g = 0, g′ = 1, with its integrals, over one tick.
///
/// a = R/L, k = Ke Kt/(L J); x, y are the poles times the tick T, e[…] are divided differences of eˣ:
///
/// ```text
/// g = T e[x, y]      G = ∫g = T² e[0, x, y]      H = ∫G = T³ e[0, 0, x, y]
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SecondOrderResponse {
    /// Impulse response g, s.
    pub impulse: f64,
    /// Step response G, s².
    pub step: f64,
    /// Ramp response H, s³.
    pub ramp: f64,
    /// Slope g′ of the impulse response.
    pub slope: f64,
    /// g′ + a g, response of the speed to its initial value.
    pub speed_decay: f64,
    /// True if g + a G, the response of the speed to a torque, is positive over the whole tick.
    pub has_constant_sign: bool,
}

impl SecondOrderResponse {
    /// Computes the response for `damping` a (1/s) and `stiffness` k (1/s²), both not negative, over `tick` s.
    pub fn new(damping: f64, stiffness: f64, tick: f64) -> Self {
        // s = −(x + y) and m = x y.
        let (s, m) = (damping * tick, stiffness * tick * tick);
        let p = s / 2.0;
        let square = p * p - m;
        let response = if s.max(m.sqrt()) <= MAX_SERIES_POLE {
            series(s, m)
        } else if square >= 0.0 {
            aperiodic(p, square.sqrt(), m)
        } else {
            let nu = (-square).sqrt();
            periodic(p, nu, m, 1.0)
        };
        let is_sign_changed = square < 0.0 && changes_sign(p, (-square).sqrt(), m);
        let UnitResponse { g, step, ramp, slope, speed_decay } = response;
        SecondOrderResponse {
            impulse: tick * g,
            step: tick * tick * step,
            ramp: tick * tick * tick * ramp,
            slope,
            speed_decay,
            has_constant_sign: !is_sign_changed && g + s * step > 0.0,
        }
    }
}

/// Response over a normalized tick of 1.
struct UnitResponse {
    g: f64,
    step: f64,
    ramp: f64,
    slope: f64,
    speed_decay: f64,
}

/// Computes the response with slow poles by the series e[…] = Σ hⱼ/(j + n)! with the complete symmetric polynomials hⱼ of x and y.
fn series(s: f64, m: f64) -> UnitResponse {
    let (mut previous, mut h) = (0.0, 1.0);
    // 1/(j + 1)!
    let mut inverse_factorial = 1.0;
    let (mut g, mut step, mut ramp) = (0.0, 0.0, 0.0);
    for j in 0..SERIES_TERMS {
        let (second, third) = ((j + 2) as f64, (j + 3) as f64);
        g += h * inverse_factorial;
        step += h * inverse_factorial / second;
        ramp += h * inverse_factorial / (second * third);
        (previous, h) = (h, -s * h - m * previous);
        inverse_factorial /= second;
    }
    let speed_decay = 1.0 - m * step;
    UnitResponse { g, step, ramp, slope: speed_decay - s * g, speed_decay }
}

/// Computes the response with two real poles, x = −p − q and y = −p + q, of which x is not slow.
fn aperiodic(p: f64, q: f64, m: f64) -> UnitResponse {
    let x = -p - q;
    // −p + q would cancel.
    let y = m / x;
    // e^y − e^x over y − x.
    let g = y.exp() * phi1(-2.0 * q);
    let (speed_decay, slope) = (y.exp() - y * g, x.exp() + y * g);
    let (step, ramp) = if -y >= MIN_SETTLED_POLE {
        settled_integrals(g, speed_decay, 2.0 * p, m)
    } else {
        // x and y are far apart.
        ((phi1(y) - phi1(x)) / (2.0 * q), (phi2(y) - phi2(x)) / (2.0 * q))
    };
    UnitResponse { g, step, ramp, slope, speed_decay }
}

/// Computes the response with two poles −p ± jν, up to time t.
fn periodic(p: f64, nu: f64, m: f64, t: f64) -> UnitResponse {
    let decay = (-p * t).exp();
    let (sine, cosine) = (nu * t).sin_cos();
    let g = decay * sine / nu;
    let (speed_decay, slope) = (decay * cosine + p * g, decay * cosine - p * g);
    let step = (1.0 - speed_decay) / m;
    UnitResponse { g, step, ramp: (t - g - 2.0 * p * step) / m, slope, speed_decay }
}

/// Computes G and H of a response that has begun to settle: g′ + a g + k G = 1, g + a G + k H = T.
fn settled_integrals(g: f64, speed_decay: f64, s: f64, m: f64) -> (f64, f64) {
    let step = (1.0 - speed_decay) / m;
    (step, (1.0 - g - s * step) / m)
}

/// Returns true if the speed response to a torque changes its sign within the tick, with poles −p ± jν.
fn changes_sign(p: f64, nu: f64, m: f64) -> bool {
    // The speed rises until g′ + a g is 0, and is lowest at the next zero of g′ + a g.
    let lowest = (nu.atan2(-p) + std::f64::consts::PI) / nu;
    let response = periodic(p, nu, m, lowest.min(1.0));
    lowest < 1.0 && response.g + 2.0 * p * response.step <= 0.0
}

/// Computes (e^z − 1)/z.
fn phi1(z: f64) -> f64 {
    if z == 0.0 { 1.0 } else { z.exp_m1() / z }
}

/// Computes (e^z − 1 − z)/z².
fn phi2(z: f64) -> f64 {
    if z.abs() > MAX_SERIES_POLE {
        return (phi1(z) - 1.0) / z;
    }
    let mut term = 0.5;
    let mut sum = 0.0;
    for k in 3..SERIES_TERMS {
        sum += term;
        term *= z / k as f64;
    }
    sum
}
