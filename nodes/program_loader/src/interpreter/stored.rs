//! Positions and work offsets that the machine stores, as far as the program or its parameter file
//! says them: `#5161`, `#5221`.

use super::Interpreter;
use super::turn::is_rotation;
use crate::findings::Findings;
use crate::parameter_file::{Section, Stored, is_kept, is_of_the_machine};
use cnc_msgs::contour::Source;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AxisSet, Position};

impl Interpreter<'_> {
    /// Takes the values of a parameter file. Those that LinuxCNC would act on at once are refused
    /// or reported.
    pub(crate) fn store(&mut self, file: &Section, findings: &mut Findings) {
        findings.begin_block();
        self.ignored(file, findings);
        let Section { name, values } = file;
        for &Stored { number, value, line } in values {
            let place = Source { line, column: 1, ..Source::default() };
            if is_of_the_machine(number) {
                self.stored.insert(number, value);
            }
            let finding = match number {
                _ if is_rotation(number) && value != 0.0 => {
                    let system = (number - 5230) / 20 + 1;
                    let message = format!(
                        "the parameter file {name} rotates work system {system} by {value} degrees"
                    );
                    let help = format!(
                        "if it is not meant to be, write 0 for #{number} into the file, or G10 L2 \
                         P{system} R0 into the program"
                    );
                    Finding::warning(Code::SuspiciousValue, place, message).help(help)
                }
                5210 if value != 0.0 => {
                    let message = format!(
                        "the parameter file {name} has G92 in force, and programs begin without"
                    );
                    let help = "write G92 into the program if it needs it";
                    Finding::warning(Code::Unsupported, place, message).help(help)
                }
                5220 if value != 1.0 && value != 0.0 => {
                    let message = format!(
                        "the parameter file {name} selects work system {value}; programs begin in G54"
                    );
                    let help = "write the work system into the program";
                    Finding::warning(Code::Unsupported, place, message).help(help)
                }
                _ => continue,
            };
            findings.push(finding);
        }
        self.begin_turned();
    }

    /// Says that there are values which no program begins with.
    fn ignored(&self, file: &Section, findings: &mut Findings) {
        let mut others = file.values.iter().filter(|it| !is_kept(it.number));
        let Some(first) = others.next() else { return };
        let more = match others.count() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let message = format!(
            "the parameter file {} sets #{}{more}, which LinuxCNC does not keep: no effect",
            file.name, first.number
        );
        let source = Source { line: first.line, column: 1, ..Source::default() };
        let help = "delete them from the file; the user's parameters are #31 to #5000";
        findings.push(Finding::warning(Code::Unsupported, source, message).help(help));
    }

    /// The program has set axes of a work system; `None`: to what only the machine knows.
    pub(super) fn store_offset(&mut self, system: u32, axes: AxisSet, origin: Option<Position>) {
        for axis in (0..3).filter(|&axis| axes.contains(axis)) {
            let number = 5221 + 20 * (system - 1) + axis as u32;
            match origin {
                Some(origin) => self.stored.insert(number, origin[axis]),
                None => self.stored.remove(&number),
            };
        }
    }

    /// The same for further axes: degrees and mm.
    pub(super) fn store_further_offset(
        &mut self,
        system: u32,
        origin: FurtherAxes,
        by_position: bool,
    ) {
        for (axis, value) in origin.iter() {
            let number = 5224 + 20 * (system - 1) + axis as u32;
            match by_position {
                false => self.stored.insert(number, value),
                true => self.stored.remove(&number),
            };
        }
    }

    /// The controller stores where it is.
    pub(super) fn store_reference(&mut self, second: bool) {
        let first = if second { 5181 } else { 5161 };
        self.stored.retain(|number, _| !(first..first + 9).contains(number));
    }
}
