//! `virtual_axes pose`: forward kinematics, the tool pose in the workpiece frame.

use std::error::Error;

use serde_json::json;
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::kinematics::Kinematics;

use crate::arguments::trial_arguments::MachineArguments;

/// Largest position, m or rad. Larger positions have no micrometer resolution in f64 arithmetic.
const MAX_POSITION: f64 = 1e6;

/// Arguments of `virtual_axes pose`.
#[derive(Debug, clap::Args)]
pub struct PoseArguments {
    #[command(flatten)]
    machine: MachineArguments,
    /// Joint positions, m or rad, for example `x=0.1,a=0.5`; other joints are at 0; can be repeated.
    #[arg(long, required = true, value_name = "JOINT=POSITION,…", allow_hyphen_values = true)]
    joints: Vec<String>,
    /// Print a JSON list.
    #[arg(long)]
    json: bool,
}

/// Returns the pose for each set of joint positions, one per line or as JSON.
pub fn run(arguments: &PoseArguments) -> Result<String, Box<dyn Error>> {
    let config = arguments.machine.parameters()?.machine_config()?;
    let kinematics = Kinematics::new(&config);
    if !kinematics.has_linear_axis() && !kinematics.has_rotary_axis() {
        return Err(
            format!("{}: no joint is named x, y, z, a or c: there is no tool pose", config.name()).into()
        );
    }
    let mut lines = String::new();
    let mut list = Vec::new();
    for text in &arguments.joints {
        let joints = positions(&config, text).map_err(|reason| format!("--joints {text}: {reason}"))?;
        let pose = kinematics.forward(&joints);
        // Adding 0 removes the sign of a negative zero.
        let [[x, y, z], [u, v, w]]: [[f64; 3]; 2] =
            [pose.tip, pose.axis].map(|v| v.map(|value| value + 0.0).into());
        let axes = config.axes().iter().zip(&joints);
        let outside: Vec<&str> = axes
            .filter(|(axis, at)| axis.limits().is_outside_travel(**at))
            .map(|(axis, _)| axis.name())
            .collect();
        let remark = match outside.as_slice() {
            [] => String::new(),
            names => format!("; outside the travel limits: {}", names.join(", ")),
        };
        let [tip, axis] = [[x, y, z], [u, v, w]].map(|values| values.map(decimals).join(" "));
        lines += &format!("tip {tip} m, axis {axis}{remark}\n");
        // Quaternion in ROS order: x, y, z, w.
        let orientation: [f64; 4] = kinematics.orientation(&joints).coords.into();
        list.push(json!({
            "joints": joints, "tip": [x, y, z], "axis": [u, v, w], "orientation": orientation,
            "outside_travel_limits": outside,
        }));
    }
    Ok(if arguments.json { format!("{:#}\n", json!(list)) } else { lines })
}

/// Formats a coordinate with at most 12 decimals; the JSON output has all digits.
fn decimals(value: f64) -> String {
    let text = format!("{value:.12}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Parses the positions of all joints of the machine.
fn positions(machine: &MachineConfig, text: &str) -> Result<Vec<f64>, String> {
    let axes = machine.axes();
    let mut positions = vec![None; axes.len()];
    for entry in text.split(',') {
        let (name, number) =
            entry.split_once('=').ok_or_else(|| format!("'{entry}' must be JOINT=POSITION"))?;
        let name = name.trim();
        let Some(index) = axes.iter().position(|axis| axis.name() == name) else {
            let known: Vec<&str> = axes.iter().map(|axis| axis.name()).collect();
            return Err(format!("unknown joint {name}; the machine has {}", known.join(", ")));
        };
        let position = number.trim().parse().ok().filter(|number: &f64| number.abs() <= MAX_POSITION);
        let position = position.ok_or_else(|| {
            format!("{name} is '{number}', must be a number from -{MAX_POSITION} to {MAX_POSITION} m or rad")
        })?;
        if positions[index].replace(position).is_some() {
            return Err(format!("joint {name} is given twice"));
        }
    }
    Ok(positions.into_iter().map(Option::unwrap_or_default).collect())
}
