//! Faults as text: `ACTION[:ARGUMENT]@TRIGGER=VALUE`.
//!
//! | action | does |
//! |---|---|
//! | `rx-drop` `rx-duplicate` `rx-corrupt` | loses, doubles or changes a byte to the controller |
//! | `rx-digit` | the next digit to the controller becomes another digit |
//! | `tx-drop` `tx-duplicate` `tx-corrupt` | the same for a byte from the controller |
//! | `lose-ok` `extra-ok` | loses an answer, sends one more |
//! | `lose-line` `extra-line` | loses a whole line to the controller, passes one on twice |
//! | `rx-delay:SECONDS` `tx-delay:SECONDS` | the line stalls for this time, then all bytes arrive in order |
//! | `mute:TEXT` `garble:TEXT` | loses the next line from the controller that contains the text, or changes a byte of it |
//! | `silent` `silent:SECONDS` | sends nothing from now on, or for this time |
//! | `push:TEXT` | the controller sends this line without a request |
//! | `alarm:N` | raises `ALARM:N` as the firmware would |
//! | `reset` | the supply fails for a moment: banner, position lost |
//! | `limit:AXIS` `release:AXIS` `cut:AXIS` | closes, releases or disconnects a limit switch |
//! | `input:N=V` | digital input N of programs becomes V, 0 or 1; `input:EN=V` is analog |
//! | `door` `close-door` | opens and closes the safety door |
//! | `close` | the cable is pulled and not plugged in again |
//! | `vanish:SECONDS` | the cable is pulled; after this time the board is back as another device |
//! | `unplug:SECONDS` | the same, and the cable was the supply: the board boots again, position lost |
//!
//! | trigger | when |
//! |---|---|
//! | `line=N` | the Nth answer (`ok` or `error:`) since power-up is sent; for `lose-line` and `extra-line`: the Nth line to the controller begins |
//! | `byte=N` | the Nth byte passes: in the direction of the fault, otherwise to the controller |
//! | `time=S` | S seconds of the controller's time after power-up |
//! | `rate=P` | each time with probability P; bytes, answers and lines only |
//!
//! Pulling the cable loses everything in transit, the answer that triggered it included. All
//! seconds are of the controller's clock; a time factor makes them shorter in real time.

use std::str::FromStr;

/// A direction of the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// `rx`: to the controller.
    ToController,
    /// `tx`: from the controller.
    FromController,
}

/// What happens to a byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ByteFault {
    /// It is lost.
    Drop,
    /// It arrives twice.
    Duplicate,
    /// One of its bits is wrong.
    Corrupt,
    /// It, or the next one that is a digit, becomes another digit.
    Digit,
}

/// What fails.
#[derive(Debug, Clone, PartialEq)]
pub enum FaultAction {
    /// A byte suffers.
    Byte(Direction, ByteFault),
    /// A direction stalls; bytes in transit arrive later, in order.
    Delay {
        /// Which direction.
        direction: Direction,
        /// How long, of the controller's clock.
        seconds: f64,
    },
    /// An answer is not sent.
    LoseOk,
    /// An additional `ok` is sent.
    ExtraOk,
    /// A line does not reach the controller; real-time bytes do.
    LoseLine,
    /// A line reaches the controller twice.
    ExtraLine,
    /// The next line from the controller that contains a text is lost or changed.
    Line {
        /// The text.
        text: String,
        /// Is the line lost, or is one byte of it wrong?
        is_lost: bool,
    },
    /// Nothing is sent, for a time or from now on.
    Silent {
        /// `None`: from now on.
        seconds: Option<f64>,
    },
    /// A line is sent without a request.
    Push(String),
    /// An alarm is raised.
    Alarm(u8),
    /// The supply fails for a moment.
    Reset,
    /// A limit switch is held closed.
    Limit(usize),
    /// The limit switch is released.
    Release(usize),
    /// The limit switch is disconnected and never closes.
    Cut(usize),
    /// An input that programs read changes.
    Input {
        /// An analog one.
        is_analog: bool,
        /// Its number.
        port: u8,
        /// What it says now.
        value: i32,
    },
    /// The safety door opens.
    Door,
    /// The safety door closes.
    CloseDoor,
    /// The cable is pulled and not plugged in again.
    Close,
    /// The cable is pulled; the board comes back as another device.
    Vanish {
        /// How long it is away.
        seconds: f64,
        /// Did the cable carry the supply?
        loses_power: bool,
    },
}

/// When it fails.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Trigger {
    /// At the Nth answer, counted from 1.
    Line(u64),
    /// At the Nth byte, counted from 1.
    Byte(u64),
    /// At a time of the controller's clock, seconds.
    Time(f64),
    /// At random, with this probability, 0 to 1.
    Rate(f64),
}

/// One fault that happens once, or at random.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// What fails.
    pub action: FaultAction,
    /// When it fails.
    pub trigger: Trigger,
}

/// Why a text is not a fault.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FaultError {
    /// No `@TRIGGER=VALUE`.
    #[error(
        "fault `{0}` has no trigger; append one: ACTION@line=N, @byte=N, @time=SECONDS or @rate=P"
    )]
    NoTrigger(String),
    /// The action is not in the table.
    #[error(
        "unknown fault action `{0}`; use rx-drop, rx-duplicate, rx-corrupt, rx-digit, tx-drop, \
         tx-duplicate, tx-corrupt, rx-delay:SECONDS, tx-delay:SECONDS, lose-ok, extra-ok, \
         lose-line, extra-line, mute:TEXT, garble:TEXT, silent[:SECONDS], push:TEXT, alarm:N, \
         reset, limit:AXIS, release:AXIS, cut:AXIS, input:N=V, input:EN=V, door, \
         close-door, close, vanish:SECONDS or unplug:SECONDS"
    )]
    Action(String),
    /// The trigger or its value is not in the table.
    #[error(
        "fault trigger `{0}` is not line=N or byte=N with N from 1, time=SECONDS or rate=P with \
         P from 0 to 1"
    )]
    Trigger(String),
    /// Only bytes, answers and lines can fail at random.
    #[error("`{0}` cannot use rate; use line, byte or time")]
    RateOfAction(String),
    /// An answer or line fails when it is sent, a byte when it passes.
    #[error(
        "`{0}` cannot use this trigger; use line or rate for answers and lines, byte or rate for bytes"
    )]
    TriggerOfAction(String),
}

impl FromStr for FaultAction {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let unknown = || FaultError::Action(text.to_string());
        let (name, argument) = match text.split_once(':') {
            Some((name, argument)) => (name, Some(argument)),
            None => (text, None),
        };
        let byte = |direction, spoil| Ok(Self::Byte(direction, spoil));
        let axis = || match argument.map(str::to_ascii_lowercase).as_deref() {
            Some("x") => Ok(0),
            Some("y") => Ok(1),
            Some("z") => Ok(2),
            _ => Err(unknown()),
        };
        let takes_argument = [
            "rx-delay", "tx-delay", "silent", "push", "alarm", "limit", "release", "cut", "vanish",
            "unplug", "mute", "garble", "input",
        ];
        if argument.is_some() && !takes_argument.contains(&name) {
            return Err(unknown());
        }
        let line = || {
            let is_line = |text: &&str| !text.is_empty() && !text.contains(['\r', '\n']);
            argument.filter(is_line).map(str::to_owned).ok_or_else(unknown)
        };
        let duration = || argument.and_then(seconds).ok_or_else(unknown);
        let delay = |direction| Ok(Self::Delay { direction, seconds: duration()? });
        match name {
            "rx-drop" => byte(Direction::ToController, ByteFault::Drop),
            "rx-duplicate" => byte(Direction::ToController, ByteFault::Duplicate),
            "rx-corrupt" => byte(Direction::ToController, ByteFault::Corrupt),
            "rx-digit" => byte(Direction::ToController, ByteFault::Digit),
            "tx-drop" => byte(Direction::FromController, ByteFault::Drop),
            "tx-duplicate" => byte(Direction::FromController, ByteFault::Duplicate),
            "tx-corrupt" => byte(Direction::FromController, ByteFault::Corrupt),
            "rx-delay" => delay(Direction::ToController),
            "tx-delay" => delay(Direction::FromController),
            "lose-ok" => Ok(Self::LoseOk),
            "extra-ok" => Ok(Self::ExtraOk),
            "lose-line" => Ok(Self::LoseLine),
            "extra-line" => Ok(Self::ExtraLine),
            "silent" => match argument.map(seconds) {
                None => Ok(Self::Silent { seconds: None }),
                Some(Some(seconds)) => Ok(Self::Silent { seconds: Some(seconds) }),
                Some(None) => Err(unknown()),
            },
            "push" => Ok(Self::Push(line()?)),
            "mute" => Ok(Self::Line { text: line()?, is_lost: true }),
            "garble" => Ok(Self::Line { text: line()?, is_lost: false }),
            "alarm" => {
                let number = argument.and_then(|text| text.parse().ok()).filter(|n| *n > 0);
                number.map(Self::Alarm).ok_or_else(unknown)
            }
            "reset" => Ok(Self::Reset),
            "limit" => axis().map(Self::Limit),
            "release" => axis().map(Self::Release),
            "cut" => axis().map(Self::Cut),
            "input" => argument.and_then(input).ok_or_else(unknown),
            "door" => Ok(Self::Door),
            "close-door" => Ok(Self::CloseDoor),
            "close" => Ok(Self::Close),
            "vanish" => Ok(Self::Vanish { seconds: duration()?, loses_power: false }),
            "unplug" => Ok(Self::Vanish { seconds: duration()?, loses_power: true }),
            _ => Err(unknown()),
        }
    }
}

impl FromStr for Fault {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let (action_text, trigger_text) =
            text.rsplit_once('@').ok_or_else(|| FaultError::NoTrigger(text.to_string()))?;
        let action = action_text.parse::<FaultAction>()?;
        let wrong = || FaultError::Trigger(trigger_text.to_string());
        let (name, value) = trigger_text.split_once('=').ok_or_else(wrong)?;
        let count = || value.parse::<u64>().ok().filter(|n| *n > 0).ok_or_else(wrong);
        let trigger = match name {
            "line" => Trigger::Line(count()?),
            "byte" => Trigger::Byte(count()?),
            "time" => Trigger::Time(seconds(value).ok_or_else(wrong)?),
            "rate" => {
                let rate = seconds(value).filter(|rate| *rate <= 1.0).ok_or_else(wrong)?;
                Trigger::Rate(rate)
            }
            _ => return Err(wrong()),
        };
        let fits = match (&action, trigger) {
            (FaultAction::Byte(..), Trigger::Byte(_) | Trigger::Rate(_)) => true,
            (
                FaultAction::LoseOk
                | FaultAction::ExtraOk
                | FaultAction::LoseLine
                | FaultAction::ExtraLine,
                Trigger::Line(_) | Trigger::Rate(_),
            ) => true,
            (
                FaultAction::Byte(..)
                | FaultAction::LoseOk
                | FaultAction::LoseLine
                | FaultAction::ExtraLine,
                _,
            ) => false,
            (FaultAction::ExtraOk, trigger) => matches!(trigger, Trigger::Time(_)),
            (_, Trigger::Rate(_)) => {
                return Err(FaultError::RateOfAction(action_text.to_string()));
            }
            _ => true,
        };
        if !fits {
            return Err(FaultError::TriggerOfAction(action_text.to_string()));
        }
        Ok(Self { action, trigger })
    }
}

/// `2=1`, or `E0=512`.
fn input(text: &str) -> Option<FaultAction> {
    let (port, value) = text.split_once('=')?;
    let (is_analog, port) = port.strip_prefix('E').map_or((false, port), |port| (true, port));
    let (port, value) = (port.parse().ok()?, value.parse::<i32>().ok()?);
    // The firmware reports no number below -1, and takes -1 for a wait in vain.
    let fits = is_analog && value >= 0 || matches!(value, 0 | 1);
    fits.then_some(FaultAction::Input { is_analog, port, value })
}

fn seconds(text: &str) -> Option<f64> {
    text.parse::<f64>().ok().filter(|s| s.is_finite() && (0.0..1e9).contains(s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_as_the_table_says() {
        let read = |text: &str| text.parse::<Fault>().unwrap();
        assert_eq!(
            read("lose-ok@line=20"),
            Fault { action: FaultAction::LoseOk, trigger: Trigger::Line(20) }
        );
        assert_eq!(
            read("silent:1.5@time=3"),
            Fault {
                action: FaultAction::Silent { seconds: Some(1.5) },
                trigger: Trigger::Time(3.0)
            }
        );
        assert_eq!(
            read("rx-corrupt@rate=0.001").action,
            FaultAction::Byte(Direction::ToController, ByteFault::Corrupt)
        );
        assert_eq!(
            read("rx-digit@byte=40").action,
            FaultAction::Byte(Direction::ToController, ByteFault::Digit)
        );
        assert_eq!(read("limit:X@byte=7").action, FaultAction::Limit(0));
        assert_eq!(
            read("tx-delay:0.5@line=3").action,
            FaultAction::Delay { direction: Direction::FromController, seconds: 0.5 }
        );
        assert_eq!(
            read("mute:Grbl 1.1@time=3").action,
            FaultAction::Line { text: "Grbl 1.1".into(), is_lost: true }
        );
        assert_eq!(
            read("input:2=1@time=3").action,
            FaultAction::Input { is_analog: false, port: 2, value: 1 }
        );
        assert_eq!(
            read("input:E0=512@time=3").action,
            FaultAction::Input { is_analog: true, port: 0, value: 512 }
        );
        assert_eq!(read("alarm:3@line=3").action, FaultAction::Alarm(3));
        assert_eq!(read("push:[MSG:a@b]@time=1").action, FaultAction::Push("[MSG:a@b]".into()));
        assert_eq!(
            read("unplug:2@byte=9").action,
            FaultAction::Vanish { seconds: 2.0, loses_power: true }
        );
    }

    #[test]
    fn what_is_no_fault_is_refused_with_the_way_to_write_it() {
        for text in [
            "",
            "lose-ok",
            "lose-ok@",
            "lose-ok@line",
            "lose-ok@line=0",
            "lose-ok@line=-1",
            "lose-ok@byte=2",
            "explode@line=1",
            "limit@line=1",
            "limit:a@line=1",
            "silent:x@line=1",
            "reset:1@line=1",
            "rx-delay@line=1",
            "rx-delay:1@rate=0.5",
            "alarm@line=1",
            "alarm:0@line=1",
            "alarm:256@line=1",
            "push:@line=1",
            "mute:@time=1",
            "garble@time=1",
            "vanish@line=1",
            "vanish:-1@line=1",
            "reset@rate=0.1",
            "rx-drop@line=2",
            "rx-drop@rate=1.5",
            "input:2@time=1",
            "input:2=5@time=1",
            "input:E2=-5@time=1",
            "input:F2=1@time=1",
            "door@time=nan",
            "door@time=inf",
        ] {
            let error = text.parse::<Fault>().expect_err(text).to_string();
            assert!(error.contains('`'), "{error}");
        }
    }
}
