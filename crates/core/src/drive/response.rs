//! How a motor answers within a tick, in closed form.
//!
//! A matrix exponential that halves the interval and squares the result keeps its largest entries right, and loses
//! the small ones of a winding that settles many times within a tick. Here each entry is made of terms that do not
//! cancel, but where it is near zero itself.

/// Largest pole times the tick for which the series is taken: its terms fall from the first on.
const SERIES: f64 = 1.0;
/// Terms of the series: with poles within [`SERIES`] what follows is below 10⁻¹⁷ of the first.
const TERMS: usize = 24;
/// Slow pole times the tick from which on 1 − e^… is no small difference any more. Below it the fast pole is 0.2 away
/// at least: both together are more than [`SERIES`].
const SETTLING: f64 = 0.4;

/// The answer of `g″ + a g′ + k g = 0` from g = 0, g′ = 1, with its integrals, over one tick.
///
/// a = R/L, k = Ke Kt/(L J); with x, y the poles times the tick T and e[…] the divided differences of eˣ:
///
/// ```text
/// g = T e[x, y]      G = ∫g = T² e[0, x, y]      H = ∫G = T³ e[0, 0, x, y]
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Response {
    /// g, s.
    pub impulse: f64,
    /// G, s².
    pub step: f64,
    /// H, s³.
    pub ramp: f64,
    /// g′.
    pub slope: f64,
    /// g′ + a g.
    pub held: f64,
    /// Whether g + a G, what a torque does to the speed, stays positive up to the end of the tick.
    pub keeps_direction: bool,
}

impl Response {
    /// That of `damping` a (1/s) and `stiffness` k (1/s²), neither negative, over `tick` s.
    pub fn new(damping: f64, stiffness: f64, tick: f64) -> Self {
        // s = −(x + y) and m = x y.
        let (s, m) = (damping * tick, stiffness * tick * tick);
        let p = s / 2.0;
        let square = p * p - m;
        let answer = if s.max(m.sqrt()) <= SERIES {
            series(s, m)
        } else if square >= 0.0 {
            aperiodic(p, square.sqrt(), m)
        } else {
            let nu = (-square).sqrt();
            periodic(p, nu, m, 1.0)
        };
        let turned = square < 0.0 && turns_back(p, (-square).sqrt(), m);
        let Answer { g, step, ramp, slope, held } = answer;
        Response {
            impulse: tick * g,
            step: tick * tick * step,
            ramp: tick * tick * tick * ramp,
            slope,
            held,
            keeps_direction: !turned && g + s * step > 0.0,
        }
    }
}

/// The same over a tick of 1.
struct Answer {
    g: f64,
    step: f64,
    ramp: f64,
    slope: f64,
    held: f64,
}

/// Slow poles: e[…] = Σ hⱼ/(j + n)! with the complete symmetric polynomials hⱼ of x and y.
fn series(s: f64, m: f64) -> Answer {
    let (mut before, mut h) = (0.0, 1.0);
    // 1/(j + 1)!
    let mut share = 1.0;
    let (mut g, mut step, mut ramp) = (0.0, 0.0, 0.0);
    for j in 0..TERMS {
        let (second, third) = ((j + 2) as f64, (j + 3) as f64);
        g += h * share;
        step += h * share / second;
        ramp += h * share / (second * third);
        (before, h) = (h, -s * h - m * before);
        share /= second;
    }
    let held = 1.0 - m * step;
    Answer { g, step, ramp, slope: held - s * g, held }
}

/// Two real poles, x = −p − q and y = −p + q, of which x is not slow.
fn aperiodic(p: f64, q: f64, m: f64) -> Answer {
    let x = -p - q;
    // −p + q would be a difference.
    let y = m / x;
    // e^y − e^x over y − x.
    let g = y.exp() * first(-2.0 * q);
    let (held, slope) = (y.exp() - y * g, x.exp() + y * g);
    let (step, ramp) = if -y >= SETTLING {
        settled(g, held, 2.0 * p, m)
    } else {
        // x and y are apart.
        ((first(y) - first(x)) / (2.0 * q), (second(y) - second(x)) / (2.0 * q))
    };
    Answer { g, step, ramp, slope, held }
}

/// Two poles −p ± jν, up to the time t.
fn periodic(p: f64, nu: f64, m: f64, t: f64) -> Answer {
    let decay = (-p * t).exp();
    let (sine, cosine) = (nu * t).sin_cos();
    let g = decay * sine / nu;
    let (held, slope) = (decay * cosine + p * g, decay * cosine - p * g);
    let step = (1.0 - held) / m;
    Answer { g, step, ramp: (t - g - 2.0 * p * step) / m, slope, held }
}

/// G and H where the answer has begun to settle: g′ + a g + k G = 1, g + a G + k H = T.
fn settled(g: f64, held: f64, s: f64, m: f64) -> (f64, f64) {
    let step = (1.0 - held) / m;
    (step, (1.0 - g - s * step) / m)
}

/// Whether a torque turns the speed against itself before the end of the tick, with poles −p ± jν.
fn turns_back(p: f64, nu: f64, m: f64) -> bool {
    // The speed rises until g′ + a g is 0, and is lowest when that is 0 again.
    let lowest = (nu.atan2(-p) + std::f64::consts::PI) / nu;
    let answer = periodic(p, nu, m, lowest.min(1.0));
    lowest < 1.0 && answer.g + 2.0 * p * answer.step <= 0.0
}

/// (e^z − 1)/z.
fn first(z: f64) -> f64 {
    if z == 0.0 { 1.0 } else { z.exp_m1() / z }
}

/// (e^z − 1 − z)/z².
fn second(z: f64) -> f64 {
    if z.abs() > SERIES {
        return (first(z) - 1.0) / z;
    }
    let mut term = 0.5;
    let mut sum = 0.0;
    for k in 3..TERMS {
        sum += term;
        term *= z / k as f64;
    }
    sum
}
