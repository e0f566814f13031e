//! Patterns of positions for modal cycles: HOLES1, HOLES2, CYCLE801, CYCLE802.

use virtual_axes_core::units::DEGREE;

use super::super::error::Outcome;
use super::super::parameters::integer;
use super::super::state::State;
use super::value::ProgramValue;

/// Most positions of a pattern.
const MAX_POSITIONS: u32 = 10_000;

/// Returns the positions of a pattern along the axes of the plane, m, in the order in which they are reached; `None` for
/// other cycles.
pub(super) fn pattern(
    name: &str,
    values: &[Option<ProgramValue>],
    state: &State,
) -> Outcome<Option<Vec<[f64; 2]>>> {
    let length = state.modal.length;
    let get = |index: usize| match values.get(index) {
        Some(Some(ProgramValue::Number(value))) => Some(*value),
        _ => None,
    };
    let number = |index: usize| get(index).unwrap_or(0.0);
    let count = |index: usize| {
        let count = integer(number(index)).filter(|count| *count <= MAX_POSITIONS);
        count.ok_or_else(|| {
            format!("{name}: {} positions, must be an integer from 0 to {MAX_POSITIONS}", number(index))
        })
    };
    Ok(Some(match name {
        // SPCA, SPCO, STA1, FDIS, DBH, NUM.
        "HOLES1" => {
            let (sine, cosine) = (number(2) * DEGREE).sin_cos();
            let mut points: Vec<[f64; 2]> = (0..count(5)?)
                .map(|index| {
                    let along = number(3) + f64::from(index) * number(4);
                    [number(0) + along * cosine, number(1) + along * sine].map(|value| value * length)
                })
                .collect();
            // The row begins with the end that is nearer.
            let present = state.programmed();
            let [first, second, _] = state.modal.plane.axes();
            let distance = |point: &[f64; 2]| (point[0] - present[first]).hypot(point[1] - present[second]);
            if let [start, .., end] = points.as_slice()
                && distance(end) < distance(start)
            {
                points.reverse();
            }
            points
        }
        // CPA, CPO, RAD, STA1, INDA, NUM.
        "HOLES2" => {
            let count = count(5)?;
            let step = match number(4) {
                0.0 => 360.0 / f64::from(count.max(1)),
                step => step,
            };
            (0..count)
                .map(|index| {
                    let (sine, cosine) = ((number(3) + f64::from(index) * step) * DEGREE).sin_cos();
                    [number(0) + number(2) * cosine, number(1) + number(2) * sine].map(|value| value * length)
                })
                .collect()
        }
        // SPCA, SPCO, STA, DIS1, DIS2, NUM1, NUM2: rows in turn from the left and the right.
        "CYCLE801" => {
            let (sine, cosine) = (number(2) * DEGREE).sin_cos();
            let (columns, rows) = (count(5)?, count(6)?);
            if columns.saturating_mul(rows) > MAX_POSITIONS {
                return Err(format!("{name}: more than {MAX_POSITIONS} positions"));
            }
            let place = |column: u32, row: u32| {
                let (x, y) = (f64::from(column) * number(3), f64::from(row) * number(4));
                [number(0) + x * cosine - y * sine, number(1) + x * sine + y * cosine]
                    .map(|value| value * length)
            };
            let column =
                |row: u32, index: u32| if row.is_multiple_of(2) { index } else { columns - 1 - index };
            (0..rows)
                .flat_map(|row| (0..columns).map(move |index| (row, index)))
                .map(|(row, index)| place(column(row, index), row))
                .collect()
        }
        // Two masks, then pairs of coordinates.
        "CYCLE802" => values
            .get(2..)
            .unwrap_or_default()
            .chunks_exact(2)
            .map_while(|pair| match pair {
                [Some(ProgramValue::Number(x)), Some(ProgramValue::Number(y))] => {
                    Some([x * length, y * length])
                }
                _ => None,
            })
            .collect(),
        _ => return Ok(None),
    }))
}
