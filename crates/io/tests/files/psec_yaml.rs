//! Position setpoints as YAML in the format of `ros2 topic pub`, and detection of kinds of files.

use virtual_axes_core::trajectory::{Start, TrajectoryRequest};
use virtual_axes_core::units::SECOND_NS;
use virtual_axes_io::files::{FileKind, Input, PsecYamlWriter, read_psec_yaml};
use virtual_axes_io::messages::joint_trajectory;
use virtual_axes_verification::fixtures::folder::TestFolder;

fn read(text: &str) -> Vec<TrajectoryRequest> {
    read_psec_yaml(text, "p.yaml").unwrap_or_else(|error| panic!("{error}"))
}

#[track_caller]
fn error(text: &str) -> String {
    read_psec_yaml(text, "p.yaml").expect_err("must be rejected").to_string()
}

#[test]
fn flow_style_with_missing_fields_is_a_request() {
    let [request] =
        &read("{joint_names: [x, y], points: [{positions: [0.1, 2], time_from_start: {sec: 1}}]}")[..]
    else {
        panic!("one")
    };
    assert_eq!((request.start(), request.joints()), (Start::Now, &["x".to_owned(), "y".to_owned()][..]));
    let (time, row) = request.point(0).expect("a point");
    assert_eq!((time, row.positions, row.velocities.len()), (SECOND_NS, &[0.1, 2.0][..], 0));
    assert_eq!(request.points(), 1);
}

#[test]
fn documents_of_topic_echo_are_read() {
    let requests = read(
        "header:\n  stamp:\n    sec: 12\n    nanosec: 500000000\n  frame_id: ''\njoint_names:\n- y\npoints:\n\
         - positions:\n  - 0.0\n  velocities:\n  - 0.5\n  accelerations: []\n  effort: []\n  time_from_start:\n    \
         sec: 0\n    nanosec: 6000000\n---\nheader:\n  stamp:\n    sec: 0\n    nanosec: 0\n  frame_id: ''\n\
         joint_names: []\npoints: []\n---\n",
    );
    assert_eq!(requests.len(), 2);
    assert_eq!(requests[0].start(), Start::At(12_500_000_000));
    let (time, row) = requests[0].point(0).expect("a point");
    assert_eq!((time, row.positions, row.velocities), (6_000_000, &[0.0][..], &[0.5][..]));
    assert_eq!((requests[1].points(), requests[1].joints().len()), (0, 0));
}

#[test]
fn keywords_of_topic_pub_start_now() {
    for header in ["auto", "{stamp: now}", "{}", "{frame_id: map, stamp: {sec: 0}}"] {
        let text = format!("header: {header}\njoint_names: [x]\npoints: [{{positions: [0]}}]\n");
        assert_eq!(read(&text)[0].start(), Start::Now, "{header}");
    }
    let message = error("header: later\njoint_names: [x]\n");
    assert!(message.starts_with("p.yaml:1: ") && message.contains("later"), "{message}");
}

#[test]
fn errors_name_file_and_line() {
    assert_eq!(error(""), "p.yaml: the file contains no trajectory, a mapping with joint_names and points");
    assert_eq!(
        error("---\n"),
        "p.yaml: the file contains no trajectory, a mapping with joint_names and points"
    );
    assert_eq!(error("joint_names: [x]\npoints: 5\n"), "p.yaml:2: expected a list: points: 5");
    assert_eq!(
        error("joint_names: &names [x]\npoints: *names\n"),
        "p.yaml:2: expected a mapping: points: *names (the alias is defined in line 1)"
    );
    assert_eq!(
        error("points:\n- positions: [0]\n  time_from_start: 5\n"),
        "p.yaml:3: expected a mapping: time_from_start: 5"
    );
    assert_eq!(
        error("joint_names: [x]\npoints:\n- position: [0.0]\n"),
        "p.yaml:3: unknown field position; there are positions, velocities, accelerations, effort, \
         time_from_start; the nearest is positions"
    );
    assert_eq!(
        error("joint_names: [x]\nspeed: 3\n"),
        "p.yaml:2: unknown field speed; there are header, joint_names, points"
    );
    assert_eq!(error("joint_names: [x]\njoint_names: [y]\n"), "p.yaml:2: duplicate key joint_names");
    assert_eq!(
        error("joint_names: [x]\npoints:\n- {positions: [0.0]}\n- {positions: [0.0, 1.0]}\n"),
        "p.yaml:4: point 1: 2 positions for 1 joints"
    );
    assert_eq!(
        error("joint_names: [x]\npoints:\n- {positions: [0.0]}\n\n- positions:\n  - .nan\n"),
        "p.yaml:5: x, point 1: position is NaN, not a finite number"
    );
    assert_eq!(
        error("joint_names: [x]\npoints: [{positions: [0], time_from_start: {nanosec: 1000000000}}]\n"),
        "p.yaml:2: point 0, time_from_start: nanosec is 1000000000, must be below 1000000000"
    );
    assert_eq!(
        error(
            "joint_names: [x]\npoints:\n- {positions: [0]}\n- {positions: [0], time_from_start: {sec: 2147483647}}\n"
        ),
        "p.yaml:4: point 1: time_from_start is 2147483647 s, must be at most 360000 s (100 h)"
    );
    for (text, line, words) in [
        ("joint_names: [x]\npoints:\n- {positions: [a]}\n", 3, &["a"][..]),
        ("joint_names: [x]\npoints:\n- {positions: [0.1}\n", 3, &["bracket"]),
        ("joint_names: [x]\npoints: {positions: [0.1]}\n", 2, &[]),
        ("- 1\n- 2\n", 1, &[]),
        ("joint_names: [x]\npoints: []\n---\njoint_names: [x]\npints: []\n", 5, &["pints", "points"]),
        ("points: [{time_from_start: {sec: 3000000000}}]\n", 1, &["3000000000"]),
        ("joint_names: [x]\npoints:\n- {positions: [0.1, '...']}\n", 3, &["--full-length"]),
    ] {
        let message = error(text);
        assert!(message.starts_with(&format!("p.yaml:{line}: ")), "{text:?}: {message}");
        eprintln!("{message}");
        assert!(words.iter().all(|word| message.contains(word)), "{text:?}: {message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}

#[test]
fn thousands_of_points_are_within_the_limits_of_the_parser() {
    let mut text = "joint_names: [x, y, z, a, c]\npoints:\n".to_owned();
    for k in 0..100_000 {
        text += &format!("- {{positions: [0, 0, 0, 0, 0], time_from_start: {{sec: {k}}}}}\n");
    }
    assert_eq!(read(&text)[0].points(), 100_000);
}

#[test]
fn written_setpoints_are_read_back_bit_for_bit() {
    let joints = ["y".to_owned(), "on: \"1\"".to_owned()];
    let values = [
        [0.1, -1e-300],
        [1.0 / 3.0, 12345678.9],
        [f64::MIN_POSITIVE, -0.0],
        [1e9, 3.0],
        [0.30000000000000004, 5e-324],
    ];
    let mut out = PsecYamlWriter::new(Vec::new(), &joints).expect("in memory");
    for (k, row) in values.iter().enumerate() {
        out.row(k as i64 * 6_000_000 + 2_000_000_000, row).expect("in memory");
    }
    let text = String::from_utf8(out.finish().expect("in memory")).expect("text");
    assert!(!text.contains("e-"), "YAML 1.1 reads no 1e-7: {text:.200}");
    let request = &read(&text)[0];
    assert_eq!(request.joints(), joints);
    for (k, row) in values.iter().enumerate() {
        let (time, found) = request.point(k).expect("a point");
        assert_eq!(time, k as i64 * 6_000_000 + 2_000_000_000);
        assert!(
            found.positions.iter().zip(row).all(|(a, b)| a.to_bits() == b.to_bits()),
            "{found:?} {row:?}"
        );
    }
    assert_eq!(request.points(), values.len());
    assert_eq!(joint_trajectory(request).header.stamp.sec, 0);
    let none = PsecYamlWriter::new(Vec::new(), &joints).expect("in memory").finish().expect("in memory");
    assert_eq!(read(&String::from_utf8(none).expect("text"))[0].points(), 0);
}

#[test]
fn the_kind_of_a_file_is_detected_by_its_content() {
    let folder = TestFolder::new("kind");
    let mcap = b"\x89MCAP0\r\nrest".as_slice();
    for (bytes, kind) in [
        (b"time,x\n0,0\n".as_slice(), FileKind::PsecCsv),
        (b"\xef\xbb\xbf\r\n \"time\" , x\r\n", FileKind::PsecCsv),
        (mcap, FileKind::Mcap),
        (b"{joint_names: [x], points: []}", FileKind::PsecYaml),
        (b"# a comment\n---\npoints: []\n---\npoints: []\n", FileKind::PsecYaml),
        (b"/**:\n  ros__parameters:\n    machine: M\n", FileKind::Machine),
        (b"cell:\n  mill:\n    ros__parameters: {x.type: linear}\n", FileKind::Machine),
        (b"title: t\nmoves:\n- line: {x: 3}\n", FileKind::Scenario),
    ] {
        let path = folder.file("f", bytes);
        let input = Input::open(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(input.kind(), kind);
        let yaml = ![FileKind::PsecCsv, FileKind::Mcap].contains(&kind);
        assert_eq!(input.text().map(str::as_bytes), yaml.then_some(bytes));
        let mut complete = Vec::new();
        std::io::Read::read_to_end(&mut input.into_reader(), &mut complete).expect("readable");
        assert_eq!(complete, bytes, "the reader returns the complete content");
    }
}

#[test]
fn errors_of_unknown_files_list_the_supported_kinds() {
    let folder = TestFolder::new("unknown");
    for (bytes, words) in [
        (b"".as_slice(), "f: the file is empty; supported are setpoints as CSV"),
        (b"t,x\n0,0\n", "f: the first line is \"t,x\"; supported are setpoints as CSV"),
        (b"foo: 1\nbar: [2]\n", "f: the file is a mapping with keys foo, bar; supported are"),
        (b"- 1\n", "f: the first line is \"- 1\"; supported are"),
        (b"\x89PNG\r\n\x1a\n\0\0\0", "f: the file is binary, must be text; supported are"),
        (b"moves: {x: 1\n", "f:1: invalid YAML: "),
    ] {
        let path = folder.file("f", bytes);
        let message = Input::open(&path).expect_err("must be rejected").to_string();
        assert!(message.contains(words), "{message}");
        assert!(message.contains("scenarios (a mapping with moves)"), "{message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
    let path = folder.file("f", b"moves:\n- {x: 1\n- y\n");
    let message = Input::open(&path).expect_err("must be rejected").to_string();
    assert!(message.contains("f:2: invalid YAML: ") && !message.contains("supported"), "{message}");
    let message = Input::open("no/such".as_ref()).expect_err("must be rejected").to_string();
    assert!(message.starts_with("no/such: "), "{message}");
    let message = Input::open("/".as_ref()).expect_err("must be rejected").to_string();
    assert!(message.starts_with("/: "), "{message}");
}

#[test]
fn values_of_points_are_bounded() {
    let points =
        |fields: &str| error(&format!("joint_names: [c]\npoints:\n- {{positions: [0]}}\n- {{{fields}}}\n"));
    for (fields, found) in [
        ("positions: [1.0e+307]", "1e307 in positions"),
        ("positions: [1], velocities: [-2.5e+9]", "-2500000000 in velocities"),
        ("positions: [1], velocities: [1], accelerations: [1.0e+300]", "1e300 in accelerations"),
        ("positions: [1], effort: [1.0e+300]", "1e300 in effort"),
    ] {
        let message = points(&format!("{fields}, time_from_start: {{sec: 1}}"));
        assert_eq!(message, format!("p.yaml:4: point 1: {found}, must lie in ±1e9 (m or rad, and s)"));
    }
    let message = points("positions: [1], time_from_start: {sec: 1.0e+300}");
    assert!(message.contains("`1e300`") && message.contains("an integer from -2147483648 to"), "{message}");
}
