//! The ROS 2 environment variables that say whom a node may meet.
//!
//! The DDS crates read none of them, so they are read here, once, into an [`Environment`], with the
//! meaning that ROS 2 Jazzy gives them:
//!
//! | variable | values | unset |
//! |---|---|---|
//! | `ROS_DOMAIN_ID` | 0 to 232 | 0 |
//! | `ROS_LOCALHOST_ONLY` | 1: as `LOCALHOST` below, whatever the next two say (deprecated) | 0 |
//! | `ROS_AUTOMATIC_DISCOVERY_RANGE` | `OFF`, `LOCALHOST`, `SUBNET`, `SYSTEM_DEFAULT` | `SUBNET` |
//! | `ROS_STATIC_PEERS` | hosts, separated by semicolons | none |
//!
//! RustDDS announces itself to multicast and to this machine, and to no host by name, so a node
//! cannot go and look for its static peers. It does answer a host that looks for it: with
//! `SUBNET`, naming this machine in the `ROS_STATIC_PEERS` of the others is enough, and a warning
//! says so.

use std::net::{IpAddr, Ipv4Addr};

use rustdds::DomainParticipantBuilder;

/// The largest domain whose ports still fit below 65536 (7400 + 250·domain + offsets).
const LAST_DOMAIN: u16 = 232;

/// Receive buffer of each socket: a trajectory of 100 000 points arrives in one burst of fragments,
/// and the kernel's default loses some of them.
const RECEIVE_BUFFER_BYTES: usize = 4 << 20;

/// How far a node looks for others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DiscoveryRange {
    /// Announces itself to nobody.
    Off,
    /// This machine, over the loopback interface and nothing else.
    Localhost,
    /// Whatever multicast reaches on each interface.
    Subnet,
    /// What the middleware does of its own accord; for RustDDS the same as [`Self::Subnet`].
    SystemDefault,
}

impl DiscoveryRange {
    const NAMES: [(&'static str, Self); 4] = [
        ("OFF", Self::Off),
        ("LOCALHOST", Self::Localhost),
        ("SUBNET", Self::Subnet),
        ("SYSTEM_DEFAULT", Self::SystemDefault),
    ];

    /// The interfaces to use, by address; `None` is all of them.
    pub(super) fn networks(self) -> Option<Vec<IpAddr>> {
        match self {
            Self::Off => Some(Vec::new()),
            Self::Localhost => Some(vec![IpAddr::V4(Ipv4Addr::LOCALHOST)]),
            Self::Subnet | Self::SystemDefault => None,
        }
    }
}

/// An environment variable that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{variable} is '{found}'; allowed is {allowed}")]
pub struct EnvironmentError {
    /// The variable's name.
    pub variable: &'static str,
    /// Its value.
    pub found: String,
    /// What it may be.
    pub allowed: &'static str,
}

/// What the environment variables say, after the rules about which of them wins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Environment {
    domain_id: u16,
    range: DiscoveryRange,
    warnings: Vec<String>,
}

impl Environment {
    /// Reads the variables of this process.
    ///
    /// # Errors
    /// As [`Self::from_lookup`].
    pub fn from_process() -> Result<Self, EnvironmentError> {
        Self::from_lookup(|name| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned()))
    }

    /// Reads the variables through `lookup`, which gives a variable's value or `None`.
    ///
    /// # Errors
    /// `ROS_DOMAIN_ID` that is not a whole number from 0 to 232.
    ///
    /// ```
    /// use virtual_axes::ros::environment::{DiscoveryRange, Environment};
    ///
    /// let environment = Environment::from_lookup(|name| match name {
    ///     "ROS_DOMAIN_ID" => Some("42".to_owned()),
    ///     "ROS_AUTOMATIC_DISCOVERY_RANGE" => Some("LOCALHOST".to_owned()),
    ///     _ => None,
    /// })
    /// .unwrap();
    /// assert_eq!(environment.domain_id(), 42);
    /// assert_eq!(environment.range(), DiscoveryRange::Localhost);
    /// ```
    pub fn from_lookup(lookup: impl Fn(&str) -> Option<String>) -> Result<Self, EnvironmentError> {
        // An empty variable counts as unset, as everywhere in ROS.
        let get = |name| lookup(name).filter(|value| !value.trim().is_empty());

        let domain_id = match get("ROS_DOMAIN_ID") {
            None => 0,
            Some(text) => parse_domain(&text)?,
        };

        let mut warnings = Vec::new();
        let peers: Vec<String> = get("ROS_STATIC_PEERS")
            .iter()
            .flat_map(|list| list.split(';'))
            .map(|peer| peer.trim().to_owned())
            .filter(|peer| !peer.is_empty())
            .collect();

        let range = if get("ROS_LOCALHOST_ONLY").is_some_and(|value| value.trim() == "1") {
            warnings.push(
                "ROS_LOCALHOST_ONLY is deprecated, and while it is 1 ROS_AUTOMATIC_DISCOVERY_RANGE and \
                 ROS_STATIC_PEERS are ignored; use ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"
                    .to_owned(),
            );
            DiscoveryRange::Localhost
        } else {
            let range = match get("ROS_AUTOMATIC_DISCOVERY_RANGE") {
                None => DiscoveryRange::Subnet,
                Some(text) => parse_range(text.trim()).unwrap_or_else(|| {
                    warnings.push(format!(
                        "ROS_AUTOMATIC_DISCOVERY_RANGE is '{text}', which is none of OFF, LOCALHOST, SUBNET, \
                         SYSTEM_DEFAULT; taken as LOCALHOST, as ROS does"
                    ));
                    DiscoveryRange::Localhost
                }),
            };
            if let Some(warning) = static_peers_warning(range, &peers) {
                warnings.push(warning);
            }
            range
        };

        Ok(Self { domain_id, range, warnings })
    }

    /// The DDS domain, 0 to 232.
    #[must_use]
    pub fn domain_id(&self) -> u16 {
        self.domain_id
    }

    /// How far to look for other nodes.
    #[must_use]
    pub fn range(&self) -> DiscoveryRange {
        self.range
    }

    /// Sentences for the log about variables that do not do what they say.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// A participant builder that is set up accordingly.
    #[must_use]
    pub fn participant_builder(&self) -> DomainParticipantBuilder {
        let builder = DomainParticipantBuilder::new(self.domain_id)
            .socket_receive_buffer_size(RECEIVE_BUFFER_BYTES)
            .same_host_loopback(self.range != DiscoveryRange::Off);
        match self.range.networks() {
            None => builder,
            Some(addresses) => builder.with_only_networks(addresses),
        }
    }
}

fn parse_domain(text: &str) -> Result<u16, EnvironmentError> {
    text.trim().parse::<u16>().ok().filter(|domain| *domain <= LAST_DOMAIN).ok_or_else(|| EnvironmentError {
        variable: "ROS_DOMAIN_ID",
        found: text.to_owned(),
        allowed: "a whole number from 0 to 232",
    })
}

fn parse_range(text: &str) -> Option<DiscoveryRange> {
    DiscoveryRange::NAMES.iter().find(|(name, _)| *name == text).map(|(_, range)| *range)
}

fn static_peers_warning(range: DiscoveryRange, peers: &[String]) -> Option<String> {
    if peers.is_empty() {
        return None;
    }
    let list = peers.join(", ");
    Some(match range {
        DiscoveryRange::Off => {
            format!("ROS_STATIC_PEERS ({list}) is ignored, because ROS_AUTOMATIC_DISCOVERY_RANGE is OFF")
        }
        DiscoveryRange::Localhost => format!(
            "ROS_STATIC_PEERS ({list}) is not supported by this node's middleware, and with LOCALHOST it meets \
             this machine only; use SUBNET, and name this machine in the ROS_STATIC_PEERS of the others"
        ),
        _ => format!(
            "ROS_STATIC_PEERS ({list}) is not supported by this node's middleware, which cannot go and look for \
             a host; name this machine in the ROS_STATIC_PEERS of the others instead"
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(variables: &[(&str, &str)]) -> Result<Environment, EnvironmentError> {
        Environment::from_lookup(|name| {
            variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn an_empty_environment_is_domain_zero_and_the_subnet() {
        let environment = read(&[]).unwrap();
        assert_eq!(environment.domain_id(), 0);
        assert_eq!(environment.range(), DiscoveryRange::Subnet);
        assert!(environment.warnings().is_empty());
        assert_eq!(
            read(&[("ROS_DOMAIN_ID", ""), ("ROS_AUTOMATIC_DISCOVERY_RANGE", ""), ("ROS_LOCALHOST_ONLY", "")])
                .unwrap(),
            environment
        );
    }

    #[test]
    fn a_domain_outside_0_to_232_is_refused_with_its_value() {
        for (text, domain) in [("0", 0), ("232", 232), (" 7 ", 7), ("007", 7)] {
            assert_eq!(read(&[("ROS_DOMAIN_ID", text)]).unwrap().domain_id(), domain);
        }
        for text in ["233", "-1", "65536", "1.0", "one", "0x10", "99999999999999999999"] {
            let message = read(&[("ROS_DOMAIN_ID", text)]).unwrap_err().to_string();
            assert!(
                message.contains("ROS_DOMAIN_ID") && message.contains(text) && message.contains("232"),
                "{message}"
            );
        }
    }

    #[test]
    fn each_range_has_its_networks() {
        use DiscoveryRange::*;
        for (text, range, networks) in [
            ("OFF", Off, Some(0)),
            ("LOCALHOST", Localhost, Some(1)),
            ("SUBNET", Subnet, None),
            ("SYSTEM_DEFAULT", SystemDefault, None),
        ] {
            let environment = read(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", text)]).unwrap();
            assert_eq!(environment.range(), range);
            assert_eq!(environment.range().networks().map(|n| n.len()), networks);
            assert!(environment.warnings().is_empty());
        }
    }

    #[test]
    fn a_misspelt_range_stays_on_this_machine_and_says_so() {
        let environment = read(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "subnet")]).unwrap();
        assert_eq!(environment.range(), DiscoveryRange::Localhost);
        assert!(environment.warnings()[0].contains("'subnet'"));
    }

    #[test]
    fn localhost_only_wins_over_range_and_peers() {
        let environment = read(&[
            ("ROS_LOCALHOST_ONLY", "1"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
            ("ROS_STATIC_PEERS", "10.0.0.1"),
        ])
        .unwrap();
        assert_eq!(environment.range(), DiscoveryRange::Localhost);
        assert_eq!(environment.warnings().len(), 1);
        for off in ["0", "true", "2"] {
            let environment = read(&[("ROS_LOCALHOST_ONLY", off)]).unwrap();
            assert_eq!(environment.range(), DiscoveryRange::Subnet);
        }
    }

    #[test]
    fn static_peers_are_not_passed_over_in_silence() {
        let environment = read(&[("ROS_STATIC_PEERS", " 192.168.0.1 ;;robot.local; ")]).unwrap();
        assert_eq!(environment.warnings().len(), 1);
        assert!(environment.warnings()[0].contains("(192.168.0.1, robot.local)"));
        let local = [("ROS_STATIC_PEERS", "a"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")];
        assert!(read(&local).unwrap().warnings()[0].contains("use SUBNET"));
        let off = [("ROS_STATIC_PEERS", "a"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")];
        assert!(read(&off).unwrap().warnings()[0].contains("OFF"));
        assert!(read(&[("ROS_STATIC_PEERS", ";")]).unwrap().warnings().is_empty());
    }
}
