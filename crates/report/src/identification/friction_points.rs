//! Friction currents of a recording without constant velocities: what inertia and gravity do not explain, by speed.

use virtual_axes_identify::identify::{AxisIdentification, SteadyCurrent};

/// Number of speeds in each direction.
const SPEEDS: usize = 12;
/// Smallest speed relative to the highest.
const SLOWEST: f64 = 0.005;
/// Fewest samples of a point.
const FEWEST: usize = 5;

/// Sums over the samples of one speed.
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    count: usize,
    velocity: f64,
    current: f64,
    friction: f64,
    squares: f64,
}

/// Returns the mean friction current at speeds in equal ratios, from the recorded current, less what the model explains
/// beside the friction `law`. Errors are standard deviations of the samples.
pub(super) fn friction_points(found: &AxisIdentification, law: impl Fn(f64) -> f64) -> Vec<SteadyCurrent> {
    let mut samples = Vec::new();
    for (recorded, agreement) in found.recordings.iter().zip(&found.identification.agreements) {
        let modeled = agreement.inverse.iter().flat_map(|inverse| &inverse.modeled);
        for (span, modeled) in
            modeled.filter_map(|(n, modeled)| Some((recorded.signals.spans.get(*n)?, modeled)))
        {
            let Some(current) = &span.smooth_current else { continue };
            for ((v, i), m) in span.velocity.iter().zip(current).zip(modeled) {
                // Samples at rest are not modeled: their current is the recorded one.
                if i.is_finite() && m.is_finite() && i != m {
                    samples.push((*v, *i, i - m + law(*v)));
                }
            }
        }
    }
    let fastest = samples.iter().fold(0.0_f64, |most, (v, ..)| most.max(v.abs()));
    let mut bins = [[Bin::default(); SPEEDS]; 2];
    for (v, current, friction) in samples {
        let share = v.abs() / fastest;
        if share < SLOWEST || share.is_nan() {
            continue;
        }
        let index = (SPEEDS as f64 * (1.0 - share.ln() / SLOWEST.ln())) as usize;
        let bin = &mut bins[usize::from(v < 0.0)][index.min(SPEEDS - 1)];
        bin.count += 1;
        bin.velocity += v;
        bin.current += current;
        bin.friction += friction;
        bin.squares += friction * friction;
    }
    let point = |bin: &Bin| {
        let n = bin.count as f64;
        let friction = bin.friction / n;
        SteadyCurrent {
            velocity: bin.velocity / n,
            current: bin.current / n,
            friction,
            error: (bin.squares / n - friction * friction).max(0.0).sqrt(),
            duration: 0.0,
        }
    };
    bins.iter().flatten().filter(|bin| bin.count >= FEWEST).map(point).collect()
}
