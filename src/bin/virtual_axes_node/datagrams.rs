//! Replacements of `recvmsg` and `sendto` that bound the datagrams of the middleware, by `virtual_axes_dds::datagrams`.
//!
//! RustDDS has no interface for this. The linker prefers the functions of the program to those of the C library.
#![allow(unsafe_code)]

use std::ffi::{c_int, c_void};
use std::net::Ipv4Addr;
use std::slice;

use libc::{msghdr, sa_family_t, size_t, sockaddr, sockaddr_in, socklen_t, ssize_t};
use virtual_axes_dds::datagrams;

/// Receives as `recvmsg` of the C library does, without the datagrams that the middleware must not receive.
///
/// # Safety
/// `message` must be valid, as for the function of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn recvmsg(socket: c_int, message: *mut msghdr, flags: c_int) -> ssize_t {
    loop {
        // SAFETY: the caller guarantees a valid header.
        let (name_length, control_length) = unsafe { ((*message).msg_namelen, (*message).msg_controllen) };
        // SAFETY: the kernel takes the same arguments and checks them.
        let received = unsafe { libc::syscall(libc::SYS_recvmsg, socket, message, flags) } as ssize_t;
        let Ok(length) = usize::try_from(received) else {
            return received;
        };
        // SAFETY: the kernel has written the header of a message that it has accepted.
        let Some((source, buffer)) = (unsafe { source_and_buffer(message) }) else {
            return received;
        };
        if length > buffer.len() || flags & libc::MSG_PEEK != 0 {
            return received;
        }
        if let Some(length) = datagrams::receive(buffer, length, source) {
            return length.cast_signed();
        }
        // SAFETY: as above; the next call gets the header as the caller has passed it.
        unsafe { ((*message).msg_namelen, (*message).msg_controllen) = (name_length, control_length) };
    }
}

/// Returns the IPv4 address of the sender and the buffer of a message with one buffer.
///
/// # Safety
/// `message` must be a header that the kernel has written.
unsafe fn source_and_buffer<'a>(message: *mut msghdr) -> Option<(Ipv4Addr, &'a mut [u8])> {
    // SAFETY: the buffers of a header that the kernel has accepted are valid for writes of their lengths.
    unsafe {
        let source = address((*message).msg_name.cast(), (*message).msg_namelen)?;
        let is_single = (*message).msg_iovlen == 1;
        let vector = is_single.then(|| *(*message).msg_iov)?;
        Some((source, slice::from_raw_parts_mut(vector.iov_base.cast(), vector.iov_len)))
    }
}

/// Returns an IPv4 address, or `None` for another family.
///
/// # Safety
/// `address` must be null or valid for reads of `length` bytes.
unsafe fn address(address: *const sockaddr, length: socklen_t) -> Option<Ipv4Addr> {
    if address.is_null() || (length as usize) < size_of::<sockaddr_in>() {
        return None;
    }
    // SAFETY: the length of an address of this family has been checked.
    let found = unsafe { address.cast::<sockaddr_in>().read_unaligned() };
    let is_ipv4 = found.sin_family == libc::AF_INET as sa_family_t;
    is_ipv4.then(|| Ipv4Addr::from_bits(u32::from_be(found.sin_addr.s_addr)))
}

/// Sends as `sendto` of the C library does, except that a datagram of the middleware that must not be sent is discarded.
///
/// # Safety
/// `buffer` must be valid for reads of `length` bytes and `destination` for `address_length`, as for the function of the C
/// library.
#[unsafe(no_mangle)]
unsafe extern "C" fn sendto(
    socket: c_int,
    buffer: *const c_void,
    length: size_t,
    flags: c_int,
    destination: *const sockaddr,
    address_length: socklen_t,
) -> ssize_t {
    // SAFETY: the caller guarantees a valid address and buffer.
    let is_discarded = unsafe { address(destination, address_length) }.is_some_and(|address| {
        !buffer.is_null() && {
            let datagram = unsafe { slice::from_raw_parts(buffer.cast(), length) };
            !datagrams::may_send(datagram, address)
        }
    });
    if is_discarded {
        return length.cast_signed();
    }
    // SAFETY: the kernel takes the same arguments and checks them.
    unsafe {
        libc::syscall(libc::SYS_sendto, socket, buffer, length, flags, destination, address_length) as ssize_t
    }
}
