//! The numbers of `error:N` and `ALARM:N`.
//!
//! The parser and the controller decide when to send them.

use std::fmt;

/// Why a line was refused: the N of `error:N`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum ErrorCode {
    /// A word did not start with a letter.
    ExpectedLetter = 1,
    /// A word has no number, or its number cannot be read.
    BadNumber = 2,
    /// A `$` command that does not exist.
    InvalidStatement = 3,
    /// A negative value where only a positive one makes sense.
    NegativeValue = 4,
    /// Homing asked for while `$22=0`.
    HomingDisabled = 5,
    /// `$0` below 3 µs.
    StepPulseTooShort = 6,
    /// A `$` command that needs Idle.
    NotIdle = 8,
    /// G-code while locked by an alarm or while jogging.
    Locked = 9,
    /// Soft limits asked for while homing is off.
    SoftLimitNeedsHoming = 10,
    /// More characters than the line buffer holds.
    LineTooLong = 11,
    /// The safety door is open.
    DoorOpen = 13,
    /// A stored line is longer than the memory for it.
    StoredLineTooLong = 14,
    /// A jog that leaves the travel.
    JogOutOfTravel = 15,
    /// A jog with words that a jog may not have.
    InvalidJog = 16,
    /// A word or code the controller does not have.
    Unsupported = 20,
    /// Two codes of one modal group.
    ModalGroupViolation = 21,
    /// Motion without a feed rate.
    UndefinedFeed = 22,
    /// A fraction where an integer is needed.
    NotInteger = 23,
    /// Two codes that both need the axis words.
    AxisCommandConflict = 24,
    /// A value word that occurs twice.
    WordRepeated = 25,
    /// A code that needs axis words has none.
    NoAxisWords = 26,
    /// N above 10 000 000.
    InvalidLineNumber = 27,
    /// A code lacks its P or L.
    ValueWordMissing = 28,
    /// A work coordinate system that does not exist.
    UnsupportedCoordinateSystem = 29,
    /// G53 with another motion than G0 or G1.
    G53InvalidMotion = 30,
    /// Axis words while G80 is active.
    AxisWordsExist = 31,
    /// An arc without an axis word of its plane.
    NoAxisWordsInPlane = 32,
    /// A target that cannot be reached as programmed.
    InvalidTarget = 33,
    /// An R smaller than half the chord.
    ArcRadius = 34,
    /// An arc without a centre in its plane.
    NoOffsetsInPlane = 35,
    /// Words that no code of the block uses.
    UnusedWords = 36,
    /// G43.1 with another axis than Z.
    DynamicOffsetAxis = 37,
    /// T above 255.
    ValueTooLarge = 38,
    /// grblHAL: a value that a code does not take.
    ValueOutOfRange = 39,
    /// grblHAL: a thread, and the spindle stands.
    SpindleNotRunning = 41,
    /// grblHAL: a thread that is too fast for the axes.
    MaxFeedRateExceeded = 43,
    /// grblHAL: only homing unlocks.
    RpmOutOfRange = 44,
    HomingRequired = 46,
    /// Words that exclude each other.
    ValueWordConflict = 48,
    /// grblHAL: a setting above its maximum.
    SettingOutOfRange = 52,
    /// grblHAL: a critical alarm needs a reset first.
    CriticalEvent = 79,
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error:{}", *self as u8)
    }
}

/// Why the controller locked itself: the N of `ALARM:N`.
///
/// 1 to 9 have the same meaning everywhere; higher numbers belong to the firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Alarm(pub(crate) u8);

impl Alarm {
    /// A limit switch was hit while moving; the position is lost.
    pub(crate) const HARD_LIMIT: Self = Self(1);
    /// A target outside of the travel; the position is kept.
    pub(crate) const SOFT_LIMIT: Self = Self(2);
    /// Reset while moving; the position is doubtful.
    pub(crate) const ABORTED_IN_MOTION: Self = Self(3);
    /// The probe was not in its expected state before the move.
    pub(crate) const PROBE_INITIAL: Self = Self(4);
    /// The probe found nothing.
    pub(crate) const PROBE_CONTACT: Self = Self(5);
    /// Homing was reset.
    pub(crate) const HOMING_RESET: Self = Self(6);
    /// The door opened while homing.
    pub(crate) const HOMING_DOOR: Self = Self(7);
    /// The pull-off did not free the switch.
    pub(crate) const HOMING_PULL_OFF: Self = Self(8);
    /// The switch was not found.
    pub(crate) const HOMING_APPROACH: Self = Self(9);
    /// grblHAL: the emergency stop is pressed.
    pub(crate) const EMERGENCY_STOP: Self = Self(10);
    /// grblHAL: only homing unlocks.
    pub(crate) const HOMING_REQUIRED: Self = Self(11);
    /// grblHAL: a limit switch is closed at a reset.
    pub(crate) const LIMITS_ENGAGED: Self = Self(12);
    /// grblHAL: the spindle is not where it should be, or too slow.
    pub(crate) const SPINDLE: Self = Self(14);
}
