//! The readers of one of our topics, for what RustDDS does not tell them.

use std::collections::BTreeSet;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};

use rustdds::DomainParticipant;

use super::rtps::Guid;

/// Who reads what one of our writers writes.
#[derive(Debug)]
pub(super) struct Readers {
    /// The writer.
    pub writer: Guid,
    /// Its topic's name in DDS.
    pub topic: String,
    participant: DomainParticipant,
    socket: UdpSocket,
}

impl Readers {
    /// Those of the writer with this GUID on this DDS topic.
    ///
    /// # Errors
    /// What the system says when it gives no socket.
    pub(super) fn new(writer: Guid, topic: String, participant: DomainParticipant) -> io::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        Ok(Self { writer, topic, participant, socket })
    }

    /// Sends them a datagram, each time to those that are known then.
    pub(super) fn send(&self, datagram: &[u8]) {
        for reader in self.addresses() {
            if let Err(error) = self.socket.send_to(datagram, reader) {
                let (length, topic) = (datagram.len(), &self.topic);
                tracing::warn!("a message of {length} octets on {topic} cannot go to {reader}: {error}");
            }
        }
    }

    /// Where they listen.
    fn addresses(&self) -> BTreeSet<SocketAddr> {
        self.participant
            .discovered_readers()
            .iter()
            .filter(|reader| reader.subscription_topic_data.topic_name() == &self.topic)
            .flat_map(|reader| &reader.reader_proxy.unicast_locator_list)
            .filter(|locator| locator.is_udp())
            .map(|locator| SocketAddr::from(*locator))
            .filter(|address| address.is_ipv4() && address.port() != 0)
            .collect()
    }
}
