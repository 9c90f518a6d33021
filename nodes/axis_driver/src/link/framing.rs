//! Bytes to lines, whatever the bytes are.

/// No firmware says more than this in a line; what is longer is garbage.
const LINE_BYTES_MAX: usize = 1024;
/// Software flow control, which another program may have switched on. The window
/// leaves nothing to throttle, so it is passed over.
const XON: u8 = 0x11;
const XOFF: u8 = 0x13;

/// Collects bytes up to a line end. Never holds more than [`LINE_BYTES_MAX`].
#[derive(Debug, Default)]
pub(super) struct Framer {
    line: Vec<u8>,
}

impl Framer {
    /// A framer in the middle of a line.
    pub(super) fn with(line: Vec<u8>) -> Self {
        Self { line }
    }

    /// What has come of a line that is not at its end.
    pub(super) fn unfinished(&self) -> &[u8] {
        &self.line
    }

    /// Gives the line that this byte ends, with the carriage return before it; one in
    /// the middle of a line stays there, to be seen as the damage it is. So does a line
    /// that grows too long.
    pub(super) fn push(&mut self, byte: u8) -> Option<Vec<u8>> {
        match byte {
            b'\n' => Some(std::mem::take(&mut self.line)),
            XON | XOFF => None,
            _ => {
                self.line.push(byte);
                (self.line.len() >= LINE_BYTES_MAX).then(|| std::mem::take(&mut self.line))
            }
        }
    }
}
