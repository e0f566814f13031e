//! Corners of two lines: path and speed, from the distance to the corner and the time that it takes.
//!
//! The time that a corner takes more than its two lines at their speed does not depend on filters; neither does it need the
//! samples near the corner. With the distance of the setpoints from the corner, which filters increase, it determines speed
//! and radius.

use super::control_estimate::ControlEstimate;
use super::law::{RampLaw, Smoothing};
use super::ramp::plateau;
use super::track::{Track, TrackedMotion, distance};
use crate::motion::{AXIS_COUNT, Coordinates, PathControl};

/// Smallest and largest change of direction of a corner, rad.
const TURNS: [f64; 2] = [0.1, 3.0];
/// Relative difference of the speeds of the lines.
const SAME_SPEED: f64 = 1e-3;
/// Number of halvings of a search.
const HALVINGS: usize = 40;
/// Steps of an integral over a filter, and number of times that a range loses a third in the search of a minimum.
const STEPS: usize = 300;
const THIRDS: usize = 25;

/// Part of the feed below which a corner is a stop, and above which it does not slow down.
pub(super) const CORNER_SPEEDS: [f64; 2] = [0.02, 0.97];

/// Corner of two lines with the same feed.
#[derive(Debug, Clone, Copy)]
pub(super) struct LineCorner {
    pub path_control: PathControl,
    /// Change of direction, rad.
    pub turn: f64,
    /// Speed of the lines, m/s.
    pub feed: f64,
    /// Smallest acceleration limit of the axes that move, m/s².
    pub limit: ControlEstimate,
    /// Speed in the corner, m/s.
    pub speed: f64,
    /// Radius of the path before the filters, m; 0 for the exact path.
    pub radius: f64,
}

impl LineCorner {
    /// Returns the corner behind a motion, if it is one between parts of constant speed.
    pub fn of(track: &Track<'_>, index: usize, law: &RampLaw) -> Option<Self> {
        let [first, second] = [track.motions.get(index)?, track.motions.get(index + 1)?];
        let is_corner =
            [first, second].iter().all(|m| m.arc.is_none() && m.is_linear() && m.feed.is_finite());
        if !is_corner || first.dwell.is_some() {
            return None;
        }
        let directions = [first.direction(), second.direction()];
        let length = |sign: f64| {
            (0..AXIS_COUNT).map(|i| (directions[0][i] + sign * directions[1][i]).powi(2)).sum::<f64>().sqrt()
        };
        let turn = 2.0 * length(-1.0).atan2(length(1.0));
        if !(TURNS[0]..=TURNS[1]).contains(&turn) {
            return None;
        }
        let period = track.log.period;
        let resolution = track.log.accuracy.resolution;
        let constant = |motion: usize| {
            let [start, end] = track.samples[motion];
            let places = track.places(motion, start..end);
            let plateau = plateau(&places, track.log.accuracy)?;
            let middle = usize::midpoint(plateau.ends[0], plateau.ends[1]);
            Some((start + middle, plateau.place, plateau.step / period))
        };
        let (before, place, feed) = constant(index)?;
        let (after, next_place, next_feed) = constant(index + 1)?;
        if (next_feed / feed - 1.0).abs() > SAME_SPEED {
            return None;
        }
        let lost = (after - before) as f64 * period - (first.length - place + next_place) / feed;
        let reached = nearest(&track.log.positions[before..=after], &first.to);
        let along = |direction: &Coordinates, of: &dyn Fn(usize) -> Option<f64>| {
            (0..AXIS_COUNT)
                .filter(|&i| direction[i] != 0.0)
                .try_fold(f64::INFINITY, |least, i| Some(least.min(of(i)? / direction[i].abs())))
        };
        let acceleration = |axis: usize| Some(law.accelerations[axis]?.value);
        let accelerations = [along(&directions[0], &acceleration)?, along(&directions[1], &acceleration)?];
        let jerk = |axis: usize| match &law.smoothing {
            Smoothing::Jerk(limits) => Some(limits[axis]?.value),
            _ => Some(f64::INFINITY),
        };
        let jerks = [along(&directions[0], &jerk)?, along(&directions[1], &jerk)?];
        let moving = (0..AXIS_COUNT).filter(|&i| directions.iter().any(|direction| direction[i] != 0.0));
        let limits = moving.filter_map(|axis| law.accelerations[axis]);
        let limit = limits.min_by(|a, b| a.value.total_cmp(&b.value))?;
        let lines = Lines { turn, feed, lost, accelerations, jerks };
        let mut filters = law.filters();
        let smoothing = track.log.accuracy.smoothing;
        match filters.as_mut_slice() {
            _ if smoothing == 0.0 => (),
            [] | [_] => filters.push(smoothing),
            [.., last] => *last = last.hypot(smoothing),
        }
        let most = 0.5 * first.length.min(second.length) / (0.5 * turn).tan();
        let path = |radius: f64| lines.distance(radius, lines.speed(radius), &filters);
        // The influence of the sampling on the distance of an exact corner.
        let tolerance = 2.0 * resolution + 2e-7 + 2e-3 * path(0.0);
        let mut radius = 0.0;
        // Without filters the exact path has a bend between two samples.
        let leaves = match filters.is_empty() {
            true => off_lines(&track.log.positions[before..=after], [first, second]) > tolerance,
            false => reached > path(0.0) + tolerance,
        };
        if leaves {
            let [mut low, mut high] = [0.0, most];
            for _ in 0..HALVINGS {
                let middle = f64::midpoint(low, high);
                if path(middle) < reached { low = middle } else { high = middle }
            }
            radius = low;
        }
        let speed = lines.speed(radius);
        Some(Self { path_control: first.path_control, turn, feed, limit, speed, radius })
    }

    /// Returns the distance of an arc of unit radius from the corner.
    pub fn bulge(&self) -> f64 {
        1.0 / (0.5 * self.turn).cos() - 1.0
    }

    /// Returns the distance of the path from the corner, m.
    pub fn distance(&self) -> f64 {
        self.radius * self.bulge()
    }

    /// Returns the tolerance P, m.
    pub fn tolerance(&self) -> Option<f64> {
        match self.path_control {
            PathControl::Blend(blend) => blend.tolerance,
            _ => None,
        }
    }

    /// Returns true in G64.
    pub fn is_blended(&self) -> bool {
        matches!(self.path_control, PathControl::Blend(_))
    }
}

/// Two lines and the time that their corner takes.
struct Lines {
    turn: f64,
    feed: f64,
    lost: f64,
    accelerations: [f64; 2],
    jerks: [f64; 2],
}

impl Lines {
    /// Returns the speed in a corner of a radius.
    fn speed(&self, radius: f64) -> f64 {
        let lost = |speed: f64| {
            let change = self.feed - speed;
            let ramps = self.accelerations.iter().zip(&self.jerks).map(|(a, j)| {
                let jerk_time = (a / j).min((change / j).sqrt());
                let time = if jerk_time > 0.0 { jerk_time + (change / a).max(jerk_time) } else { change / a };
                0.5 * time * change / self.feed
            });
            let arc = radius * (self.turn / speed - 2.0 * (0.5 * self.turn).tan() / self.feed);
            ramps.sum::<f64>() + arc
        };
        let [mut low, mut high] = [0.0, self.feed];
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            if lost(middle) > self.lost { low = middle } else { high = middle }
        }
        high
    }

    /// Returns the distance of the filtered path from the corner, m.
    fn distance(&self, radius: f64, speed: f64, filters: &[f64]) -> f64 {
        let (sine, cosine) = (0.5 * self.turn).sin_cos();
        let arc_time = 0.5 * radius * self.turn / speed.max(f64::MIN_POSITIVE);
        // Towards the inside of the corner, and from one line to the other.
        let path = |time: f64| {
            let away = time.abs() - arc_time;
            if away < 0.0 {
                let (s, c) = (speed * time / radius).sin_cos();
                return [radius / cosine - radius * c, radius * s];
            }
            let a = self.accelerations[usize::from(time > 0.0)];
            let ramp = ((self.feed - speed) / a).min(away);
            let line = radius * sine / cosine + speed * away + a * ramp * (away - 0.5 * ramp);
            [line * sine, time.signum() * line * cosine]
        };
        let [long, short] = match *filters {
            [] => return path(0.0)[0],
            [one] => [one, 0.0],
            [a, b, ..] => [a.max(b), a.min(b)],
        };
        let [outer, inner] = [0.5 * (long + short), 0.5 * (long - short)];
        let weight = |time: f64| if time <= inner { 1.0 } else { (outer - time) / (outer - inner) };
        let times: Vec<f64> = (0..STEPS).map(|k| ((2 * k + 1) as f64 / STEPS as f64 - 1.0) * outer).collect();
        let weights: Vec<f64> = times.iter().map(|time| weight(time.abs())).collect();
        let total: f64 = weights.iter().sum();
        let away = |center: f64| {
            let mut sum = [0.0; 2];
            for (time, weight) in times.iter().zip(&weights) {
                let [inside, along] = path(center + time);
                (sum[0], sum[1]) = (sum[0] + weight * inside, sum[1] + weight * along);
            }
            sum[0].hypot(sum[1]) / total
        };
        // The distance has one minimum, near the middle.
        let [mut low, mut high] = [-0.5 * outer, 0.5 * outer];
        for _ in 0..THIRDS {
            let third = (high - low) / 3.0;
            if away(low + third) < away(high - third) { high -= third } else { low += third }
        }
        away(f64::midpoint(low, high))
    }
}

/// Returns the largest distance of samples from the nearer one of two lines.
fn off_lines(positions: &[Coordinates], lines: [&TrackedMotion; 2]) -> f64 {
    let away = |position: &Coordinates| {
        let of = |line: &TrackedMotion| {
            let place = line.place(position, 0.0).clamp(0.0, line.length);
            distance(position, &line.position(place))
        };
        of(lines[0]).min(of(lines[1]))
    };
    positions.iter().map(away).fold(0.0, f64::max)
}

/// Returns the smallest distance of a sampled path from a point; parabolas join the samples.
fn nearest(positions: &[Coordinates], point: &Coordinates) -> f64 {
    let away = |position: &Coordinates| distance(position, point);
    let Some(best) =
        (0..positions.len()).min_by(|a, b| away(&positions[*a]).total_cmp(&away(&positions[*b])))
    else {
        return f64::INFINITY;
    };
    let here = away(&positions[best]);
    if best == 0 || best + 1 >= positions.len() {
        return here;
    }
    let [before, middle, after] = [&positions[best - 1], &positions[best], &positions[best + 1]];
    let at = |t: f64| -> Coordinates {
        std::array::from_fn(|i| {
            middle[i] + 0.5 * t * (after[i] - before[i] + t * (after[i] - 2.0 * middle[i] + before[i]))
        })
    };
    (-20..=20).map(|k| away(&at(f64::from(k) / 20.0))).fold(here, f64::min)
}
