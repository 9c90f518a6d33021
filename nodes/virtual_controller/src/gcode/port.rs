//! M62 to M68, as grblHAL checks them.

use crate::codes::ErrorCode;
use crate::gcode::sort::Words;

/// A value for an output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Output {
    pub(crate) is_analog: bool,
    pub(crate) port: u8,
    pub(crate) value: f64,
}

/// What M66 waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum InputWait {
    No,
    Rise,
    Fall,
    High,
    Low,
}

/// What a block does with the ports of the board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum PortCommand {
    Switch {
        output: Output,
        /// When the next motion begins.
        with_motion: bool,
    },
    Read {
        is_analog: bool,
        port: u8,
        wait: InputWait,
        seconds: f64,
    },
}

/// How many ports of each kind a board has: digital inputs and outputs, then analog ones.
pub(crate) type PortCounts = [u8; 4];

/// Whether a board with these ports knows the word.
pub(super) fn is_known(
    number: i64,
    [digital_in, digital_out, analog_in, analog_out]: PortCounts,
) -> bool {
    match number {
        62..=65 => digital_out > 0,
        66 => digital_in > 0 || analog_in > 0,
        67 | 68 => analog_out > 0,
        _ => false,
    }
}

/// Takes the words of M62 to M68.
pub(super) fn command(
    w: &mut Words,
    number: i64,
    [digital_in, digital_out, analog_in, analog_out]: PortCounts,
) -> Result<PortCommand, ErrorCode> {
    let port = |value: f64, count: u8| match value as u32 {
        _ if value < 0.0 => Err(ErrorCode::NegativeValue),
        port if port < u32::from(count) => Ok(port as u8),
        _ => Err(ErrorCode::ValueOutOfRange),
    };
    let with_motion = matches!(number, 62 | 63 | 67);
    match number {
        62..=65 => {
            let port = port(w.take('P').ok_or(ErrorCode::ValueWordMissing)?, digital_out)?;
            let value = f64::from(u8::from(number % 2 == 0));
            let output = Output { is_analog: false, port, value };
            Ok(PortCommand::Switch { output, with_motion })
        }
        66 => {
            let (p, e, l, q) = (w.take('P'), w.take('E'), w.take('L'), w.take('Q'));
            if l.is_none() && q.is_none() {
                return Err(ErrorCode::ValueWordMissing);
            }
            if p.is_some() && e.is_some() {
                return Err(ErrorCode::ValueWordConflict);
            }
            let wait = match l.unwrap_or(0.0).trunc() as i64 {
                0 => InputWait::No,
                1 => InputWait::Rise,
                2 => InputWait::Fall,
                3 => InputWait::High,
                4 => InputWait::Low,
                _ => return Err(ErrorCode::ValueOutOfRange),
            };
            let seconds = q.unwrap_or(0.0);
            if wait != InputWait::No && (seconds == 0.0 || e.is_some()) {
                return Err(ErrorCode::ValueOutOfRange);
            }
            let (is_analog, port) = match e {
                Some(e) => (true, port(e, analog_in)?),
                None => (false, port(p.unwrap_or(0.0), digital_in)?),
            };
            Ok(PortCommand::Read { is_analog, port, wait, seconds })
        }
        _ => {
            let (e, q) = (w.take('E'), w.take('Q'));
            if e.is_none() && q.is_none() {
                return Err(ErrorCode::ValueWordMissing);
            }
            // Its code for this is that of a speed.
            let port = port(e.unwrap_or(0.0), analog_out).map_err(|_| ErrorCode::RpmOutOfRange)?;
            // The firmware keeps a whole number.
            let value = f64::from(q.unwrap_or(0.0) as i32);
            let output = Output { is_analog: true, port, value };
            Ok(PortCommand::Switch { output, with_motion })
        }
    }
}
