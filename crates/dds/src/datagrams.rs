//! Filter of the datagrams of the middleware.
//!
//! A program that receives and sends by these functions in place of `recvmsg` and `sendto`, as `virtual_axes_node` does, has
//! the bounds of `defects::datagram_bounds`, `defects::participant_flood` and `hosts`, and the history of
//! `defects::late_readers`.

use std::net::Ipv4Addr;
use std::time::Instant;

use crate::defects::{datagram_bounds, late_readers, participant_flood};
use crate::hosts;

/// Beginning of each datagram of RTPS.
const RTPS: &[u8] = b"RTPS";

/// Checks and bounds a received datagram, the first `length` octets of `buffer`, in place. Returns its new length, or `None`
/// if it must be discarded. Datagrams other than those of RTPS are not changed.
pub fn receive(buffer: &mut [u8], length: usize, source: Ipv4Addr) -> Option<usize> {
    if !buffer[..length].starts_with(RTPS) {
        return Some(length);
    }
    let now = Instant::now();
    if !hosts::may_receive(source, now) || !participant_flood::may_receive(&buffer[..length], now) {
        return None;
    }
    let length = datagram_bounds::bound(buffer, length, source, now)?;
    late_readers::receive(&mut buffer[..length]);
    Some(length)
}

/// Returns true if a datagram may be sent to `destination`, as any but those of RTPS.
pub fn may_send(datagram: &[u8], destination: Ipv4Addr) -> bool {
    !datagram.starts_with(RTPS) || hosts::may_send(destination, Instant::now())
}
