//! States and transitions of a managed node, with the numbers and labels of `rcl_lifecycle`.

use ros2_interfaces_jazzy_serde::lifecycle_msgs::msg::{State, Transition, TransitionDescription};

/// Primary state of a managed node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PrimaryState {
    /// The machine is not read; all parameters can be set.
    Unconfigured,
    /// The axes are at rest; no trajectory is accepted and no sample published.
    Inactive,
    /// The axes follow trajectories.
    Active,
    /// No transition is possible.
    Finalized,
}

/// Transition that a client can request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RequestedTransition {
    /// Reads the machine and creates topics, services and actions.
    Configure,
    /// Removes them.
    Cleanup,
    /// Accepts trajectories and publishes samples.
    Activate,
    /// Stops the axes within their limits.
    Deactivate,
    /// Ends the operation for good.
    Shutdown,
}

/// Number and label of a state.
type StateRow = (u8, &'static str);

/// States in the order of their numbers.
const STATES: [StateRow; 11] = [
    (State::PRIMARY_STATE_UNKNOWN, "unknown"),
    (State::PRIMARY_STATE_UNCONFIGURED, "unconfigured"),
    (State::PRIMARY_STATE_INACTIVE, "inactive"),
    (State::PRIMARY_STATE_ACTIVE, "active"),
    (State::PRIMARY_STATE_FINALIZED, "finalized"),
    (State::TRANSITION_STATE_CONFIGURING, "configuring"),
    (State::TRANSITION_STATE_CLEANINGUP, "cleaningup"),
    (State::TRANSITION_STATE_SHUTTINGDOWN, "shuttingdown"),
    (State::TRANSITION_STATE_ACTIVATING, "activating"),
    (State::TRANSITION_STATE_DEACTIVATING, "deactivating"),
    (State::TRANSITION_STATE_ERRORPROCESSING, "errorprocessing"),
];

const SUCCESS: &str = "transition_success";
const FAILURE: &str = "transition_failure";
const ERROR: &str = "transition_error";

/// Transitions: number, label, start and goal.
const TRANSITIONS: [(u8, &str, u8, u8); 25] = [
    (1, "configure", 1, 10),
    (10, SUCCESS, 10, 2),
    (11, FAILURE, 10, 1),
    (12, ERROR, 10, 15),
    (2, "cleanup", 2, 11),
    (20, SUCCESS, 11, 1),
    (21, FAILURE, 11, 2),
    (22, ERROR, 11, 15),
    (3, "activate", 2, 13),
    (30, SUCCESS, 13, 3),
    (31, FAILURE, 13, 2),
    (32, ERROR, 13, 15),
    (4, "deactivate", 3, 14),
    (40, SUCCESS, 14, 2),
    (41, FAILURE, 14, 3),
    (42, ERROR, 14, 15),
    (5, "shutdown", 1, 12),
    (6, "shutdown", 2, 12),
    (7, "shutdown", 3, 12),
    (50, SUCCESS, 12, 4),
    (51, FAILURE, 12, 4),
    (52, ERROR, 12, 15),
    (60, SUCCESS, 15, 1),
    (61, FAILURE, 15, 4),
    (62, ERROR, 15, 4),
];
/// Numbers above this one belong to the ends of transitions, which no client requests.
const LAST_REQUESTED: u8 = 7;

impl PrimaryState {
    fn number(self) -> u8 {
        match self {
            Self::Unconfigured => State::PRIMARY_STATE_UNCONFIGURED,
            Self::Inactive => State::PRIMARY_STATE_INACTIVE,
            Self::Active => State::PRIMARY_STATE_ACTIVE,
            Self::Finalized => State::PRIMARY_STATE_FINALIZED,
        }
    }

    fn from_number(number: u8) -> Option<Self> {
        [Self::Unconfigured, Self::Inactive, Self::Active, Self::Finalized]
            .into_iter()
            .find(|state| state.number() == number)
    }

    /// Returns the message.
    pub fn message(self) -> State {
        state(self.number())
    }

    /// Returns the transitions that a client can request in this state.
    pub fn available(self) -> Vec<TransitionDescription> {
        transitions().into_iter().filter(|row| self.allows(row)).collect()
    }

    /// Returns the transition with the label of `request`, or with its number if it has no label; `None` if this state
    /// has no such transition.
    pub fn find(self, request: &Transition) -> Option<TransitionDescription> {
        self.available().into_iter().find(|row| match request.label.as_str() {
            "" => row.transition.id == request.id,
            label => row.transition.label == label,
        })
    }

    fn allows(self, row: &TransitionDescription) -> bool {
        row.start_state.id == self.number() && row.transition.id <= LAST_REQUESTED
    }
}

impl RequestedTransition {
    /// Returns the transition of a description; `None` if a client cannot request it.
    pub fn of(description: &TransitionDescription) -> Option<Self> {
        Some(match description.transition.id {
            Transition::TRANSITION_CONFIGURE => Self::Configure,
            Transition::TRANSITION_CLEANUP => Self::Cleanup,
            Transition::TRANSITION_ACTIVATE => Self::Activate,
            Transition::TRANSITION_DEACTIVATE => Self::Deactivate,
            Transition::TRANSITION_UNCONFIGURED_SHUTDOWN
            | Transition::TRANSITION_INACTIVE_SHUTDOWN
            | Transition::TRANSITION_ACTIVE_SHUTDOWN => Self::Shutdown,
            _ => return None,
        })
    }
}

/// Returns the end of a transition that is in the state `during`, with the primary state after it.
pub fn end(during: &State, is_successful: bool) -> Option<(TransitionDescription, PrimaryState)> {
    let label = if is_successful { SUCCESS } else { FAILURE };
    let row =
        transitions().into_iter().find(|row| row.start_state == *during && row.transition.label == label)?;
    let after = PrimaryState::from_number(row.goal_state.id)?;
    Some((row, after))
}

/// Returns all states.
pub fn states() -> Vec<State> {
    STATES.iter().map(|&(id, label)| State { id, label: label.to_owned() }).collect()
}

/// Returns all transitions.
pub fn transitions() -> Vec<TransitionDescription> {
    let row = |&(id, label, start, goal): &(u8, &str, u8, u8)| TransitionDescription {
        transition: Transition { id, label: label.to_owned() },
        start_state: state(start),
        goal_state: state(goal),
    };
    TRANSITIONS.iter().map(row).collect()
}

/// Returns the state with a number.
fn state(id: u8) -> State {
    let label = STATES.iter().find(|(number, _)| *number == id).map_or("unknown", |(_, label)| *label);
    State { id, label: label.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn available(state: PrimaryState) -> Vec<String> {
        state.available().into_iter().map(|row| row.transition.label).collect()
    }

    #[test]
    fn each_state_has_its_transitions() {
        assert_eq!(available(PrimaryState::Unconfigured), ["configure", "shutdown"]);
        assert_eq!(available(PrimaryState::Inactive), ["cleanup", "activate", "shutdown"]);
        assert_eq!(available(PrimaryState::Active), ["deactivate", "shutdown"]);
        assert!(available(PrimaryState::Finalized).is_empty());
    }

    #[test]
    fn a_transition_is_found_by_label_or_number() {
        let find = |id, label: &str| {
            let found = PrimaryState::Active.find(&Transition { id, label: label.to_owned() });
            found.map(|row| row.transition.id)
        };
        assert_eq!(find(4, ""), Some(4));
        assert_eq!(find(0, "shutdown"), Some(7));
        assert_eq!(find(3, "deactivate"), Some(4));
        assert_eq!(find(3, ""), None);
        assert_eq!(find(40, ""), None);
    }

    #[test]
    fn every_requested_transition_ends() {
        for row in transitions().iter().filter(|row| row.transition.id <= LAST_REQUESTED) {
            assert!(RequestedTransition::of(row).is_some());
            for is_successful in [true, false] {
                let (_, after) = end(&row.goal_state, is_successful).unwrap();
                let is_back = after.number() == row.start_state.id;
                assert_eq!(is_back, !is_successful && row.transition.label != "shutdown", "{row:?}");
            }
        }
    }
}
