use proptest::prelude::*;

use super::*;

fn parse(line: &str) -> Result<Command, ArgsError> {
    Command::parse(line.split_whitespace(), "talker")
}

fn run(line: &str) -> RosArgs {
    match parse(line) {
        Ok(Command::Run(args)) => args,
        other => panic!("{line}: {other:?}"),
    }
}

fn rejection(line: &str) -> String {
    match parse(line) {
        Err(error) => error.to_string(),
        Ok(command) => panic!("{line}: {command:?}"),
    }
}

#[test]
fn without_arguments_the_node_has_its_default_name() {
    let args = run("");
    assert_eq!(args.node().to_string(), "/talker");
    assert_eq!(args.parameters().count(), 0);
    assert_eq!(args.log_level(), None);
    assert_eq!(args.log_sinks(), LogSinks::default());
    assert_eq!(run("--ros-args"), args);
    assert_eq!(run("--ros-args --"), args);
}

#[test]
fn help_and_version_apply_outside_ros_args_only() {
    assert_eq!(parse("--help"), Ok(Command::Help));
    assert_eq!(parse("-h --version"), Ok(Command::Help));
    for (arguments, is_managed) in
        [("", false), ("--lifecycle", true), ("--ros-args -r a:=b -- --lifecycle", true)]
    {
        let Ok(Command::Run(args)) = parse(arguments) else { panic!("{arguments}") };
        assert_eq!(args.is_managed(), is_managed, "{arguments}");
    }
    assert_eq!(parse("--ros-args -r a:=b -- --version"), Ok(Command::Version));
    assert!(rejection("--ros-args --help").contains("--help"));
}

#[test]
fn arguments_outside_ros_args_are_rejected() {
    for line in ["x", "-r a:=b", "a:=b", "--", "--ros-args -- x", "--ros-args -r a:=b -- --"] {
        assert!(rejection(line).contains("after --ros-args"), "{line}");
    }
}

#[test]
fn several_blocks_of_ros_args_are_accepted() {
    let args = run("--ros-args -p a:=1 -- --ros-args -p b:=2 --ros-args -p c:=3");
    assert_eq!(args.parameters().count(), 3);
}

#[test]
fn parameters_keep_text_order_and_node() {
    use ParameterSource::{File, Value};
    let args = run("--ros-args -p x.gain:=4.5 --params-file p.yaml --param talker:a/b:=b:=c -p other:a:=1");
    let found: Vec<_> = args.parameters().cloned().collect();
    let value = |node: Option<&str>, name: &str, text: &str| Value {
        node: node.map(str::to_owned),
        name: name.to_owned(),
        text: text.to_owned(),
    };
    assert_eq!(
        found,
        [value(None, "x.gain", "4.5"), File("p.yaml".into()), value(Some("talker"), "a/b", "b:=c"),]
    );
}

#[test]
fn a_parameter_for_this_node_applies_in_a_namespace_too() {
    assert_eq!(run("--ros-args -r __ns:=/foo -p talker:a:=1").parameters().count(), 1);
    assert_eq!(run("--ros-args -r __node:=a -p talker:a:=1").parameters().count(), 0);
    assert_eq!(run("--ros-args -r __node:=a -p a:a:=1").parameters().count(), 1);
}

#[test]
fn an_empty_string_parameter_requires_quotes() {
    assert!(rejection("--ros-args -p a:=").contains("''"));
    assert_eq!(run("--ros-args -p a:=''").parameters().count(), 1);
}

#[test]
fn invalid_arguments_are_rejected_with_flag_value_and_expectation() {
    for (line, parts) in [
        ("--ros-args -p", ["'-p' lacks", "name:=value"]),
        ("--ros-args -p a", ["'-p a'", "no ':='"]),
        ("--ros-args -p a:b:c:=1", ["'b:c'", "parameter name"]),
        ("--ros-args -p 1a:=2", ["'1a'", "name:=value"]),
        ("--ros-args -p a-b:=2", ["'a-b'", "name:=value"]),
        ("--ros-args -p :=2", ["''", "name:=value"]),
        ("--ros-args --params-file", ["lacks", "path"]),
        ("--ros-args -r a:=b:=c", ["'b:=c'", "from:=to"]),
        ("--ros-args -r chatter:=", ["chatter:=", "it is empty"]),
        ("--ros-args -r chatter:=~", ["'~'", "from:=to"]),
        ("--ros-args -r chatter:={node}/u", ["{node}", "from:=to"]),
        ("--ros-args -r chatter:=rostopic://s", ["rostopic://s", "from:=to"]),
        ("--ros-args -r /*:=s", ["'-r /*:=s'", "wildcards"]),
        ("--ros-args -r 1a:=b", ["'1a'", "digit"]),
        ("--ros-args -r a__b:=c", ["'a__b'", "underscores"]),
        ("--ros-args -r __ns:=foo", ["'foo'", "slash"]),
        ("--ros-args -r __ns:=/a/", ["'/a/'", "slash"]),
        ("--ros-args -r __node:=a/b", ["'a/b'", "node name"]),
        ("--ros-args -r __foo:=a", ["'__foo'", "underscores"]),
        ("--ros-args --log-level warning", ["'warning'", "WARN"]),
        ("--ros-args --log-level x:=y:=info", ["'y:=info'", "DEBUG"]),
        ("--ros-args --log-level :=info", ["no logger", "DEBUG"]),
        ("--ros-args -e x", ["'x'", "absolute"]),
        ("--ros-args --foo", ["'--foo'", "--params-file"]),
        ("--ros-args --disable-foo-logs", ["'--disable-foo-logs'", "rosout-logs"]),
        ("--ros-args --log-level=debug", ["'--log-level=debug'", "--log-level"]),
    ] {
        let message = rejection(line);
        for part in parts {
            assert!(message.contains(part), "{line}: {message}");
        }
    }
}

// Expected names: resolved by rclpy of Jazzy with the same arguments.
#[test]
fn names_resolve_as_in_rcl() {
    for (line, node, topics) in [
        ("", "/talker", ["/chatter", "/chatter", "/talker/chatter", "/foo/chatter"]),
        ("-r chatter:=c2", "/talker", ["/c2", "/c2", "/talker/chatter", "/foo/chatter"]),
        ("-r ~/chatter:=/x", "/talker", ["/chatter", "/chatter", "/x", "/foo/chatter"]),
        ("-r chatter:=~/x", "/talker", ["/talker/x", "/talker/x", "/talker/chatter", "/foo/chatter"]),
        ("-r __ns:=/foo", "/foo/talker", ["/foo/chatter", "/chatter", "/foo/talker/chatter", "/foo/chatter"]),
        (
            "-r __ns:=/foo -r /chatter:=/z",
            "/foo/talker",
            ["/foo/chatter", "/z", "/foo/talker/chatter", "/foo/chatter"],
        ),
        ("-r __ns:=/foo -r chatter:=/z", "/foo/talker", ["/z", "/chatter", "/foo/talker/chatter", "/z"]),
        ("-r __node:=a -r a:chatter:=q", "/a", ["/q", "/q", "/a/chatter", "/foo/chatter"]),
        ("-r __name:=a -r talker:chatter:=q", "/a", ["/chatter", "/chatter", "/a/chatter", "/foo/chatter"]),
        (
            "-r rosservice://chatter:=s",
            "/talker",
            ["/chatter", "/chatter", "/talker/chatter", "/foo/chatter"],
        ),
        ("-r rostopic://chatter:=s", "/talker", ["/s", "/s", "/talker/chatter", "/foo/chatter"]),
        (
            "-r talker:__ns:=/foo",
            "/foo/talker",
            ["/foo/chatter", "/chatter", "/foo/talker/chatter", "/foo/chatter"],
        ),
        ("-r other:__ns:=/foo", "/talker", ["/chatter", "/chatter", "/talker/chatter", "/foo/chatter"]),
        ("-r chatter:=c1 -r chatter:=c2", "/talker", ["/c1", "/c1", "/talker/chatter", "/foo/chatter"]),
        ("-r __node:=a -r __node:=b", "/a", ["/chatter", "/chatter", "/a/chatter", "/foo/chatter"]),
    ] {
        let args = run(&format!("--ros-args {line}"));
        assert_eq!(args.node().to_string(), node, "{line}");
        let resolved = ["chatter", "/chatter", "~/chatter", "/foo/chatter"]
            .map(|name| args.resolve_topic(name).unwrap());
        assert_eq!(resolved, topics, "{line}");
    }
}

#[test]
fn a_service_rule_does_not_apply_to_topics() {
    let args = run("--ros-args -r rosservice://~/reset:=/home -r rostopic://stop:=/halt");
    assert_eq!(args.resolve_service("~/reset").unwrap(), "/home");
    assert_eq!(args.resolve_topic("~/reset").unwrap(), "/talker/reset");
    assert_eq!(args.resolve_service("stop").unwrap(), "/stop");
    assert!(args.resolve_topic("stop it").is_err());
}

/// A rule for a part of an action applies as in rcl, before one for the whole action.
#[test]
fn parts_of_an_action_are_remapped() {
    let line = "--ros-args -r ~/move/_action/status:=/goals -r rosservice://~/move/_action/send_goal:=go -r ~/move:=/m";
    let args = run(line);
    for (kind, part, name) in [
        (NameKind::Topic, "status", "/goals"),
        (NameKind::Topic, "feedback", "/m/_action/feedback"),
        (NameKind::Service, "send_goal", "/go"),
        (NameKind::Service, "get_result", "/m/_action/get_result"),
        (NameKind::Topic, "send_goal", "/m/_action/send_goal"),
    ] {
        assert_eq!(args.resolve_action_part(kind, "~/move", part).as_deref(), Ok(name));
    }
}

#[test]
fn log_arguments_are_stored_per_logger() {
    let args = run("--ros-args --log-level warn --log-level rustdds:=Debug --disable-rosout-logs \
         --disable-stdout-logs --enable-stdout-logs");
    assert_eq!(args.log_level(), Some(LogLevel::Warn));
    assert_eq!(args.logger_levels(), [("rustdds".to_owned(), LogLevel::Debug)]);
    assert!(!args.log_sinks().rosout && args.log_sinks().stdout && args.log_sinks().external_lib);
}

#[test]
fn arguments_without_effect_cause_warnings() {
    let args = run("--ros-args --log-file-name a --log-config-file b");
    assert_eq!(args.warnings().len(), 2);
}

#[test]
fn the_last_enclave_applies() {
    let args = run("--ros-args -e /x --enclave /cell/mill");
    assert_eq!(args.enclave(), Some("/cell/mill"));
    assert!(args.warnings().is_empty());
    assert_eq!(run("").enclave(), None);
}

fn argument() -> impl Strategy<Value = String> {
    prop_oneof![
        any::<String>(),
        "[-a-z_/~:={}*.0-9 ]{0,12}",
        "(-r|-p|-e|--|--ros-args|--param|--remap|--params-file|--log-level|--enclave|--enable-stdout-logs)",
        "(a:)?(__ns|__node|~/a|rostopic://a|/b):=(/a/b|~/c|d|/)",
    ]
}

/// Returns true if the name is absolute and no part of it is empty.
fn is_valid_name(resolved: &str) -> bool {
    resolved.strip_prefix('/').is_some_and(|parts| parts.split('/').all(|part| !part.is_empty()))
}

proptest! {
    #[test]
    fn no_argument_vector_panics(
        arguments in proptest::collection::vec(argument(), 0..8),
        name in argument(),
    ) {
        let ros = std::iter::once("--ros-args".to_owned()).chain(arguments.clone());
        for result in [Command::parse(&arguments, "talker"), Command::parse(ros, "talker")] {
            match result {
                Ok(Command::Run(args)) => {
                    if let Ok(resolved) = args.resolve_topic(&name) {
                        prop_assert!(is_valid_name(&resolved), "{}", resolved);
                    }
                    let _ = args.resolve_service(&name);
                }
                Ok(Command::Help | Command::Version) => {}
                Err(error) => prop_assert!(!error.to_string().is_empty()),
            }
        }
    }
}
