//! Datagrams to the readers of a topic of this node, beside those of RustDDS.

use std::collections::BTreeSet;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};

use rustdds::DomainParticipant;

use super::Guid;

/// Readers of a local writer, with a socket to send them datagrams.
#[derive(Debug)]
pub(crate) struct Readers {
    /// GUID of the writer.
    pub writer: Guid,
    /// Name of the topic in DDS.
    pub topic: String,
    participant: DomainParticipant,
    socket: UdpSocket,
}

impl Readers {
    /// Creates the socket for the readers of `writer` on the DDS topic `topic`.
    ///
    /// # Errors
    /// Error of the operating system if it provides no socket.
    pub(crate) fn new(writer: Guid, topic: String, participant: DomainParticipant) -> io::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        Ok(Self { writer, topic, participant, socket })
    }

    /// Sends a datagram to all readers discovered so far. Send errors are logged.
    pub(crate) fn send(&self, datagram: &[u8]) {
        self.send_if(datagram, |topic, _| topic == self.topic);
    }

    /// Sends a datagram to one reader. Send errors are logged.
    pub(crate) fn send_to(&self, reader: &Guid, datagram: &[u8]) {
        self.send_if(datagram, |_, found| found == reader);
    }

    fn send_if(&self, datagram: &[u8], is_receiver: impl Fn(&str, &Guid) -> bool) {
        for reader in self.addresses(is_receiver) {
            if let Err(error) = self.socket.send_to(datagram, reader) {
                let (length, topic) = (datagram.len(), &self.topic);
                tracing::warn!("cannot send a datagram of {length} octets on {topic} to {reader}: {error}");
            }
        }
    }

    /// Returns the unicast addresses of discovered readers.
    fn addresses(&self, is_receiver: impl Fn(&str, &Guid) -> bool) -> BTreeSet<SocketAddr> {
        self.participant
            .discovered_readers()
            .iter()
            .filter(|reader| {
                let guid = reader.reader_proxy.remote_reader_guid.to_bytes();
                is_receiver(reader.subscription_topic_data.topic_name(), &guid)
            })
            .flat_map(|reader| &reader.reader_proxy.unicast_locator_list)
            .filter(|locator| locator.is_udp())
            .map(|locator| SocketAddr::from(*locator))
            .filter(|address| address.is_ipv4() && address.port() != 0)
            .collect()
    }
}
