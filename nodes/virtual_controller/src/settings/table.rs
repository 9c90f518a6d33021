//! All settings by number: which firmware has them, how they print, their defaults.

use crate::firmware::{Firmware, SettingNumbers};

/// How a setting is stored and printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ValueKind {
    /// 0 to 255, or a mask.
    Integer,
    /// 0 to 65535, or a mask.
    Word,
    /// 0 or 1.
    Boolean,
    /// Three decimals.
    Float,
    /// A float that grbl prints without decimals.
    Rpm,
}

/// Which numbering has a setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Owner {
    All,
    /// That of grbl: grblHAL uses the number for a wider setting.
    Classic,
    GrblHal,
}

/// One setting.
#[derive(Debug)]
pub(super) struct SettingRow {
    pub(super) number: u16,
    pub(super) kind: ValueKind,
    /// Default of bare firmware.
    pub(super) generic: f64,
    /// Default of the small router.
    pub(super) router: f64,
    owner: Owner,
}

use Owner::{All, Classic, GrblHal};
use ValueKind::{Boolean, Float, Integer, Rpm, Word};

const fn row(number: u16, kind: ValueKind, generic: f64, router: f64, owner: Owner) -> SettingRow {
    SettingRow { number, kind, generic, router, owner }
}

/// A setting that only grblHAL has, with the same default on every machine.
const fn hal(number: u16, kind: ValueKind, default: f64) -> SettingRow {
    row(number, kind, default, default, GrblHal)
}

/// All settings, by number.
static TABLE: &[SettingRow] = &[
    row(0, Integer, 10.0, 10.0, All),
    row(1, Integer, 25.0, 255.0, All),
    row(2, Integer, 0.0, 0.0, All),
    row(3, Integer, 0.0, 0.0, All),
    row(4, Boolean, 0.0, 0.0, All),
    row(5, Boolean, 0.0, 0.0, All),
    row(6, Boolean, 0.0, 0.0, All),
    hal(9, Integer, 1.0),
    row(10, Integer, 1.0, 3.0, Classic),
    hal(10, Word, 511.0),
    row(11, Float, 0.010, 0.010, All),
    row(12, Float, 0.002, 0.002, All),
    row(13, Boolean, 0.0, 0.0, All),
    hal(14, Integer, 0.0),
    hal(15, Integer, 0.0),
    hal(17, Integer, 0.0),
    hal(18, Integer, 0.0),
    hal(19, Boolean, 0.0),
    row(20, Boolean, 0.0, 0.0, All),
    row(21, Boolean, 0.0, 0.0, Classic),
    hal(21, Integer, 0.0),
    row(22, Boolean, 0.0, 0.0, Classic),
    hal(22, Word, 0.0),
    row(23, Integer, 0.0, 0.0, All),
    row(24, Float, 25.0, 100.0, All),
    row(25, Float, 500.0, 2000.0, All),
    row(26, Word, 250.0, 100.0, All),
    row(27, Float, 1.0, 2.0, All),
    hal(28, Float, 0.1),
    hal(29, Float, 0.0),
    row(30, Rpm, 1000.0, 24000.0, All),
    row(31, Rpm, 0.0, 0.0, All),
    row(32, Boolean, 0.0, 0.0, Classic),
    hal(32, Integer, 0.0),
    hal(33, Float, 5000.0),
    hal(34, Float, 0.0),
    hal(35, Float, 0.0),
    hal(36, Float, 100.0),
    hal(37, Integer, 0.0),
    hal(39, Boolean, 1.0),
    hal(40, Boolean, 0.0),
    hal(41, Integer, 0.0),
    hal(42, Integer, 2.0),
    hal(43, Integer, 1.0),
    hal(44, Integer, 4.0),
    hal(45, Integer, 3.0),
    hal(46, Integer, 0.0),
    hal(56, Float, 5.0),
    hal(57, Float, 100.0),
    hal(58, Float, -5.0),
    hal(59, Float, 500.0),
    hal(60, Boolean, 1.0),
    hal(61, Integer, 0.0),
    hal(62, Boolean, 0.0),
    hal(63, Integer, 2.0),
    hal(64, Boolean, 0.0),
    hal(65, Integer, 0.0),
    row(100, Float, 250.0, 250.0, All),
    row(101, Float, 250.0, 250.0, All),
    row(102, Float, 250.0, 250.0, All),
    row(103, Float, 250.0, 100.0, All),
    row(104, Float, 250.0, 100.0, All),
    row(105, Float, 250.0, 100.0, All),
    row(110, Float, 500.0, 5000.0, All),
    row(111, Float, 500.0, 5000.0, All),
    row(112, Float, 500.0, 2000.0, All),
    row(113, Float, 500.0, 7200.0, All),
    row(114, Float, 500.0, 7200.0, All),
    row(115, Float, 500.0, 7200.0, All),
    row(120, Float, 10.0, 500.0, All),
    row(121, Float, 10.0, 500.0, All),
    row(122, Float, 10.0, 200.0, All),
    row(123, Float, 10.0, 400.0, All),
    row(124, Float, 10.0, 400.0, All),
    row(125, Float, 10.0, 400.0, All),
    row(130, Float, 200.0, 600.0, All),
    row(131, Float, 200.0, 400.0, All),
    row(132, Float, 200.0, 100.0, All),
    row(133, Float, 0.0, 0.0, All),
    row(134, Float, 0.0, 0.0, All),
    row(135, Float, 0.0, 0.0, All),
    hal(341, Integer, 0.0),
    hal(342, Float, 30.0),
    hal(343, Float, 25.0),
    hal(344, Float, 200.0),
    hal(345, Float, 200.0),
    hal(346, Integer, 1.0),
    hal(384, Boolean, 0.0),
    hal(392, Float, 4.0),
    hal(393, Float, 1.0),
    hal(398, Word, 100.0),
    hal(481, Word, 0.0),
    hal(484, Boolean, 1.0),
    hal(486, Integer, 0.0),
    hal(676, Integer, 3.0),
];

/// The settings of a family with so many axes, by number.
pub(super) fn rows(firmware: Firmware, axes: usize) -> impl Iterator<Item = &'static SettingRow> {
    let numbers = firmware.traits().setting_numbers;
    TABLE.iter().filter(move |row| match (row.number, row.owner) {
        (100..=139, _) => usize::from(row.number % 10) < axes,
        (_, All) => true,
        (_, Classic) => numbers == SettingNumbers::Grbl,
        (_, GrblHal) => numbers == SettingNumbers::GrblHal,
    })
}

impl ValueKind {
    /// A value as the firmware stores it.
    pub(super) fn stored(self, value: f64) -> f64 {
        match self {
            Integer => value.trunc().min(255.0),
            Word => value.trunc().min(65535.0),
            Boolean => f64::from(u8::from(value.trunc() != 0.0)),
            Float | Rpm => value,
        }
    }

    /// A value as `$$` prints it.
    pub(super) fn printed(self, value: f64, firmware: Firmware) -> String {
        match self {
            Float => format!("{value:.3}"),
            Rpm if firmware.traits().prints_rpm_decimals => format!("{value:.3}"),
            Integer | Word | Boolean | Rpm => format!("{value:.0}"),
        }
    }
}
