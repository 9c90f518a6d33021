//! Kerf: a participant that only this computer reaches, and peers that it knows by address.
//!
//! `with_only_networks([127.0.0.1])` means this computer alone. The kernel then drops what comes from elsewhere before
//! the socket has it, and refuses to send elsewhere from the address 127.0.0.1. A packet to an address of this computer
//! goes over the loopback interface, whatever interface has the address.

use std::{
  io,
  net::{IpAddr, Ipv4Addr, SocketAddr},
};

use socket2::Socket;

use crate::structure::locator::Locator;

/// How many peers by address there may be: a jump in a filter of the kernel is at most 255 long.
pub const PEERS_MAX: usize = 100;

/// Whether a participant with these networks is for this computer alone.
pub(crate) fn is_only_this_host(only_networks: Option<&[IpAddr]>) -> bool {
  only_networks.is_some_and(|networks| networks.iter().all(IpAddr::is_loopback))
}

/// The addresses of this computer but for those of the loopback interface.
pub(crate) fn own_addresses() -> Vec<Ipv4Addr> {
  let interfaces = netdev::get_interfaces();
  let addresses = interfaces
    .iter()
    .flat_map(|it| it.ipv4.iter().map(|net| net.addr()));
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
/// A packet to this computer from itself comes over the loopback interface. One to a multicast group of another
/// interface is heard there, from an address of this computer, which the kernel takes from nobody else.
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
  let mut sources = peers.to_vec();
  // What has more addresses is found by fewer of them.
  sources.extend(own_addresses().into_iter().take(PEERS_MAX));
  let count = sources.len() as u8;
  let mut filter = vec![
    SockFilter::new(LOAD_WORD, 0, 0, INTERFACE_INDEX),
    // To the end, over what looks for sources.
    SockFilter::new(JUMP_IF_EQUAL, count + 2, 0, loopback.index),
    SockFilter::new(LOAD_WORD, 0, 0, SOURCE_ADDRESS),
  ];
  for (source, after) in sources.into_iter().zip((1..=count).rev()) {
    filter.push(SockFilter::new(JUMP_IF_EQUAL, after, 0, source.into()));
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
