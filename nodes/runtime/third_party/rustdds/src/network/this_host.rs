//! Kerf: a participant that only this computer reaches, and peers that it knows by address.
//!
//! `with_only_networks([127.0.0.1])` means this computer alone. The kernel then drops what comes from elsewhere before
//! the socket has it, and sends nothing elsewhere. A packet to an address of this computer goes over the loopback
//! interface, whatever interface has the address.

use std::{
  io,
  net::{IpAddr, Ipv4Addr},
};

use socket2::Socket;

/// How many peers by address there may be: a jump in a filter of the kernel is at most 255 long.
pub const PEERS_MAX: usize = 200;

/// Whether a participant with these networks is for this computer alone.
pub(crate) fn is_only_this_host(only_networks: Option<&[IpAddr]>) -> bool {
  only_networks.is_some_and(|networks| networks.iter().all(IpAddr::is_loopback))
}

/// Whether the kernel can do it; the reason otherwise.
pub(crate) fn check(peers: &[Ipv4Addr]) -> io::Result<()> {
  let probe = Socket::new(socket2::Domain::IPV4, socket2::Type::DGRAM, None)?;
  receive_only(&probe, peers)?;
  send_only(&probe, peers)
}

/// From now on the socket receives nothing but from this computer and from these peers.
#[cfg(target_os = "linux")]
pub(crate) fn receive_only(socket: &Socket, peers: &[Ipv4Addr]) -> io::Result<()> {
  use socket2::SockFilter;
  // Of linux/bpf_common.h and linux/filter.h.
  const LOAD_WORD: u16 = 0x20;
  const JUMP_IF_EQUAL: u16 = 0x15;
  const RETURN: u16 = 0x06;
  const INTERFACE_INDEX: u32 = -0x1000_i32 as u32 + 8;
  const SOURCE_ADDRESS: u32 = -0x10_0000_i32 as u32 + 12;
  let interfaces = netdev::get_interfaces();
  let loopback = interfaces
    .iter()
    .find(|it| it.is_loopback())
    .ok_or_else(|| io::Error::other("there is no loopback interface"))?;
  if peers.len() > PEERS_MAX {
    return Err(io::Error::other(format!(
      "{} peers by address, at most {PEERS_MAX} are possible",
      peers.len()
    )));
  }
  let of_peer = peers.len() as u8;
  let mut filter = vec![
    SockFilter::new(LOAD_WORD, 0, 0, INTERFACE_INDEX),
    // To the end, over what looks for peers.
    SockFilter::new(JUMP_IF_EQUAL, of_peer + 2, 0, loopback.index),
    SockFilter::new(LOAD_WORD, 0, 0, SOURCE_ADDRESS),
  ];
  for (peer, after) in peers.iter().zip((1..=of_peer).rev()) {
    filter.push(SockFilter::new(JUMP_IF_EQUAL, after, 0, (*peer).into()));
  }
  filter.push(SockFilter::new(RETURN, 0, 0, 0));
  filter.push(SockFilter::new(RETURN, 0, 0, u32::MAX));
  socket.attach_filter(&filter)
}

/// From now on the socket sends nothing elsewhere. With peers it sends to what they announce.
#[cfg(target_os = "linux")]
pub(crate) fn send_only(socket: &Socket, peers: &[Ipv4Addr]) -> io::Result<()> {
  if peers.is_empty() {
    socket.bind_device(Some(b"lo"))?;
  }
  Ok(())
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn receive_only(_: &Socket, _: &[Ipv4Addr]) -> io::Result<()> {
  Err(io::ErrorKind::Unsupported.into())
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn send_only(_: &Socket, _: &[Ipv4Addr]) -> io::Result<()> {
  Err(io::ErrorKind::Unsupported.into())
}
