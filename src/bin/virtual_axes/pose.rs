//! `virtual_axes pose`: where the tool is in the workpiece frame.

use std::error::Error;

use serde_json::json;
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::kinematics::Kinematics;

use crate::subject::MachineChoice;

/// Furthest position from 0, m or rad: with more, its figures would have no digits left for micrometers.
const FURTHEST: f64 = 1e6;

/// Which machine, and where its joints are.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineChoice,
    /// Positions, m or rad, as in `x=0.1,a=0.5`; joints that are not named are at 0. Can be given several
    /// times.
    #[arg(long, required = true, value_name = "JOINT=POSITION,…", allow_hyphen_values = true)]
    joints: Vec<String>,
    /// As a JSON list.
    #[arg(long)]
    json: bool,
}

/// A line for each set of joints.
pub fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    let config = arguments.machine.parameters()?.machine_config()?;
    let kinematics = Kinematics::new(&config);
    let mut lines = String::new();
    let mut list = Vec::new();
    for text in &arguments.joints {
        let joints = positions(&config, text).map_err(|reason| format!("--joints {text}: {reason}"))?;
        let pose = kinematics.forward(&joints);
        // No minus before a zero.
        let [[x, y, z], [u, v, w]]: [[f64; 3]; 2] =
            [pose.tip, pose.axis].map(|v| v.map(|value| value + 0.0).into());
        let axes = config.axes().iter().zip(&joints);
        let outside: Vec<&str> =
            axes.filter(|(axis, at)| axis.limits().is_left_by(**at)).map(|(axis, _)| axis.name()).collect();
        let remark = match outside.as_slice() {
            [] => String::new(),
            names => format!("; outside the stroke: {}", names.join(", ")),
        };
        lines += &format!("tip {x} {y} {z} m, axis {u} {v} {w}{remark}\n");
        // In the order of ROS: x, y, z, w.
        let orientation: [f64; 4] = kinematics.orientation(&joints).coords.into();
        list.push(json!({
            "joints": joints, "tip": [x, y, z], "axis": [u, v, w], "orientation": orientation,
            "outside_stroke": outside,
        }));
    }
    Ok(if arguments.json { format!("{:#}\n", json!(list)) } else { lines })
}

/// One position for each joint of the machine.
fn positions(machine: &MachineConfig, text: &str) -> Result<Vec<f64>, String> {
    let axes = machine.axes();
    let mut positions = vec![None; axes.len()];
    for entry in text.split(',') {
        let (name, number) =
            entry.split_once('=').ok_or_else(|| format!("'{entry}' is not JOINT=POSITION"))?;
        let name = name.trim();
        let Some(place) = axes.iter().position(|axis| axis.name() == name) else {
            let known: Vec<&str> = axes.iter().map(|axis| axis.name()).collect();
            return Err(format!("unknown joint {name}; there are {}", known.join(", ")));
        };
        let position = number.trim().parse().ok().filter(|number: &f64| number.abs() <= FURTHEST);
        let position = position.ok_or_else(|| {
            format!("{name} is '{number}', must be a number from -{FURTHEST} to {FURTHEST} m or rad")
        })?;
        if positions[place].replace(position).is_some() {
            return Err(format!("joint {name} is named twice"));
        }
    }
    Ok(positions.into_iter().map(Option::unwrap_or_default).collect())
}
