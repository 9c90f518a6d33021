//! Telnet (RFC 854, 855) without a socket: takes the commands out of what comes, and answers them.
//!
//! A side offers what it wants once and answers each change once, so that two of them never
//! answer each other for ever (RFC 1143 in short). Knows no meaning of an option; that of
//! COM-PORT is in `com_port`.

pub(super) const IAC: u8 = 255;
const DONT: u8 = 254;
const DO: u8 = 253;
const WONT: u8 = 252;
const WILL: u8 = 251;
const SB: u8 = 250;
const SE: u8 = 240;
/// Eight bits, as they are (RFC 856).
pub(super) const BINARY: u8 = 0;
/// No half duplex (RFC 858).
pub(super) const SUPPRESS_GO_AHEAD: u8 = 3;
/// The settings of a serial port (RFC 2217).
pub(super) const COM_PORT: u8 = 44;

/// The longest subnegotiation that is kept; signatures of gateways are the longest.
const SUBNEGOTIATION_BYTES_MAX: usize = 256;

/// What came, sorted.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Received {
    /// Bytes for the driver.
    pub(super) data: Vec<u8>,
    /// Bytes to send back.
    pub(super) reply: Vec<u8>,
    pub(super) events: Vec<Event>,
}

/// What was agreed on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Event {
    /// The peer wants us to do an option that we have offered, or refuses it.
    Ours { option: u8, is_on: bool },
    /// A subnegotiation, its option first.
    Subnegotiation(Vec<u8>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NvtState {
    Data,
    Command,
    Option(u8),
    Subnegotiation,
    SubnegotiationCommand,
}

/// One end of a Telnet connection.
#[derive(Debug)]
pub(super) struct Telnet {
    /// Options that both sides may have on; all others are refused.
    wanted: &'static [u8],
    ours: Vec<u8>,
    theirs: Vec<u8>,
    state: NvtState,
    subnegotiation: Vec<u8>,
}

impl Telnet {
    /// One that takes part in these options and refuses all others.
    pub(super) fn new(wanted: &'static [u8]) -> Self {
        let (ours, theirs) = (Vec::new(), Vec::new());
        Self { wanted, ours, theirs, state: NvtState::Data, subnegotiation: Vec::new() }
    }

    /// Offers to do these options, and asks the peer to do the others.
    pub(super) fn offer(&mut self, ours: &[u8], theirs: &[u8]) -> Vec<u8> {
        self.ours.extend(ours);
        self.theirs.extend(theirs);
        let offers = ours.iter().flat_map(|option| [IAC, WILL, *option]);
        offers.chain(theirs.iter().flat_map(|option| [IAC, DO, *option])).collect()
    }

    /// Takes what came, in pieces of any size.
    pub(super) fn receive(&mut self, bytes: &[u8]) -> Received {
        let mut received = Received::default();
        for &byte in bytes {
            self.state = self.step(byte, &mut received);
        }
        received
    }

    fn step(&mut self, byte: u8, to: &mut Received) -> NvtState {
        match (self.state, byte) {
            (NvtState::Data, IAC) => NvtState::Command,
            (NvtState::Data, _) => {
                to.data.push(byte);
                NvtState::Data
            }
            (NvtState::Command, IAC) => {
                to.data.push(IAC);
                NvtState::Data
            }
            (NvtState::Command, DO | DONT | WILL | WONT) => NvtState::Option(byte),
            (NvtState::Command, SB) => {
                self.subnegotiation.clear();
                NvtState::Subnegotiation
            }
            // Commands of one byte: nothing, go ahead, are you there.
            (NvtState::Command, _) => NvtState::Data,
            (NvtState::Option(verb), option) => {
                self.negotiate(verb, option, to);
                NvtState::Data
            }
            (NvtState::Subnegotiation, IAC) => NvtState::SubnegotiationCommand,
            (NvtState::Subnegotiation, _) => {
                self.keep(byte);
                NvtState::Subnegotiation
            }
            (NvtState::SubnegotiationCommand, IAC) => {
                self.keep(IAC);
                NvtState::Subnegotiation
            }
            (NvtState::SubnegotiationCommand, SE) => {
                let all = std::mem::take(&mut self.subnegotiation);
                to.events.push(Event::Subnegotiation(all));
                NvtState::Data
            }
            // It broke off: what follows is a command of its own.
            (NvtState::SubnegotiationCommand, _) => {
                self.state = NvtState::Command;
                self.step(byte, to)
            }
        }
    }

    fn keep(&mut self, byte: u8) {
        if self.subnegotiation.len() < SUBNEGOTIATION_BYTES_MAX {
            self.subnegotiation.push(byte);
        }
    }

    fn negotiate(&mut self, verb: u8, option: u8, to: &mut Received) {
        let is_on = matches!(verb, DO | WILL);
        let concerns_us = matches!(verb, DO | DONT);
        let [accept, refuse] = if concerns_us { [WILL, WONT] } else { [DO, DONT] };
        let options = if concerns_us { &mut self.ours } else { &mut self.theirs };
        let was_on = options.contains(&option);
        if is_on && !was_on {
            // An offer of the peer.
            let answer = match self.wanted.contains(&option) {
                true => {
                    options.push(option);
                    accept
                }
                false => refuse,
            };
            to.reply.extend([IAC, answer, option]);
        } else if !is_on && was_on {
            options.retain(|on| *on != option);
            to.reply.extend([IAC, refuse, option]);
        }
        if concerns_us {
            let is_on = self.ours.contains(&option);
            to.events.push(Event::Ours { option, is_on });
        }
    }
}

/// Doubles what would begin a command.
pub(super) fn escape(bytes: &[u8]) -> Vec<u8> {
    let twice = |byte: &u8| std::iter::repeat_n(*byte, if *byte == IAC { 2 } else { 1 });
    bytes.iter().flat_map(twice).collect()
}

/// A subnegotiation with these bytes.
pub(super) fn subnegotiate(option: u8, bytes: &[u8]) -> Vec<u8> {
    [&[IAC, SB, option][..], &escape(bytes), &[IAC, SE]].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WANTED: &[u8] = &[BINARY, SUPPRESS_GO_AHEAD];

    #[test]
    fn commands_are_taken_out_and_each_offer_is_answered_once() {
        let ours = |option, is_on| Event::Ours { option, is_on };
        // What comes, what of it is data, what is answered, what is said of it.
        type Row<'a> = (&'a [u8], &'a [u8], &'a [u8], Vec<Event>);
        let rows: Vec<Row<'_>> = vec![
            (b"ok\r\n", b"ok\r\n", b"", vec![]),
            (b"o\xff\xffk", b"o\xffk", b"", vec![]),
            // Nothing, and are you there.
            (b"o\xff\xf1k\xff\xf6", b"ok", b"", vec![]),
            // WILL ECHO is refused, WILL BINARY is taken.
            (b"\xff\xfb\x01<", b"<", b"\xff\xfe\x01", vec![]),
            (b"\xff\xfb\x00\xff\xfb\x00", b"", b"\xff\xfd\x00", vec![]),
            // DO of what is not wanted, and of what is.
            (b"\xff\xfd\x18", b"", b"\xff\xfc\x18", vec![ours(0x18, false)]),
            (b"\xff\xfd\x03", b"", b"\xff\xfb\x03", vec![ours(3, true)]),
            // WONT and DONT of what is off need no answer.
            (b"\xff\xfc\x01\xff\xfe\x01", b"", b"", vec![ours(1, false)]),
            (
                b"\xff\xfa\x2c\x65\x00\xff\xff\xff\xf0ok",
                b"ok",
                b"",
                vec![Event::Subnegotiation(vec![0x2c, 0x65, 0, 0xff])],
            ),
            // A subnegotiation that breaks off into another command.
            (b"\xff\xfa\x2c\x65\xff\xfb\x01ok", b"ok", b"\xff\xfe\x01", vec![]),
        ];
        for (bytes, data, reply, events) in rows {
            let received = Telnet::new(WANTED).receive(bytes);
            let wanted = Received { data: data.into(), reply: reply.into(), events };
            assert_eq!(received, wanted, "{bytes:x?}");
        }
    }

    #[test]
    fn an_offer_that_is_taken_is_not_answered_and_one_that_is_refused_is_taken_back() {
        let mut telnet = Telnet::new(&[COM_PORT, BINARY]);
        let offers = telnet.offer(&[COM_PORT], &[BINARY]);
        assert_eq!(offers, b"\xff\xfb\x2c\xff\xfd\x00");
        let taken = telnet.receive(b"\xff\xfd\x2c\xff\xfb\x00");
        assert_eq!(taken.reply, b"");
        assert_eq!(taken.events, [Event::Ours { option: COM_PORT, is_on: true }]);
        let refused = telnet.receive(b"\xff\xfe\x2c");
        assert_eq!(refused.reply, b"\xff\xfc\x2c");
        assert_eq!(refused.events, [Event::Ours { option: COM_PORT, is_on: false }]);
    }

    #[test]
    fn a_subnegotiation_without_an_end_takes_no_memory() {
        let mut telnet = Telnet::new(WANTED);
        telnet.receive(&[IAC, SB, COM_PORT]);
        (0..1000).for_each(|_| drop(telnet.receive(&[7; 1000])));
        assert_eq!(telnet.subnegotiation.len(), SUBNEGOTIATION_BYTES_MAX);
    }

    proptest! {
        #[test]
        fn pieces_of_any_size_are_read_as_the_whole(
            bytes in prop::collection::vec(
                prop_oneof![Just(IAC), Just(SB), Just(SE), Just(DO), Just(WILL), any::<u8>()],
                0..200,
            ),
            cuts in prop::collection::vec(0usize..200, 0..8),
        ) {
            let whole = Telnet::new(WANTED).receive(&bytes);
            let mut cuts: Vec<usize> = cuts.into_iter().map(|cut| cut.min(bytes.len())).collect();
            cuts.extend([0, bytes.len()]);
            cuts.sort_unstable();
            let mut telnet = Telnet::new(WANTED);
            let mut pieces = Received::default();
            for cut in cuts.windows(2) {
                let piece = telnet.receive(&bytes[cut[0]..cut[1]]);
                pieces.data.extend(piece.data);
                pieces.reply.extend(piece.reply);
                pieces.events.extend(piece.events);
            }
            prop_assert_eq!(pieces, whole);
        }

        #[test]
        fn what_is_escaped_arrives_as_it_was(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let received = Telnet::new(WANTED).receive(&escape(&bytes));
            prop_assert_eq!(received.data, bytes.clone());
            let mut telnet = Telnet::new(WANTED);
            let received = telnet.receive(&subnegotiate(COM_PORT, &bytes));
            let mut all = vec![COM_PORT];
            all.extend(&bytes);
            all.truncate(SUBNEGOTIATION_BYTES_MAX);
            prop_assert_eq!(received.events, [Event::Subnegotiation(all)]);
        }
    }
}
