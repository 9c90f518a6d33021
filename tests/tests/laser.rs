//! A laser engraves as fast through the driver as through a plain sender.
//!
//! With `$32=1` the power of a pixel travels in the line of its move, and the machine does
//! not stop for it. On a line of its own it does: the firmware waits for all motion then.

use axis_driver::driver::RunOutcome;
use cnc_msgs::contour::{Action, Source, SpindleMode};
use cnc_msgs::geometry::{AxisSet, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement, PathEvent, Role};
use kerf_tests::line::Line;
use kerf_tests::plain::{count_characters, switched_on};
use std::time::Duration;
use virtual_controller::{Build, Drawn, Firmware, Settings};

const PIXELS: u32 = 400;
const PIXEL_MM: f64 = 0.1;
const FEED_MM_PER_MIN: f64 = 1_500.0;

fn laser(firmware: Firmware) -> Build {
    let mut settings = Settings::small_router_of(firmware);
    settings.set_line("$32=1").expect("a setting of every firmware");
    Build::new(settings)
}

fn power(pixel: u32) -> u32 {
    pixel * 37 % 256
}

/// One row of pixels, as engraving programs are posted: `G1X.1S37`.
fn raster(mode: SpindleMode) -> CompensatedPath {
    let source = |line: u32| Source { line, ..Source::default() };
    let mut path = CompensatedPath::default();
    path.events.push(PathEvent { at_element: 0, action: Action::Spindle(mode), source: source(1) });
    for pixel in 1..=PIXELS {
        path.events.push(PathEvent {
            at_element: path.elements.len(),
            action: Action::SpindleSpeed { rpm: f64::from(power(pixel)) },
            source: source(pixel + 1),
        });
        path.elements.push(PathElement {
            side: None,
            shape: Shape::Line,
            end: [f64::from(pixel) * PIXEL_MM, 0.0, 0.0],
            feed_mm_per_min: Some(FEED_MM_PER_MIN),
            role: Role::None,
            axes: AxisSet::NONE.with(0),
            source: source(pixel + 1),
        });
    }
    path.events.push(PathEvent {
        at_element: path.elements.len(),
        action: Action::Spindle(SpindleMode::Off),
        source: source(PIXELS + 2),
    });
    path
}

/// The same as text, with S in the line of its move or before it.
fn text(is_alone: bool) -> Vec<String> {
    let between = if is_alone { "\n" } else { "" };
    let pixel = |pixel: u32| {
        let x = f64::from(pixel) * PIXEL_MM;
        format!("S{}{between}G1X{x:.1}F{FEED_MM_PER_MIN}", power(pixel))
    };
    let pixels = (1..=PIXELS).map(pixel).collect::<Vec<_>>().join("\n");
    format!("M4\n{pixels}\nM5\nG4P0").lines().map(str::to_owned).collect()
}

/// Seconds from the first line to standstill, as a plain sender does it.
fn plain(firmware: Firmware, is_alone: bool) -> f64 {
    let (mut controller, start) = switched_on(laser(firmware));
    let lines = text(is_alone);
    count_characters(&mut controller, start, &lines, 128);
    (controller.device().controller().counts().machine_time - start).as_secs_f64()
}

/// The same through the driver, and what was drawn.
fn driven(firmware: Firmware, mode: SpindleMode) -> (f64, Vec<Drawn>) {
    let mut line = Line::connected(laser(firmware));
    line.controller.device_mut().controller_mut().keep_drawn();
    let begun = line.now;
    assert_eq!(line.run(raster(mode)).outcome, RunOutcome::Succeeded);
    let is_pixel = |(at, bytes): &&(Duration, Vec<u8>)| *at >= begun && bytes.contains(&b'M');
    let (start, _) = line.written.iter().find(is_pixel).expect("M3 or M4 was written");
    ((line.now - *start).as_secs_f64(), line.controller.device_mut().controller_mut().take_drawn())
}

#[test]
fn a_raster_takes_no_longer_than_with_a_plain_sender_and_an_s_of_its_own_stops() {
    for firmware in Firmware::ALL {
        let (inline, alone) = (plain(firmware, false), plain(firmware, true));
        let (driven, _) = driven(firmware, SpindleMode::CounterClockwise);
        // The controller makes the difference that real firmware makes: 7.0 s instead of 1.7 s.
        assert!(alone > 3.0 * inline, "{firmware}: {alone} s with S alone, {inline} s inline");
        // A run ends when a report after its last dwell has shown that the machine is at rest.
        const END_S: f64 = 0.25;
        let most = 1.05 * inline + END_S;
        assert!(driven <= most, "{firmware}: {driven} s, a plain sender {inline} s");
    }
}

#[test]
fn every_pixel_is_cut_with_its_own_power_and_m4_stays_m4() {
    for (mode, word) in [(SpindleMode::CounterClockwise, 4), (SpindleMode::Clockwise, 3)] {
        for firmware in Firmware::ALL {
            let (_, drawn) = driven(firmware, mode);
            assert_eq!(drawn.len(), PIXELS as usize, "{firmware}");
            for (pixel, drawn) in (1..).zip(drawn) {
                let wanted = (f64::from(power(pixel)), word);
                assert_eq!((drawn.spindle_rpm, drawn.spindle), wanted, "{firmware}: {pixel}");
            }
        }
    }
}
