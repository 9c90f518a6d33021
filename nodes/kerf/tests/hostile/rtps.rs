//! Packets of RTPS 2.4 as a hostile or broken peer sends them, and where to send them.

use super::support::TIMEOUT;
use std::collections::BTreeSet;
use std::net::{Ipv4Addr, UdpSocket};
use std::time::{Duration, Instant};

/// Whose name a packet is sent in.
pub(crate) type Prefix = [u8; 12];

/// Participants that are looked for on the loopback interface.
const PARTICIPANTS: u16 = 12;
/// The endpoints that announce writers; every participant has both, and they are matched with those of all others.
const READER: [u8; 4] = [0, 0, 3, 0xc7];
const WRITER: [u8; 4] = [0, 0, 3, 0xc2];

/// Makes a packet in the name of this participant.
type Packet = fn(Prefix) -> Vec<u8>;

/// The packets of this issue, by name.
pub(crate) const PACKETS: [(&str, Packet); 5] = [
    ("NACK_FRAG 0", |from| nack_frag(from, 0)),
    ("NACK_FRAG 0xfffffff0", |from| nack_frag(from, 0xffff_fff0)),
    ("DATA_FRAG of 4 GB", data_frag),
    ("HEARTBEAT 1 to 2^62", heartbeat),
    ("GAP to 2^32", gap),
];

fn packet(from: Prefix, id: u8, body: &[&[u8]]) -> Vec<u8> {
    let body = body.concat();
    let mut packet = b"RTPS\x02\x04\x01\x12".to_vec();
    packet.extend(from);
    packet.extend([id, 1]);
    packet.extend(u16::try_from(body.len()).expect("short").to_le_bytes());
    packet.extend(body);
    packet
}

fn sequence_number(number: u64) -> Vec<u8> {
    let (high, low) = ((number >> 32) as u32, number as u32);
    [high.to_le_bytes(), low.to_le_bytes()].concat()
}

fn nack_frag(from: Prefix, fragment: u32) -> Vec<u8> {
    let set = [fragment, 1, 0x8000_0000, 1].map(u32::to_le_bytes).concat();
    packet(from, 0x12, &[&READER, &WRITER, &sequence_number(1), &set])
}

fn data_frag(from: Prefix) -> Vec<u8> {
    let head = [&[0, 0, 28, 0][..], &READER, &WRITER].concat();
    let sizes = [&1_u32.to_le_bytes()[..], &1_u16.to_le_bytes(), &1_024_u16.to_le_bytes()].concat();
    let all = 0xffff_fff0_u32.to_le_bytes();
    packet(from, 0x16, &[&head, &sequence_number(1_000), &sizes, &all, &[0; 1_024]])
}

fn heartbeat(from: Prefix) -> Vec<u8> {
    let count = 1_000_000_u32.to_le_bytes();
    packet(from, 7, &[&READER, &WRITER, &sequence_number(1), &sequence_number(1 << 62), &count])
}

fn gap(from: Prefix) -> Vec<u8> {
    let none = [0; 4];
    packet(
        from,
        8,
        &[&READER, &WRITER, &sequence_number(100_000), &sequence_number(1 << 32), &none],
    )
}

/// Where the participants of a domain listen, on this computer.
fn ports(domain: u16) -> impl Iterator<Item = u16> {
    (0..PARTICIPANTS).flat_map(move |id| [10, 11].map(|kind| 7_400 + 250 * domain + kind + 2 * id))
}

/// Sends a packet to every participant of a domain.
pub(crate) fn send(socket: &UdpSocket, domain: u16, packet: &[u8]) {
    for port in ports(domain) {
        // The port may be closed; some sizes do not fit.
        let _ = socket.send_to(packet, (Ipv4Addr::LOCALHOST, port));
    }
}

/// A socket to send from.
pub(crate) fn socket() -> UdpSocket {
    UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a socket")
}

/// The participants that announce themselves to unused ports.
pub(crate) fn participants(domain: u16, count: usize) -> BTreeSet<Prefix> {
    let listening: Vec<UdpSocket> = ports(domain)
        .filter_map(|port| UdpSocket::bind((Ipv4Addr::LOCALHOST, port)).ok())
        .inspect(|socket| socket.set_nonblocking(true).expect("a socket"))
        .collect();
    let (mut found, end) = (BTreeSet::new(), Instant::now() + TIMEOUT);
    while found.len() < count {
        assert!(Instant::now() < end, "{} of {count} participants", found.len());
        for socket in &listening {
            let mut packet = [0; 65_536];
            while let Ok(length) = socket.recv(&mut packet) {
                if length > 20 && packet.starts_with(b"RTPS") {
                    found.insert(packet[8..20].try_into().expect("twelve bytes"));
                }
            }
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    found
}

/// A sequence of numbers from a seed.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(2).wrapping_add(0x9e37_79b9_7f4a_7c15))
    }

    /// One below `end`.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        // xorshift64*
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % end
    }

    fn byte(&mut self) -> u8 {
        self.below(256) as u8
    }

    /// A packet that begins as one of RTPS: some submessages, known or not, with bodies of any
    /// numbers or those that real ones have, and now and then a byte changed.
    pub(crate) fn packet(&mut self, prefixes: &[Prefix]) -> Vec<u8> {
        const KINDS: [u8; 14] =
            [1, 6, 7, 8, 9, 0x0c, 0x0d, 0x0e, 0x0f, 0x12, 0x13, 0x15, 0x16, 0x30];
        const NUMBERS: [u32; 9] = [0, 1, 2, 28, 255, 65_535, 1 << 30, 0x7fff_ffff, u32::MAX - 15];
        let from = prefixes[self.below(prefixes.len())];
        if self.below(4) == 0 {
            let mut packet = PACKETS[self.below(PACKETS.len())].1(from);
            for _ in 0..self.below(4) {
                let place = 20 + self.below(packet.len() - 20);
                packet[place] = self.byte();
            }
            return packet;
        }
        let mut packet = b"RTPS\x02\x04\x01\x12".to_vec();
        packet.extend(from);
        for _ in 0..=self.below(4) {
            let mut body = Vec::new();
            if self.below(3) > 0 {
                body.extend([READER, WRITER].concat());
            }
            for _ in 0..self.below(24) {
                match self.below(3) {
                    0 => body.extend(NUMBERS[self.below(NUMBERS.len())].to_le_bytes()),
                    _ => body.extend([self.byte(), self.byte(), self.byte(), self.byte()]),
                }
            }
            packet.extend([KINDS[self.below(KINDS.len())], 1 | self.byte() & 0x0e]);
            packet.extend((body.len() as u16).to_le_bytes());
            packet.extend(body);
        }
        packet
    }
}
