//! Who gives `/clock`: of several machines in `fast` exactly one, and none while somebody else does.
//!
//! Each has a publisher and knows by discovery of the others'. A machine that starts listens first,
//! and follows what it hears. Two that publish hear each other, and the one with the lower GUID goes
//! on. When the one that is followed leaves, the lowest of those that are left goes on.

/// Looks for which a stranger is waited for to turn out as a machine by one that has its clock: topics of a
/// participant become known one by one.
const STRANGE_LOOKS: u32 = 4;
/// Looks after which whoever follows nobody leads, lowest or not: the lowest may follow one that has
/// ceased to lead. Where two come to lead so, the lower goes on.
const SILENT_LOOKS: u32 = 20;

/// Prefix of a participant's GUIDs; they are ordered by it.
pub type Prefix = [u8; 12];

/// Another participant that has a publisher of the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rival {
    /// Who.
    pub prefix: Prefix,
    /// Whether it is a machine of this package, which follows these rules.
    pub machine: bool,
}

/// What this node does about the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Listens whether there is a clock.
    Listening,
    /// Gives it.
    Leading,
    /// Follows it, by whom it last heard of it.
    Following(Option<Prefix>),
}

/// The rules, for one machine in `fast`.
#[derive(Debug)]
pub struct Election {
    own: Prefix,
    rivals: Vec<Rival>,
    role: Role,
    /// Looks in a row that found a stranger.
    strange: u32,
    /// Looks in a row at which nobody was there to be followed.
    silent: u32,
}

impl Election {
    /// One that listens first.
    pub fn new(own: Prefix) -> Self {
        Election { own, rivals: Vec::new(), role: Role::Listening, strange: 0, silent: 0 }
    }

    /// What this node does now.
    pub fn role(&self) -> Role {
        self.role
    }

    fn rival(&self, prefix: Prefix) -> Option<Rival> {
        self.rivals.iter().copied().find(|r| r.prefix == prefix)
    }

    /// Whether the lowest machine is this one.
    fn is_lowest(&self) -> bool {
        self.rivals.iter().filter(|r| r.machine).all(|r| self.own < r.prefix)
    }

    fn has_stranger(&self) -> bool {
        self.rivals.iter().any(|r| !r.machine)
    }

    /// Takes those who have a publisher now; `listened` once this node has listened long enough.
    pub fn see(&mut self, rivals: Vec<Rival>, listened: bool) {
        self.rivals = rivals;
        self.strange = if self.has_stranger() { self.strange.saturating_add(1) } else { 0 };
        if self.strange > 0 {
            let has_clock = matches!(self.role, Role::Leading | Role::Following(Some(_)));
            let follows_it = matches!(self.role, Role::Following(Some(who)) if self.is_stranger(who));
            if !follows_it && (!has_clock || self.strange >= STRANGE_LOOKS) {
                self.role = Role::Following(None);
            }
            return;
        }
        let leaderless = match self.role {
            Role::Listening => listened,
            Role::Leading => false,
            Role::Following(leader) => leader.is_none_or(|who| self.rival(who).is_none()),
        };
        self.silent = if leaderless { self.silent.saturating_add(1) } else { 0 };
        if leaderless {
            let leads = self.is_lowest() || self.silent >= SILENT_LOOKS;
            self.role = if leads { Role::Leading } else { Role::Following(None) };
        }
    }

    fn is_stranger(&self, prefix: Prefix) -> bool {
        self.rival(prefix).is_some_and(|rival| !rival.machine)
    }

    /// Whether the clock that `from` gives counts here; `from` is one of those seen.
    pub fn hear(&mut self, from: Prefix) -> bool {
        let Some(rival) = self.rival(from) else { return false };
        let follows = if !rival.machine {
            true
        } else if self.strange >= STRANGE_LOOKS {
            false
        } else {
            match self.role {
                Role::Listening | Role::Following(None) => true,
                Role::Leading => from < self.own,
                Role::Following(Some(leader)) => from <= leader,
            }
        };
        if follows {
            self.role = Role::Following(Some(from));
            self.silent = 0;
        }
        follows
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn machine(number: u8) -> Rival {
        Rival { prefix: [number; 12], machine: true }
    }

    fn stranger(number: u8) -> Rival {
        Rival { prefix: [number; 12], machine: false }
    }

    #[test]
    fn the_second_follows_the_first_whatever_their_ids() {
        for (first, second) in [(1, 2), (2, 1)] {
            let mut newcomer = Election::new([second; 12]);
            newcomer.see(vec![machine(first)], false);
            assert!(newcomer.hear([first; 12]));
            newcomer.see(vec![machine(first)], true);
            assert_eq!(newcomer.role(), Role::Following(Some([first; 12])));
        }
    }

    #[test]
    fn alone_it_leads_once_it_has_listened() {
        let mut machine = Election::new([1; 12]);
        machine.see(Vec::new(), false);
        assert_eq!(machine.role(), Role::Listening);
        machine.see(Vec::new(), true);
        assert_eq!(machine.role(), Role::Leading);
    }

    #[test]
    fn a_stranger_wins_whatever_its_id_and_while_it_says_nothing() {
        let mut election = Election::new([1; 12]);
        election.see(Vec::new(), true);
        for _ in 1..STRANGE_LOOKS {
            election.see(vec![stranger(2), machine(3)], true);
            assert_eq!(election.role(), Role::Leading, "it may turn out to be a machine");
        }
        election.see(vec![stranger(2), machine(3)], true);
        assert_eq!(election.role(), Role::Following(None));
        assert!(!election.hear([3; 12]));
        assert!(election.hear([2; 12]));
        election.see(vec![machine(3)], true);
        assert_eq!(election.role(), Role::Leading);
    }

    /// The lower one follows the higher one, which took it for a stranger and yielded.
    #[test]
    fn two_that_wait_for_each_other_do_not_wait_for_ever() {
        let (mut low, mut high) = (Election::new([1; 12]), Election::new([2; 12]));
        high.see(Vec::new(), true);
        low.see(vec![machine(2)], false);
        assert!(low.hear([2; 12]));
        for _ in 0..STRANGE_LOOKS {
            high.see(vec![stranger(1)], true);
        }
        assert_eq!((low.role(), high.role()), (Role::Following(Some([2; 12])), Role::Following(None)));
        for _ in 0..SILENT_LOOKS {
            low.see(vec![machine(2)], true);
            high.see(vec![machine(1)], true);
        }
        assert_eq!((low.role(), high.role()), (Role::Following(Some([2; 12])), Role::Leading));
    }

    #[test]
    fn who_is_not_known_is_not_followed() {
        assert!(!Election::new([2; 12]).hear([1; 12]));
    }

    /// Machines that all see each other, and hear those that lead.
    struct Group(Vec<Election>);

    impl Group {
        fn round(&mut self, order: &[usize]) {
            let all: Vec<Prefix> = self.0.iter().map(|e| e.own).collect();
            for &i in order.iter().filter(|&&i| i < all.len()) {
                let others = all.iter().filter(|&&p| p != all[i]);
                let seen = others.map(|&prefix| Rival { prefix, machine: true }).collect();
                self.0[i].see(seen, true);
                let leads = self.0[i].role() == Role::Leading;
                for j in (0..all.len()).filter(|&j| leads && j != i) {
                    self.0[j].hear(all[i]);
                }
            }
        }

        fn leaders(&self) -> Vec<Prefix> {
            self.0.iter().filter(|e| e.role() == Role::Leading).map(|e| e.own).collect()
        }
    }

    proptest! {
        #[test]
        fn exactly_one_leads_and_another_when_it_leaves(
            count in 1_usize..6,
            // Some have begun to lead before they knew of each other.
            early in prop::collection::vec(any::<bool>(), 6),
            order in Just((0..6).collect::<Vec<usize>>()).prop_shuffle(),
        ) {
            let mut group = Group((0..count).map(|n| Election::new([n as u8; 12])).collect());
            for (election, _) in group.0.iter_mut().zip(&early).filter(|(_, early)| **early) {
                election.see(Vec::new(), true);
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
