//! The serial gateway of RFC 2217, without a socket: what it answers to its client.

const IAC: u8 = 0xff;
const SB: u8 = 0xfa;
const SE: u8 = 0xf0;
const WILL: u8 = 0xfb;
const WONT: u8 = 0xfc;
const DO: u8 = 0xfd;
const DONT: u8 = 0xfe;
const BINARY: u8 = 0;
const SUPPRESS_GO_AHEAD: u8 = 3;
const COM_PORT: u8 = 44;
/// Longer ones are cut off; none that is answered is as long.
const SUBNEGOTIATION_BYTES_MAX: usize = 64;
/// What a gateway adds to the number of a request that it answers.
const ANSWER: u8 = 100;

/// A gateway; every port setting is taken, and none has an effect.
#[derive(Debug, Default)]
pub(super) struct Gateway {
    /// The bytes of a command that is not complete.
    command: Vec<u8>,
    /// Options that were answered, with their verb.
    answered: Vec<[u8; 2]>,
}

impl Gateway {
    /// Takes bytes from the client; returns those for the board, and appends answers to `reply`.
    pub(super) fn receive(&mut self, bytes: &[u8], reply: &mut Vec<u8>) -> Vec<u8> {
        let mut data = Vec::new();
        for &byte in bytes {
            if self.command.is_empty() && byte != IAC {
                data.push(byte);
                continue;
            }
            self.command.push(byte);
            let is_whole = match self.command.as_slice() {
                [IAC] => false,
                [IAC, IAC] => {
                    data.push(IAC);
                    true
                }
                [IAC, verb @ (WILL | WONT | DO | DONT), option] => {
                    let (verb, option) = (*verb, *option);
                    self.negotiate(verb, option, reply);
                    true
                }
                [IAC, WILL | WONT | DO | DONT] => false,
                [IAC, SB, inside @ .., IAC, SE] if !ends_in_escape(inside) => {
                    answer(inside, reply);
                    true
                }
                [IAC, SB, inside @ ..] => {
                    if inside.len() > SUBNEGOTIATION_BYTES_MAX {
                        self.command.truncate(SUBNEGOTIATION_BYTES_MAX);
                    }
                    false
                }
                _ => true,
            };
            if is_whole {
                self.command.clear();
            }
        }
        data
    }

    /// Agrees to its options, once each, and refuses all others.
    fn negotiate(&mut self, verb: u8, option: u8, reply: &mut Vec<u8>) {
        let is_known = [BINARY, SUPPRESS_GO_AHEAD, COM_PORT].contains(&option);
        let answer = match (verb, is_known) {
            (WILL, true) => DO,
            (WILL, false) => DONT,
            (DO, true) => WILL,
            (DO, false) => WONT,
            _ => return,
        };
        if !self.answered.contains(&[answer, option]) {
            self.answered.push([answer, option]);
            reply.extend([IAC, answer, option]);
        }
    }
}

/// Whether an odd number of escapes comes before the end.
fn ends_in_escape(inside: &[u8]) -> bool {
    inside.iter().rev().take_while(|byte| **byte == IAC).count() % 2 == 1
}

/// Confirms a request about the port with the value that it has.
fn answer(inside: &[u8], reply: &mut Vec<u8>) {
    if let [COM_PORT, request, value @ ..] = inside {
        // The escapes in the value stay as they are.
        reply.extend([IAC, SB, COM_PORT, request + ANSWER]);
        reply.extend_from_slice(value);
        reply.extend([IAC, SE]);
    }
}

/// Doubles what would begin a command.
pub(super) fn escape(bytes: &[u8]) -> Vec<u8> {
    bytes.iter().flat_map(|byte| if *byte == IAC { vec![IAC; 2] } else { vec![*byte] }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_answered_and_kept_from_the_board_in_pieces_of_any_size() {
        let rows: [(&[u8], &[u8], &[u8]); 6] = [
            (b"G1X1\n", b"G1X1\n", b""),
            (b"\xff\xff\xff\xf1?", b"\xff?", b""),
            // WILL COM-PORT twice, DO ECHO, WONT ECHO.
            (b"\xff\xfb\x2c\xff\xfb\x2c", b"", b"\xff\xfd\x2c"),
            (b"\xff\xfd\x01\xff\xfc\x01", b"", b"\xff\xfc\x01"),
            // SET-BAUDRATE 115200, then one with an escaped byte.
            (
                b"\xff\xfa\x2c\x01\x00\x01\xc2\x00\xff\xf0!",
                b"!",
                b"\xff\xfa\x2c\x65\x00\x01\xc2\x00\xff\xf0",
            ),
            (
                b"\xff\xfa\x2c\x01\x00\xff\xff\xf0\x00\xff\xf0",
                b"",
                b"\xff\xfa\x2c\x65\x00\xff\xff\xf0\x00\xff\xf0",
            ),
        ];
        for (bytes, data, reply) in rows {
            for size in 1..=bytes.len() {
                let (mut gateway, mut got, mut said) = (Gateway::default(), Vec::new(), Vec::new());
                for piece in bytes.chunks(size) {
                    got.extend(gateway.receive(piece, &mut said));
                }
                assert_eq!(
                    (got.as_slice(), said.as_slice()),
                    (data, reply),
                    "{bytes:x?} by {size}"
                );
            }
        }
        assert_eq!(escape(b"a\xffb"), b"a\xff\xffb");
    }

    #[test]
    fn a_subnegotiation_without_an_end_takes_no_memory() {
        let (mut gateway, mut reply) = (Gateway::default(), Vec::new());
        gateway.receive(b"\xff\xfa", &mut reply);
        (0..100).for_each(|_| drop(gateway.receive(&[7; 1000], &mut reply)));
        assert!(gateway.command.len() <= SUBNEGOTIATION_BYTES_MAX + 2);
    }
}
