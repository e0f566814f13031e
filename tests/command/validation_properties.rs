//! Property tests of the validation: messages and requests with arbitrary content and arbitrary bytes.

use std::sync::{Arc, LazyLock};

use byteorder::{BigEndian, LittleEndian};
use proptest::prelude::*;
use virtual_axes::validation::parameters::{LiveNodeParameters, ParameterStore, ParameterValue};
use virtual_axes::validation::{GoalValidator, ReorderFilter, StreamSetpoints, TrajectoryValidator, loads};
use virtual_axes_core::config::{ParameterKind, Parameters};
use virtual_axes_core::simulation::{self, Simulation};
use virtual_axes_core::trajectory::{JointLimits, MotionId};
use virtual_axes_core::units::SECOND_NS;
use virtual_axes_io::messages::builtin_interfaces::msg::Duration;
use virtual_axes_io::messages::rcl_interfaces::srv::SetParametersRequest;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;
use virtual_axes_io::messages::trajectory_msgs::msg::{JointTrajectory, JointTrajectoryPoint};
use virtual_axes_io::messages::{FollowJointTrajectoryGoal, JointTolerance, SendGoalRequest};

/// Largest length of a rejection text, bytes.
const MAX_REJECTION_LENGTH: usize = 2000;

static DEFAULT: LazyLock<Parameters> =
    LazyLock::new(|| Parameters::embedded_default().expect("default machine"));

fn joints() -> Vec<JointLimits> {
    simulation::joint_limits(&DEFAULT.machine_config().expect("default machine"), "")
}

fn validator() -> TrajectoryValidator {
    let config = DEFAULT.machine_config().expect("default machine");
    let live = Arc::new(LiveNodeParameters::default());
    TrajectoryValidator {
        joints: joints(),
        period: config.periods().position,
        max_points: 1000,
        interpolates: true,
        live,
    }
}

fn at_rest() -> Simulation {
    Simulation::new(&DEFAULT.machine_config().expect("default machine"), joints(), SECOND_NS)
        .expect("default machine")
}

fn is_finite(simulation: &mut Simulation) -> bool {
    (0..10).all(|_| {
        simulation.step();
        simulation
            .samples()
            .iter()
            .all(|s| s.psec.is_finite() && s.position.is_finite() && s.current.is_finite())
    })
}

/// Returns true for a non-empty, short, single line.
fn is_one_line(text: &str) -> bool {
    !text.is_empty() && text.len() < MAX_REJECTION_LENGTH && !text.contains(char::is_control)
}

fn joint() -> impl Strategy<Value = String> {
    prop_oneof![8 => "[xyzac]", 1 => any::<String>(), 1 => Just("x\n".repeat(5000))]
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![3 => Just(0.0), 4 => -0.01..0.01f64, 1 => any::<f64>()]
}

fn numbers() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(number(), 0..4)
}

fn time() -> impl Strategy<Value = Duration> {
    let sec = prop_oneof![6 => 0..3i32, 1 => -2..100i32];
    let nanosec = prop_oneof![6 => 0..1_000_000_000u32, 1 => any::<u32>()];
    (sec, nanosec).prop_map(|(sec, nanosec)| Duration { sec, nanosec })
}

fn trajectory() -> impl Strategy<Value = JointTrajectory> {
    let point = (numbers(), numbers(), numbers(), time()).prop_map(
        |(positions, velocities, accelerations, time_from_start)| JointTrajectoryPoint {
            positions,
            velocities,
            accelerations,
            effort: vec![],
            time_from_start,
        },
    );
    (prop::collection::vec(joint(), 0..4), prop::collection::vec(point, 0..5), any::<bool>()).prop_map(
        |(joint_names, mut points, even)| {
            if even {
                // One value per joint, sorted by time: often a valid trajectory.
                points.sort_by_key(|p| (p.time_from_start.sec, p.time_from_start.nanosec));
                for point in &mut points {
                    point.positions.resize(joint_names.len(), 0.0);
                    point.velocities.clear();
                    point.accelerations.clear();
                }
            }
            JointTrajectory { joint_names, points, ..JointTrajectory::default() }
        },
    )
}

fn tolerances() -> impl Strategy<Value = Vec<JointTolerance>> {
    let tolerance = (joint(), number(), number()).prop_map(|(name, position, velocity)| JointTolerance {
        name,
        position,
        velocity,
        acceleration: -1.0,
    });
    prop::collection::vec(tolerance, 0..3)
}

/// Parameter value of any type; integers and small numbers are more frequent.
fn value() -> impl Strategy<Value = ParameterValue> {
    prop_oneof![
        any::<bool>().prop_map(ParameterValue::Bool),
        prop_oneof![-3..20i64, any::<i64>()].prop_map(ParameterValue::Integer),
        prop_oneof![0.0..2.0f64, any::<f64>()].prop_map(ParameterValue::Double),
        prop_oneof!["gpc|cascade|rst", any::<String>()].prop_map(ParameterValue::String),
        prop::collection::vec(any::<u8>(), 0..3).prop_map(ParameterValue::ByteArray),
        prop::collection::vec(any::<f64>(), 0..4).prop_map(ParameterValue::DoubleArray),
        prop::collection::vec(any::<String>(), 0..3).prop_map(ParameterValue::StringArray),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn any_trajectory_is_executed_or_rejected_with_one_line(message in trajectory()) {
        match validator().validate(&message) {
            Ok(trajectory) => {
                let mut simulation = at_rest();
                if let Err(rejection) = simulation.submit(MotionId(1), Arc::new(trajectory)) {
                    prop_assert!(is_one_line(&rejection.text), "{}", rejection);
                }
                prop_assert!(is_finite(&mut simulation));
            }
            Err(rejection) => {
                prop_assert!(is_one_line(&rejection.text), "{}", rejection);
                prop_assert!(rejection.joint.is_none_or(|joint| joint.len() < MAX_REJECTION_LENGTH));
            }
        }
    }

    #[test]
    fn any_goal_has_tolerances_for_its_joints_or_is_rejected_with_one_line(
        trajectory in trajectory(), path_tolerance in tolerances(), goal_tolerance in tolerances(),
        goal_time_tolerance in time(),
    ) {
        let goal = FollowJointTrajectoryGoal {
            trajectory, path_tolerance, goal_tolerance, goal_time_tolerance, ..Default::default()
        };
        match (GoalValidator { trajectories: Arc::new(validator()) }).validate(&goal) {
            Ok((trajectory, tolerances)) => {
                let columns = trajectory.joints().len();
                prop_assert_eq!((tolerances.path.len(), tolerances.goal.len()), (columns, columns));
                let mut simulation = at_rest();
                let _ = simulation.submit_with_tolerances(MotionId(1), Arc::new(trajectory), tolerances);
                prop_assert!(is_finite(&mut simulation));
            }
            Err(rejection) => prop_assert!(is_one_line(&rejection.text), "{}", rejection),
        }
    }

    #[test]
    fn any_streamed_setpoints_and_loads_leave_the_axes_finite(
        name in prop::collection::vec(joint(), 0..40), position in numbers(), effort in numbers(), even: bool,
    ) {
        let mut message = JointState { name, position, effort, ..JointState::default() };
        if even {
            message.position.resize(message.name.len(), 0.001);
            message.effort.resize(message.name.len(), 5.0);
        }
        let names: Vec<String> = joints().into_iter().map(|joint| joint.name).collect();
        let setpoints = StreamSetpoints::from_message_in_order(&message, &names, [0; 16], &mut ReorderFilter::default());
        let count = setpoints.rejected.len() as u64 + setpoints.unlisted_rejections + setpoints.positions.len() as u64;
        prop_assert!(count <= message.position.len().max(1) as u64);
        prop_assert!(setpoints.rejected.iter().all(|rejection| is_one_line(&rejection.text)));
        let mut simulation = at_rest();
        for (joint, position) in setpoints.positions {
            let _ = simulation.submit_setpoint_stamped(joint, position, setpoints.sent);
        }
        match loads(&message, &names) {
            Ok(loads) => loads.into_iter().for_each(|(axis, load)| simulation.set_load(axis, load, SECOND_NS)),
            Err(reason) => prop_assert!(is_one_line(&reason), "{}", reason),
        }
        prop_assert!(is_finite(&mut simulation));
    }

    #[test]
    fn any_set_of_parameters_is_applied_as_a_whole_or_rejected(
        changes in prop::collection::vec((any::<prop::sample::Index>(), value(), any::<bool>()), 1..5),
    ) {
        let mut store = ParameterStore::new(DEFAULT.clone(), Arc::default());
        let all: Vec<_> = DEFAULT.definitions().collect();
        let changes: Vec<_> = changes
            .into_iter()
            .map(|(index, value, fit)| {
                let (name, definition) = &all[index.index(all.len())];
                // Correct type and range in half of the cases.
                let value = match (definition.kind, fit) {
                    (ParameterKind::Number { min, max }, true) => ParameterValue::Double(1.0f64.clamp(min, max)),
                    (ParameterKind::Integer { min, max }, true) => ParameterValue::Integer(2_i64.clamp(min, max)),
                    (ParameterKind::Flag, true) => ParameterValue::Bool(true),
                    _ => value,
                };
                (name.clone(), value)
            })
            .collect();
        match store.check(changes.clone()) {
            Ok((changed, _)) => {
                prop_assert!(changed.machine_config().is_ok());
                store.replace(changed);
                let (name, value) = changes.last().expect("at least one change");
                let found = store.get(name).expect("parameter that was set");
                prop_assert!(found == *value || matches!((value, &found),
                    (ParameterValue::Integer(i), ParameterValue::Double(d)) if *i as f64 == *d), "{:?}", found);
            }
            Err(reason) => {
                prop_assert!(is_one_line(&reason), "{}", reason);
                prop_assert_eq!(store.parameters(), &*DEFAULT);
            }
        }
    }

    /// Decodes damaged messages in the same way as RustDDS.
    #[test]
    fn damaged_messages_do_not_panic(
        message in trajectory(), tolerance in tolerances(),
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        keep in prop_oneof![Just(1.0), 0.0..1.0f64],
        big: bool,
    ) {
        let goal = FollowJointTrajectoryGoal {
            trajectory: message, path_tolerance: tolerance, ..Default::default()
        };
        let request = SendGoalRequest { goal, ..Default::default() };
        let mut bytes = match big {
            true => cdr_encoding::to_vec::<_, BigEndian>(&request),
            false => cdr_encoding::to_vec::<_, LittleEndian>(&request),
        }.expect("message is encoded");
        let whole = bytes.len();
        for &(index, value) in &flips {
            let index = index.index(bytes.len());
            bytes[index] = value;
        }
        bytes.truncate((whole as f64 * keep) as usize);
        let found = match big {
            true => cdr_encoding::from_bytes::<SendGoalRequest, BigEndian>(&bytes),
            false => cdr_encoding::from_bytes::<SendGoalRequest, LittleEndian>(&bytes),
        };
        if let Ok((mut found, consumed)) = found {
            prop_assert!(consumed <= bytes.len());
            for point in &mut found.goal.trajectory.points {
                // Bounds the cost: every instant is checked.
                point.time_from_start.sec = point.time_from_start.sec.min(100);
            }
            if let Err(rejection) = (GoalValidator { trajectories: Arc::new(validator()) }).validate(&found.goal) {
                prop_assert!(is_one_line(&rejection.text), "{}", rejection);
            }
        } else {
            prop_assert!(!flips.is_empty() || keep < 1.0, "an undamaged message is decoded");
        }
        let _ = cdr_encoding::from_bytes::<SetParametersRequest, LittleEndian>(&bytes);
        let _ = cdr_encoding::from_bytes::<JointState, LittleEndian>(&bytes);
    }
}
