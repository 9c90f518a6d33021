//! What goes wrong on a line, once.

/// What happens once, to what passes next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Trouble {
    /// The next `ok` does not arrive.
    LoseOk,
    /// The next `ok` arrives twice.
    DoubleOk,
    /// The next `ok` arrives without its first letter.
    HalveOk,
    /// The next status report arrives without its first byte.
    BeheadReport,
    /// After the next line of the controller that begins so, these bytes arrive, which it
    /// never said.
    Say { after: &'static str, bytes: Vec<u8> },
    /// The next line of motion is not ended.
    LoseLineEnd,
    /// The next line of motion arrives without its first letter.
    LoseLetter,
    /// This byte is lost the next time.
    LoseByte(u8),
    /// The cable is pulled when so many bytes of the next line of motion have passed.
    Unplug { after: usize },
}

impl Trouble {
    /// Whether it happens in the direction of the driver.
    pub(super) fn is_to_driver(&self) -> bool {
        use Trouble::{BeheadReport, DoubleOk, HalveOk, LoseOk, Say};
        matches!(self, LoseOk | DoubleOk | HalveOk | BeheadReport | Say { .. })
    }
}
