//! Position setpoints as CSV, read as a stream at position cycles.

use std::io::{self, Read};
use std::sync::Arc;

use proptest::prelude::*;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::trajectory::{
    JointLimits, MotionId, Start, Timeline, Trajectory, TrajectoryPoint, TrajectoryRequest, ValidationContext,
};
use virtual_axes_core::units::{Nanoseconds, SECOND_NS};
use virtual_axes_io::files::{FileError, PsecCsvReader};

/// Tsp of the machine, ns.
const TSP: Nanoseconds = 6_000_000;

fn limits() -> Vec<JointLimits> {
    let parameters = virtual_axes_core::config::Parameters::embedded_default().expect("shipped");
    joint_limits(&parameters.machine_config().expect("valid"), "")
}

fn open(text: &str) -> Result<PsecCsvReader<&[u8]>, FileError> {
    PsecCsvReader::new(text.as_bytes(), "p.csv", TSP, &limits())
}

/// Returns all rows, or the first error.
fn rows(text: &str) -> Result<Vec<Vec<f64>>, FileError> {
    let mut psec = open(text)?;
    let mut row = vec![0.0; psec.joints().len()];
    let mut rows = Vec::new();
    while psec.next(&mut row)? {
        rows.push(row.clone());
    }
    assert!(!psec.next(&mut row)?, "nothing comes after the end");
    Ok(rows)
}

#[track_caller]
fn error(text: &str) -> String {
    rows(text).expect_err("must be rejected").to_string()
}

/// Returns the setpoints of the timeline for the same points, at position cycles 0 … n−1.
fn commanded(points: &[(Nanoseconds, Vec<f64>)], names: &[&str], instants: usize) -> Vec<Vec<f64>> {
    let limits = limits();
    let mut request = TrajectoryRequest::new(Start::Now, names.iter().map(|n| (*n).to_owned()).collect());
    for (time, positions) in points {
        request.push(*time, TrajectoryPoint { positions, ..TrajectoryPoint::default() }).expect("finite");
    }
    let context = ValidationContext {
        joints: &limits,
        period: TSP,
        max_points: usize::MAX,
        allow_nonzero_end_velocity: false,
    };
    let trajectory = Arc::new(Trajectory::new(request, &context).expect("within the limits"));
    let indices = trajectory.joints().to_vec();
    let mut timeline = Timeline::new(limits.clone(), TSP, &vec![0.0; limits.len()]).expect("a timeline");
    timeline.submit(MotionId(1), trajectory, 0).expect("starts at home");
    let mut rows = Vec::new();
    for _ in 0..instants {
        timeline.next();
        rows.push(indices.iter().map(|&index| timeline.psec()[index]).collect());
    }
    assert!(!timeline.is_moving(), "the stream ends where the timeline does");
    rows
}

fn csv(points: &[(Nanoseconds, Vec<f64>)], names: &[&str]) -> String {
    let mut text = format!("time,{}\n", names.join(","));
    for (time, positions) in points {
        text += &format!("{}.{:09}", time / SECOND_NS, time % SECOND_NS);
        for position in positions {
            text += &format!(",{position}");
        }
        text += "\n";
    }
    text
}

fn bits(rows: &[Vec<f64>]) -> Vec<Vec<u64>> {
    rows.iter().map(|row| row.iter().map(|v| v.to_bits()).collect()).collect()
}

#[track_caller]
fn assert_equals_timeline(points: &[(Nanoseconds, Vec<f64>)], names: &[&str]) {
    let streamed = rows(&csv(points, names)).expect("within the limits");
    let last = points.last().expect("points").0;
    assert_eq!(streamed.len() as i64, (last + TSP - 1) / TSP + 1);
    let commanded = commanded(points, names, streamed.len());
    assert_eq!(bits(&streamed), bits(&commanded));
}

/// Returns smooth positions within Vmax at the given times.
fn wander(times: &[Nanoseconds]) -> Vec<(Nanoseconds, Vec<f64>)> {
    times
        .iter()
        .map(|&time| {
            let t = time as f64 / SECOND_NS as f64;
            (time, vec![0.03 * (1.7 * t).sin(), 0.2 * (1.0 - (2.3 * t).cos())])
        })
        .collect()
}

#[test]
fn rows_at_position_cycles_are_used_bit_for_bit() {
    let points = wander(&(0..500).map(|k| k * TSP).collect::<Vec<_>>());
    let streamed = rows(&csv(&points, &["x", "c"])).expect("within the limits");
    let given: Vec<Vec<f64>> = points.iter().map(|(_, positions)| positions.clone()).collect();
    assert_eq!(bits(&streamed), bits(&given));
    assert_equals_timeline(&points, &["x", "c"]);
}

#[test]
fn interpolated_rows_equal_the_timeline_bit_for_bit() {
    let coarse: Vec<i64> = (0..40).map(|k| k * 71_234_567).collect();
    assert_equals_timeline(&wander(&coarse), &["y", "a"]);
    let fine: Vec<i64> = (0..4000).map(|k| k * 999_999).collect();
    assert_equals_timeline(&wander(&fine), &["z", "c"]);
}

#[test]
fn the_approach_to_a_late_first_row_equals_the_timeline() {
    for first in [1, TSP, 2 * TSP + 1, 100 * TSP + 17] {
        let times: Vec<i64> = (0..30).map(|k| first + k * 31_000_000).collect();
        let mut points = wander(&times);
        for (_, positions) in &mut points {
            // Reachable within one period.
            positions.iter_mut().for_each(|p| *p *= 1e-3);
            positions[0] += 5e-5;
        }
        assert_equals_timeline(&points, &["x", "a"]);
        let text = csv(&points, &["x", "a"]);
        let psec = open(&text).expect("good");
        assert_eq!(psec.first_time(), first);
    }
    let rows = rows("time,x\n0.012,0.001\n").expect("one row");
    assert_eq!(rows, [[0.0], [0.0005], [0.001]]);
}

#[test]
fn the_first_row_is_checked_against_the_start_positions() {
    let text = "time,z,x\n0,0.1,0.2\n0.006,0.101,0.2\n";
    let message = error(text);
    assert!(message.starts_with("p.csv:2: z: starts at 0.1 m, 0.1 m away from"), "{message}");
    let mut psec = open(text).expect("good").with_start_positions(&[0.2, 0.0, 0.1, 0.0, 0.0]);
    assert_eq!(psec.joints(), [2, 0]);
    let mut row = [0.0; 2];
    assert!(psec.next(&mut row).expect("at the start"));
    assert_eq!(row, [0.1, 0.2]);
}

proptest! {
    #[test]
    fn rows_at_any_times_equal_the_timeline(
        steps in prop::collection::vec(1_i64..50_000_000, 1..60),
        first in prop_oneof![Just(0_i64), 1_i64..20_000_000],
        tail in prop::collection::vec(-1.0_f64..1.0, 60),
    ) {
        let mut time = first;
        let mut position = 0.0;
        let mut points = vec![(time, vec![if first == 0 { 0.0 } else { 1e-12 * first as f64 }])];
        for (step, way) in steps.iter().zip(&tail) {
            time += step;
            // At most a tenth of Vmax.
            position += way * 0.05 * *step as f64 / SECOND_NS as f64;
            points.push((time, vec![position]));
        }
        assert_equals_timeline(&points, &["x"]);
    }
}

#[test]
fn errors_name_file_line_and_column() {
    let header = "must be \"time\", then one joint name per column";
    assert_eq!(error(""), format!("p.csv:1: the header is \"\", {header}"));
    assert_eq!(error("t,x\n0,0\n"), format!("p.csv:1: the header is \"t,x\", {header}"));
    assert_eq!(error("time\n0\n"), format!("p.csv:1: the header is \"time\", {header}"));
    assert_eq!(error("time,x,\n0,0,0\n"), format!("p.csv:1: the header is \"time,x,\", {header}"));
    assert_eq!(error("time;x\n0;0\n"), format!("p.csv:1: the header is \"time;x\", {header}"));
    assert_eq!(error("time,x,q\n0,0,0\n"), "p.csv:1: there is no joint \"q\"; there are x, y, z, a, c");
    assert_eq!(error("time,x,x\n0,0,0\n"), "p.csv:1: joint x has two columns");
    assert_eq!(error("time,x\n"), "p.csv: there is no setpoint below the header");
    assert_eq!(error("\n\ntime,x\n\n  \n"), "p.csv: there is no setpoint below the header");
    assert_eq!(error("time,x\n0,0\n0.006,NaN\n"), "p.csv:3: x is \"NaN\", must be a finite number");
    assert_eq!(error("time,x\n0,0\n0.006,inf\n"), "p.csv:3: x is \"inf\", must be a finite number");
    assert_eq!(error("time,x\n0,0\n0.006,1e999\n"), "p.csv:3: x is \"1e999\", must be a finite number");
    assert_eq!(error("time,x\n0,0\n0.006,\n"), "p.csv:3: x is \"\", must be a finite number");
    assert_eq!(error("time,x\n0,0\nnow,0\n"), "p.csv:3: time is \"now\", must be a finite number");
    assert_eq!(error("time,x,y\n0,0,0\n\n0.006,0\n"), "p.csv:4: 2 values, the header names 3 columns");
    assert_eq!(
        error("time,x\n0,0\n0,006,0\n"),
        "p.csv:3: 3 values, the header names 2 columns; decimals must be separated by a point, not by a comma"
    );
    assert_eq!(
        error("time,x\n-0.1,0\n"),
        "p.csv:2: time is -0.1 s, must lie in 0 … 360000 s (100 h); is the column in s?"
    );
    assert_eq!(
        error("time,x\n0,0\n2e8,1\n"),
        "p.csv:3: time is 200000000 s, must lie in 0 … 360000 s (100 h); is the column in s?"
    );
    assert_eq!(
        error("time,x\n0,0\n0.006,0\n0.006,0\n"),
        "p.csv:4: time is 0.006 s, must be later than 0.006 s of the previous row"
    );
    assert_eq!(
        error("time,x\n0,0\n1,0.36\n"),
        "p.csv:3: x, point 1: position 0.36 m (360 mm) is outside the travel limits, -0.355 m (-355 mm) to 0.355 m (355 mm)"
    );
    // C has no travel limits; the bound is that of trajectories in YAML.
    for (text, value) in [("1e307", "1e307"), ("-1.1e9", "-1100000000")] {
        assert_eq!(
            error(&format!("time,c\n0,0\n0.006,{text}\n")),
            format!("p.csv:3: c is {value}, must lie in ±1e9 (m or rad)")
        );
    }
}

#[test]
fn an_error_in_a_late_row_names_its_line() {
    let mut text = "time,x\r\n".to_owned();
    for k in 0..4711 {
        text += &format!("{},{}\r\n", k as f64 * 0.006, if k == 4709 { "NaN" } else { "0" });
    }
    assert_eq!(error(&text), "p.csv:4711: x is \"NaN\", must be a finite number");
}

#[test]
fn a_speed_error_names_the_row_at_the_end_of_the_segment() {
    // Vmax is 0.5 m/s, 3 mm in a period.
    let message = error("time,x\n0,0\n0.006,0.001\n0.012,0.005\n0.018,0.005\n");
    assert!(message.starts_with("p.csv:4: x, point 2: speed 0.66"), "{message}");
    assert!(message.ends_with(" exceeds limits.velocity_m_min, 0.5 m/s (30 m/min)"), "{message}");
    let message = error("time,x\n0,0\n0.003,0.001\n0.011,0.009\n0.1,0.005\n");
    assert!(message.starts_with("p.csv:4: x, point 2: speed "), "{message}");
    let message = error("time,x\n0.012,0.1\n");
    assert!(message.starts_with("p.csv:2: x, point 0: speed on the approach to it 8.3"), "{message}");
}

#[test]
fn csv_variants_of_other_programs_are_read() {
    let plain = rows("time,x,c\n0,0,0\n0.006,0.001,-0.01\n").expect("plain");
    assert_eq!(plain, [[0.0, 0.0], [0.001, -0.01]]);
    for text in [
        "\u{feff}time,x,c\n0,0,0\n0.006,0.001,-0.01\n",
        "time,x,c\r\n0,0,0\r\n0.006,0.001,-0.01\r\n\r\n\r\n",
        " time , x ,\tc\n 0 , 0 , 0 \n\n  \n0.006,1e-3, -1E-2",
        "\"time\",\"x\",\"c\"\n\"0\",0,0\n6e-3,\"0.001\",-.01\n",
        "\n\u{feff}\ntime,x,c\n0,0,0\n+0.006,0.001,-0.01\n",
    ] {
        assert_eq!(rows(text).as_ref(), Ok(&plain), "{text:?}");
    }
}

#[test]
fn binary_files_and_missing_files_are_rejected() {
    let read = |bytes: &'static [u8]| {
        PsecCsvReader::new(bytes, "p.csv", TSP, &limits()).expect_err("must be rejected")
    };
    assert_eq!(read(b"time,x\n0,0\xff\n").to_string(), "p.csv:2: x is \"0ÿ\", must be a finite number");
    let endless =
        PsecCsvReader::new(io::repeat(b'7'), "/dev/zero", TSP, &limits()).expect_err("must be rejected");
    assert_eq!(endless.to_string(), "/dev/zero:1: the line is longer than 65536 bytes");
    let missing = PsecCsvReader::open("no/such.csv".as_ref(), TSP, &limits()).expect_err("must be rejected");
    assert!(missing.to_string().starts_with("no/such.csv: "), "{missing}");
}

/// Reader that generates rows on demand and counts the bytes read.
struct Generator<'a> {
    row: u64,
    rows: u64,
    rest: Vec<u8>,
    bytes_read: &'a std::cell::Cell<u64>,
}

impl Read for Generator<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.rest.is_empty() && self.row <= self.rows {
            let text = match self.row {
                0 => "time,x\n".to_owned(),
                k => format!("{},{}\n", (k - 1) as f64 * 0.006, (k % 2) as f64 * 1e-4),
            };
            self.rest = text.into_bytes();
            self.row += 1;
        }
        let length = self.rest.len().min(buffer.len());
        buffer[..length].copy_from_slice(&self.rest[..length]);
        self.rest.drain(..length);
        self.bytes_read.set(self.bytes_read.get() + length as u64);
        Ok(length)
    }
}

#[test]
fn a_million_rows_are_streamed() {
    let bytes_read = std::cell::Cell::new(0);
    let rows = 1_000_000;
    let generator = Generator { row: 0, rows, rest: Vec::new(), bytes_read: &bytes_read };
    let mut psec = PsecCsvReader::new(generator, "p.csv", TSP, &limits()).expect("good");
    let mut row = [0.0];
    let mut instants = 0;
    while psec.next(&mut row).expect("good") {
        instants += 1;
        assert_eq!(row[0], (instants % 2) as f64 * 1e-4);
        // A row has 7 to 20 bytes: at most two rows and a buffer are read in advance.
        assert!(
            bytes_read.get() < 20 * (instants + 2) + 8192 + 64,
            "{} bytes at {instants}",
            bytes_read.get()
        );
    }
    assert_eq!(instants, rows);
}
