//! `virtual_axes design`: position controllers in RST form, with their poles and margins.

use std::error::Error;

use nalgebra::Complex;
use virtual_axes_core::config::{AxisConfig, DEFAULT_MACHINE, Parameters, Periods, Value};
use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{
    DesignError, GpcTuning, MAX_GAIN, Margins, PidTuning, PolePlacement, PredictionModel, ControlWeight, require_stable, gpc,
    margins, p_controller, pi_controller, pid_controller, pole_pair, pole_placement, poles,
};
use virtual_axes_core::machine::prediction_model;
use virtual_axes_core::units::{MILLISECOND, POSITION_GAIN, Rounded};

use crate::{design_output, variant};

/// Least `--gain`, (m/min)/mm: with less, what rounding leaves of the feedforward counts beside it.
const LEAST_GAIN: f64 = 1e-6;

/// Which controllers.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    method: Method,
}

#[derive(Debug, clap::Subcommand)]
enum Method {
    /// Generalized predictive control (Prévost section 5); what is left out is the machine file's.
    Gpc {
        /// N1, first period of the prediction horizon.
        #[arg(long)]
        n1: Option<usize>,
        /// N2, last period of the prediction horizon.
        #[arg(long)]
        n2: Option<usize>,
        /// Nu, periods of the control horizon.
        #[arg(long)]
        nu: Option<usize>,
        /// λ / trace(GᵀG), weight of the control increments.
        #[arg(long, allow_negative_numbers = true, conflicts_with = "lambda")]
        lambda_rel: Option<f64>,
        /// λ, weight of the control increments.
        #[arg(long, allow_negative_numbers = true)]
        lambda: Option<f64>,
        #[command(flatten)]
        common: Common,
    },
    /// Proportional, with velocity feedforward.
    P {
        #[command(flatten)]
        proportional: Proportional,
        #[command(flatten)]
        common: Common,
    },
    /// Proportional and integral.
    Pi {
        #[command(flatten)]
        proportional: Proportional,
        /// Ti, ms.
        #[arg(long, allow_negative_numbers = true)]
        integral_time_ms: f64,
        #[command(flatten)]
        common: Common,
    },
    /// Proportional, integral, and derivative of the position.
    Pid {
        #[command(flatten)]
        proportional: Proportional,
        /// Ti, ms.
        #[arg(long, allow_negative_numbers = true)]
        integral_time_ms: f64,
        /// Td, ms.
        #[arg(long, allow_negative_numbers = true)]
        derivative_time_ms: f64,
        /// Tf of the derivative's filter, ms; 0 is a plain difference.
        #[arg(long, allow_negative_numbers = true, default_value_t = 0.0)]
        filter_time_ms: f64,
        #[command(flatten)]
        common: Common,
    },
    /// By placing the closed loop's poles; those not asked for lie at 0.
    Poles {
        /// Natural frequency of a pair of poles, rad/s.
        #[arg(long, allow_negative_numbers = true, required_unless_present = "pole")]
        bandwidth: Option<f64>,
        /// Damping of that pair.
        #[arg(long, allow_negative_numbers = true, requires = "bandwidth", default_value_t = 0.7)]
        damping: f64,
        /// A pole in z; with an imaginary part its conjugate is placed too. Can be given several times.
        #[arg(long, value_name = "RE[,IM]", allow_hyphen_values = true, value_parser = pole)]
        pole: Vec<Complex<f64>>,
        /// Integral action: no constant torque leaves an error.
        #[arg(long)]
        integrator: bool,
        /// Weight of the velocity feedforward; the machine file's if it is not given.
        #[arg(long, allow_negative_numbers = true)]
        feedforward: Option<f64>,
        #[command(flatten)]
        common: Common,
    },
}

/// What P, PI and PID have in common.
#[derive(Debug, clap::Args)]
struct Proportional {
    /// Kp, (m/min)/mm or (1000 °/min)/°; the machine file's if it is not given.
    #[arg(long, allow_negative_numbers = true)]
    gain: Option<f64>,
    /// Weight of the velocity feedforward; the machine file's if it is not given.
    #[arg(long, allow_negative_numbers = true)]
    feedforward: Option<f64>,
}

/// What all methods have in common.
#[derive(Debug, clap::Args)]
struct Common {
    /// A shipped machine or a machine file.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// A parameter, as in `x.velocity_loop.gain=4.5`; can be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The axes to design for; all if none is given.
    #[arg(long, value_name = "AXIS[,AXIS]…", value_delimiter = ',')]
    axis: Vec<String>,
    /// Accept an unstable closed loop.
    #[arg(long)]
    force: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Print the lines of a machine file (a ROS 2 parameter file) that run these controllers.
    #[arg(long, conflicts_with = "json")]
    yaml: bool,
}

/// The controller of one axis and what its loop is like.
#[derive(Debug)]
pub struct Design {
    /// Name of the axis.
    pub axis: String,
    /// Name and value of what it was designed with.
    pub tuning: Vec<(&'static str, f64)>,
    /// What it was designed for.
    pub model: PredictionModel,
    /// The controller.
    pub rst: Rst,
    /// Poles of the closed loop, largest modulus first.
    pub poles: Vec<Complex<f64>>,
    /// Margins of a stable loop, or the pole that makes it unstable.
    pub margins: Result<Margins, DesignError>,
}

/// Designs the controllers; the text is the figures, JSON or YAML.
pub fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    let (method, common) = match &arguments.method {
        Method::Gpc { common, .. } => ("gpc", common),
        Method::P { common, .. } => ("p", common),
        Method::Pi { common, .. } => ("pi", common),
        Method::Pid { common, .. } => ("pid", common),
        Method::Poles { common, .. } => ("poles", common),
    };
    let machine = Parameters::load(&common.machine)?;
    let parameters = variant::parameters(&machine, None, &common.set, &[])?;
    let config = parameters.machine_config()?;
    let mut designs = Vec::new();
    for axis in chosen(config.axes(), &common.axis)? {
        let design = one(&arguments.method, &parameters, axis, &config.periods(), common.force)
            .map_err(|error| format!("axis {}: {error}", axis.name()))?;
        designs.push(design);
    }
    if common.json {
        let object = design_output::object(config.name(), method, &designs);
        return Ok(format!("{object:#}\n"));
    }
    Ok(if common.yaml { design_output::yaml(&designs) } else { design_output::text(method, &designs) })
}

/// The axes of these names, in the order of the machine; all without names.
fn chosen<'a>(axes: &'a [AxisConfig], names: &[String]) -> Result<Vec<&'a AxisConfig>, Box<dyn Error>> {
    if let Some(unknown) = names.iter().find(|name| axes.iter().all(|axis| axis.name() != name.as_str())) {
        let known: Vec<&str> = axes.iter().map(AxisConfig::name).collect();
        return Err(format!("--axis {unknown}: the machine has {}", known.join(", ")).into());
    }
    let wanted = |axis: &&AxisConfig| names.is_empty() || names.iter().any(|name| axis.name() == name);
    Ok(axes.iter().filter(wanted).collect())
}

fn one(
    method: &Method,
    parameters: &Parameters,
    axis: &AxisConfig,
    periods: &Periods,
    force: bool,
) -> Result<Design, Box<dyn Error>> {
    let model = prediction_model(axis, periods)?;
    let preset = Preset { parameters, axis: axis.name() };
    let (rst, tuning) = controller(method, &preset, &model)?;
    let rst = require_stable(&model, rst, force).map_err(|error| format!("{error}; --force accepts it"))?;
    let (poles, margins) = (poles(&model, &rst)?, margins(&model, &rst));
    Ok(Design { axis: axis.name().to_owned(), tuning, model, rst, poles, margins })
}

/// A controller and what it was designed with.
type Tuned = (Rst, Vec<(&'static str, f64)>);

fn controller(
    method: &Method,
    preset: &Preset<'_>,
    model: &PredictionModel,
) -> Result<Tuned, Box<dyn Error>> {
    let period = model.period();
    Ok(match method {
        Method::Gpc { n1, n2, nu, lambda_rel, lambda, .. } => {
            let tuning = GpcTuning {
                n1: preset.count(*n1, "position_loop.gpc.n1")?,
                n2: preset.count(*n2, "position_loop.gpc.n2")?,
                nu: preset.count(*nu, "position_loop.gpc.nu")?,
                weight: preset.weight(*lambda_rel, *lambda)?,
            };
            let weight = match tuning.weight {
                ControlWeight::Absolute(lambda) => ("lambda", lambda),
                ControlWeight::Relative(lambda_rel) => ("lambda_rel", lambda_rel),
            };
            let horizons = [("n1", tuning.n1), ("n2", tuning.n2), ("nu", tuning.nu)];
            let horizons = horizons.map(|(name, periods)| (name, periods as f64));
            (gpc(model, &tuning)?, horizons.into_iter().chain([weight]).collect())
        }
        Method::P { proportional, .. } => {
            let (gain, feedforward, tuning) = preset.proportional(proportional)?;
            (p_controller(gain, feedforward, period)?, tuning)
        }
        Method::Pi { proportional, integral_time_ms, .. } => {
            let (gain, feedforward, mut tuning) = preset.proportional(proportional)?;
            tuning.push(("integral_time_ms", *integral_time_ms));
            (pi_controller(gain, integral_time_ms * MILLISECOND, feedforward, period)?, tuning)
        }
        Method::Pid { proportional, integral_time_ms, derivative_time_ms, filter_time_ms, .. } => {
            let (gain, velocity_feedforward, mut tuning) = preset.proportional(proportional)?;
            tuning.extend([
                ("integral_time_ms", *integral_time_ms),
                ("derivative_time_ms", *derivative_time_ms),
                ("filter_time_ms", *filter_time_ms),
            ]);
            let pid_tuning = PidTuning {
                gain,
                integral_time: integral_time_ms * MILLISECOND,
                derivative_time: derivative_time_ms * MILLISECOND,
                filter_time: filter_time_ms * MILLISECOND,
                velocity_feedforward,
            };
            (pid_controller(&pid_tuning, period)?, tuning)
        }
        Method::Poles { bandwidth, damping, pole, integrator, feedforward, .. } => {
            let mut poles = Vec::new();
            let mut tuning = Vec::new();
            if let Some(bandwidth) = *bandwidth {
                poles.extend(pole_pair(bandwidth, *damping, period)?);
                tuning.extend([("bandwidth_rad_s", bandwidth), ("damping", *damping)]);
            }
            for pole in pole {
                poles.push(*pole);
                if pole.im != 0.0 {
                    poles.push(pole.conj());
                }
            }
            let velocity_feedforward = preset.number(*feedforward, FEEDFORWARD)?;
            tuning.push(("feedforward", velocity_feedforward));
            let wanted = PolePlacement { poles, integrator: *integrator, velocity_feedforward };
            (pole_placement(model, &wanted)?, tuning)
        }
    })
}

/// Key of the weight of the velocity feedforward.
const FEEDFORWARD: &str = "feedforward.velocity";

/// What the machine file says of an axis.
struct Preset<'a> {
    parameters: &'a Parameters,
    axis: &'a str,
}

impl Preset<'_> {
    fn get(&self, key: &str) -> Option<Value> {
        self.parameters.get(&format!("{}.{key}", self.axis))
    }

    fn count(&self, given: Option<usize>, key: &str) -> Result<usize, Box<dyn Error>> {
        match (given, self.get(key)) {
            (Some(count), _) => Ok(count),
            (None, Some(Value::Integer(count))) => Ok(usize::try_from(count)?),
            _ => Err(format!("{key} is not given").into()),
        }
    }

    fn number(&self, given: Option<f64>, key: &str) -> Result<f64, Box<dyn Error>> {
        match (given, self.get(key)) {
            (Some(number), _) | (None, Some(Value::Double(number))) => Ok(number),
            _ => Err(format!("{key} is not given").into()),
        }
    }

    /// λ of the machine file goes before its λ_rel, as in the axis.
    fn weight(&self, lambda_rel: Option<f64>, lambda: Option<f64>) -> Result<ControlWeight, Box<dyn Error>> {
        Ok(match (lambda_rel, lambda, self.get("position_loop.gpc.lambda")) {
            (_, Some(lambda), _) | (None, None, Some(Value::Double(lambda))) => ControlWeight::Absolute(lambda),
            _ => ControlWeight::Relative(self.number(lambda_rel, "position_loop.gpc.lambda_rel")?),
        })
    }

    /// Kp in s⁻¹, the weight of the feedforward, and both as given.
    fn proportional(&self, given: &Proportional) -> Result<Gains, Box<dyn Error>> {
        let gain = self.number(given.gain, "position_loop.gain")?;
        if given.gain.is_some() && !(gain >= LEAST_GAIN && gain * POSITION_GAIN <= MAX_GAIN) {
            let (gain, most) = (Rounded(gain), MAX_GAIN / POSITION_GAIN);
            return Err(format!(
                "--gain: {gain} must be at least {LEAST_GAIN:e} and at most {most:.0} (m/min)/mm or (1000 °/min)/°"
            )
            .into());
        }
        let feedforward = self.number(given.feedforward, FEEDFORWARD)?;
        Ok((gain * POSITION_GAIN, feedforward, vec![("gain", gain), ("feedforward", feedforward)]))
    }
}

type Gains = (f64, f64, Vec<(&'static str, f64)>);

/// `RE` or `RE,IM`.
fn pole(text: &str) -> Result<Complex<f64>, String> {
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_| format!("{text:?} is not a number"));
    match text.split_once(',') {
        Some((re, im)) => Ok(Complex::new(number(re)?, number(im)?)),
        None => Ok(Complex::new(number(text)?, 0.0)),
    }
}
