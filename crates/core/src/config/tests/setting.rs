//! Setting parameters: single values, batches and overlay files.

use super::mikron;
use crate::config::{
    Assignment, DEFINITIONS, ParameterKind, Parameters, Presence, Scope, TimeMode, Value, ValueSource,
    listing, parse_assignment,
};

fn source() -> ValueSource {
    ValueSource::named("--set")
}

fn set(text: &str) -> Result<Parameters, String> {
    let mut parameters = mikron();
    match parameters.set_text(text, &source()) {
        Ok(()) => Ok(parameters),
        Err(error) => Err(error.to_string()),
    }
}

fn rejection(text: &str) -> String {
    set(text).err().unwrap_or_else(|| "accepted".to_owned())
}

#[test]
fn every_live_key_accepts_both_ends_of_its_range() {
    let mut live = 0;
    for machine in virtual_axes_builtin::MACHINES.iter().map(|(name, _)| *name) {
        let start = Parameters::load(machine, virtual_axes_builtin::MACHINES).expect("a built-in machine");
        for (key, definition) in start.definitions().filter(|(_, definition)| definition.is_live) {
            live += 1;
            let values = match definition.kind {
                ParameterKind::Number { min, max } => vec![Value::Double(min), Value::Double(max)],
                ParameterKind::Integer { min, max } => vec![Value::Integer(min), Value::Integer(max)],
                ParameterKind::Flag => vec![Value::Bool(false), Value::Bool(true)],
                ParameterKind::Choice(choices) => {
                    choices.iter().map(|choice| Value::Text((*choice).to_owned())).collect()
                }
                ParameterKind::NumberList { min_len, max_len } => {
                    vec![Value::DoubleList(vec![1.0; min_len]), Value::DoubleList(vec![-1e300; max_len])]
                }
                ParameterKind::Text | ParameterKind::TextList => Vec::new(),
            };
            for value in values {
                let mut parameters = start.clone();
                // Values of related keys, so that only the range of the key is tested.
                if let Some((joint, _)) = key.split_once(".position_loop.") {
                    for polynomial in ["r", "s", "t"] {
                        let key = format!("{joint}.position_loop.rst.{polynomial}");
                        parameters.set(&key, Value::DoubleList(vec![1.0]), &source()).expect("a polynomial");
                    }
                    let others =
                        if key.ends_with("n2") { [("nu", 1), ("n1", 1)] } else { [("n2", 200), ("nu", 1)] };
                    for (name, count) in others {
                        let key = format!("{joint}.position_loop.gpc.{name}");
                        parameters.set(&key, Value::Integer(count), &source()).expect("a horizon");
                    }
                }
                assert_eq!(parameters.set(&key, value.clone(), &source()), Ok(()), "{key}");
                assert_eq!(parameters.get(&key), Some(value), "{key}");
                assert!(parameters.machine_config().is_ok(), "{key}");
            }
            let mut parameters = start.clone();
            let error = parameters.set(&format!("{key}q"), Value::Double(1.0), &source());
            assert!(
                matches!(&error, Err(error) if error.to_string().ends_with(&format!("; the nearest is {key}"))),
                "{error:?}"
            );
            assert_eq!(parameters, start);
        }
    }
    assert!(live > 400, "{live}");
}

#[test]
fn inconsistent_horizons_are_rejected_with_their_keys() {
    for (text, key, value) in [
        ("x.position_loop.gpc.n1=15", "x.position_loop.gpc.n1", "15"),
        ("x.position_loop.gpc.nu=15", "x.position_loop.gpc.nu", "15"),
        ("x.position_loop.gpc.n2=11", "x.position_loop.gpc.n2", "11"),
    ] {
        let error = set(text).expect_err(text).to_string();
        assert!(error.contains(key) && error.contains(value) && error.contains("n2"), "{error}");
    }
    let error = set("x.position_loop.gpc.lambda_rel=-1").expect_err("negative").to_string();
    assert!(error.contains("lambda_rel") && error.contains("-1"), "{error}");
    let error = set("y.position_loop.controller=rst").expect_err("no polynomials").to_string();
    assert!(error.contains("y.position_loop.rst.r") && error.contains("list of numbers"), "{error}");
}

#[test]
fn lists_of_numbers_accept_integers() {
    for (text, expected) in
        [("[1.0, -2]", vec![1.0, -2.0]), ("[3, 4]", vec![3.0, 4.0]), ("[1e-9]", vec![1e-9])]
    {
        let parameters = set(&format!("x.position_loop.rst.r={text}")).expect(text);
        assert_eq!(parameters.get("x.position_loop.rst.r"), Some(Value::DoubleList(expected)));
    }
}

#[test]
fn invalid_lists_of_numbers_are_rejected() {
    for (text, why) in [
        ("x.position_loop.rst.r=2.0", "found number 2, expected list of numbers"),
        ("x.position_loop.rst.r=[a]", "found a list of texts [a], expected list of numbers"),
        ("x.position_loop.rst.r=[true]", "found a list of flags [true], expected list of numbers"),
        ("x.position_loop.rst.r=[1, [2]]", "found a list with mixed types or nested items, expected a value"),
    ] {
        assert_eq!(rejection(text), format!("--set: x.position_loop.rst.r: {why}"));
    }
    for value in ["[]", "[1, NaN]", "[inf]"] {
        let written = value.replace("NaN", ".nan").replace("inf", ".inf");
        assert_eq!(
            rejection(&format!("x.position_loop.rst.r={written}")),
            format!("--set: x.position_loop.rst.r = {value}: must be a list of 1 … 32 finite numbers")
        );
    }
    let long = format!("x.position_loop.rst.t=[{}1]", "1,".repeat(401));
    assert!(rejection(&long).ends_with("must be a list of 1 … 401 finite numbers"), "{}", rejection(&long));
}

#[test]
fn a_gain_is_set_in_the_machine_configuration() {
    let machine = set("x.velocity_loop.gain=4.5").map(|parameters| parameters.machine_config());
    let gain = machine.map(|machine| machine.map(|machine| machine.axes()[0].velocity_loop.gain));
    assert_eq!(gain, Ok(Ok(4.5)));
}

#[test]
fn an_integer_is_accepted_for_a_number() {
    let parameters = set("x.velocity_loop.gain:=4");
    let value = parameters.map(|parameters| parameters.get("x.velocity_loop.gain"));
    assert_eq!(value, Ok(Some(Value::Double(4.0))));
}

#[test]
fn invalid_assignments_are_rejected() {
    for (text, expected) in [
        ("x.velocity_loop.gain", "--set: expected KEY=VALUE, found x.velocity_loop.gain"),
        ("=1", "--set: expected KEY=VALUE, found =1"),
        ("x.velocity_loop.gain=", "--set: x.velocity_loop.gain: found text \"\", expected number"),
        ("x.velocity_loop.gain=-1", "--set: x.velocity_loop.gain = -1: must lie in 0 … 1e9 N·m/(rad/s)"),
        (
            "x.velocity_loop.gian=1",
            "--set: unknown parameter x.velocity_loop.gian; the nearest is \
             x.velocity_loop.gain",
        ),
        (
            "b.velocity_loop.gain=1",
            "--set: b.velocity_loop.gain does not apply: there is no joint b; joints = [x, y, z, \
             a, c]",
        ),
        ("time=slow", "--set: time = slow: must be real or fast"),
        ("max_points=0", "--set: max_points = 0: must lie in 1 … 100000000"),
        ("x.feedforward.velocity={a: 1}", "--set: x.feedforward.velocity: found a mapping, expected a value"),
        ("joints=[x, [y]]", "--set: joints: found a list with mixed types or nested items, expected a value"),
        ("joint_prefix=7", "--set: joint_prefix: found integer 7, expected text (in quotation marks)"),
        (
            "x.gravity.tilt_nm=3",
            "--set: x.gravity.tilt_nm does not apply: it is for rotary axes, and x.type = linear",
        ),
    ] {
        assert_eq!(rejection(text), expected);
    }
}

#[test]
fn a_batch_with_an_error_sets_nothing() {
    let mut parameters = mikron();
    let assignment =
        |key: &str, value| Assignment { key: key.to_owned(), value: Value::Double(value), source: source() };
    let good = assignment("x.velocity_loop.gain", 4.5);
    let bad = assignment("y.velocity_loop.gain", -4.5);
    assert!(parameters.set_all(vec![good, bad]).is_err());
    assert_eq!(parameters, mikron());
}

#[test]
fn a_batch_is_checked_as_a_whole() {
    let mut parameters = mikron();
    let assignment =
        |key: &str, value| Assignment { key: key.to_owned(), value: Value::Double(value), source: source() };
    // Each alone would violate the integer multiple.
    let batch = vec![assignment("periods.velocity_us", 300.0), assignment("periods.current_us", 100.0)];
    assert_eq!(parameters.set_all(batch), Ok(()));
    assert_eq!(parameters.set_all(Vec::new()), Ok(()));
}

#[test]
fn parameters_of_a_removed_joint_are_removed() {
    let parameters = set("joints=[c, x]").expect("two of five joints");
    let machine = parameters.machine_config().expect("a valid machine");
    let names: Vec<&str> = machine.axes().iter().map(|axis| axis.name()).collect();
    assert_eq!(names, ["c", "x"]);
    assert_eq!(parameters.get("y.type"), None);
    assert!(rejection("joints=[x, b]").starts_with("--set: b.type is missing: "));
}

#[test]
fn defaults_are_listed_and_optional_parameters_are_not() {
    let parameters = mikron();
    let listed: Vec<(String, Value)> = parameters.iter().collect();
    assert!(listed.contains(&("publish_rate".to_owned(), Value::Double(0.0))));
    assert!(listed.contains(&("x.gravity.weight_n".to_owned(), Value::Double(0.0))));
    assert!(!listed.iter().any(|(key, _)| key == "c.limits.travel_min_deg"));
    assert_eq!(parameters.source("publish_rate"), None);
    assert_eq!(listed[0].0, "machine");
    let unit = parameters.definition("a.position_loop.gain").map(|definition| definition.unit);
    assert_eq!(unit, Some("(1000 °/min)/°"));
}

#[test]
fn node_parameters_have_their_defaults_and_units() {
    let mut parameters = mikron();
    let node = parameters.node_config();
    assert_eq!(node.time, TimeMode::Real);
    assert_eq!((node.publish_rate, node.load_timeout), (None, 100_000_000));
    assert_eq!((node.joint_prefix.as_str(), node.max_points), ("", 1_000_000));
    assert!(!node.allow_nonzero_velocity_at_trajectory_end);
    for text in ["time=fast", "publish_rate=50", "joint_prefix=mill_", "max_points=7"] {
        assert_eq!(parameters.set_text(text, &source()), Ok(()));
    }
    let node = parameters.node_config();
    assert_eq!((node.time, node.publish_rate), (TimeMode::Fast, Some(50.0)));
    assert_eq!((node.joint_prefix.as_str(), node.max_points), ("mill_", 7));
}

#[test]
fn an_overlay_changes_parameters_of_the_matching_node() {
    let text = "\
/**:
  ros__parameters:
    x.velocity_loop: {gain: 4}
    y:
      velocity_loop.gain: 3
/cell:
  mill:
    ros__parameters: {x.velocity_loop.gain: 2.5}
other:
  ros__parameters: {speed: 3}
";
    let mut parameters = mikron();
    let overlay = parameters.overlay_yaml(text, "site.yaml", Some("/cell/mill"));
    let overlay = overlay.expect("a valid file");
    assert_eq!((overlay.parameters, overlay.sections), (3, 2));
    assert_eq!(overlay.skipped, ["/other"]);
    assert!(!overlay.is_machine_replaced);
    // The later section takes precedence.
    assert_eq!(parameters.get("x.velocity_loop.gain"), Some(Value::Double(2.5)));
    assert_eq!(parameters.get("y.velocity_loop.gain"), Some(Value::Double(3.0)));
    let at = parameters.source("x.velocity_loop.gain").map(ToString::to_string);
    assert_eq!(at.as_deref(), Some("site.yaml:8"));

    let mut parameters = mikron();
    let overlay = parameters.overlay_yaml(text, "site.yaml", Some("/virtual_axes"));
    assert_eq!(overlay.map(|overlay| overlay.sections), Ok(1));
    assert_eq!(parameters.get("x.velocity_loop.gain"), Some(Value::Double(4.0)));
}

#[test]
fn parameters_of_other_nodes_are_ignored_in_a_section_for_several_nodes() {
    let text = "\
/**:
  ros__parameters:
    cell_name: hall_3
    x.velocity_loop.gain: 4
    x.velocity_loop.gian: 5
mill:
  ros__parameters:
    qos_overrides./joint_states.publisher.depth: 5
    publish_rate: null
";
    let mut parameters = mikron();
    let overlay = parameters.overlay_yaml(text, "site.yaml", Some("/mill")).expect("a valid file");
    assert_eq!((overlay.parameters, overlay.ignored.len()), (1, 3));
    assert_eq!(overlay.ignored[0], "site.yaml:3: unknown parameter cell_name");
    assert_eq!(
        overlay.ignored[1],
        "site.yaml:5: unknown parameter x.velocity_loop.gian; the nearest is x.velocity_loop.gain"
    );
    assert_eq!(parameters.get("x.velocity_loop.gain"), Some(Value::Double(4.0)));
    assert_eq!(parameters.node_config().publish_rate, None);

    let own = text.replace("/**:", "/mill:").replace("\nmill:", "\n/*:");
    let error = parameters.overlay_yaml(&own, "site.yaml", Some("/mill")).map_err(|error| error.to_string());
    assert_eq!(error, Err("site.yaml:3: unknown parameter cell_name".to_owned()));

    let ignored = |text: &str| {
        let assignment = parse_assignment(text, &ValueSource::named("-p")).expect("an assignment");
        parameters.ignored(&assignment).map(|reason| reason.to_string())
    };
    for foreign in ["foreign", "cell", "base", "gain", "arr", "frame_id", "rate", "plugin.name"] {
        let reason = ignored(&format!("{foreign}:=1"));
        assert!(reason.is_some_and(|reason| reason.starts_with(&format!("-p: unknown parameter {foreign}"))));
    }
    for slip in ["publsh_rate", "velocity_loop.gain", "use_sim_tiem"] {
        assert_eq!(ignored(&format!("{slip}:=1")), None, "{slip}");
    }
    assert!(ignored("start_type_description_service:=false").is_some());
    for (foreign, own) in [
        ("/joint_states.publisher.durability", "; the nearest is qos.joint_states.durability"),
        ("/joint_states.publisher.history", ""),
        ("/parameter_events.publisher.reliability", ""),
    ] {
        let reason = format!("-p: unknown parameter qos_overrides.{foreign}{own}");
        assert_eq!(ignored(&format!("qos_overrides.{foreign}:=volatile")), Some(reason));
    }
    assert!(
        ignored("gains.x.p:=2.0")
            .is_some_and(|reason| reason.starts_with("-p: gains.x.p = 2: must be omitted"))
    );
    for own in ["x.velocity_loop.gian:=4", "constraints.goal_time:=1", "command_interfaces:=[position]"] {
        assert_eq!(ignored(own), None);
    }
}

/// Returns the parameters of a node `/mill` after a file, and its warnings.
fn overlaid(text: &str) -> Result<(Parameters, Vec<String>), String> {
    let mut parameters = mikron();
    let overlay =
        parameters.overlay_yaml(text, "site.yaml", Some("/mill")).map_err(|error| error.to_string())?;
    Ok((parameters, [overlay.ignored, overlay.repeated].concat()))
}

#[test]
fn the_last_of_several_values_in_a_shared_section_applies() {
    let text = "\
/**:
  ros__parameters:
    cell: 1
    x: {velocity_loop: {gain: 4}}
    cell: 2
    x.velocity_loop.gain: 4.5
mill:
  ros__parameters: {y.velocity_loop.gain: 3}
mill:
  ros__parameters: {z.velocity_loop.gain: 3.5}
";
    let (parameters, warnings) = overlaid(text).expect("a valid file");
    for (key, value) in [("x", 4.5), ("y", 3.0), ("z", 3.5)] {
        assert_eq!(parameters.get(&format!("{key}.velocity_loop.gain")), Some(Value::Double(value)));
    }
    assert_eq!(
        warnings,
        [
            "site.yaml:3: unknown parameter cell",
            "site.yaml:6: duplicate parameter x.velocity_loop.gain, first set at site.yaml:4",
        ]
    );
    let controller = "mill:\n  ros__parameters:\n    joints: [x]\n    command_interfaces: [position]\n    joints: [y, x]\n";
    let (_, warnings) = overlaid(controller).expect("as a controller reads it");
    assert_eq!(warnings, ["site.yaml:5: duplicate parameter joints, first set at site.yaml:3"]);
    let own = "mill:\n  ros__parameters:\n    x.velocity_loop.gain: 4\n    x.velocity_loop.gain: 5\n";
    let error = "site.yaml:4: duplicate parameter x.velocity_loop.gain, first set at site.yaml:3";
    assert_eq!(overlaid(own).map(|_| ()), Err(error.to_owned()));
}

#[test]
fn files_of_other_nodes_that_ros_reads_are_accepted() {
    for text in ["", "# nothing\n", "---\n"] {
        assert_eq!(overlaid(text), Ok((mikron(), Vec::new())), "{text}");
        assert!(Parameters::from_yaml(text, "my.yaml").is_err());
    }
    let shared = |lines: &str| overlaid(&format!("/**:\n  ros__parameters:\n    {lines}\n"));
    for (line, reason) in [
        ("arr: [1, two]", "arr: found a list with mixed types or nested items, expected a value"),
        ("arr: [{a: 1}]", "arr: found a list with mixed types or nested items, expected a value"),
        (
            "machine: vmc_3",
            "machine = vmc_3: must be part of a complete machine, which a machine file describes",
        ),
        (
            "joints: [shoulder, elbow]",
            "joints = [shoulder, elbow]: must be part of a complete machine, which a machine file describes",
        ),
    ] {
        assert_eq!(shared(line), Ok((mikron(), vec![format!("site.yaml:3: {reason}")])), "{line}");
    }
    let slip = "/**:\n  ros__parameters: {update_rate: 50.0, type: diff}\nmill:\n  ros__parameters: {x.velocity_loop.gian: 4}\n";
    assert!(overlaid(slip).is_err_and(|error| error.contains("unknown parameter x.velocity_loop.gian")));
    let both = shared("machine: ur5e\n    joints: [shoulder, elbow]").expect("a file of another node");
    assert_eq!((both.0, both.1.len()), (mikron(), 2));
    for (line, reason) in [
        ("x.velocity_loop.gain: [1, two]", "x.velocity_loop.gain: found a list with mixed types"),
        ("joints: [x, elbow]", "elbow.type is missing"),
        ("machine: vmc_3\n    x.velocity_loop.gain: 4.0", "joints is missing"),
    ] {
        assert!(shared(line).is_err_and(|error| error.contains(reason)), "{line}");
    }
}

/// Values as rcl_yaml_param_parser of Jazzy reads them.
#[test]
fn all_documents_of_a_file_are_read() {
    let text = "%YAML 1.1\n---\nmill:\n  ros__parameters: {x.velocity_loop.gain: 4}\n---\n---\nlathe:\n  ros__parameters: {cell: 1}\n\
                ---\nmill:\n  ros__parameters:\n    x.velocity_loop.gain: 4.5\n    y.velocity_loop.gain: 3\n...\n";
    let (parameters, warnings) = overlaid(text).expect("a valid file");
    for (key, value) in [("x", 4.5), ("y", 3.0)] {
        assert_eq!(parameters.get(&format!("{key}.velocity_loop.gain")), Some(Value::Double(value)));
    }
    assert_eq!(warnings, Vec::<String>::new());
    let error = overlaid("lathe:\n  ros__parameters: {cell: 1}\n---\nmill: 5\n").expect_err("no section");
    assert!(
        error.starts_with("site.yaml:4: not a ROS 2 parameter file: no `ros__parameters` in `mill`"),
        "{error}"
    );
}

#[test]
fn an_integer_of_more_than_64_bits_is_a_number() {
    let other = "lathe:\n  ros__parameters: {mask: 18446744073709551615, big: 340282366920938463463374607431768211456, \
                 low: -9223372036854775809}\nmill:\n  ros__parameters: {x.velocity_loop.gain: 4}\n";
    assert_eq!(overlaid(other).map(|(_, warnings)| warnings), Ok(Vec::new()));
    let own = "mill:\n  ros__parameters: {max_points: 18446744073709551615}\n";
    let error = overlaid(own).expect_err("no integer");
    assert!(
        error.starts_with("site.yaml:2: max_points: found number 18446744073709552000, expected integer"),
        "{error}"
    );
}

#[test]
fn the_publisher_of_the_clock_ignores_use_sim_time_of_a_file_for_all_nodes() {
    let shared = "/**:\n  ros__parameters: {use_sim_time: true}\n";
    let fast = || Assignment {
        key: "time".to_owned(),
        value: Value::Text("fast".to_owned()),
        source: ValueSource::named("-p"),
    };
    let mut parameters = mikron();
    parameters.set_all(vec![fast()]).expect("a choice");
    let overlay = parameters.overlay_yaml(shared, "site.yaml", Some("/mill")).expect("a valid file");
    assert_eq!(
        overlay.ignored,
        ["site.yaml:2: use_sim_time = true: must be false for this node: time = fast publishes /clock"]
    );
    assert!(parameters.overlay_yaml(&shared.replace("/**", "mill"), "own.yaml", Some("/mill")).is_err());

    let mut parameters = mikron();
    parameters.overlay_yaml(shared, "site.yaml", Some("/mill")).expect("a valid file");
    assert!(parameters.node_config().use_sim_time);
    parameters.set_all(vec![fast()]).expect("a choice");
    let config = parameters.node_config();
    assert!(!config.use_sim_time && config.time == TimeMode::Fast);
}

#[test]
fn a_file_with_a_controller_manager_is_a_file_of_controllers() {
    let own =
        "base:\n  ros__parameters: {left_wheel_names: [l], wheel_separation: 0.5, publish_rate: 50.0}\n";
    assert!(mikron().overlay_yaml(own, "base.yaml", Some("/base")).is_err());
    let manager = "controller_manager:\n  ros__parameters: {update_rate: 100}\n";
    let overlay = mikron().overlay_yaml(&format!("{manager}{own}"), "base.yaml", Some("/base"));
    assert_eq!(overlay.map(|overlay| overlay.ignored.len()), Ok(2));
}

#[test]
fn a_flag_may_be_a_word_that_ros_reads_as_one() {
    let key = "allow_nonzero_velocity_at_trajectory_end";
    for (word, flag) in
        [("yes", true), ("On", true), ("y", true), ("no", false), ("OFF", false), ("N", false)]
    {
        let (parameters, _) =
            overlaid(&format!("mill:\n  ros__parameters: {{{key}: {word}}}\n")).expect(word);
        assert_eq!(parameters.get(key), Some(Value::Bool(flag)), "{word}");
    }
    let error = overlaid(&format!("mill:\n  ros__parameters: {{{key}: 'true'}}\n"));
    assert!(error.is_err_and(|error| error.contains("found text \"true\", expected true or false")));
}

#[test]
fn a_file_of_a_controller_is_followed_as_far_as_the_node_can() {
    let text = "\
arm:
  ros__parameters:
    joints: [shoulder, elbow]
    command_interfaces: [effort]
    state_publish_rate: 100.0
    interpolation_method: cubic
    vendor_extension: 3
    gains:
      shoulder: {p: 1.0, i: 0.0}
      elbow: {p: 2.0}
    constraints:
      goal_time: 0.5
      elbow: {goal: 0.1}
      x: {goal: 0.002, trajectory: -1.0}
      y: {goal: 0.1}
";
    let mut parameters = mikron();
    let overlay = parameters.overlay_yaml(text, "arm.yaml", Some("/arm")).expect("the file of a controller");
    let ignored: Vec<_> =
        overlay.ignored.iter().map(|reason| reason.split([' ', ';']).collect::<Vec<_>>()).collect();
    let keys: Vec<_> = ignored.iter().map(|words| (words[0], words[1])).collect();
    let expected = [
        ("arm.yaml:3:", "joints"),
        ("arm.yaml:4:", "command_interfaces"),
        ("arm.yaml:5:", "state_publish_rate"),
        ("arm.yaml:6:", "interpolation_method"),
        ("arm.yaml:7:", "unknown"),
        ("arm.yaml:9:", "gains.shoulder.p"),
        ("arm.yaml:13:", "constraints.elbow.goal"),
        ("arm.yaml:14:", "constraints.x.trajectory"),
    ];
    assert_eq!(keys, expected);
    assert_eq!(parameters.get("constraints.x.goal"), Some(Value::Double(0.002)));
    assert_eq!(parameters.get("goal_time_tolerance"), Some(Value::Double(0.5)));
    assert_eq!(parameters.machine_config().map(|machine| machine.axes().len()), Ok(5));

    // Joints of this machine are followed, with their prefix.
    let text = text.replace("[shoulder, elbow]", "[cell_x, cell_c]\n    joint_prefix: cell_");
    let overlay = parameters.overlay_yaml(&text, "arm.yaml", Some("/arm")).expect("the file of a controller");
    // Not its joints any more, but the constraint of a joint that it does not have.
    assert_eq!(overlay.ignored.len(), expected.len());
    assert!(
        overlay.ignored.last().is_some_and(|reason| reason.contains("constraints.y.goal does not apply"))
    );
    assert_eq!(parameters.get("joints"), Some(Value::TextList(vec!["x".to_owned(), "c".to_owned()])));
}

#[test]
fn an_overlay_for_another_node_changes_nothing() {
    let mut parameters = mikron();
    let text = "/mill:\n  ros__parameters:\n    nonsense: 1\n";
    let overlay = parameters.overlay_yaml(text, "site.yaml", Some("/lathe"));
    let overlay = overlay.expect("nothing for this node");
    assert_eq!((overlay.sections, overlay.skipped), (0, vec!["/mill".to_owned()]));
    assert_eq!(parameters, mikron());
}

#[test]
fn an_invalid_overlay_changes_nothing() {
    let mut parameters = mikron();
    let text = "/**:\n  ros__parameters:\n    x.velocity_loop.gain: 4\n    y.velocity_loop.gain: -4\n";
    let error = parameters.overlay_yaml(text, "site.yaml", None).map_err(|error| error.to_string());
    assert_eq!(
        error,
        Err("site.yaml:4: y.velocity_loop.gain = -4: must lie in 0 … 1e9 N·m/(rad/s)".to_owned())
    );
    assert_eq!(parameters, mikron());
}

#[test]
fn a_complete_machine_replaces_the_machine_and_keeps_node_parameters() {
    let mut parameters = mikron();
    assert_eq!(parameters.set_text("joint_prefix=mill_", &source()), Ok(()));
    let text = include_str!("../../../config/linear_motor_center.yaml");
    let overlay = parameters.overlay_yaml(text, "other.yaml", None);
    assert_eq!(overlay.map(|overlay| overlay.is_machine_replaced), Ok(true));
    let expected = Parameters::load("linear_motor_center", virtual_axes_builtin::MACHINES)
        .map(|machine| machine.machine_config());
    assert_eq!(Ok(parameters.machine_config()), expected);
    assert_eq!(parameters.node_config().joint_prefix, "mill_");
}

#[test]
fn an_incomplete_machine_is_rejected() {
    let text = "/**:\n  ros__parameters:\n    joints: [x]\n    x.type: linear\n";
    let error = mikron().overlay_yaml(text, "half.yaml", None).map_err(|error| error.to_string());
    let message = error.err().unwrap_or_default();
    assert!(message.starts_with("half.yaml: machine is missing: "), "{message}");
    assert!(message.ends_with("omit both to change parameters of the present machine"));
}

#[test]
fn definitions_are_consistent() {
    for (index, definition) in DEFINITIONS.iter().enumerate() {
        let key = definition.key;
        assert!(definition.description.ends_with('.'), "{key}");
        if let ParameterKind::Number { min, max } = definition.kind {
            assert!(min < max && min.is_finite() && max.is_finite(), "{key}");
        }
        if let Some(value) = definition.default_value() {
            assert_eq!(definition.checked(key, &value, &source()), Ok(value), "{key}");
        }
        if definition.scope == Scope::Node {
            // A machine file need not contain node parameters.
            assert!(matches!(definition.presence, Presence::Default(_)), "{key}");
        }
        for other in &DEFINITIONS[index + 1..] {
            let same_axis = definition.axis.is_none() || definition.axis == other.axis;
            let same_motor = definition.motor.is_none() || definition.motor == other.motor;
            assert!(key != other.key || !(same_axis && same_motor), "{key} is ambiguous");
        }
    }
    assert_eq!(listing::rows().len(), DEFINITIONS.len());
    assert_eq!(listing::markdown().lines().count(), DEFINITIONS.len() + 2);
}
