//! Units of the variables in base units of the SI, and units for their display.

/// Returns the units that a unit is displayed in, with the factor from it: those of a numerical control.
pub(crate) fn display_units(name: &str) -> &'static [(&'static str, f64)] {
    match name {
        "m" => &[("mm", 1e3), ("µm", 1e6)],
        "rad" => &[("°", 57.295_779_513_082_32), ("mdeg", 57_295.779_513_082_32)],
        "m/s" => &[("m/min", 60.0)],
        "rad/s" => &[("rpm", 9.549_296_585_513_721)],
        _ => &[],
    }
}

/// Returns the unit for the display of a variable: µm or mdeg for an error, otherwise the first of its unit.
pub(crate) fn display_unit(variable: &str, unit: &str) -> Option<&'static str> {
    let units = display_units(unit);
    let fine = usize::from(variable.contains("error") && units.len() > 1);
    units.get(fine).map(|(name, _)| *name)
}

/// Exponents and factor of the unit in base units, attributes of `BaseUnit`; none for an unknown unit.
pub(crate) fn base_unit(name: &str) -> Option<&'static str> {
    Some(match name {
        "m" => r#"m="1""#,
        "µm" => r#"m="1" factor="1e-6""#,
        "mm" => r#"m="1" factor="0.001""#,
        "rad" => r#"rad="1""#,
        "°" => r#"rad="1" factor="0.017453292519943295""#,
        "s" => r#"s="1""#,
        "ms" => r#"s="1" factor="0.001""#,
        "µs" => r#"s="1" factor="1e-6""#,
        "s²" => r#"s="2""#,
        "s⁻¹" => r#"s="-1""#,
        "Hz" => r#"s="-1""#,
        // A level is dimensionless and has no linear conversion.
        "dB" => "",
        "m/s" => r#"m="1" s="-1""#,
        "rad/s" => r#"rad="1" s="-1""#,
        "m/min" => r#"m="1" s="-1" factor="0.016666666666666666""#,
        "rpm" => r#"rad="1" s="-1" factor="0.10471975511965977""#,
        "min/m" => r#"m="-1" s="1" factor="60""#,
        "min/rev" => r#"rad="-1" s="1" factor="9.549296585513721""#,
        "(m/min)/mm" | "(1000 °/min)/°" => r#"s="-1" factor="16.666666666666668""#,
        "A" => r#"A="1""#,
        "A/(m/min)" => r#"A="1" m="-1" s="1" factor="60""#,
        "A/rpm" => r#"A="1" rad="-1" s="1" factor="9.549296585513721""#,
        "V" => r#"kg="1" m="2" s="-3" A="-1""#,
        "Ω" | "V/A" => r#"kg="1" m="2" s="-3" A="-2""#,
        "mH" => r#"kg="1" m="2" s="-2" A="-2" factor="0.001""#,
        "N" => r#"kg="1" m="1" s="-2""#,
        "N·m" => r#"kg="1" m="2" s="-2""#,
        "N/s" => r#"kg="1" m="1" s="-3""#,
        "N·m/s" => r#"kg="1" m="2" s="-3""#,
        "N/A" => r#"kg="1" m="1" s="-2" A="-1""#,
        "N·m/A" => r#"kg="1" m="2" s="-2" A="-1""#,
        "V·s/m" => r#"kg="1" m="1" s="-2" A="-1""#,
        "V·s/rad" => r#"kg="1" m="2" s="-2" A="-1" rad="-1""#,
        "N/(m/s)" => r#"kg="1" s="-1""#,
        "N·m/(rad/s)" => r#"kg="1" m="2" s="-1" rad="-1""#,
        "N/µm" => r#"kg="1" s="-2" factor="1e6""#,
        "N·m/rad" => r#"kg="1" m="2" s="-2" rad="-1""#,
        "kg" => r#"kg="1""#,
        "kg·m²" => r#"kg="1" m="2""#,
        _ => return None,
    })
}
