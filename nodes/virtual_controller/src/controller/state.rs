//! What the controller is doing, and the stages of it.

use crate::axes::AXES;
use crate::homing::Homing;

/// What the controller is doing.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ControllerState {
    /// No supply.
    Off,
    /// The board is starting; the banner has not been sent.
    Starting {
        left_s: f64,
    },
    Idle,
    /// Locked until `$X` or `$H`; a critical alarm needs a reset first.
    Alarm {
        is_critical: bool,
    },
    Check,
    Homing(Homing),
    Run,
    Hold {
        is_stopped: bool,
    },
    Jog {
        is_cancelled: bool,
    },
    Door(Door),
    Sleep,
    /// M6: waits until the operator has changed the tool.
    Tool,
    /// Braking because a target is outside of the travel.
    SoftLimit,
    /// Braking, then dropping everything queued.
    Stopping,
}

/// The stages of an open door.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Door {
    /// A jog is dropped when it has stopped; a program is not.
    Stopping {
        is_jog: bool,
    },
    /// The tool goes to its parking place.
    Retracting,
    Stopped,
    /// The tool comes back from there.
    Returning,
    Resuming {
        left_s: f64,
    },
}

/// A probing move under way.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Probing {
    pub(super) away: bool,
    pub(super) miss_is_fine: bool,
    pub(super) contact_steps: Option<[i64; AXES]>,
}
