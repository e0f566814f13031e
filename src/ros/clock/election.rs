//! Election of the publisher of `/clock` among the nodes of this package in `fast`.
//!
//! Exactly one node of a domain publishes, and none while a foreign node does. Each has a publisher and discovers those
//! of the others. A node that starts listens first and follows a clock that it receives. If two nodes publish, the one
//! with the lower GUID continues. If the followed node leaves, the lowest of the remaining ones continues.

/// Number of consecutive polls after which a node that has a clock treats a participant as foreign. The topics of a
/// participant are discovered one by one, so a machine is first discovered as foreign.
const FOREIGN_POLLS: u32 = 4;
/// Number of consecutive polls without a leader after which a follower leads even if its GUID is not the lowest: the
/// lowest node may follow one that no longer leads. If two nodes start to lead, the lower continues.
const LEADERLESS_POLLS: u32 = 20;

/// GUID prefix of a participant, which orders the participants.
pub type GuidPrefix = [u8; 12];

/// Other participant that has a publisher of the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RemoteClock {
    /// GUID prefix of the participant.
    pub prefix: GuidPrefix,
    /// True for a node of this package, which takes part in the election.
    pub is_machine: bool,
}

/// Role of this node for the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Listening phase: the node waits for a clock.
    Listening,
    /// The node publishes the clock.
    Leading,
    /// The node follows the publisher of the last received message, if any.
    Following(Option<GuidPrefix>),
}

/// Election state of one node in `fast`.
#[derive(Debug)]
pub struct Election {
    own: GuidPrefix,
    remote: Vec<RemoteClock>,
    role: Role,
    /// Number of consecutive polls that found a foreign participant.
    foreign_polls: u32,
    /// Number of consecutive polls without a leader.
    leaderless_polls: u32,
}

impl Election {
    /// Creates the election in the listening phase.
    pub fn new(own: GuidPrefix) -> Self {
        Election { own, remote: Vec::new(), role: Role::Listening, foreign_polls: 0, leaderless_polls: 0 }
    }

    /// Returns the current role.
    pub fn role(&self) -> Role {
        self.role
    }

    fn find(&self, prefix: GuidPrefix) -> Option<RemoteClock> {
        self.remote.iter().copied().find(|r| r.prefix == prefix)
    }

    /// Returns true if this node has the lowest GUID of all machines.
    fn is_lowest(&self) -> bool {
        self.remote.iter().filter(|r| r.is_machine).all(|r| self.own < r.prefix)
    }

    fn has_foreign(&self) -> bool {
        self.remote.iter().any(|r| !r.is_machine)
    }

    /// Updates the role for the present publishers; `has_listened` is true after the listening phase.
    pub fn update(&mut self, remote: Vec<RemoteClock>, has_listened: bool) {
        self.remote = remote;
        self.foreign_polls = if self.has_foreign() { self.foreign_polls.saturating_add(1) } else { 0 };
        if self.foreign_polls > 0 {
            let has_clock = matches!(self.role, Role::Leading | Role::Following(Some(_)));
            let follows_it = matches!(self.role, Role::Following(Some(leader)) if self.is_foreign(leader));
            if !follows_it && (!has_clock || self.foreign_polls >= FOREIGN_POLLS) {
                self.role = Role::Following(None);
            }
            return;
        }
        let is_leaderless = match self.role {
            Role::Listening => has_listened,
            Role::Leading => false,
            Role::Following(leader) => leader.is_none_or(|leader| self.find(leader).is_none()),
        };
        self.leaderless_polls = if is_leaderless { self.leaderless_polls.saturating_add(1) } else { 0 };
        if is_leaderless {
            let leads = self.is_lowest() || self.leaderless_polls >= LEADERLESS_POLLS;
            self.role = if leads { Role::Leading } else { Role::Following(None) };
        }
    }

    fn is_foreign(&self, prefix: GuidPrefix) -> bool {
        self.find(prefix).is_some_and(|remote| !remote.is_machine)
    }

    /// Updates the role for a received message of `from`. Returns true if this node follows it.
    pub fn receive(&mut self, from: GuidPrefix) -> bool {
        let Some(remote) = self.find(from) else { return false };
        let is_followed = if !remote.is_machine {
            true
        } else if self.foreign_polls >= FOREIGN_POLLS {
            false
        } else {
            match self.role {
                Role::Listening | Role::Following(None) => true,
                Role::Leading => from < self.own,
                Role::Following(Some(leader)) => from <= leader,
            }
        };
        if is_followed {
            self.role = Role::Following(Some(from));
            self.leaderless_polls = 0;
        }
        is_followed
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn machine(number: u8) -> RemoteClock {
        RemoteClock { prefix: [number; 12], is_machine: true }
    }

    fn foreign(number: u8) -> RemoteClock {
        RemoteClock { prefix: [number; 12], is_machine: false }
    }

    #[test]
    fn the_second_node_follows_the_first_for_any_guids() {
        for (first, second) in [(1, 2), (2, 1)] {
            let mut newcomer = Election::new([second; 12]);
            newcomer.update(vec![machine(first)], false);
            assert!(newcomer.receive([first; 12]));
            newcomer.update(vec![machine(first)], true);
            assert_eq!(newcomer.role(), Role::Following(Some([first; 12])));
        }
    }

    #[test]
    fn a_single_node_leads_after_listening() {
        let mut machine = Election::new([1; 12]);
        machine.update(Vec::new(), false);
        assert_eq!(machine.role(), Role::Listening);
        machine.update(Vec::new(), true);
        assert_eq!(machine.role(), Role::Leading);
    }

    #[test]
    fn a_foreign_clock_has_priority_even_while_silent() {
        let mut election = Election::new([1; 12]);
        election.update(Vec::new(), true);
        for _ in 1..FOREIGN_POLLS {
            election.update(vec![foreign(2), machine(3)], true);
            assert_eq!(election.role(), Role::Leading, "it may be a machine");
        }
        election.update(vec![foreign(2), machine(3)], true);
        assert_eq!(election.role(), Role::Following(None));
        assert!(!election.receive([3; 12]));
        assert!(election.receive([2; 12]));
        election.update(vec![machine(3)], true);
        assert_eq!(election.role(), Role::Leading);
    }

    /// The lower node follows the higher one, which yields because it has discovered the lower one as foreign.
    #[test]
    fn mutual_waiting_ends_after_a_bounded_number_of_polls() {
        let (mut low, mut high) = (Election::new([1; 12]), Election::new([2; 12]));
        high.update(Vec::new(), true);
        low.update(vec![machine(2)], false);
        assert!(low.receive([2; 12]));
        for _ in 0..FOREIGN_POLLS {
            high.update(vec![foreign(1)], true);
        }
        assert_eq!((low.role(), high.role()), (Role::Following(Some([2; 12])), Role::Following(None)));
        for _ in 0..LEADERLESS_POLLS {
            low.update(vec![machine(2)], true);
            high.update(vec![machine(1)], true);
        }
        assert_eq!((low.role(), high.role()), (Role::Following(Some([2; 12])), Role::Leading));
    }

    #[test]
    fn an_undiscovered_publisher_is_not_followed() {
        assert!(!Election::new([2; 12]).receive([1; 12]));
    }

    /// Nodes that have discovered each other and receive the clock of those that lead.
    struct Group(Vec<Election>);

    impl Group {
        fn round(&mut self, order: &[usize]) {
            let all: Vec<GuidPrefix> = self.0.iter().map(|e| e.own).collect();
            for &i in order.iter().filter(|&&i| i < all.len()) {
                let others = all.iter().filter(|&&p| p != all[i]);
                let remote = others.map(|&prefix| RemoteClock { prefix, is_machine: true }).collect();
                self.0[i].update(remote, true);
                let leads = self.0[i].role() == Role::Leading;
                for j in (0..all.len()).filter(|&j| leads && j != i) {
                    self.0[j].receive(all[i]);
                }
            }
        }

        fn leaders(&self) -> Vec<GuidPrefix> {
            self.0.iter().filter(|e| e.role() == Role::Leading).map(|e| e.own).collect()
        }
    }

    proptest! {
        #[test]
        fn exactly_one_node_leads_and_is_replaced_when_it_leaves(
            count in 1_usize..6,
            // Some nodes have started to lead before they discovered each other.
            early in prop::collection::vec(any::<bool>(), 6),
            order in Just((0..6).collect::<Vec<usize>>()).prop_shuffle(),
        ) {
            let mut group = Group((0..count).map(|n| Election::new([n as u8; 12])).collect());
            for (election, _) in group.0.iter_mut().zip(&early).filter(|(_, early)| **early) {
                election.update(Vec::new(), true);
            }
            while !group.0.is_empty() {
                group.round(&order);
                group.round(&order);
                let leaders = group.leaders();
                prop_assert_eq!(leaders.len(), 1);
                group.round(&order);
                prop_assert_eq!(group.leaders(), leaders.clone());
                for follower in group.0.iter().filter(|e| e.own != leaders[0]) {
                    prop_assert_eq!(follower.role(), Role::Following(Some(leaders[0])));
                }
                group.0.retain(|e| e.own != leaders[0]);
            }
        }
    }
}
