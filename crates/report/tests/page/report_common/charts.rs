//! A page of charts with synthetic values.

use std::f64::consts::PI;

use virtual_axes_report::{
    Band, BandClass, Chart, ChartAxis, ChartSeries, DisplayUnit, Document, Guide, Notice, NoticeLevel, Panel,
    Section, SeriesStyle, Table, TableColumn,
};

const KILOGRAM: DisplayUnit = DisplayUnit::new("kg", 1.0, 1e-3);
/// m/s in a meter per minute.
const METER_PER_MINUTE: f64 = 1.0 / 60.0;

/// Returns an axis of a chart.
pub fn axis(quantity: &str, unit: DisplayUnit) -> ChartAxis {
    ChartAxis::new(quantity, unit)
}

/// Returns noise in −1 … 1 (xorshift generator).
pub fn noise(length: usize, seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state as f64 / u64::MAX as f64 * 2.0 - 1.0
    };
    std::iter::repeat_with(next).take(length).collect()
}

/// Returns a friction current, A, for a velocity in m/s.
fn friction(velocity: f64) -> f64 {
    let v = velocity.abs() / METER_PER_MINUTE;
    velocity.signum() * (2.4 + 1.6 * (-v / 0.8).exp() + 0.12 * v)
}

fn friction_law() -> Chart {
    let speeds = [
        0.05, 0.1, 0.2, 0.5, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 19.0,
        20.0,
    ];
    let both = speeds.iter().flat_map(|v| [-v, *v]).map(|v| v * METER_PER_MINUTE);
    let scatter = noise(2 * speeds.len(), 5);
    let measured: Vec<[f64; 2]> = both.zip(&scatter).map(|(v, n)| [v, friction(v) + 0.15 * n]).collect();
    let (fast, slow): (Vec<_>, Vec<_>) = measured.into_iter().partition(|p| p[0] > 0.0);
    let errors = vec![0.2; speeds.len()];
    let curve = |sign: f64| (1..=400).map(move |i| sign * f64::from(i) * 0.05 * METER_PER_MINUTE);
    let fitted: Vec<[f64; 2]> = curve(-1.0)
        .collect::<Vec<_>>()
        .into_iter()
        .rev()
        .map(|v| [v, friction(v)])
        .chain([[0.0, f64::NAN]])
        .chain(curve(1.0).map(|v| [v, friction(v)]))
        .collect();
    let panel = Panel {
        lines: vec![Guide::new(4.0, "i0 = 4.00 A")],
        ..Panel::new(
            axis("Current", DisplayUnit::AMPERE),
            vec![
                ChartSeries::new("measured, positive direction", SeriesStyle::Points(0), fast)
                    .with_errors(errors.clone()),
                ChartSeries::new("measured, negative direction", SeriesStyle::Points(1), slow)
                    .with_errors(errors),
                ChartSeries::new("fitted law", SeriesStyle::Simulated, fitted),
            ],
        )
    };
    let note = "R² 0.998, bars: standard deviation".to_owned();
    Chart { note, ..Chart::new("Friction law", axis("Velocity", DisplayUnit::METER_PER_MINUTE), vec![panel]) }
}

fn inertia() -> Chart {
    let (values, times, jitter) = (noise(6000, 3), noise(6000, 9), noise(6000, 12));
    let dots = times.iter().zip(&values).enumerate().map(|(i, (t, n))| {
        let outlier = if i % 500 == 0 { 60.0 } else { 1.0 };
        [10.0 * (1.0 + (t * 6.0).floor() / 6.0) + 0.5 + 0.4 * jitter[i], 95.1 + 6.0 * n.powi(3) * outlier]
    });
    let panel = Panel {
        bands: vec![Band::interval("± spread", 93.1, 97.1)],
        lines: vec![Guide::new(95.1, "robust mean 95.1 kg")],
        ..Panel::new(
            axis("Equivalent inertia", KILOGRAM).within(80.0, 110.0),
            vec![ChartSeries::new("samples", SeriesStyle::Points(0), dots.collect())],
        )
    };
    Chart::new("Equivalent inertia", axis("Time", DisplayUnit::SECOND), vec![panel])
}

fn regression() -> Chart {
    let acceleration: Vec<f64> = noise(4000, 21).iter().map(|n| 3.0 * n).collect();
    let current: Vec<f64> = acceleration.iter().zip(noise(4000, 8)).map(|(a, n)| 5.2 * a + 0.8 * n).collect();
    let panel = Panel::new(
        axis("Feedforward current", DisplayUnit::AMPERE),
        vec![
            ChartSeries::from_xy("recorded", SeriesStyle::Points(0), &acceleration, &current),
            ChartSeries::new("regression", SeriesStyle::Simulated, vec![[-3.0, -15.6], [3.0, 15.6]]),
        ],
    );
    let unit = DisplayUnit::new("m/s²", 1.0, 1e-3);
    Chart {
        note: "R² 0.994".to_owned(),
        ..Chart::new("Torque feedforward", axis("Acceleration", unit), vec![panel])
    }
}

fn delay() -> Chart {
    let sums: Vec<[f64; 2]> =
        (0..=60).map(|i| f64::from(i) * 1e-4).map(|d| [d, 2e-10 + 8e-5 * (d - 2.4e-3).powi(2)]).collect();
    let unit = DisplayUnit::new("µm²", 1e-12, 1.0);
    let series = vec![
        ChartSeries::new("simulated − recorded", SeriesStyle::Measured, sums.clone()),
        ChartSeries::new(
            "at the comparator",
            SeriesStyle::Steps(2),
            sums.iter().step_by(10).copied().collect(),
        ),
    ];
    Chart {
        bands: vec![Band::interval("accepted", 1.8e-3, 3.0e-3)],
        lines: vec![Guide::new(2.4e-3, "2.4 ms")],
        ..Chart::new(
            "Delay α",
            axis("Delay", DisplayUnit::MILLISECOND),
            vec![Panel::new(axis("Sum of squares", unit).with_zero(), series)],
        )
    }
}

/// Returns a chart of deviation, velocity and current of reciprocating moves, sampled at 1 kHz.
pub fn validation(length: usize) -> Chart {
    let time: Vec<f64> = (0..length).map(|i| i as f64 * 1e-3).collect();
    let n = noise(length, 77);
    let velocity: Vec<f64> =
        time.iter().map(|t| (2.0 * (PI * t / 4.0).sin()).clamp(-1.0, 1.0) * 0.1).collect();
    let current: Vec<f64> =
        velocity.iter().zip(&n).map(|(v, n)| 3.0 * (v * 80.0).tanh() + 20.0 * v + 0.4 * n).collect();
    let deviation: Vec<f64> = velocity.iter().zip(&n).map(|(v, n)| 3e-5 * v + 1e-6 * n).collect();
    let panel = |quantity: &str, unit, values: &[f64], factor: f64| {
        let simulated: Vec<f64> = values.iter().map(|v| v * factor).collect();
        Panel::new(
            axis(quantity, unit),
            vec![
                ChartSeries::from_xy("measured", SeriesStyle::Measured, &time, values),
                ChartSeries::from_xy("simulated", SeriesStyle::Simulated, &time, &simulated),
            ],
        )
    };
    let count = (length as f64 * 1e-3 / 4.0).ceil() as i32;
    let bands = (0..count).flat_map(|i| {
        let start = 4.0 * f64::from(i);
        [
            Band::new(BandClass::Accelerating, start - 0.66, start + 0.66),
            Band::new(BandClass::ConstantVelocity, start + 0.67, start + 2.4),
            Band::new(BandClass::Static, start + 2.4, start + 3.33),
        ]
    });
    Chart {
        bands: bands.filter(|band| band.from >= 0.0).collect(),
        ..Chart::new(
            "Measured and simulated",
            axis("Time", DisplayUnit::SECOND),
            vec![
                panel("Deviation", DisplayUnit::MICROMETER, &deviation, 0.9),
                panel("Velocity", DisplayUnit::METER_PER_MINUTE, &velocity, 1.02),
                panel("Current", DisplayUnit::AMPERE, &current, 0.85),
            ],
        )
    }
}

/// Returns a page with each kind of chart of an identification.
pub fn example() -> Document {
    let table = Table {
        caption: "Parameters".to_owned(),
        columns: vec![
            TableColumn::new("parameter", ""),
            TableColumn::new("value", "kg"),
            TableColumn::new("± (95 %)", "kg"),
        ],
        rows: vec![vec!["inertia".to_owned(), "95.1".to_owned(), "-0.4".to_owned()]],
        ..Table::default()
    };
    let section = |heading: &str, chart| Section { charts: vec![chart], ..Section::new(heading) };
    Document {
        title: "Identification of the X axis".to_owned(),
        description: "Made from three recordings.".to_owned(),
        facts: vec![
            ("recording".to_owned(), "off.csv".to_owned()),
            ("recording".to_owned(), "both.csv".to_owned()),
            ("cut-off".to_owned(), "40 Hz".to_owned()),
        ],
        sections: vec![
            Section {
                paragraphs: vec!["Currents at constant velocity without gravity.".to_owned()],
                notices: vec![
                    Notice::new(NoticeLevel::Note, "the directions differ by 2 %"),
                    Notice::new(NoticeLevel::Warning, "the current is saturated in 12 samples"),
                    Notice::new(
                        NoticeLevel::Missing,
                        "γ cannot be identified without torque feedforward; record with both",
                    ),
                ],
                tables: vec![table],
                ..section("Friction", friction_law())
            },
            section("Inertia", inertia()),
            section("Feedforward", regression()),
            section("Delays", delay()),
            section("Validation", validation(20_000)),
        ],
        ..Document::default()
    }
}
