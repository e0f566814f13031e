//! Figures of a page as JSON, which its script plots: values in display units, rounded.

use serde_json::{Value, json};

use super::chart::{AxisRange, Band, Chart, ChartAxis, ChartForm, ChartSeries, Guide, Panel};
use super::decimate::kept;
use super::extent::is_drawable;

/// Number of significant digits of a value.
const DIGITS: i32 = 7;

/// Rounds a value that can be drawn; null for others.
pub(super) fn rounded(value: f64) -> Value {
    if !is_drawable(value) {
        return Value::Null;
    }
    if value.abs() < f64::MIN_POSITIVE {
        return json!(0);
    }
    let decimals = DIGITS - 1 - value.abs().log10().floor() as i32;
    // A power of ten with a positive exponent is exact up to 1e22.
    let (scale, inverse) = (10f64.powi(decimals.abs()), decimals < 0);
    let rounded = if inverse { (value / scale).round() * scale } else { (value * scale).round() / scale };
    if rounded.is_finite() { json!(rounded) } else { Value::Null }
}

impl Chart {
    /// Returns the chart as JSON; each series has at most about `most` points.
    pub(super) fn json(&self, most: usize) -> Value {
        let (form, axes) = match &self.form {
            ChartForm::Plain => ("plain", None),
            ChartForm::RunTime => ("time", None),
            ChartForm::Circle(axes) => ("circle", Some(axes)),
        };
        json!({
            "form": form,
            "axes": axes,
            "x": self.x.json(),
            "panels": self.panels.iter().map(|panel| self.panel(panel, most)).collect::<Vec<_>>(),
            "bands": bands(&self.bands, &self.x),
            "lines": guides(&self.lines, &self.x),
        })
    }

    fn panel(&self, panel: &Panel, most: usize) -> Value {
        json!({
            "y": panel.y.json(),
            "series": panel.series.iter().map(|series| self.series(panel, series, most)).collect::<Vec<_>>(),
            "bands": bands(&panel.bands, &panel.y),
            "lines": guides(&panel.lines, &panel.y),
        })
    }

    fn series(&self, panel: &Panel, series: &ChartSeries, most: usize) -> Value {
        let (kind, style) = series.style.name();
        let kept = kept(&series.points, most);
        let column =
            |value: &dyn Fn(usize) -> f64| kept.iter().map(|i| rounded(value(*i))).collect::<Vec<_>>();
        let error =
            |i: usize| series.errors.get(i).filter(|e| **e > 0.0).map_or(f64::NAN, |e| e / panel.y.unit.size);
        json!({
            "label": series.label,
            "kind": kind,
            "style": style,
            "run": series.run,
            "x": column(&|i| self.x.in_unit(series.points[i][0])),
            "y": column(&|i| panel.y.in_unit(series.points[i][1])),
            "errors": if series.errors.is_empty() { Vec::new() } else { column(&error) },
        })
    }
}

impl ChartAxis {
    fn json(&self) -> Value {
        let [from, to] = match self.range {
            AxisRange::Within(from, to) if from < to => [from, to].map(|end| rounded(self.in_unit(end))),
            _ => [Value::Null, Value::Null],
        };
        json!({
            "label": self.unit.label(&self.quantity),
            "unit": self.unit.symbol,
            "least": rounded(self.unit.least_range),
            "from": from,
            "to": to,
            "zero": self.range == AxisRange::WithZero,
            "log": self.is_logarithmic,
        })
    }

    /// Converts a value to the unit of the axis; NaN if a logarithmic axis does not have it.
    pub(super) fn in_unit(&self, value: f64) -> f64 {
        if self.is_logarithmic && value <= 0.0 { f64::NAN } else { value / self.unit.size }
    }
}

fn guides(lines: &[Guide], axis: &ChartAxis) -> Vec<Value> {
    let drawn = lines.iter().filter(|guide| is_drawable(axis.in_unit(guide.at)));
    drawn.map(|guide| json!({ "at": rounded(axis.in_unit(guide.at)), "label": guide.label })).collect()
}

/// Returns the bands as JSON, each class and label with the ends of its intervals; intervals that almost touch are joined.
fn bands(bands: &[Band], axis: &ChartAxis) -> Vec<Value> {
    let mut kinds: Vec<(&Band, Vec<[f64; 2]>)> = Vec::new();
    for band in bands.iter().filter(|band| !band.from.is_nan() && !band.to.is_nan()) {
        let ends = [band.from.min(band.to), band.from.max(band.to)].map(|end| axis.in_unit(end));
        match kinds.iter_mut().find(|(kind, _)| kind.class == band.class && kind.label == band.label) {
            Some((_, all)) => all.push(ends),
            None => kinds.push((band, vec![ends])),
        }
    }
    let json = |(kind, mut all): (&Band, Vec<[f64; 2]>)| {
        all.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let (first, last) = (all[0][0], all.iter().map(|ends| ends[1]).fold(f64::MIN, f64::max));
        let gap = GAP * (last - first);
        let mut joined: Vec<[f64; 2]> = Vec::new();
        for [from, to] in all {
            match joined.last_mut() {
                Some([_, end]) if from <= *end + gap => *end = end.max(to),
                _ => joined.push([from, to]),
            }
        }
        let ends: Vec<[Value; 2]> = joined.into_iter().map(|ends| ends.map(rounded)).collect();
        json!({ "class": kind.class.name(), "label": kind.label, "ends": ends })
    };
    kinds.into_iter().map(json).collect()
}

/// Gap below which intervals are joined, as a fraction of their range.
const GAP: f64 = 5e-4;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_seven_digits() {
        let values = [123.456_789_1, -0.000_012_345_678_9, 1.0 / 3.0, 9_999_999.96, 1e11 / 3.0, 5e-324, -0.0];
        let texts = values.map(|value| rounded(value).to_string());
        assert_eq!(
            texts,
            ["123.4568", "-0.00001234568", "0.3333333", "10000000.0", "33333330000.0", "0", "0"]
        );
        for value in [f64::NAN, f64::INFINITY, 1e13] {
            assert_eq!(rounded(value), Value::Null);
        }
    }

    #[test]
    fn intervals_that_almost_touch_are_joined() {
        let axis = ChartAxis::new("Time", crate::DisplayUnit::MILLISECOND);
        let all = [(0.2, 0.3), (0.0, 0.1), (0.1, 0.15), (f64::NAN, 1.0), (1.0, 0.9)];
        let found = bands(&all.map(|(from, to)| Band::interval("a", from, to)), &axis);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0]["ends"].to_string(), "[[0,150.0],[200.0,300.0],[900.0,1000.0]]");
    }
}
