//! Units of the variables in base units of the SI.

/// Exponents and factor of the unit in base units, attributes of `BaseUnit`; none for an unknown unit.
pub(crate) fn base_unit(name: &str) -> Option<&'static str> {
    Some(match name {
        "m" => r#"m="1""#,
        "mm" => r#"m="1" factor="0.001""#,
        "rad" => r#"rad="1""#,
        "°" => r#"rad="1" factor="0.017453292519943295""#,
        "s" => r#"s="1""#,
        "ms" => r#"s="1" factor="0.001""#,
        "µs" => r#"s="1" factor="1e-6""#,
        "s²" => r#"s="2""#,
        "s⁻¹" => r#"s="-1""#,
        "m/s" => r#"m="1" s="-1""#,
        "rad/s" => r#"rad="1" s="-1""#,
        "m/min" => r#"m="1" s="-1" factor="0.016666666666666666""#,
        "rpm" => r#"rad="1" s="-1" factor="0.10471975511965977""#,
        "min/m" => r#"m="-1" s="1" factor="60""#,
        "min/rev" => r#"rad="-1" s="1" factor="9.549296585513721""#,
        "(m/min)/mm" | "(1000 °/min)/°" => r#"s="-1" factor="16.666666666666668""#,
        "A" => r#"A="1""#,
        "V" => r#"kg="1" m="2" s="-3" A="-1""#,
        "Ω" | "V/A" => r#"kg="1" m="2" s="-3" A="-2""#,
        "mH" => r#"kg="1" m="2" s="-2" A="-2" factor="0.001""#,
        "N" => r#"kg="1" m="1" s="-2""#,
        "N·m" => r#"kg="1" m="2" s="-2""#,
        "N/A" => r#"kg="1" m="1" s="-2" A="-1""#,
        "N·m/A" => r#"kg="1" m="2" s="-2" A="-1""#,
        "V·s/m" => r#"kg="1" m="1" s="-2" A="-1""#,
        "V·s/rad" => r#"kg="1" m="2" s="-2" A="-1" rad="-1""#,
        "N/(m/s)" => r#"kg="1" s="-1""#,
        "N·m/(rad/s)" => r#"kg="1" m="2" s="-1" rad="-1""#,
        "kg" => r#"kg="1""#,
        "kg·m²" => r#"kg="1" m="2""#,
        _ => return None,
    })
}
