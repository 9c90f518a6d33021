//! What `error:N` means: why a line was refused, and what to do where that helps.
//!
//! The numbers that all firmwares share; the others are in [`crate::firmware`].

use crate::firmware::CodeRow;

#[rustfmt::skip]
pub(super) const SHARED: &[CodeRow] = &[
    (1, "a word has no letter"),
    (2, "a word has no number, or one that cannot be read"),
    (3, "this $ command is not known"),
    (4, "a value that must be positive is negative"),
    (5, "homing is switched off in the controller: set $22, or configure it on FluidNC"),
    (6, "the step pulse would be too short: raise $0"),
    (7, "the stored settings were unreadable and have been replaced by defaults: check them all"),
    (8, "this $ command is only taken while the machine is idle"),
    (9, "motion is locked by an alarm or a jog"),
    (10, "soft limits need homing to be enabled: set $22 first"),
    (11, "the line is too long for the controller"),
    (12, "the setting asks for more steps per second than the controller can make"),
    (13, "the safety door is open"),
    (14, "the text is too long to be stored"),
    (15, "the jog would leave the travel of the machine"),
    (16, "the jog command is malformed or holds a word that is not allowed in one"),
    (17, "laser mode needs a PWM output"),
    (20, "a G or M word that this controller does not know"),
    (21, "two words of one modal group in a line"),
    (22, "no feed rate was given"),
    (23, "a word needs a whole number"),
    (24, "two commands in a line both want the axis words"),
    (25, "a word is given twice"),
    (26, "the command needs an axis word"),
    (27, "the line number is out of range"),
    (28, "a word that the command needs is missing"),
    (29, "this controller has no such work system"),
    (30, "G53 goes with G0 and G1 only"),
    (31, "axis words that no command uses"),
    (32, "an arc without an axis word in its plane"),
    (33, "the target of the motion cannot be: start, end and centre of the arc disagree"),
    (34, "the radius of the arc cannot be"),
    (35, "an arc without an offset to its centre in its plane"),
    (36, "words that no command uses"),
    (37, "the tool length offset is for another axis"),
];
