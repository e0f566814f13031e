//! Fuzz targets of messages and requests from the network: four bytes of header, then CDR.

use std::fmt::Debug;
use std::sync::Arc;

use byteorder::{BigEndian, LittleEndian};
use serde::Serialize;
use serde::de::DeserializeOwned;
use virtual_axes::validation::parameters::{
    LiveNodeParameters, ParameterStore, check_count, descriptor_to_wire, list_parameters,
    parameter_from_wire, result_to_wire, type_number, value_to_wire,
};
use virtual_axes::validation::{
    CancelCandidate, GoalValidator, ReorderFilter, StreamSetpoints, TrajectoryValidator, loads,
    select_goals_to_cancel,
};
use virtual_axes_core::trajectory::MotionId;
use virtual_axes_core::units::SECOND_NS;
use virtual_axes_io::messages::action_msgs::srv::CancelGoalRequest;
use virtual_axes_io::messages::rcl_interfaces::srv::{
    DescribeParametersRequest, GetParameterTypesRequest, GetParametersRequest, ListParametersRequest,
    SetParametersAtomicallyRequest, SetParametersRequest,
};
use virtual_axes_io::messages::rosgraph_msgs::msg::Clock;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;
use virtual_axes_io::messages::std_srvs::srv::TriggerRequest;
use virtual_axes_io::messages::trajectory_msgs::msg::JointTrajectory;
use virtual_axes_io::messages::{self, GetResultRequest, SendGoalRequest, nanoseconds};

use crate::{JOINTS, MACHINE, ORIGIN, PARAMETERS, assert_one_line, bounded, machine_at_rest, names, step};

/// Length of the encapsulation header, bytes.
const HEADER: usize = 4;
/// Simulated position cycles after an accepted message.
const PERIODS: usize = 12;
/// Longest trajectory of the target, s; the node accepts any duration.
const LONGEST: i32 = 60;

/// Decodes a sample with the decoder of RustDDS, in the byte order of the header, and asserts that it round-trips.
fn decode<T: DeserializeOwned + Serialize + PartialEq + Debug>(sample: &[u8]) -> Option<T> {
    let (header, body) = sample.split_first_chunk::<HEADER>()?;
    let message = match header[1] {
        0 => cdr_encoding::from_bytes::<T, BigEndian>(body),
        _ => cdr_encoding::from_bytes::<T, LittleEndian>(body),
    };
    let (message, consumed) = message.ok()?;
    assert!(consumed <= body.len());
    // A decoded message can be encoded and decoded again.
    let mut written = Vec::new();
    virtual_axes_io::files::encode_cdr(&message, &mut written).expect("a message can be written");
    let (again, _) = cdr_encoding::from_bytes::<T, LittleEndian>(&written[HEADER..]).expect("it can be read");
    // Bytes are compared because NaN differs from itself.
    let mut twice = Vec::new();
    virtual_axes_io::files::encode_cdr(&again, &mut twice).expect("a message can be written");
    assert_eq!(written, twice);
    Some(message)
}

fn validator() -> TrajectoryValidator {
    let live = Arc::new(LiveNodeParameters::default());
    let config = PARAMETERS.node_config();
    TrajectoryValidator {
        joints: JOINTS.clone(),
        period: MACHINE.periods().position,
        max_points: config.max_points,
        interpolates: true,
        live,
    }
}

/// Limits times, because validation checks each position cycle.
fn shorten_times(message: &mut JointTrajectory) {
    for point in &mut message.points {
        point.time_from_start.sec = point.time_from_start.sec.clamp(-1, LONGEST);
    }
}

/// Validates, submits and starts a trajectory of the topic `psec`.
pub fn cdr_psec(data: &[u8]) {
    bounded(data.len(), || {
        let Some(mut message) = decode::<JointTrajectory>(data) else { return };
        shorten_times(&mut message);
        let trajectory = match validator().validate(&message) {
            Ok(trajectory) => trajectory,
            Err(rejection) => return assert_one_line(&rejection.to_string()),
        };
        let request = messages::request(&message, usize::MAX).expect("it has just been read");
        let again = messages::joint_trajectory(&request);
        assert_eq!(messages::request(&again, usize::MAX).as_ref(), Ok(&request));
        let mut simulation = machine_at_rest();
        if let Err(rejection) = simulation.submit(MotionId(1), Arc::new(trajectory)) {
            assert_one_line(&rejection.to_string());
        }
        step(&mut simulation, PERIODS);
    });
}

/// Uses one message as setpoints (`psec_stream`) and as loads (`load`).
pub fn cdr_joint_state(data: &[u8]) {
    bounded(data.len(), || {
        let Some(message) = decode::<JointState>(data) else { return };
        let names = names();
        let mut simulation = machine_at_rest();
        let mut order = ReorderFilter::default();
        for publisher in [[1; 16], [1; 16], [2; 16]] {
            let setpoints = StreamSetpoints::from_message_in_order(&message, &names, publisher, &mut order);
            assert!(!setpoints.is_reordered, "an equal stamp is in order");
            assert!(setpoints.positions.len() <= names.len());
            setpoints.rejected.iter().for_each(|rejection| assert_one_line(&rejection.to_string()));
            for &(index, position) in &setpoints.positions {
                if let Err(rejection) = simulation.submit_setpoint_stamped(index, position, setpoints.sent) {
                    assert_one_line(&rejection.to_string());
                }
            }
            step(&mut simulation, 2);
        }
        match loads(&message, &names) {
            Ok(loads) => loads.iter().for_each(|&(index, load)| simulation.set_load(index, load, SECOND_NS)),
            Err(reason) => assert_one_line(&reason),
        }
        step(&mut simulation, PERIODS);
    });
}

/// Validates, submits and starts a goal of the action with its tolerances.
pub fn cdr_goal(data: &[u8]) {
    bounded(data.len(), || {
        let Some(mut message) = decode::<SendGoalRequest>(data) else { return };
        shorten_times(&mut message.goal.trajectory);
        let goals = GoalValidator { trajectories: Arc::new(validator()) };
        match goals.validate(&message.goal) {
            Ok((trajectory, tolerances)) => {
                let columns = trajectory.joints().len();
                assert_eq!((tolerances.path.len(), tolerances.goal.len()), (columns, columns));
                let mut simulation = machine_at_rest();
                if let Err(rejection) =
                    simulation.submit_with_tolerances(MotionId(1), Arc::new(trajectory), tolerances)
                {
                    assert_one_line(&rejection.to_string());
                }
                step(&mut simulation, PERIODS);
            }
            Err(rejection) => assert_one_line(&rejection.to_string()),
        }
    });
}

/// Processes a request of a parameter service; the last byte of the header selects the service.
pub fn cdr_parameters(data: &[u8]) {
    let settings = || ParameterStore::new(PARAMETERS.clone(), Arc::default());
    bounded(data.len(), || match data.get(HEADER - 1).copied().unwrap_or_default() % 6 {
        0 | 1 => {
            let parameters = match data.get(HEADER - 1).copied().unwrap_or_default() % 6 {
                0 => decode::<SetParametersRequest>(data).map(|request| request.parameters),
                _ => decode::<SetParametersAtomicallyRequest>(data).map(|request| request.parameters),
            };
            let parameters = parameters.unwrap_or_default();
            if let Err(reason) = check_count(parameters.len()) {
                return assert_one_line(&reason);
            }
            let changes = parameters.into_iter().map(parameter_from_wire);
            let changes = match changes.collect::<Result<Vec<_>, _>>() {
                Ok(changes) => changes,
                Err(reason) => return assert_one_line(&reason),
            };
            let mut settings = settings();
            let result = settings.check(changes.clone()).map(|(changed, _)| settings.replace(changed));
            if let Err(reason) = &result {
                assert_one_line(reason);
                assert_eq!(settings.parameters(), &*PARAMETERS, "a rejected request changes nothing");
            } else {
                // The last value of a name applies, and an integer is a valid number.
                for (index, (name, value)) in changes.iter().enumerate() {
                    let kind = settings.get(name).expect("it has just been set").kind();
                    let is_last = changes[index + 1..].iter().all(|(later, _)| later != name);
                    if is_last && value.kind() == kind {
                        assert_eq!(settings.get(name).as_ref(), Some(value));
                    }
                }
                settings.parameters().machine_config().expect("what is accepted is valid");
            }
            result_to_wire(result);
        }
        2 => {
            let Some(request) = decode::<GetParametersRequest>(data) else { return };
            let settings = settings();
            for name in &request.names {
                let wire = value_to_wire(settings.get(name));
                assert_eq!(
                    wire.type_ != 0,
                    settings.parameters().definition(name).is_some() && wire.type_ != 0
                );
            }
        }
        3 => {
            let Some(request) = decode::<GetParameterTypesRequest>(data) else { return };
            let settings = settings();
            for name in &request.names {
                type_number(settings.get(name).map(|value| value.kind()));
            }
        }
        4 => {
            let Some(request) = decode::<ListParametersRequest>(data) else { return };
            let names = settings().names();
            let found = list_parameters(&names, &request.prefixes, request.depth);
            assert!(found.names.iter().all(|name| names.contains(name)));
        }
        _ => {
            let Some(request) = decode::<DescribeParametersRequest>(data) else { return };
            let settings = settings();
            for name in request.names {
                let known = settings.get(&name).is_some();
                let descriptor = settings.describe(&name);
                assert!(!known || descriptor.is_some());
                descriptor_to_wire(name, descriptor);
            }
        }
    });
}

/// Processes messages of `/clock` and requests of `~/stop`, `~/reset`, cancel goal and get result.
pub fn cdr_other(data: &[u8]) {
    bounded(data.len(), || match data.get(HEADER - 1).copied().unwrap_or_default() % 4 {
        0 => _ = decode::<Clock>(data).map(|message| nanoseconds(&message.clock)),
        1 => _ = decode::<TriggerRequest>(data),
        2 => _ = decode::<GetResultRequest>(data),
        _ => {
            let Some(request) = decode::<CancelGoalRequest>(data) else { return };
            let goal_info = &request.goal_info;
            let goals = (0..4u8).map(|n| CancelCandidate {
                id: [n; 16],
                stamp: ORIGIN + i64::from(n) * SECOND_NS,
                is_cancelable: n != 2,
            });
            match select_goals_to_cancel(&goal_info.goal_id.uuid, nanoseconds(&goal_info.stamp), goals) {
                Ok(ids) => assert!(ids.len() <= 3 && !ids.contains(&[2; 16])),
                Err(code) => assert!(code > 0),
            }
        }
    });
}
