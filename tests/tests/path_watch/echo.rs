//! Firmware that repeats each line that it has read: what was damaged on its way never moves.

use crate::certified::{Certified, OFF_MM};
use crate::damaged::spoil;
use crate::parts::{Part, Random, START, built};
use axis_driver::codes::error_code;
use axis_driver::driver::{Command, DriverConfig, OnPathDeviation, RunOutcome};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::CompensatedPath;
use std::time::Duration;
use virtual_controller::{Build, Firmware, Settings};

/// A third of a second a line: what the controller reads is seconds ahead of the tool. More lines
/// than the planner of grblHAL takes at once.
fn slow_zigzag() -> CompensatedPath {
    let mut part = Part::new();
    part.feed(300.0);
    for step in 1..=200 {
        part.line([1.2 * f64::from(step), f64::from(step % 2), -0.125 * f64::from(step % 5)]);
    }
    part.path
}

#[test]
fn no_damaged_line_moves_the_tool_while_others_are_before_it() {
    // Nothing else looks at places or counts.
    let config = DriverConfig {
        on_path_deviation: OnPathDeviation::Off,
        line_check_interval_ms: 0,
        ..DriverConfig::default()
    };
    let path = slow_zigzag();
    let (mut unlike, mut others) = (0, 0);
    for firmware in [Firmware::Grbl, Firmware::GrblHal] {
        for seed in 0..60 {
            let settings = Settings::small_router_of(firmware);
            let build = Build { echoes_lines: true, ..Build::new(settings) };
            let mut line = built(build, config.clone());
            let certified = Certified::new(&path, START, line.all_axes());
            let mut random = Random(seed);
            line.start(path.clone(), 0);
            line.wait(random.between(2.0, 12.0));
            let what = format!("{firmware} seed {seed}");
            let mut chance = Random(random.next());
            line.spoil_next(move |bytes| spoil(bytes, &mut chance));
            let (mut hint, end) = (0, line.now + Duration::from_secs(120));
            while line.finished.is_none() && line.now < end {
                line.controller.advance(line.now);
                let off = certified.off(line.all_axes(), &mut hint).mm;
                assert!(off <= OFF_MM, "{what}: {off:.3} mm off\n{}", line.log.join("\n"));
                line.step_within(Duration::from_millis(4));
                // The damaged byte may be a hold or a stop of the program.
                if matches!(line.mode(), Mode::Hold | Mode::ToolChange) && line.finished.is_none() {
                    line.wait(1.0);
                    line.begin(Command::CancelRun { run: None });
                    line.until("it ends", |line| line.finished.is_some());
                }
            }
            let result = line.finished.take().expect("it has ended");
            let is_unlike = result.message.contains("where") && result.message.contains("was sent");
            if is_unlike {
                assert_eq!(result.error_code, error_code::PROTOCOL, "{what}: {result:?}");
                assert!(line.state().needs_reset, "{what}");
                unlike += 1;
            } else if result.outcome != RunOutcome::Succeeded {
                others += 1;
            }
        }
    }
    assert!(unlike > 90, "{unlike} of 120, {others} stopped otherwise");
}
