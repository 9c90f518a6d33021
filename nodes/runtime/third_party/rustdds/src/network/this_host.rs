//! Kerf: a participant that only this computer reaches, and peers that it knows by address.
//!
//! `with_only_networks([127.0.0.1])` means this computer alone. The kernel then drops what comes from elsewhere before
//! the socket has it, and sends nothing elsewhere from the address 127.0.0.1 (unless somebody has set `route_localnet`,
//! and then only what a peer of this computer asks for). A packet to an address of this computer
//! goes over the loopback interface, whatever interface has the address.

use std::{
  io,
  net::{IpAddr, Ipv4Addr, SocketAddr},
};

use socket2::Socket;

use crate::{network::util::enumerate_interfaces, structure::locator::Locator};

/// How many peers by address there may be: a jump in a filter of the kernel is at most 255 long.
pub const PEERS_MAX: usize = 100;

/// Whether a participant with these networks is for this computer alone.
pub(crate) fn is_only_this_host(only_networks: Option<&[IpAddr]>) -> bool {
  only_networks.is_some_and(|networks| networks.iter().all(IpAddr::is_loopback))
}

/// The addresses that this computer has now, but for those of the loopback interface.
pub fn own_addresses() -> Vec<Ipv4Addr> {
  let addresses = enumerate_interfaces().unwrap_or_default().into_iter();
  let addresses = addresses.filter_map(|it| match it.ip {
    IpAddr::V4(address) => Some(address),
    IpAddr::V6(_) => None,
  });
  addresses.filter(|it| !it.is_loopback()).collect()
}

/// Where a participant for this computer alone sends from: any port of 127.0.0.1. With peers it sends from any address
/// to what they announce.
pub(crate) fn source(peers: &[Ipv4Addr], port: u16) -> SocketAddr {
  let address = match peers {
    [] => Ipv4Addr::LOCALHOST,
    _ => Ipv4Addr::UNSPECIFIED,
  };
  (address, port).into()
}

/// Of the addresses of a peer on this computer, the one of the loopback interface is enough.
pub(crate) fn nearest(locators: &[Locator]) -> &[Locator] {
  let loopback = locators.iter().position(Locator::is_loopback);
  loopback.map_or(locators, |at| &locators[at..=at])
}

/// From now on the socket receives nothing but from this computer and from these peers; the reason where the kernel
/// cannot do that.
///
/// A packet to this computer from itself comes over the loopback interface, or is the copy of one that it has sent to a
/// multicast group on another interface. The kernel marks such copies, and nothing that comes from outside.
#[cfg(target_os = "linux")]
pub(crate) fn receive_only(socket: &Socket, peers: &[Ipv4Addr]) -> io::Result<()> {
  use socket2::SockFilter;
  // Of linux/bpf_common.h, linux/filter.h and linux/if_packet.h.
  const LOAD_WORD: u16 = 0x20;
  const JUMP_IF_EQUAL: u16 = 0x15;
  const RETURN: u16 = 0x06;
  const PACKET_TYPE: u32 = -0x1000_i32 as u32 + 4;
  const INTERFACE_INDEX: u32 = -0x1000_i32 as u32 + 8;
  const SOURCE_ADDRESS: u32 = -0x10_0000_i32 as u32 + 12;
  const OWN_COPY: u32 = 5;
  let interfaces = enumerate_interfaces()?;
  let loopback = interfaces
    .iter()
    .find(|it| it.is_loopback)
    .ok_or_else(|| io::Error::other("there is no loopback interface"))?;
  if peers.len() > PEERS_MAX {
    return Err(io::Error::other(format!(
      "{} peers by address, at most {PEERS_MAX} are possible",
      peers.len()
    )));
  }
  let mut sources = vec![
    (INTERFACE_INDEX, loopback.index),
    (PACKET_TYPE, OWN_COPY),
  ];
  sources.extend(peers.iter().map(|it| (SOURCE_ADDRESS, u32::from(*it))));
  let mut filter = Vec::new();
  for (at, (place, value)) in sources.iter().enumerate() {
    // Over the pairs that follow, and the first of the two ends.
    let to_end = 2 * (sources.len() - at - 1) as u8 + 1;
    filter.push(SockFilter::new(LOAD_WORD, 0, 0, *place));
    filter.push(SockFilter::new(JUMP_IF_EQUAL, to_end, 0, *value));
  }
  filter.push(SockFilter::new(RETURN, 0, 0, 0));
  filter.push(SockFilter::new(RETURN, 0, 0, u32::MAX));
  socket.attach_filter(&filter)
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn receive_only(_: &Socket, _: &[Ipv4Addr]) -> io::Result<()> {
  Err(io::ErrorKind::Unsupported.into())
}

/// Whether the kernel can do it; the reason otherwise.
pub(crate) fn check(peers: &[Ipv4Addr]) -> io::Result<()> {
  let probe = Socket::new(socket2::Domain::IPV4, socket2::Type::DGRAM, None)?;
  receive_only(&probe, peers)
}
