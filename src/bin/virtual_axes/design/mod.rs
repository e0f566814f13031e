//! `virtual_axes design`: design of position controllers in RST form, with closed-loop poles and margins.

pub mod design_output;

use std::error::Error;

use clap::ArgGroup;
use nalgebra::Complex;
use virtual_axes_core::config::{AxisConfig, DEFAULT_MACHINE, Parameters, Periods, Value};
use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{
    ControlWeight, GpcTuning, MAX_GAIN, PidTuning, PolePlacement, PredictionModel, gpc, margins,
    p_controller, pi_controller, pid_controller, pole_pair, pole_placement, poles, require_stable,
};
use virtual_axes_core::machine::prediction_model;
use virtual_axes_core::units::{MILLISECOND, POSITION_GAIN, Rounded};

use crate::arguments::axis::selected_axes;
use crate::arguments::output_arguments::{OutputArguments, OutputFormat};
use crate::arguments::variant;
use design_output::AxisDesign;

/// Smallest `--gain`, (m/min)/mm. Below it the rounding error of the feedforward is not negligible.
const LEAST_GAIN: f64 = 1e-6;

/// Arguments of `virtual_axes design`.
#[derive(Debug, clap::Args)]
pub struct DesignArguments {
    #[command(subcommand)]
    method: DesignMethod,
}

#[derive(Debug, clap::Subcommand)]
enum DesignMethod {
    /// Design a generalized predictive controller (Prévost section 5); omitted values are those of the
    /// machine file.
    Gpc {
        /// N1, first position cycle of the prediction horizon.
        #[arg(long)]
        n1: Option<usize>,
        /// N2, last position cycle of the prediction horizon.
        #[arg(long)]
        n2: Option<usize>,
        /// Nu, control horizon in position cycles.
        #[arg(long)]
        nu: Option<usize>,
        /// Weight of the control increments relative to trace(GᵀG): λ / trace(GᵀG).
        #[arg(long, allow_negative_numbers = true, conflicts_with = "lambda")]
        lambda_rel: Option<f64>,
        /// Weight λ of the control increments.
        #[arg(long, allow_negative_numbers = true)]
        lambda: Option<f64>,
        #[command(flatten)]
        common: CommonDesignArguments,
    },
    /// Design a proportional controller with velocity feedforward.
    P {
        #[command(flatten)]
        proportional: ProportionalArguments,
        #[command(flatten)]
        common: CommonDesignArguments,
    },
    /// Design a PI controller.
    Pi {
        #[command(flatten)]
        proportional: ProportionalArguments,
        /// Integral time Ti, ms.
        #[arg(long, value_name = "MS", allow_negative_numbers = true)]
        integral_time_ms: f64,
        #[command(flatten)]
        common: CommonDesignArguments,
    },
    /// Design a PID controller with derivative action on the position.
    #[command(
        override_usage = "virtual_axes design pid [OPTIONS] --integral-time-ms <MS>\n           --derivative-time-ms <MS>"
    )]
    Pid {
        #[command(flatten)]
        proportional: ProportionalArguments,
        /// Integral time Ti, ms.
        #[arg(long, value_name = "MS", allow_negative_numbers = true)]
        integral_time_ms: f64,
        /// Derivative time Td, ms.
        #[arg(long, value_name = "MS", allow_negative_numbers = true)]
        derivative_time_ms: f64,
        /// Filter time Tf of the derivative, ms; 0 disables the filter.
        #[arg(long, allow_negative_numbers = true, default_value_t = 0.0)]
        filter_time_ms: f64,
        #[command(flatten)]
        common: CommonDesignArguments,
    },
    /// Design by pole placement; unspecified closed-loop poles are at 0.
    #[command(group(ArgGroup::new("poles").args(["bandwidth", "pole"]).required(true).multiple(true)))]
    Poles {
        /// Natural frequency of a pole pair, rad/s.
        #[arg(long, allow_negative_numbers = true)]
        bandwidth: Option<f64>,
        /// Damping ratio of that pole pair.
        #[arg(long, allow_negative_numbers = true, requires = "bandwidth", default_value_t = 0.7)]
        damping: f64,
        /// Pole in the z plane; the conjugate of a complex pole is added; can be repeated.
        #[arg(long, value_name = "RE[,IM]", allow_hyphen_values = true, value_parser = pole)]
        pole: Vec<Complex<f64>>,
        /// Add integral action, which rejects constant disturbance torques.
        #[arg(long)]
        integrator: bool,
        /// Weight of the velocity feedforward [default: machine file].
        #[arg(long, allow_negative_numbers = true)]
        feedforward: Option<f64>,
        #[command(flatten)]
        common: CommonDesignArguments,
    },
}

/// Arguments of P, PI and PID controllers.
#[derive(Debug, clap::Args)]
struct ProportionalArguments {
    /// Gain Kp, (m/min)/mm or (1000 °/min)/° [default: machine file].
    #[arg(long, allow_negative_numbers = true)]
    gain: Option<f64>,
    /// Weight of the velocity feedforward [default: machine file].
    #[arg(long, allow_negative_numbers = true)]
    feedforward: Option<f64>,
}

/// Arguments of all design methods.
#[derive(Debug, clap::Args)]
struct CommonDesignArguments {
    /// Built-in machine or machine file.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// Set a parameter, for example `x.velocity_loop.gain=4.5`; can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Axes to design for [default: all].
    #[arg(long, value_name = "AXIS[,AXIS]…", value_delimiter = ',')]
    axis: Vec<String>,
    /// Accept an unstable closed loop.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    output: OutputArguments,
    /// Print the controllers as parameters of a machine file (ROS 2 parameter file).
    #[arg(long, conflicts_with_all = ["quiet", "json", "csv"])]
    yaml: bool,
}

/// Designs the controllers and returns figures, JSON or YAML.
pub fn run(arguments: &DesignArguments) -> Result<String, Box<dyn Error>> {
    let (method, common) = match &arguments.method {
        DesignMethod::Gpc { common, .. } => ("gpc", common),
        DesignMethod::P { common, .. } => ("p", common),
        DesignMethod::Pi { common, .. } => ("pi", common),
        DesignMethod::Pid { common, .. } => ("pid", common),
        DesignMethod::Poles { common, .. } => ("poles", common),
    };
    let machine = Parameters::load(&common.machine, crate::builtin::MACHINES)?;
    let parameters = variant::parameters(&machine, None, &common.set, &[])?;
    let config = parameters.machine_config()?;
    let mut designs = Vec::new();
    for axis in selected_axes(config.axes(), &common.axis)? {
        let design = design_axis(&arguments.method, &parameters, axis, &config.periods(), common.force)
            .map_err(|error| format!("axis {}: {error}", axis.name()))?;
        designs.push(design);
    }
    if common.yaml {
        return Ok(design_output::yaml(&designs));
    }
    Ok(match common.output.format() {
        OutputFormat::Json => format!("{:#}\n", design_output::object(config.name(), method, &designs)),
        OutputFormat::Csv => design_output::csv(&designs),
        OutputFormat::Quiet => design_output::verdict(&designs),
        OutputFormat::Text => design_output::text(method, &designs),
    })
}

fn design_axis(
    method: &DesignMethod,
    parameters: &Parameters,
    axis: &AxisConfig,
    periods: &Periods,
    force: bool,
) -> Result<AxisDesign, Box<dyn Error>> {
    let model = prediction_model(axis, periods)?;
    let preset = MachinePreset { parameters, axis: axis.name() };
    let (rst, tuning) = controller(method, &preset, &model)?;
    let rst =
        require_stable(&model, rst, force).map_err(|error| format!("{error}; use --force to accept it"))?;
    let (poles, margins) = (poles(&model, &rst)?, margins(&model, &rst));
    Ok(AxisDesign { axis: axis.name().to_owned(), tuning, model, rst, poles, margins })
}

/// Controller polynomials with names and values of the design parameters.
type TunedController = (Rst, Vec<(&'static str, f64)>);

fn controller(
    method: &DesignMethod,
    preset: &MachinePreset<'_>,
    model: &PredictionModel,
) -> Result<TunedController, Box<dyn Error>> {
    let period = model.period();
    Ok(match method {
        DesignMethod::Gpc { n1, n2, nu, lambda_rel, lambda, .. } => {
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
        DesignMethod::P { proportional, .. } => {
            let (gain, feedforward, tuning) = preset.proportional(proportional)?;
            (p_controller(gain, feedforward, period)?, tuning)
        }
        DesignMethod::Pi { proportional, integral_time_ms, .. } => {
            let (gain, feedforward, mut tuning) = preset.proportional(proportional)?;
            tuning.push(("integral_time_ms", *integral_time_ms));
            (pi_controller(gain, integral_time_ms * MILLISECOND, feedforward, period)?, tuning)
        }
        DesignMethod::Pid { proportional, integral_time_ms, derivative_time_ms, filter_time_ms, .. } => {
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
        DesignMethod::Poles { bandwidth, damping, pole, integrator, feedforward, .. } => {
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
            let placement = PolePlacement { poles, integrator: *integrator, velocity_feedforward };
            (pole_placement(model, &placement)?, tuning)
        }
    })
}

/// Parameter key of the weight of the velocity feedforward.
const FEEDFORWARD: &str = "feedforward.velocity";

/// Parameters of one axis in the machine file, which are the defaults of the options.
struct MachinePreset<'a> {
    parameters: &'a Parameters,
    axis: &'a str,
}

impl MachinePreset<'_> {
    fn get(&self, key: &str) -> Option<Value> {
        self.parameters.get(&format!("{}.{key}", self.axis))
    }

    fn count(&self, given: Option<usize>, key: &str) -> Result<usize, Box<dyn Error>> {
        match (given, self.get(key)) {
            (Some(count), _) => Ok(count),
            (None, Some(Value::Integer(count))) => Ok(usize::try_from(count)?),
            _ => Err(format!("{key} is not set; set it in the machine file or with --set").into()),
        }
    }

    fn number(&self, given: Option<f64>, key: &str) -> Result<f64, Box<dyn Error>> {
        match (given, self.get(key)) {
            (Some(number), _) | (None, Some(Value::Double(number))) => Ok(number),
            _ => Err(format!("{key} is not set; set it in the machine file or with --set").into()),
        }
    }

    /// Returns the weight of the control increments. In the machine file λ has priority over λ_rel.
    fn weight(&self, lambda_rel: Option<f64>, lambda: Option<f64>) -> Result<ControlWeight, Box<dyn Error>> {
        Ok(match (lambda_rel, lambda, self.get("position_loop.gpc.lambda")) {
            (_, Some(lambda), _) | (None, None, Some(Value::Double(lambda))) => {
                ControlWeight::Absolute(lambda)
            }
            _ => ControlWeight::Relative(self.number(lambda_rel, "position_loop.gpc.lambda_rel")?),
        })
    }

    /// Returns Kp in s⁻¹, the weight of the feedforward, and both in units of the options.
    fn proportional(&self, given: &ProportionalArguments) -> Result<Gains, Box<dyn Error>> {
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

/// Parses a pole `RE` or `RE,IM`.
fn pole(text: &str) -> Result<Complex<f64>, String> {
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_| format!("{text:?} is not a number"));
    match text.split_once(',') {
        Some((re, im)) => Ok(Complex::new(number(re)?, number(im)?)),
        None => Ok(Complex::new(number(text)?, 0.0)),
    }
}
