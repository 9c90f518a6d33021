//! The numbers a grbl 1.1 answers with.
//!
//! Knows codes only; when they are due is the parser's and the controller's business.

use std::fmt;

/// Why a line was refused: the N of `error:N`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum ErrorCode {
    /// A word did not start with a letter.
    ExpectedLetter = 1,
    /// A word has no number, or not one that can be read.
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
    /// A jog with words that jogs may not have.
    InvalidJog = 16,
    /// A word or code the controller does not have.
    Unsupported = 20,
    /// Two codes of one modal group.
    ModalGroupViolation = 21,
    /// Motion without a feed rate.
    UndefinedFeed = 22,
    /// A fraction where an integer is needed.
    NotInteger = 23,
    /// Two codes that both want the axis words.
    AxisCommandConflict = 24,
    /// A value word that occurs twice.
    WordRepeated = 25,
    /// A code that needs axis words has none.
    NoAxisWords = 26,
    /// N beyond 10 000 000.
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
    /// Words nothing in the block uses.
    UnusedWords = 36,
    /// G43.1 with another axis than Z.
    DynamicOffsetAxis = 37,
    /// T beyond 255.
    ValueTooLarge = 38,
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error:{}", *self as u8)
    }
}

/// Why the controller locked itself: the N of `ALARM:N`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Alarm {
    /// A limit switch was hit while moving; the position is lost.
    HardLimit = 1,
    /// A target outside of the travel; the position is kept.
    SoftLimit = 2,
    /// Reset while moving; the position is doubtful.
    AbortedInMotion = 3,
    /// The probe was not in its expected state before the move.
    ProbeInitial = 4,
    /// The probe found nothing.
    ProbeContact = 5,
    /// Homing was reset.
    HomingReset = 6,
    /// The door opened while homing.
    HomingDoor = 7,
    /// The pull-off did not free the switch.
    HomingPullOff = 8,
    /// The switch was not found.
    HomingApproach = 9,
}
