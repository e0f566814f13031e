//! Hosts with which datagrams are exchanged, by the discovery range.
//!
//! RustDDS binds its sockets to all interfaces and sends to every address that an announcement names. With `LOCALHOST` and
//! `OFF`, datagrams of other hosts are discarded, and none is sent to them. Otherwise an address from which nothing has
//! been received gets at most [`MAX_UNANSWERED`] datagrams and then one per second: an announcement, which any host can
//! send, directs no more than that to a foreign host.

use std::collections::HashMap;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::environment::DiscoveryRange;

/// Number of datagrams to an address that has sent none, before one per second.
const MAX_UNANSWERED: u32 = 100;
/// Time between further datagrams to it.
const UNANSWERED_PERIOD: Duration = Duration::from_secs(1);
/// Largest number of stored addresses. Datagrams to more addresses that have sent none are discarded.
const MAX_HOSTS: usize = 4096;
/// Time for which it is stored that an address belongs to this host or does not.
const LOCALITY_TIME: Duration = Duration::from_secs(2);

static HOSTS: Mutex<Option<Hosts>> = Mutex::new(None);

fn hosts() -> MutexGuard<'static, Option<Hosts>> {
    HOSTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Sets the discovery range of this process.
pub(crate) fn set_range(range: DiscoveryRange) {
    let is_local = matches!(range, DiscoveryRange::Localhost | DiscoveryRange::Off);
    *hosts() = Some(Hosts { is_local, ..Hosts::default() });
}

/// Permits any number of datagrams to an address that the user has named.
pub(crate) fn permit(address: Ipv4Addr) {
    let now = Instant::now();
    if let Some(hosts) = hosts().as_mut()
        && let Some(host) = hosts.host(address, now)
    {
        host.is_answering = true;
    }
}

/// Returns true if a datagram of `source` may be received.
pub(crate) fn may_receive(source: Ipv4Addr, now: Instant) -> bool {
    source.is_loopback() || hosts().as_mut().is_none_or(|hosts| hosts.may_receive(source, now))
}

/// Returns true if a datagram may be sent to `destination`.
pub(crate) fn may_send(destination: Ipv4Addr, now: Instant) -> bool {
    destination.is_loopback()
        || destination.is_multicast()
        || hosts().as_mut().is_none_or(|hosts| hosts.may_send(destination, now))
}

/// Address of another host, or of this one.
#[derive(Debug)]
struct Host {
    /// True if the address belongs to this host, and the time of that test.
    locality: Option<(bool, Instant)>,
    /// True if a datagram has been received from it, or the user has named it.
    is_answering: bool,
    sent: u32,
    last: Instant,
}

impl Host {
    fn is_local(&mut self, address: Ipv4Addr, now: Instant) -> bool {
        match self.locality {
            Some((is_local, at)) if now.saturating_duration_since(at) < LOCALITY_TIME => is_local,
            _ => {
                // Only addresses of this host can be bound.
                let is_local = UdpSocket::bind((address, 0)).is_ok();
                self.locality = Some((is_local, now));
                is_local
            }
        }
    }
}

#[derive(Debug, Default)]
struct Hosts {
    /// True if only this host is permitted.
    is_local: bool,
    known: HashMap<Ipv4Addr, Host>,
}

impl Hosts {
    /// Returns the state of an address, or `None` if too many are stored.
    fn host(&mut self, address: Ipv4Addr, now: Instant) -> Option<&mut Host> {
        if self.known.len() >= MAX_HOSTS && !self.known.contains_key(&address) {
            self.known.retain(|_, host| host.is_answering);
            if self.known.len() >= MAX_HOSTS {
                return None;
            }
        }
        let new = || Host { locality: None, is_answering: false, sent: 0, last: now };
        Some(self.known.entry(address).or_insert_with(new))
    }

    fn may_receive(&mut self, source: Ipv4Addr, now: Instant) -> bool {
        let is_local_only = self.is_local;
        let Some(host) = self.host(source, now) else {
            return !is_local_only;
        };
        if is_local_only {
            return host.is_local(source, now);
        }
        host.is_answering = true;
        true
    }

    fn may_send(&mut self, destination: Ipv4Addr, now: Instant) -> bool {
        let is_local_only = self.is_local;
        let Some(host) = self.host(destination, now) else {
            return false;
        };
        if is_local_only {
            return host.is_local(destination, now);
        }
        if host.is_answering {
            return true;
        }
        let is_permitted =
            host.sent < MAX_UNANSWERED || now.saturating_duration_since(host.last) >= UNANSWERED_PERIOD;
        if is_permitted {
            (host.sent, host.last) = (host.sent + 1, now);
        }
        is_permitted || host.is_local(destination, now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOREIGN: Ipv4Addr = Ipv4Addr::new(192, 0, 2, 7);

    #[test]
    fn on_the_local_range_only_addresses_of_this_host_are_permitted() {
        let (mut hosts, now) = (Hosts { is_local: true, ..Hosts::default() }, Instant::now());
        assert!(hosts.may_receive(Ipv4Addr::LOCALHOST, now) && hosts.may_send(Ipv4Addr::LOCALHOST, now));
        assert!(!hosts.may_receive(FOREIGN, now) && !hosts.may_send(FOREIGN, now));
    }

    #[test]
    fn an_address_that_has_sent_nothing_gets_few_datagrams() {
        let (mut hosts, began) = (Hosts::default(), Instant::now());
        let sent = |hosts: &mut Hosts, seconds: u64| {
            let now = began + Duration::from_secs(seconds);
            (0..1000).filter(|_| hosts.may_send(FOREIGN, now)).count()
        };
        assert_eq!(sent(&mut hosts, 0), 100);
        assert_eq!(sent(&mut hosts, 1), 1);
        assert_eq!(sent(&mut hosts, 2), 1);
        assert!(hosts.may_receive(FOREIGN, began));
        assert_eq!(sent(&mut hosts, 2), 1000);
    }

    #[test]
    fn the_number_of_stored_addresses_is_bounded() {
        let (mut hosts, now) = (Hosts::default(), Instant::now());
        for number in 0..100_000_u32 {
            hosts.may_receive(Ipv4Addr::from_bits(0x0b00_0000 + number), now);
            hosts.may_send(Ipv4Addr::from_bits(0x0c00_0000 + number), now);
        }
        assert!(hosts.known.len() <= MAX_HOSTS);
    }
}
