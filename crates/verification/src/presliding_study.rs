//! Study of the identified presliding over random axes and recordings.

use std::f64::consts::{PI, TAU};
use std::fmt;

use virtual_axes_core::config::{AxisKind, MachineConfig, Parameters};
use virtual_axes_core::statistics::quantile;
use virtual_axes_core::units::{DEGREE, MILLISECOND_NS, NEWTON_PER_MICROMETER, seconds};
use virtual_axes_identify::identify::{
    FeedforwardMode, IdentificationInput, IdentificationOptions, RefinementScope, identify,
};
use virtual_axes_identify::recording::{Conditioning, condition};

use crate::fixtures::machines::set;
use crate::fixtures::recordings::{CurrentNoise, Disturbance, axis_index, record};
use crate::stress::random::RandomSource;

/// Random stream of a seed.
const STREAM: u64 = 400;
/// Axes of the default machine.
const AXES: [&str; 4] = ["x", "y", "z", "c"];
/// Standard errors of a 95 % interval.
const INTERVAL: f64 = 1.96;

/// Result of one random axis.
#[derive(Debug, Clone, PartialEq)]
pub struct PreslidingCase {
    /// Seed, axis and conditions.
    pub name: String,
    /// True stiffness at the axis, N/m or N·m/rad; none for an axis without presliding.
    pub truth: Option<f64>,
    /// True damping at the axis, N·s/m or N·m·s/rad.
    pub damping: f64,
    /// Identified stiffness and the bounds of its interval.
    pub found: Option<[f64; 3]>,
    /// Identified damping and its standard error.
    pub found_damping: Option<(f64, f64)>,
    /// Code and text of the finding without a stiffness.
    pub reason: Option<(&'static str, String)>,
    /// Stiffness below which presliding is excluded; none without such a statement.
    pub excluded: Option<f64>,
}

/// Study over many random axes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PreslidingStudy {
    cases: Vec<PreslidingCase>,
}

impl PreslidingStudy {
    /// Returns the cases so far.
    pub fn cases(&self) -> &[PreslidingCase] {
        &self.cases
    }

    /// Identifies the axis of a seed and returns its case.
    ///
    /// The friction, inertia, presliding, encoder, noise, sampling period and motion are random; one axis in four has no
    /// presliding. The machine file has another inertia and friction.
    ///
    /// # Panics
    /// If the default machine cannot be changed or simulated.
    pub fn add(&mut self, seed: u64) -> &PreslidingCase {
        self.cases.push(study(seed));
        &self.cases[self.cases.len() - 1]
    }
}

/// Axis with hidden values.
struct Hidden {
    axis: &'static str,
    machine: Parameters,
    guess: Parameters,
    config: MachineConfig,
    stiffness: Option<f64>,
    damping: f64,
}

fn hidden(random: &mut RandomSource) -> Hidden {
    let axis = AXES[random.below(AXES.len())];
    let mut machine = Parameters::embedded_default().expect("the default machine");
    let config = machine.machine_config().expect("the default machine");
    let known = config.axes()[axis_index(&config, axis)].clone();
    let factor = random.between(0.6, 1.6);
    let friction = [("friction.a", known.friction.a), ("friction.c", known.friction.c)];
    for (key, value) in friction {
        set(&mut machine, axis, key, value * factor);
    }
    let guess_factor = random.between(0.7, 1.4);
    let mut guess = machine.clone();
    for (key, value) in friction {
        set(&mut guess, axis, key, value * factor * guess_factor);
    }
    set(&mut guess, axis, "motor.inertia_kg_m2", known.motor.inertia * random.between(0.95, 1.05));
    let (kt, ratio) = (known.motor.torque_constant, known.transmission_ratio);
    let level = factor * (known.friction.a + known.friction.c) * kt / ratio;
    let (low, high) = match known.kind() {
        AxisKind::Linear => (2e-6, 80e-6),
        AxisKind::Rotary => (2e-3 * DEGREE, 80e-3 * DEGREE),
    };
    let stiffness = level / random.log_between(low, high);
    let mass = known.motor.inertia / (ratio * ratio);
    let damping = 2.0 * (stiffness * mass).sqrt() * random.between(0.0, 1.0) * random.below(2) as f64;
    let is_present = random.chance(0.75);
    if is_present {
        let (keys, unit) = match known.kind() {
            AxisKind::Linear => (
                ["friction.presliding_stiffness_n_um", "friction.presliding_damping_n_s_m"],
                NEWTON_PER_MICROMETER,
            ),
            AxisKind::Rotary => {
                (["friction.presliding_stiffness_nm_rad", "friction.presliding_damping_nm_s_rad"], 1.0)
            }
        };
        set(&mut machine, axis, keys[0], stiffness / unit);
        set(&mut machine, axis, keys[1], damping);
    }
    let config = machine.machine_config().expect("a machine");
    Hidden { axis, machine, guess, config, stiffness: is_present.then_some(stiffness), damping }
}

/// Returns setpoints of a motion to and fro: a sine, or a triangle with rounded corners, of random size and period.
fn motion(random: &mut RandomSource, kind: AxisKind, tsp: f64) -> (String, Vec<f64>) {
    let unit = match kind {
        AxisKind::Linear => 1e-3,
        AxisKind::Rotary => DEGREE,
    };
    let (size, period) = (random.log_between(0.3, 4.0), random.log_between(1.5, 8.0));
    let rounds = 4 + random.below(7);
    let is_sine = random.chance(0.5);
    let at = |t: f64| {
        let phase = TAU * t / period;
        let wave = if is_sine { (1.0 - phase.cos()) / 2.0 } else { (0.98 * phase.cos()).acos() / PI };
        unit * size * wave
    };
    let rest = |t: f64| at((t - 1.0).clamp(0.0, rounds as f64 * period)) - at(0.0);
    let count = ((rounds as f64 * period + 2.0) / tsp) as usize;
    let name =
        format!("{rounds} {} of {size:.2} in {period:.1} s", if is_sine { "sines" } else { "triangles" });
    (name, (0..count).map(|k| rest(k as f64 * tsp)).collect())
}

fn study(seed: u64) -> PreslidingCase {
    let mut random = RandomSource::new(seed, STREAM);
    let hidden = hidden(&mut random);
    let (config, axis) = (&hidden.config, hidden.axis);
    let kind = config.axes()[axis_index(config, axis)].kind();
    let (program, psec) = motion(&mut random, kind, seconds(config.periods().position));
    let increment = random.log_between(0.02, 2.0);
    let noise = random.between(0.002, 0.04);
    let milliseconds = [1, 2, 6][random.below(3)];
    let disturbance = Disturbance {
        sample_ticks: Some((milliseconds * MILLISECOND_NS / config.periods().current) as u64),
        resolution: increment * if kind == AxisKind::Linear { 1e-6 } else { 1e-3 * DEGREE },
        noise: CurrentNoise::OfLargest(noise),
        seed,
        ..Disturbance::default()
    };
    let mut raw = record(&hidden.machine.machine_config().expect("a machine"), axis, &psec, &disturbance);
    // Without setpoints nothing but the plant is identified.
    raw.psec = None;
    let guess = hidden.guess;
    let guess = guess.machine_config().expect("a machine");
    let start = &guess.axes()[axis_index(&guess, axis)];
    // Presliding delays the current behind the motion, as a lag of the recording does.
    let conditioning = Conditioning { current_lag: Some(0.0), ..Conditioning::default() };
    let conditioned = condition(&raw, start, &guess.periods(), &conditioning);
    let name = format!(
        "{seed} {axis} {program}, {milliseconds} ms, increment {increment:.3}, noise {:.1} %",
        100.0 * noise
    );
    let mut case = PreslidingCase {
        name,
        truth: hidden.stiffness,
        damping: hidden.damping,
        found: None,
        found_damping: None,
        reason: None,
        excluded: None,
    };
    let signals = match conditioned {
        Ok((signals, _)) => signals,
        Err(error) => {
            case.reason = Some(("conditioning", error.to_string()));
            return case;
        }
    };
    let options =
        IdentificationOptions { refine: RefinementScope::NONE, presliding: true, ..Default::default() };
    let input = IdentificationInput { signals: &signals, feedforward: Some(FeedforwardMode::Both) };
    let found = identify(&[input], start, &guess.periods(), &options);
    if let Some(fit) = &found.presliding {
        case.found = Some([fit.stiffness, fit.interval[0], fit.interval[1]]);
        case.found_damping = fit.damping;
    } else {
        let codes = ["no-presliding", "no-reversals", "no-sliding"];
        case.reason = found
            .findings
            .iter()
            .find(|finding| codes.contains(&finding.code))
            .map(|finding| (finding.code, finding.what.clone()));
        case.excluded = found.excluded_presliding;
    }
    case
}

impl fmt::Display for PreslidingCase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.name)?;
        match self.truth {
            Some(truth) => write!(f, "σ0 {truth:.3e}, σ1 {:.3e}; ", self.damping)?,
            None => write!(f, "without presliding; ")?,
        }
        match (self.found, &self.reason) {
            (Some([value, low, high]), _) => {
                write!(f, "found {value:.3e} ({low:.3e} … {high:.3e})")?;
                if let Some(truth) = self.truth {
                    let is_inside = (low..=high).contains(&truth);
                    let error = 100.0 * (value / truth - 1.0);
                    write!(f, " {error:+.1} %{}", if is_inside { "" } else { " OUTSIDE" })?;
                }
                if let Some((value, error)) = self.found_damping {
                    write!(f, "; σ1 {value:.3e} ± {error:.1e}")?;
                }
                Ok(())
            }
            (None, Some((code, text))) => {
                write!(f, "{code}: {text}")?;
                let is_wrong =
                    self.excluded.zip(self.truth).is_some_and(|(excluded, truth)| truth < excluded);
                write!(f, "{}", if is_wrong { " WRONG BOUND" } else { "" })
            }
            (None, None) => write!(f, "no finding"),
        }
    }
}

impl fmt::Display for PreslidingStudy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let with = || self.cases.iter().filter_map(|case| case.truth.map(|truth| (case, truth)));
        let found = || with().filter_map(|(case, truth)| case.found.map(|found| (case, truth, found)));
        let without = || self.cases.iter().filter(|case| case.truth.is_none());
        writeln!(f, "{:56} {:>7}", "axes with presliding", with().count())?;
        writeln!(f, "{:56} {:>7}", "– with an identified stiffness", found().count())?;
        let mut errors: Vec<f64> =
            found().map(|(_, truth, [value, ..])| (value / truth - 1.0).abs()).collect();
        let mut widths: Vec<f64> =
            found().map(|(_, _, [value, low, high])| 0.5 * (high - low) / value).collect();
        for (name, values) in
            [("error of the stiffness, %", &mut errors), ("half width of the interval, %", &mut widths)]
        {
            let mut at = |q: f64| 100.0 * quantile(values, q).unwrap_or(f64::NAN);
            let row = [at(0.5), at(0.9), at(1.0)];
            writeln!(f, "{name:56} {:7.2} {:7.2} {:7.2}  median, 90 %, largest", row[0], row[1], row[2])?;
        }
        let inside = found().filter(|(_, truth, [_, low, high])| (low..=high).contains(&truth)).count();
        let share = |part: usize, all: usize| 100.0 * part as f64 / all.max(1) as f64;
        let name = "95 % interval contains the true stiffness";
        writeln!(f, "{name:56} {:7.1} %", share(inside, found().count()))?;
        let damped = || found().filter_map(|(case, ..)| case.found_damping.map(|found| (case, found)));
        let right = damped()
            .filter(|(case, (value, error))| (value - case.damping).abs() <= INTERVAL * error)
            .count();
        writeln!(f, "{:56} {:>7}", "– with an identified damping", damped().count())?;
        let name = "95 % interval contains the true damping";
        writeln!(f, "{name:56} {:7.1} %", share(right, damped().count()))?;
        let bounds = || with().filter_map(|(case, truth)| case.excluded.map(|excluded| (truth, excluded)));
        let wrong = bounds().filter(|(truth, excluded)| truth < excluded).count();
        writeln!(f, "{:56} {:>7}", "– without a number, a bound on the stiffness", bounds().count())?;
        writeln!(f, "{:56} {wrong:>7}", "– of these with a true stiffness in the excluded range")?;
        writeln!(f, "{:56} {:>7}", "axes without presliding", without().count())?;
        let false_alarms = without().filter(|case| case.found.is_some()).count();
        writeln!(f, "{:56} {false_alarms:>7}", "– with an identified stiffness")
    }
}
