//! How a serial port is opened at the end of a network (RFC 2217), without a socket.
//!
//! The gateway has to take part in the option COM-PORT and to confirm the baud rate; before that
//! nothing is sent to the board. Its reports of modem lines and of its buffers are switched off
//! or passed over: what is under way fits the board's buffer.

use super::telnet::{BINARY, COM_PORT, Event, SUPPRESS_GO_AHEAD, Telnet, subnegotiate};

/// The options of a connection of this kind.
const OPTIONS: &[u8] = &[COM_PORT, BINARY, SUPPRESS_GO_AHEAD];

const SET_BAUD: u8 = 1;
const SET_DATA_BITS: u8 = 2;
const SET_PARITY: u8 = 3;
const SET_STOP_BITS: u8 = 4;
const SET_CONTROL: u8 = 5;
const SET_LINE_STATE_MASK: u8 = 10;
const SET_MODEM_STATE_MASK: u8 = 11;
const PURGE: u8 = 12;
/// A gateway adds this to the number of what it answers.
const ANSWER: u8 = 100;

const NO_PARITY: u8 = 1;
const ONE_STOP_BIT: u8 = 1;
const NO_FLOW_CONTROL: u8 = 1;
const DTR_ON: u8 = 8;
const DTR_OFF: u8 = 9;
const RTS_ON: u8 = 11;
const RTS_OFF: u8 = 12;
const BOTH_BUFFERS: u8 = 3;

/// What the port is to be like; 8N1 without flow control in any case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PortSettings {
    pub(super) baud: u32,
    /// The level of DTR; `None` leaves what the gateway does.
    pub(super) dtr: Option<bool>,
    pub(super) rts: Option<bool>,
}

/// A port that is being opened.
#[derive(Debug)]
pub(super) struct Opening {
    telnet: Telnet,
    settings: PortSettings,
    has_asked: bool,
}

/// How far it is.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// The gateway has not answered yet.
    Waiting,
    /// The port is as wanted.
    Open,
    /// It never will be; the text is for people.
    Refused(String),
}

impl Opening {
    /// Begins, with the bytes to send first.
    pub(super) fn new(settings: PortSettings) -> (Self, Vec<u8>) {
        let mut telnet = Telnet::new(OPTIONS);
        let offer = telnet.offer(OPTIONS, &[BINARY, SUPPRESS_GO_AHEAD]);
        (Self { telnet, settings, has_asked: false }, offer)
    }

    /// Takes what the gateway has sent; returns how far the port is, and what to send.
    ///
    /// Bytes of the board that come before the port is as wanted are dropped: they may have come
    /// at another baud rate.
    pub(super) fn receive(&mut self, bytes: &[u8]) -> (Progress, Vec<u8>) {
        let received = self.telnet.receive(bytes);
        let mut reply = received.reply;
        for event in received.events {
            match event {
                Event::Ours { option: COM_PORT, is_on: true } if !self.has_asked => {
                    self.has_asked = true;
                    reply.extend(requests(self.settings));
                }
                Event::Ours { option: COM_PORT, is_on: false } => {
                    let text = "the gateway refuses the option COM-PORT of RFC 2217; write tcp:// for a \
                                port that passes bytes on as they are";
                    return (Progress::Refused(text.into()), reply);
                }
                Event::Subnegotiation(bytes) => match baud_answer(&bytes) {
                    Some(baud) if baud == self.settings.baud => return (Progress::Open, reply),
                    Some(baud) => {
                        let wanted = self.settings.baud;
                        let text = format!(
                            "the gateway runs the port at {baud} baud, not at {wanted}; change its \
                             configuration or the parameter baud"
                        );
                        return (Progress::Refused(text), reply);
                    }
                    None => {}
                },
                Event::Ours { .. } => {}
            }
        }
        (Progress::Waiting, reply)
    }

    /// The Telnet end of the port that is open.
    pub(super) fn into_telnet(self) -> Telnet {
        self.telnet
    }
}

/// The requests that make a port as wanted; the baud rate last, since its answer is waited for.
fn requests(settings: PortSettings) -> Vec<u8> {
    let PortSettings { baud, dtr, rts } = settings;
    let level = |level: Option<bool>, on, off| {
        level.map(|is_on| (SET_CONTROL, if is_on { on } else { off }))
    };
    let bytes = [
        (SET_DATA_BITS, 8),
        (SET_PARITY, NO_PARITY),
        (SET_STOP_BITS, ONE_STOP_BIT),
        (SET_CONTROL, NO_FLOW_CONTROL),
        (SET_LINE_STATE_MASK, 0),
        (SET_MODEM_STATE_MASK, 0),
    ];
    let levels = [level(dtr, DTR_ON, DTR_OFF), level(rts, RTS_ON, RTS_OFF)];
    let requests = bytes.into_iter().chain(levels.into_iter().flatten());
    let requests = requests.chain([(PURGE, BOTH_BUFFERS)]);
    let mut all: Vec<u8> =
        requests.flat_map(|(request, value)| subnegotiate(COM_PORT, &[request, value])).collect();
    let [a, b, c, d] = baud.to_be_bytes();
    all.extend(subnegotiate(COM_PORT, &[SET_BAUD, a, b, c, d]));
    all
}

/// The baud rate, where a subnegotiation answers that.
fn baud_answer(bytes: &[u8]) -> Option<u32> {
    match bytes {
        [COM_PORT, request, baud @ ..] if *request == SET_BAUD + ANSWER => {
            baud.try_into().ok().map(u32::from_be_bytes)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: PortSettings = PortSettings { baud: 115_200, dtr: None, rts: Some(false) };

    #[test]
    fn a_port_is_open_when_the_gateway_has_confirmed_its_baud_rate() {
        let (mut opening, offer) = Opening::new(SETTINGS);
        assert_eq!(
            offer, b"\xff\xfb\x2c\xff\xfb\x00\xff\xfb\x03\xff\xfd\x00\xff\xfd\x03",
            "WILL COM-PORT, BINARY, SGA; DO BINARY, SGA"
        );
        // What the board says before is dropped.
        let (progress, asked) = opening.receive(b"Grbl\xff\xfd\x2c\xff\xfb\x00");
        assert_eq!(progress, Progress::Waiting);
        let requests: [&[u8]; 9] = [
            b"\x02\x08",
            b"\x03\x01",
            b"\x04\x01",
            b"\x05\x01",
            b"\x0a\x00",
            b"\x0b\x00",
            b"\x05\x0c",
            b"\x0c\x03",
            b"\x01\x00\x01\xc2\x00",
        ];
        let wanted: Vec<u8> =
            requests.iter().flat_map(|it| [b"\xff\xfa\x2c", *it, b"\xff\xf0"].concat()).collect();
        assert_eq!(asked, wanted);
        // The answers to the others, and a report of the modem lines.
        let others = b"\xff\xfa\x2c\x66\x08\xff\xf0\xff\xfa\x2c\x6b\xb0\xff\xf0";
        assert_eq!(opening.receive(others), (Progress::Waiting, vec![]));
        let answer = b"\xff\xfa\x2c\x65\x00\x01\xc2\x00\xff\xf0";
        assert_eq!(opening.receive(answer), (Progress::Open, vec![]));
    }

    #[test]
    fn a_gateway_that_cannot_is_refused_with_the_reason() {
        let rows: [(&[u8], &str); 3] = [
            (b"\xff\xfe\x2c", "refuses the option COM-PORT"),
            (
                b"\xff\xfd\x2c\xff\xfa\x2c\x65\x00\x00\x25\x80\xff\xf0",
                "at 9600 baud, not at 115200",
            ),
            // Answered without having been asked.
            (b"\xff\xfa\x2c\x65\x00\x00\x00\x00\xff\xf0", "at 0 baud"),
        ];
        for (bytes, wanted) in rows {
            let (mut opening, _) = Opening::new(SETTINGS);
            match opening.receive(bytes).0 {
                Progress::Refused(text) => assert!(text.contains(wanted), "{text}"),
                other => panic!("{bytes:x?}: {other:?}"),
            }
        }
    }

    #[test]
    fn bytes_of_another_protocol_open_no_port() {
        for bytes in
            [&b"<Idle|MPos:0,0,0>\r\nok\r\n"[..], b"HTTP/1.1 400\r\n", b"\x15\x03\x03\0\x02"]
        {
            let (mut opening, _) = Opening::new(SETTINGS);
            assert_eq!(opening.receive(bytes), (Progress::Waiting, vec![]), "{bytes:?}");
        }
    }
}
