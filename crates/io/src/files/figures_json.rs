//! JSON of the figures of a trial.
//!
//! Keys contain units; the unit of an axis's errors is in its `unit`: um or mdeg.

use serde_json::{Map, Value, json};
use virtual_axes_core::config::AxisUnits;
use virtual_axes_core::trial::{
    AxisEnergy, AxisFigures, BidirectionalFigures, CircleFigures, CornerFigures, DcLinkEnergy, Figures,
    Reference,
};
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, MICROMETER, MILLIDEGREE, MILLIMETER};
use virtual_axes_nc::offline::{
    LineEnergy, OperationFigures, ProgramEnergy, ProgramFigures, ProgramTimes, ProgrammedErrors, ToolFigures,
    WorstLine,
};

/// Returns all figures as a JSON object, the keys of `virtual_axes run --json` (docs/reference/json.md).
pub fn figures_json(figures: &Figures) -> Map<String, Value> {
    let mut object = Map::new();
    object.insert("duration_s".to_owned(), json!(figures.duration));
    let axes = figures.axes.iter().map(|axis| (axis.name.clone(), self::axis(axis)));
    object.insert("axes".to_owned(), Value::Object(axes.collect()));
    object.extend(figures.dc_link.map(|link| ("dc_link".to_owned(), dc_link(&link))));
    object.insert("contour_error_um".to_owned(), contour(figures));
    object.insert("orientation_error_mdeg".to_owned(), orientation(figures));
    object.insert("circles".to_owned(), figures.circles.iter().map(circle).collect());
    object.insert("more_circles".to_owned(), json!(figures.more_circles));
    object.insert("bidirectional".to_owned(), figures.bidirectional.iter().map(bidirectional).collect());
    object.insert("corners".to_owned(), figures.corners.iter().map(corner).collect());
    object.insert("more_corners".to_owned(), json!(figures.more_corners));
    object
}

fn dc_link(link: &DcLinkEnergy) -> Value {
    json!({ "drawn_j": link.drawn, "returned_j": link.returned, "peak_power_w": link.peak_power })
}

fn axis_energy(energy: &AxisEnergy) -> Value {
    json!({
        "input_j": energy.input,
        "returned_j": energy.returned,
        "copper_loss_j": energy.copper_loss,
        "mechanical_work_j": energy.mechanical_work,
        "magnetic_j": energy.magnetic,
        "peak_power_w": energy.peak_power,
        "holding_power_w": energy.holding_power,
    })
}

/// Returns times and energy of a part of a program.
fn part(times: &ProgramTimes, energy: Option<ProgramEnergy>) -> Map<String, Value> {
    let mut object = Map::new();
    let times = json!({
        "feed": times.feed,
        "rapid": times.rapid,
        "dwell": times.dwell,
        "auxiliary": times.auxiliary,
        "total": times.total(),
    });
    object.insert("times_s".to_owned(), times);
    object.insert("energy".to_owned(), energy.map_or(Value::Null, |energy| program_energy(&energy)));
    object
}

fn program_energy(energy: &ProgramEnergy) -> Value {
    json!({ "input_j": energy.input, "copper_loss_j": energy.copper_loss })
}

fn operation(operation: &OperationFigures) -> Value {
    let mut object = part(&operation.times, operation.energy);
    object.insert("line".to_owned(), json!(operation.line));
    object.insert("text".to_owned(), json!(operation.text));
    object.insert("tool".to_owned(), json!(operation.tool));
    Value::Object(object)
}

fn tool(tool: &ToolFigures) -> Value {
    let mut object = part(&tool.times, tool.energy);
    object.insert("tool".to_owned(), json!(tool.tool));
    Value::Object(object)
}

/// Returns times and worst lines of a part program as a JSON object, `part_program` of `virtual_axes run --json`.
pub fn part_program_json(figures: &ProgramFigures) -> Value {
    let line = |worst: &WorstLine| {
        json!({
            "line": worst.cycle.line,
            "text": worst.text,
            "cause": worst.cause.text(),
            "contour_error_um": worst.cycle.contour_error / MICROMETER,
            "blending_um": worst.cycle.blending / MICROMETER,
            "drives_um": worst.cycle.drives / MICROMETER,
            "orientation_error_mdeg": worst.orientation / MILLIDEGREE,
            "time_s": worst.cycle.time,
        })
    };
    let energy_line = |one: &LineEnergy| {
        let energy = program_energy(&one.energy);
        json!({ "line": one.line, "text": one.text, "energy": energy })
    };
    let errors = |errors: ProgrammedErrors| {
        json!({
            "max": errors.max / MICROMETER,
            "rms": errors.rms / MICROMETER,
            "blending": errors.blending / MICROMETER,
            "drives": errors.drives / MICROMETER,
        })
    };
    json!({
        "contour_error_um": { "cuts": figures.cuts.map(errors), "rapids": figures.rapids.map(errors) },
        "cycle_time_s": figures.cycle_time,
        "programmed_time_s": figures.programmed_time,
        "times_s": part(&figures.operations.times, None)["times_s"],
        "tools": figures.operations.tools.iter().map(tool).collect::<Vec<_>>(),
        "operations": figures.operations.operations.iter().map(operation).collect::<Vec<_>>(),
        "energy_lines": figures.operations.energy_lines.iter().map(energy_line).collect::<Vec<_>>(),
        "worst_lines": figures.worst_lines.iter().map(line).collect::<Vec<_>>(),
        "worst_rapids": figures.worst_rapids.iter().map(line).collect::<Vec<_>>(),
    })
}

fn axis(axis: &AxisFigures) -> Value {
    let AxisUnits { error: scale, error_key: unit, .. } = AxisUnits::for_kind(axis.kind);
    let report = &axis.report;
    let mut object = json!({
        "unit": unit,
        "moves": axis.moves,
        "following_error": {
            "max": report.max_following_error / scale,
            "rms": report.rms_following_error / scale,
        },
        "delay_compensated_following_error": {
            "max": report.max_delay_compensated_following_error / scale,
            "rms": report.rms_delay_compensated_following_error / scale,
        },
        "peak_current_a": report.peak_current,
        "saturation_s": report.saturation_time,
        "control_activity_a": report.control_activity,
        "outside_travel_limits_s": axis.outside_travel_limits_time,
        "friction_extrapolated": axis.friction_extrapolated,
    });
    if let Some(energy) = &axis.energy {
        object["energy"] = axis_energy(energy);
    }
    object
}

fn contour(figures: &Figures) -> Value {
    figures.contour.map_or(Value::Null, |contour| {
        json!({
            "reference": match contour.reference {
                Reference::Path => "path",
                Reference::Setpoints => "setpoints",
            },
            "max": contour.max / MICROMETER,
            "rms": contour.rms / MICROMETER,
            "max_within_ends": contour.max_within_ends / MICROMETER,
            "rms_within_ends": contour.rms_within_ends / MICROMETER,
            "rapids": contour.rapids.map(|rapids| {
                json!({ "max": rapids.max / MICROMETER, "rms": rapids.rms / MICROMETER })
            }),
        })
    })
}

fn orientation(figures: &Figures) -> Value {
    figures.orientation.map_or(
        Value::Null,
        |orientation| json!({ "max": orientation.max / MILLIDEGREE, "rms": orientation.rms / MILLIDEGREE }),
    )
}

fn circle(circle: &CircleFigures) -> Value {
    json!({
        "move": circle.index,
        "plane": circle.plane,
        "direction": if circle.counterclockwise { "counterclockwise" } else { "clockwise" },
        "radius_mm": circle.radius / MILLIMETER,
        "feed_m_min": circle.feed / METER_PER_MINUTE,
        "radial_deviation_um": {
            "mean": circle.mean / MICROMETER,
            "min": circle.min / MICROMETER,
            "max": circle.max / MICROMETER,
        },
        "circular_deviation_um": circle.circular_deviation.map(|g| g / MICROMETER),
        "reversal_spikes_um": circle.reversal_spikes.map(|spikes| {
            let names = ["plus_first", "plus_second", "minus_first", "minus_second"];
            let spikes = names.iter().zip(spikes).map(|(name, spike)| ((*name).to_owned(), json!(spike / MICROMETER)));
            Value::Object(spikes.collect())
        }),
    })
}

fn bidirectional(pair: &BidirectionalFigures) -> Value {
    json!({
        "moves": pair.moves,
        "circular_deviation_um": pair.circular_deviation / MICROMETER,
        "mean_radial_deviation_um": pair.mean_radial_deviation / MICROMETER,
    })
}

fn corner(corner: &CornerFigures) -> Value {
    json!({
        "move": corner.index,
        "turn_deg": corner.turn / DEGREE,
        "max_contour_error_um": corner.max_contour_error / MICROMETER,
    })
}
