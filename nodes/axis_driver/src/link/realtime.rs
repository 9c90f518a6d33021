//! Bytes that act at once, wherever they stand.
//!
//! Only these are ever sent outside of lines. XON (0x11) is none of them: it would switch
//! on software flow control of FluidNC, as other control characters would its echo. Nor is
//! any byte from 0xC0 on, which FluidNC takes for the beginning of a pin event.

pub const SOFT_RESET: u8 = 0x18;
pub const STATUS: u8 = b'?';
pub const FEED_HOLD: u8 = b'!';
pub const RESUME: u8 = b'~';
pub const SAFETY_DOOR: u8 = 0x84;
pub const JOG_CANCEL: u8 = 0x85;
pub const FEED_100: u8 = 0x90;
pub const FEED_PLUS_10: u8 = 0x91;
pub const FEED_MINUS_10: u8 = 0x92;
pub const FEED_PLUS_1: u8 = 0x93;
pub const FEED_MINUS_1: u8 = 0x94;
pub const RAPID_100: u8 = 0x95;
pub const RAPID_50: u8 = 0x96;
pub const RAPID_25: u8 = 0x97;
pub const SPINDLE_100: u8 = 0x99;
pub const SPINDLE_PLUS_10: u8 = 0x9a;
pub const SPINDLE_MINUS_10: u8 = 0x9b;
pub const SPINDLE_PLUS_1: u8 = 0x9c;
pub const SPINDLE_MINUS_1: u8 = 0x9d;
/// In a hold only.
pub const SPINDLE_STOP: u8 = 0x9e;
pub const FLOOD_TOGGLE: u8 = 0xa0;
pub const MIST_TOGGLE: u8 = 0xa1;
/// FluidNC: no echo and no editing of lines.
pub const ECHO_OFF: u8 = 0x0c;
/// grblHAL: stops and forgets all lines, keeps the position.
pub const STOP: u8 = 0x19;
/// grblHAL: a report with all fields. FluidNC runs a macro for it.
pub const FULL_STATUS: u8 = 0x87;
/// grblHAL: the tool is in, the axes may be jogged.
pub const TOOL_CHANGE_ACKNOWLEDGE: u8 = 0xa3;

/// Whether the byte is one of those above.
pub const fn is_named(byte: u8) -> bool {
    matches!(
        byte,
        SOFT_RESET
            | STATUS
            | FEED_HOLD
            | RESUME
            | SAFETY_DOOR
            | JOG_CANCEL
            | FEED_100..=RAPID_25
            | SPINDLE_100..=SPINDLE_STOP
            | FLOOD_TOGGLE
            | MIST_TOGGLE
            | ECHO_OFF
            | STOP
            | FULL_STATUS
            | TOOL_CHANGE_ACKNOWLEDGE
    )
}
