//! The machines of the proof: each seed draws a cable, axes, accelerations and a report interval.

use crate::parts::{Random, built, holding};
use axis_driver::driver::DriverConfig;
use kerf_tests::line::Line;
use std::time::Duration;
use virtual_controller::{Build, Firmware, Settings};

/// A long report, bytes.
const REPORT_BYTES: f64 = 100.0;
/// Of what a serial line carries, reports take one in so many bytes where lines fill it
/// (`CROWDED_REPORT_SHARE` of the driver).
const CROWDED_SHARE: f64 = 20.0;
/// The same where little else is under way (`WATCHED_REPORT_SHARE`).
const QUIET_SHARE: f64 = 5.0;

/// How bytes come to the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Cable {
    Network,
    /// At so many baud.
    Serial(u32),
}

/// A machine and its cable.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rig {
    pub(crate) firmware: Firmware,
    pub(crate) cable: Cable,
    pub(crate) axes: &'static str,
    /// Of each axis, degrees where it turns (`$120` and on); `None`: as delivered.
    pub(crate) acceleration_mm_per_s2: Option<u32>,
    pub(crate) report_interval_ms: u32,
}

impl Rig {
    pub(crate) fn draw(firmware: Firmware, random: &mut Random) -> Self {
        let (network, usual) = (Cable::Network, Cable::Serial(115_200));
        Self {
            firmware,
            cable: random.of(&[
                network,
                network,
                usual,
                usual,
                Cable::Serial(57_600),
                Cable::Serial(250_000),
                Cable::Serial(921_600),
            ]),
            axes: random.of(&["XYZ", "XYZ", "XYZA", "XYZABC"]),
            acceleration_mm_per_s2: Some(random.of(&[50, 200, 800, 3_000])),
            report_interval_ms: random.of(&[20, 50, 50]),
        }
    }

    /// As most are.
    pub(crate) fn usual(firmware: Firmware, axes: &'static str) -> Self {
        let (cable, report_interval_ms) = (Cable::Serial(115_200), 50);
        Self { firmware, cable, axes, acceleration_mm_per_s2: None, report_interval_ms }
    }

    /// The board, idle, with its work zero where it stands; `lines` are further settings.
    pub(crate) fn line(&self, lines: &[&str], config: DriverConfig) -> Line {
        let axes = self.axes.parse().expect("axes");
        let mut settings = Settings::small_router_of(self.firmware).with_axes(axes);
        let numbers = 120..120 + self.axes.len();
        let set = |acceleration| {
            numbers.map(|number| format!("${number}={acceleration}")).collect::<Vec<_>>()
        };
        let accelerations = self.acceleration_mm_per_s2.map(set).unwrap_or_default().into_iter();
        for line in accelerations.chain(lines.iter().map(|line| (*line).to_owned())) {
            settings.set_line(&line).expect("a setting of this firmware");
        }
        let (is_networked, baud) = match self.cable {
            Cable::Network => (true, DriverConfig::default().baud),
            Cable::Serial(baud) => (false, baud),
        };
        let busy_poll_interval_ms = self.report_interval_ms;
        let config = DriverConfig { is_networked, baud, busy_poll_interval_ms, ..config };
        let mut line = built(Build::new(settings), config);
        line.forget_written();
        line
    }

    pub(crate) fn holding(&self) -> Line {
        self.line(&[], holding())
    }

    pub(crate) fn turns(&self) -> bool {
        self.axes.contains('A')
    }

    /// From the moment at which the tool is off its path to the hold on the wire, at most.
    ///
    /// The interval of reports, then the second report, which is asked for at once. A serial line that is
    /// full of short lines carries reports more seldom: one of 100 bytes may take a twentieth of it, or
    /// it would take the place of lines. Both reports stand behind answers there.
    pub(crate) fn held_within(&self) -> Duration {
        let interval_s = f64::from(self.report_interval_ms) / 1e3;
        let at_rest_s = f64::from(DriverConfig::default().poll_interval_ms) / 1e3;
        let seconds = match self.cable {
            Cable::Network => interval_s + SECOND_REPORT_S,
            Cable::Serial(baud) => {
                let report_s = REPORT_BYTES * 10.0 / f64::from(baud);
                let quiet_s = interval_s.max(report_s * QUIET_SHARE);
                let crowded_s = (report_s * CROWDED_SHARE).max(quiet_s).min(at_rest_s);
                crowded_s + SECOND_REPORT_S + 4.0 * report_s
            }
        };
        Duration::from_secs_f64(seconds)
    }
}

/// A request, the look of the firmware at it, and the report: without the bytes on the wire.
const SECOND_REPORT_S: f64 = 0.01;
