//! ROS 2 environment variables for domain and discovery.
//!
//! The DDS crates read none of them. They are read here once into an [`Environment`], with the meaning of ROS 2 Jazzy:
//!
//! | variable | values | unset |
//! |---|---|---|
//! | `ROS_DOMAIN_ID` | 0 to 232 | 0 |
//! | `ROS_LOCALHOST_ONLY` | 1: as `LOCALHOST` below, overrides the next two (deprecated) | 0 |
//! | `ROS_AUTOMATIC_DISCOVERY_RANGE` | `OFF`, `LOCALHOST`, `SUBNET`, `SYSTEM_DEFAULT` | `SUBNET` |
//! | `ROS_STATIC_PEERS` | hosts, separated by semicolons | none |
//!
//! Variables of other transports and discoveries cause a warning.
//!
//! RustDDS announces itself by multicast and to this host; `static_peers` forwards the announcements to other hosts. It
//! also responds to a host that discovers it. With `SUBNET`, an entry in the `ROS_STATIC_PEERS` of one side is
//! therefore enough.

use std::net::{IpAddr, Ipv4Addr};

use rustdds::DomainParticipantBuilder;

/// Largest domain id with ports below 65536 (7400 + 250·domain + offsets).
const LAST_DOMAIN: u16 = 232;

/// Receive buffer of each socket, bytes. A trajectory of 100 000 points arrives in one burst of fragments, which
/// overflows the kernel's default buffer.
const RECEIVE_BUFFER_BYTES: usize = 4 << 20;

/// Network range of discovery.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DiscoveryRange {
    /// No discovery.
    Off,
    /// This host, by the loopback interface only.
    Localhost,
    /// All hosts reached by multicast on any interface.
    Subnet,
    /// Default of the middleware; for RustDDS the same as [`Self::Subnet`].
    SystemDefault,
}

impl DiscoveryRange {
    const NAMES: [(&'static str, Self); 4] = [
        ("OFF", Self::Off),
        ("LOCALHOST", Self::Localhost),
        ("SUBNET", Self::Subnet),
        ("SYSTEM_DEFAULT", Self::SystemDefault),
    ];

    /// Returns the addresses of the interfaces to use; `None` means all.
    fn networks(self) -> Option<Vec<IpAddr>> {
        match self {
            Self::Off => Some(Vec::new()),
            Self::Localhost => Some(vec![IpAddr::V4(Ipv4Addr::LOCALHOST)]),
            Self::Subnet | Self::SystemDefault => None,
        }
    }
}

/// Invalid value of an environment variable.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{variable} is '{found}'; allowed is {allowed}")]
pub struct EnvironmentError {
    /// Name of the variable.
    pub variable: &'static str,
    /// Value of the variable.
    pub found: String,
    /// Allowed values.
    pub allowed: &'static str,
}

/// Discovery settings from the environment variables, after the rules of precedence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Environment {
    domain_id: u16,
    range: DiscoveryRange,
    static_peers: Vec<String>,
    warnings: Vec<String>,
}

impl Environment {
    /// Reads the variables of this process.
    ///
    /// # Errors
    /// [`EnvironmentError`] if `ROS_DOMAIN_ID` is not an integer from 0 to 232.
    pub fn from_process() -> Result<Self, EnvironmentError> {
        Self::from_lookup(|name| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned()))
    }

    /// Reads the variables through `lookup`, which returns the value of a variable or `None`.
    ///
    /// # Errors
    /// [`EnvironmentError`] if `ROS_DOMAIN_ID` is not an integer from 0 to 232.
    ///
    /// ```
    /// use virtual_axes_dds::{DiscoveryRange, Environment};
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
        let get = |name: &str| lookup(name).filter(|value| !value.trim().is_empty());

        let domain_id = match get("ROS_DOMAIN_ID") {
            None => 0,
            Some(text) => parse_domain(&text)?,
        };

        let mut warnings = transport_warnings(get);
        let mut static_peers: Vec<String> = get("ROS_STATIC_PEERS")
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
                        "ROS_AUTOMATIC_DISCOVERY_RANGE is '{text}'; allowed is OFF, LOCALHOST, SUBNET or \
                         SYSTEM_DEFAULT; LOCALHOST is used, as in ROS"
                    ));
                    DiscoveryRange::Localhost
                }),
            };
            if let Some(warning) = static_peers_warning(range, &static_peers) {
                warnings.push(warning);
            }
            range
        };
        if matches!(range, DiscoveryRange::Off | DiscoveryRange::Localhost) {
            static_peers.clear();
        }
        Ok(Self { domain_id, range, static_peers, warnings })
    }

    /// Returns the DDS domain id, 0 to 232.
    #[must_use]
    pub fn domain_id(&self) -> u16 {
        self.domain_id
    }

    /// Returns the network range of discovery.
    #[must_use]
    pub fn range(&self) -> DiscoveryRange {
        self.range
    }

    /// Returns the hosts to which the participant is announced by name.
    pub(crate) fn static_peers(&self) -> &[String] {
        &self.static_peers
    }

    /// Returns warnings for the log about ignored or unsupported variables.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns a participant builder with these settings.
    pub(crate) fn participant_builder(&self) -> DomainParticipantBuilder {
        let builder = DomainParticipantBuilder::new(self.domain_id)
            .socket_receive_buffer_size(RECEIVE_BUFFER_BYTES)
            .same_host_loopback(self.range != DiscoveryRange::Off);
        match self.range.networks() {
            None => builder,
            Some(addresses) => builder.with_only_networks(addresses),
        }
    }
}

/// Returns a warning for each variable that leads other nodes to transports or a discovery that this node does not have.
fn transport_warnings(get: impl Fn(&str) -> Option<String>) -> Vec<String> {
    /// Fast DDS and Cyclone DDS, by default, discover by multicast and exchange data by UDP.
    const UDP: &str = "this node discovers by multicast and exchanges data by UDP over IPv4 only";
    let warn = |name: &str, remedy: &str| {
        let value = get(name)?;
        let value = value.escape_debug().take(200).collect::<String>();
        Some(format!("{name}={value} has no effect here: {UDP}; {remedy}"))
    };
    let is_foreign_rmw = |value: &String| {
        !["rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp", "rmw_cyclonedds_cpp"].contains(&value.as_str())
    };
    let is_udp = |value: &String| ["DEFAULT", "UDPv4"].contains(&value.as_str());
    let rmw = get("RMW_IMPLEMENTATION").filter(is_foreign_rmw);
    let transports = get("FASTDDS_BUILTIN_TRANSPORTS").filter(|value| !is_udp(value));
    let profiles =
        ["FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE", "CYCLONEDDS_URI"].into_iter();
    [
        warn(
            "ROS_DISCOVERY_SERVER",
            "unset it for the other nodes, or set ROS_STATIC_PEERS to hosts that multicast does not reach",
        ),
        rmw.and_then(|_| {
            warn("RMW_IMPLEMENTATION", "start the other nodes with rmw_fastrtps_cpp or rmw_cyclonedds_cpp")
        }),
        transports.and_then(|_| {
            warn("FASTDDS_BUILTIN_TRANSPORTS", "start the other nodes with FASTDDS_BUILTIN_TRANSPORTS=UDPv4")
        }),
    ]
    .into_iter()
    .chain(profiles.map(|name| {
        warn(
            name,
            "if its profile has static peers, other transports or no multicast, use ROS_STATIC_PEERS and UDP",
        )
    }))
    .flatten()
    .collect()
}

fn parse_domain(text: &str) -> Result<u16, EnvironmentError> {
    text.trim().parse::<u16>().ok().filter(|domain| *domain <= LAST_DOMAIN).ok_or_else(|| EnvironmentError {
        variable: "ROS_DOMAIN_ID",
        found: text.to_owned(),
        allowed: "an integer from 0 to 232",
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
    match range {
        DiscoveryRange::Off => Some(format!(
            "ROS_STATIC_PEERS ({list}) is ignored, because ROS_AUTOMATIC_DISCOVERY_RANGE is OFF"
        )),
        DiscoveryRange::Localhost => Some(format!(
            "ROS_STATIC_PEERS ({list}) is ignored, because LOCALHOST restricts discovery to this host; use \
             ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"
        )),
        DiscoveryRange::Subnet | DiscoveryRange::SystemDefault => None,
    }
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
    fn an_empty_environment_gives_domain_0_and_subnet() {
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
    fn a_domain_id_outside_0_to_232_is_an_error_with_its_value() {
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
    fn a_transport_that_the_node_does_not_have_causes_one_warning_with_the_remedy() {
        for (name, value, remedy) in [
            ("ROS_DISCOVERY_SERVER", "10.0.0.1:11811", "ROS_STATIC_PEERS"),
            ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp", "rmw_fastrtps_cpp"),
            ("FASTDDS_BUILTIN_TRANSPORTS", "LARGE_DATA", "UDPv4"),
            ("FASTDDS_BUILTIN_TRANSPORTS", "SHM", "UDPv4"),
            ("FASTDDS_BUILTIN_TRANSPORTS", "UDPv6", "UDPv4"),
            ("FASTDDS_BUILTIN_TRANSPORTS", "DEFAULTv6", "UDPv4"),
            ("CYCLONEDDS_URI", "file:///etc/cyclone.xml", "ROS_STATIC_PEERS"),
        ] {
            let environment = read(&[(name, value)]).unwrap();
            let [warning] = environment.warnings() else { panic!("{:?}", environment.warnings()) };
            assert!(
                warning.starts_with(&format!("{name}={value} ")) && warning.contains(remedy),
                "{warning}"
            );
        }
        for (name, value) in [
            ("ROS_DISCOVERY_SERVER", ""),
            ("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp"),
            ("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp"),
            ("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4"),
            ("FASTDDS_BUILTIN_TRANSPORTS", "DEFAULT"),
        ] {
            assert!(read(&[(name, value)]).unwrap().warnings().is_empty(), "{name}={value}");
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
    fn an_invalid_range_falls_back_to_localhost_with_a_warning() {
        let environment = read(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "subnet")]).unwrap();
        assert_eq!(environment.range(), DiscoveryRange::Localhost);
        assert!(environment.warnings()[0].contains("'subnet'"));
    }

    #[test]
    fn localhost_only_overrides_range_and_peers() {
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
    fn static_peers_are_used_beyond_this_host_and_cause_a_warning_otherwise() {
        let environment = read(&[("ROS_STATIC_PEERS", " 192.168.0.1 ;;robot.local; ")]).unwrap();
        assert!(environment.warnings().is_empty());
        assert_eq!(environment.static_peers(), ["192.168.0.1", "robot.local"]);
        let local = [("ROS_STATIC_PEERS", "a"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")];
        assert!(read(&local).unwrap().static_peers().is_empty());
        assert!(read(&local).unwrap().warnings()[0].contains("SUBNET"));
        let off = [("ROS_STATIC_PEERS", "a"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")];
        assert!(read(&off).unwrap().warnings()[0].contains("OFF"));
        assert!(read(&[("ROS_STATIC_PEERS", ";")]).unwrap().warnings().is_empty());
    }
}
