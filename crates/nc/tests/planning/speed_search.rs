//! Shortest time along a sampled path, by dynamic programming over (path, speed, acceleration), independent of the planner.
//!
//! The path is a sequence of chords. A profile is the speed on each chord; speed, acceleration and jerk of each joint are
//! the first, second and third divided differences, as the limit audit computes them. A state is the speed on the last two
//! chords, that is, speed and acceleration along the path. The search advances chord by chord from both ends, both at
//! rest, with the next speeds that keep all limits: equal parts of their interval, its ends, the speed limit, and constant
//! speed. Of the states in a cell of speed and acceleration it keeps the earliest one, and the one with the least
//! acceleration, from which the limits ahead can be kept. States that cannot be faster than the time `worst` are dropped,
//! by a bound without jerk. Both searches are joined at several places by pairs of states that keep the limits there.
//!
//! The result is the time of a profile within all limits. It exceeds the optimum by the states that are not kept.

use virtual_axes_core::config::LimitsConfig;

/// Places at which both searches are joined, as parts of the path.
const JOINED_AT: [f64; 5] = [0.4, 0.45, 0.5, 0.55, 0.6];
/// Number of equal parts of the interval of next speeds.
const PARTS: usize = 6;
/// Relative tolerance of the limits.
const TOLERANCE: f64 = 1e-6;
/// Bisections towards a limit.
const BISECTIONS: usize = 14;
/// Largest number of joints.
const JOINTS: usize = 9;
/// Change of a joint per length of the path below which it does not limit the speed.
const NO_MOTION: f64 = 1e-9;
/// Iterations of the interval of next speeds, whose limits depend on the duration.
const ITERATIONS: usize = 4;
/// Lowest next speed, relative to the present one.
const SLOWEST: f64 = 0.1;

/// Resolution of the states: number of cells of the square root of the speed, and of the acceleration.
#[derive(Debug, Clone, Copy)]
pub struct Grid {
    pub speeds: usize,
    pub accelerations: usize,
}

/// Chord of a path.
#[derive(Debug, Clone)]
struct Chord {
    /// Length along the path.
    length: f64,
    /// Change of each joint per length.
    tangent: Vec<f64>,
    /// Largest speed along the path.
    fastest: f64,
}

/// Path with the limits of its joints.
#[derive(Debug, Clone)]
pub struct SampledPath {
    chords: Vec<Chord>,
    limits: Vec<LimitsConfig>,
}

/// Earliest state of a cell: time at the end of the last chord, and the speeds on the last two chords.
#[derive(Debug, Clone, Copy)]
struct Reached {
    time: f64,
    before: f64,
    speed: f64,
}

impl SampledPath {
    /// Creates a path through positions of the joints; `tips` are the points to which the feed, m/s, applies. Chords
    /// shorter than `shortest`, m, are joined.
    pub fn new(
        joints: &[Vec<f64>],
        tips: &[[f64; 3]],
        limits: Vec<LimitsConfig>,
        feed: f64,
        shortest: f64,
    ) -> Self {
        let mut chords = Vec::new();
        let mut from = 0;
        for to in 1..joints.len() {
            let steps: Vec<f64> = joints[to].iter().zip(&joints[from]).map(|(b, a)| b - a).collect();
            // The measure of length is arbitrary.
            let length = steps.iter().map(|step| step * step).sum::<f64>().sqrt();
            if length < shortest && (to + 1 < joints.len() || length == 0.0) {
                continue;
            }
            let tip = (0..3).map(|i| (tips[to][i] - tips[from][i]).powi(2)).sum::<f64>().sqrt();
            let tangent: Vec<f64> = steps.iter().map(|step| step / length).collect();
            let of_joints = limits.iter().zip(&tangent).map(|(limits, t)| limits.velocity / t.abs());
            let fastest = of_joints.fold(feed * length / tip, f64::min);
            chords.push(Chord { length, tangent, fastest });
            from = to;
        }
        Self { chords, limits }
    }

    fn reversed(&self) -> Self {
        let mut path = self.clone();
        path.chords.reverse();
        path
    }

    /// Returns the shortest time from rest to rest that the search finds below `worst`, s.
    pub fn shortest_time(&self, grid: Grid, worst: f64) -> Option<f64> {
        let count = self.chords.len();
        let ahead: Vec<usize> = JOINED_AT.iter().map(|part| (count as f64 * part) as usize).collect();
        let back: Vec<usize> = ahead.iter().rev().map(|ahead| count - ahead).collect();
        let mut best = worst;
        let ends = self.reversed().search(grid, &back, worst);
        for ((ahead, states), (_, mut ends)) in
            self.search(grid, &ahead, worst).into_iter().zip(ends.into_iter().rev())
        {
            ends.sort_unstable_by(|a, b| a.speed.total_cmp(&b.speed));
            for here in states {
                let next = self.next(ahead, &here);
                let [low, high] = next.interval();
                let from = ends.partition_point(|end| end.speed < low);
                for end in ends[from..].iter().take_while(|end| end.speed <= high) {
                    let time = here.time + end.time;
                    if time < best && next.is_allowed(end.speed) {
                        let middle = Reached { time, before: here.speed, speed: end.speed };
                        if self.next(ahead + 1, &middle).is_allowed(end.before) {
                            best = time;
                        }
                    }
                }
            }
        }
        (best < worst).then_some(best)
    }

    /// Returns the largest speed and a bound of the acceleration along the path.
    fn scale(&self) -> [f64; 2] {
        let fastest = self.chords.iter().map(|chord| chord.fastest).fold(0.0, f64::max);
        [fastest, self.chords.iter().map(|chord| self.steepest(chord)).fold(0.0, f64::max)]
    }

    /// Returns a bound of the acceleration along a chord.
    fn steepest(&self, chord: &Chord) -> f64 {
        let terms = chord.tangent.iter().zip(&self.limits).map(|(t, limits)| t.abs() * limits.acceleration);
        let square: f64 = chord.tangent.iter().map(|t| t * t).sum();
        terms.sum::<f64>() / square
    }

    /// Returns a lower bound of the time from each chord to the end, by the limits of speed and acceleration.
    fn bounds_to_go(&self) -> Vec<f64> {
        let mut bounds = vec![0.0; self.chords.len() + 1];
        let mut square = 0.0;
        for (k, chord) in self.chords.iter().enumerate().rev() {
            let next = self.chords.get(k + 1).map_or(chord.length, |next| next.length);
            square += 1.05 * self.steepest(chord) * (chord.length + next);
            square = square.min(chord.fastest.powi(2));
            bounds[k] = bounds[k + 1] + chord.length / square.sqrt();
        }
        bounds
    }

    /// Returns the states after each of the increasing numbers of chords in `counts`, at rest before the first chord.
    fn search(&self, grid: Grid, counts: &[usize], worst: f64) -> Vec<(usize, Vec<Reached>)> {
        let (bound, scale) = (self.bounds_to_go(), self.scale());
        let mut table: Vec<Option<[Reached; 2]>> = vec![None; (grid.speeds + 1) * (grid.accelerations + 1)];
        let (mut cells, mut speeds) = (Vec::new(), Vec::new());
        let (mut found, mut states) = (Vec::new(), self.first_states());
        for k in 1..counts.last().map_or(0, |count| *count) {
            let lengths = [k - 1, k].map(|k| self.chords[k].length);
            for state in &states {
                self.next_speeds(k, state, &mut speeds);
                for &speed in &speeds {
                    let time = state.time + lengths[1] / speed;
                    if time + bound[k + 1] >= worst {
                        continue;
                    }
                    let next = Reached { time, before: state.speed, speed };
                    let acceleration = next.acceleration(lengths);
                    let cell = grid.cell(&next, acceleration, scale);
                    let Some([earliest, slowing]) = &mut table[cell] else {
                        table[cell] = Some([next; 2]);
                        cells.push(cell);
                        continue;
                    };
                    if time < earliest.time {
                        *earliest = next;
                    }
                    if acceleration < slowing.acceleration(lengths) {
                        *slowing = next;
                    }
                }
            }
            states.clear();
            for [earliest, slowing] in cells.drain(..).filter_map(|cell: usize| table[cell].take()) {
                states.push(earliest);
                states.extend((slowing.speed != earliest.speed).then_some(slowing));
            }
            if counts.contains(&(k + 1)) {
                found.push((k + 1, states.clone()));
            }
        }
        found
    }

    /// Returns states at the end of the first chord, with constant jerk from rest.
    fn first_states(&self) -> Vec<Reached> {
        let chord = &self.chords[0];
        let mut highest = chord.fastest;
        for (limits, t) in self.limits.iter().zip(&chord.tangent) {
            let (t, length) = (t.abs(), chord.length);
            // Constant jerk from rest, up to the limit of the acceleration.
            highest = highest.min((limits.jerk * length * length / t / 6.0).cbrt());
            highest = highest.min((limits.acceleration * length / t / 6.0).sqrt());
        }
        let speeds = (1..=8).map(|i| highest * f64::from(i) / 8.0);
        speeds.map(|speed| Reached { time: chord.length / speed, before: 0.0, speed }).collect()
    }

    /// Replaces `speeds` by speeds on chord `k` within the limits.
    fn next_speeds(&self, k: usize, state: &Reached, speeds: &mut Vec<f64>) {
        speeds.clear();
        let next = self.next(k, state);
        let [low, high] = next.interval();
        if low > high {
            return;
        }
        let candidates = (0..=PARTS).map(|i| low + (high - low) * i as f64 / PARTS as f64);
        let further =
            [state.speed, self.chords[k].fastest].into_iter().filter(|speed| low < *speed && *speed < high);
        speeds.extend(candidates.chain(further).filter(|speed| next.is_allowed(*speed)));
        let Some(&inside) = speeds.first() else { return };
        for end in [low, high] {
            if !next.is_allowed(end) {
                speeds.push(next.last_allowed(inside, end));
            }
        }
    }

    fn next<'a>(&'a self, k: usize, state: &Reached) -> NextChord<'a> {
        let (chord, here) = (&self.chords[k], &self.chords[k - 1]);
        let before = (state.before > 0.0).then(|| &self.chords[k - 2]);
        let mut next = NextChord {
            chord,
            limits: &self.limits,
            d0: before.map(|chord| chord.length / state.before),
            d1: here.length / state.speed,
            speeds: [0.0; JOINTS],
            accelerations: [0.0; JOINTS],
            guess: state.speed,
        };
        for j in 0..self.limits.len() {
            next.speeds[j] = here.tangent[j] * state.speed;
            if let (Some(before), Some(d0)) = (before, next.d0) {
                let speed = before.tangent[j] * state.before;
                next.accelerations[j] = 2.0 * (next.speeds[j] - speed) / (d0 + next.d1);
            }
        }
        next
    }
}

impl Reached {
    /// Returns the acceleration from one to the other of the last two chords, which have `lengths`.
    fn acceleration(&self, lengths: [f64; 2]) -> f64 {
        2.0 * (self.speed - self.before) / (lengths[0] / self.before + lengths[1] / self.speed)
    }
}

impl Grid {
    /// Returns the cell of a state with an acceleration; `fastest` and `steepest` are the largest values.
    fn cell(self, state: &Reached, acceleration: f64, [fastest, steepest]: [f64; 2]) -> usize {
        let along = (0.5 * (acceleration / steepest + 1.0)).clamp(0.0, 1.0) * self.accelerations as f64;
        let speed = (state.speed / fastest).sqrt().min(1.0) * self.speeds as f64;
        speed.round() as usize * (self.accelerations + 1) + along.round() as usize
    }
}

/// Next chord after a state.
struct NextChord<'a> {
    chord: &'a Chord,
    limits: &'a [LimitsConfig],
    /// Duration of the chord before the last one, s; `None` at rest.
    d0: Option<f64>,
    /// Duration of the last chord, s.
    d1: f64,
    /// Speed of each joint on the last chord, and acceleration to it.
    speeds: [f64; JOINTS],
    accelerations: [f64; JOINTS],
    /// Speed along the last chord.
    guess: f64,
}

impl NextChord<'_> {
    /// Returns the times between the speeds and between the accelerations if the next chord takes `d2`, s.
    fn distances(&self, d2: f64) -> (f64, f64) {
        (0.5 * (self.d1 + d2), (self.d0.unwrap_or(self.d1) + self.d1 + d2) / 3.0)
    }

    /// Returns the interval of the speed within the limits if the duration is `d2`, s; empty if the first is larger.
    fn interval_of(&self, d2: f64) -> [f64; 2] {
        let (half, third) = self.distances(d2);
        let (mut low, mut high) = (0.0_f64, self.chord.fastest);
        for (j, limits) in self.limits.iter().enumerate() {
            let (t, a) = (self.chord.tangent[j], self.accelerations[j]);
            let least = (-limits.acceleration).max(a - limits.jerk * third);
            let most = limits.acceleration.min(a + limits.jerk * third);
            if t.abs() > NO_MOTION {
                let ends = [least, most].map(|a| (self.speeds[j] + half * a) / t);
                low = low.max(ends[0].min(ends[1]));
                high = high.min(ends[0].max(ends[1]));
            }
        }
        [low, high]
    }

    /// Returns the interval of the speed within the limits, approximately.
    fn interval(&self) -> [f64; 2] {
        let mut ends = [self.guess; 2];
        for (i, end) in ends.iter_mut().enumerate() {
            for _ in 0..ITERATIONS {
                *end = self.interval_of(self.chord.length / *end)[i].max(SLOWEST * self.guess);
            }
        }
        ends
    }

    fn is_allowed(&self, speed: f64) -> bool {
        if speed > self.chord.fastest * (1.0 + TOLERANCE) {
            return false;
        }
        let d2 = self.chord.length / speed;
        let (half, third) = self.distances(d2);
        self.limits.iter().enumerate().all(|(j, limits)| {
            let acceleration = (self.chord.tangent[j] * speed - self.speeds[j]) / half;
            let jerk = (acceleration - self.accelerations[j]) / third;
            acceleration.abs() <= limits.acceleration * (1.0 + TOLERANCE)
                && jerk.abs() <= limits.jerk * (1.0 + TOLERANCE)
        })
    }

    /// Returns the allowed speed that is nearest to `outside`, on the side of `inside`.
    fn last_allowed(&self, mut inside: f64, mut outside: f64) -> f64 {
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (inside + outside);
            *(if self.is_allowed(middle) { &mut inside } else { &mut outside }) = middle;
        }
        inside
    }
}
