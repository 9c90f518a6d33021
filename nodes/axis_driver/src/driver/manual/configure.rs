//! Which setting of the controller decides how well the link is watched, and to what it
//! is to be set.
//!
//! That is the mask of the status report, `$10`, and nothing else is ever written. The
//! decision is a function of firmware and mask; writing it is a manual operation.

use super::{ManualOrder, Task};
use crate::codes::error_code;
use crate::driver::answer::Refusal;
use crate::driver::context::Context;
use crate::driver::context::machine::Machine;
use crate::firmware::Firmware;
use crate::link::LineKind;

/// The mask of the status report.
const REPORT_MASK: u16 = 10;
/// Asks for all settings.
const SETTINGS: &str = "$$";

/// A change of the mask.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Change {
    from: u32,
    to: u32,
    gives: Vec<&'static str>,
}

/// `None` when the mask has all that the driver can use.
fn change(firmware: Firmware, mask: u32, line_numbers: bool) -> Option<Change> {
    let traits = firmware.traits();
    let fields = traits.report_fields.iter();
    let fields = fields.chain(traits.line_number_field.iter().filter(|_| line_numbers));
    let missing = fields.filter(|field| mask & (1 << field.bit) == 0);
    let (to, gives) = missing.fold((mask, Vec::new()), |(to, mut gives), field| {
        gives.push(field.gives);
        (to | 1 << field.bit, gives)
    });
    (to != mask).then_some(Change { from: mask, to, gives })
}

impl Change {
    /// `$10=3, was $10=1: adds Bf ...`
    fn describe(&self) -> String {
        let Self { from, to, gives } = self;
        format!("${REPORT_MASK}={to}, was ${REPORT_MASK}={from}: adds {}", gives.join("; "))
    }
}

/// What `configure` gives.
pub(in crate::driver) enum Configuration {
    WouldWrite(String),
    Write(ManualOrder),
}

/// Says what would be written, or gives what writes it and reads it back.
pub(in crate::driver) fn configure(
    context: &Context,
    write: bool,
) -> Result<Configuration, Refusal> {
    let firmware = context.machine.firmware;
    let Some(mask) = context.machine.mask(REPORT_MASK) else {
        let text = format!("the controller did not report ${REPORT_MASK}: soft_reset asks again");
        return Err(Refusal::new(error_code::CONNECTING, text));
    };
    let Some(change) = change(firmware, mask, context.config.encoder.line_numbers) else {
        let why = match firmware.traits().no_field_because {
            "" => {
                format!("with ${REPORT_MASK}={mask} reports have all fields that the driver uses")
            }
            why => why.to_owned(),
        };
        let text = format!("nothing to write: {why}");
        return Err(Refusal::new(error_code::NOTHING_TO_DO, text));
    };
    if !write {
        return Ok(Configuration::WouldWrite(format!("would write {}", change.describe())));
    }
    let line = format!("${REPORT_MASK}={}", change.to);
    let task = Task::Configure { wanted: change.to, done: change.describe() };
    Ok(Configuration::Write(ManualOrder::new(task, LineKind::Slow, [line, SETTINGS.to_owned()])))
}

/// Whether the controller reports the mask that was written.
pub(in crate::driver) fn judge_mask(
    machine: &Machine,
    wanted: u32,
    done: &str,
) -> Result<String, Refusal> {
    match machine.mask(REPORT_MASK) {
        Some(mask) if mask == wanted => Ok(format!("written and read back: {done}")),
        read => {
            let read = read.map_or("nothing".to_owned(), |mask| format!("${REPORT_MASK}={mask}"));
            let text = format!(
                "the controller accepted ${REPORT_MASK}={wanted}, but reports {read}: its settings \
                 may be write-protected"
            );
            Err(Refusal::new(error_code::CONTROLLER_ERROR, text))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_bits_are_added_and_only_those_that_are_used() {
        for (firmware, mask, line_numbers, wanted) in [
            (Firmware::Grbl, 0, false, Some(2)),
            (Firmware::Grbl, 1, false, Some(3)),
            (Firmware::Grbl, 3, false, None),
            (Firmware::GrblHal, 511, true, None),
            (Firmware::GrblHal, 0, false, Some(0b111_1010)),
            (Firmware::GrblHal, 0, true, Some(0b111_1110)),
            // What others have switched on stays.
            (Firmware::GrblHal, 8192 | 1, false, Some(8192 | 0b111_1011)),
            (Firmware::FluidNc, 1, false, None),
        ] {
            let to = change(firmware, mask, line_numbers).map(|change| change.to);
            assert_eq!(to, wanted, "{firmware:?} {mask}");
        }
        let change = change(Firmware::Grbl, 1, false).unwrap();
        assert!(change.describe().starts_with("$10=3, was $10=1: adds Bf"), "{change:?}");
    }
}
