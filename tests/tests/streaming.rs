//! The machine is kept fed: how much of the line's byte rate short segments get.
//!
//! And that no line is lost, doubled or left waiting.
//!
//! In time that only the test moves, so that the figures are exact and the same on every
//! machine. `cargo bench -p kerf --bench streaming` shows the same on a pseudo-terminal.

use axis_driver::driver::{Command, DriverConfig, RunOutcome, RunRequest};
use cnc_msgs::path::CompensatedPath;
use kerf_tests::line::{Line, short_segments};
use kerf_tests::plain::{count_characters, switched_on};
use std::sync::Arc;
use std::time::Duration;
use virtual_controller::{Build, Firmware, Settings};

/// A machine that is fast enough to leave the line as the bottleneck.
fn fast() -> Build {
    let mut settings = Settings::small_router();
    for axis in 0..3 {
        settings.set_line(&format!("$11{axis}=30000")).unwrap();
        settings.set_line(&format!("$12{axis}=20000")).unwrap();
    }
    Build::new(settings)
}

/// Bytes a second on the line, and what of them lines were.
fn rate(path: CompensatedPath) -> (f64, f64) {
    let mut line = Line::new(DriverConfig::default(), fast(), &[]);
    line.until("idle", |line| line.mode() == cnc_msgs::machine::Mode::Idle);
    let request = RunRequest {
        program_id: "part".into(),
        revision: 1,
        path: Arc::new(path),
        start_line: 0,
        occurrence: 0,
        in_span: Default::default(),
        check_only: false,
        tool_diameters_mm: Default::default(),
    };
    line.ask(Command::RunProgram(request)).unwrap();
    // From the first line of the path to the last, with the machine at speed.
    let then = line.now;
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    let sent: Vec<(Duration, usize)> = line
        .written
        .iter()
        .filter(|(at, bytes)| *at >= then && bytes.contains(&b'X'))
        .map(|(at, bytes)| (*at, bytes.iter().filter(|byte| **byte != b'?').count()))
        .collect();
    let (first, last) = (sent.len() / 10, sent.len() * 9 / 10);
    let bytes: usize = sent[first..last].iter().map(|(_, count)| count).sum();
    let seconds = (sent[last].0 - sent[first].0).as_secs_f64();
    (bytes as f64 / seconds, 11_520.0)
}

#[test]
fn short_segments_get_99_percent_of_the_line() {
    let (rate, line) = rate(short_segments(6_000, 0.4));
    assert!(rate >= 0.99 * line, "{rate:.0} of {line} bytes a second");
}

/// Seconds from the first segment to each, as the driver and as a plain character counter
/// send them to two controllers of the same sort; and the driver's window.
fn side_by_side(firmware: Firmware, report: u16) -> (Vec<f64>, Vec<f64>, usize) {
    let build = || {
        let mut settings = Settings::small_router_of(firmware);
        for axis in 0..3 {
            settings.set_line(&format!("$11{axis}=30000")).unwrap();
            settings.set_line(&format!("$12{axis}=20000")).unwrap();
        }
        settings.set_line(&format!("$10={report}")).unwrap();
        Build::new(settings)
    };
    let mut line = Line::connected(build());
    // A few reports at rest say how large the buffer is.
    line.wait(2.0);
    let begun = line.now;
    assert_eq!(line.run(short_segments(4_000, 0.4)).outcome, RunOutcome::Succeeded);
    let window = line.driver.window();
    // One write may hold several lines, and requests for status.
    let mut lines = Vec::new();
    let mut unfinished = Vec::new();
    for (at, bytes) in line.written.iter().filter(|(at, _)| *at >= begun) {
        for &byte in bytes.iter().filter(|byte| !matches!(byte, b'?' | 0x80..)) {
            if byte != b'\n' {
                unfinished.push(byte);
                continue;
            }
            let text = String::from_utf8(std::mem::take(&mut unfinished)).expect("G-code");
            if text.contains(['X', 'Y']) {
                lines.push((*at, text));
            }
        }
    }
    let (driven, text): (Vec<Duration>, Vec<String>) = lines.into_iter().unzip();
    let (mut controller, now) = switched_on(build());
    let plain = count_characters(&mut controller, now, &text, window);
    let since_first = |times: Vec<Duration>| -> Vec<f64> {
        times.iter().map(|at| (*at - times[0]).as_secs_f64()).collect()
    };
    (since_first(driven), since_first(plain), window)
}

#[test]
fn no_line_is_sent_later_than_a_plain_character_counter_sends_it() {
    for (firmware, report, window, late_s, slower) in [
        // grbl's own `stream.py` stays below 127.
        (Firmware::Grbl, 3, 127, 0.02, 1.001),
        (Firmware::Grbl, 1, 127, 0.02, 1.001),
        // Bounded by the hold latency: 20 ms of 115 200 Bd. Nothing follows a check before all
        // before it is answered, twice a second.
        (Firmware::GrblHal, 511, 230, 0.03, 1.004),
        (Firmware::FluidNc, 3, 127, 0.02, 1.001),
    ] {
        let (driven, plain, is) = side_by_side(firmware, report);
        assert_eq!((is, driven.len()), (window, plain.len()), "{firmware}");
        // The requests for status come at other moments: a byte each, and a report that an
        // answer may have to wait for.
        let late = driven.iter().zip(&plain).map(|(driven, plain)| driven - plain);
        let latest = late.fold(f64::MIN, f64::max);
        let seconds = plain[plain.len() - 1];
        assert!(latest < late_s, "{firmware}: {latest} s after a plain counter");
        let driven = driven[driven.len() - 1];
        assert!(driven <= seconds * slower, "{firmware}: {driven} s on the whole, not {seconds}");
    }
}

#[test]
fn what_is_queued_before_a_hold_takes_no_longer_than_it_may() {
    for milliseconds in [5, 20, 100] {
        let hold_latency_ms_max = milliseconds;
        let config = DriverConfig { hold_latency_ms_max, ..DriverConfig::default() };
        // A machine with room for far more than that.
        let mut line = Line::new(config, fast(), &[]);
        line.until("idle", |line| line.mode() == cnc_msgs::machine::Mode::Idle);
        line.start(short_segments(20_000, 0.4), 0);
        line.wait(1.0);
        for _ in 0..50 {
            line.wait(0.037);
            let queued = line.controller.backlog();
            let then = line.now;
            line.ask(Command::FeedHold).unwrap();
            // It is written in the same turn, before any line that waits for the port.
            let (at, bytes) =
                line.written.iter().rfind(|(_, bytes)| bytes.contains(&b'!')).unwrap();
            assert_eq!((*at, bytes[0]), (then, b'!'));
            let most = f64::from(milliseconds) / 1e3 * 11_520.0;
            assert!(queued as f64 <= most + 1.0, "{queued} bytes, {most} may wait");
            line.until("a hold", |line| line.mode() == cnc_msgs::machine::Mode::Hold);
            while !line.ask_resume() {}
        }
    }
}

#[test]
fn every_line_is_sent_once_answered_and_cut_and_the_machine_never_waits_for_us() {
    // `KERF_SOAK_LINES=1000000 cargo test --release -p kerf_tests --test streaming` is an
    // hour and more of machine time.
    let lines = std::env::var("KERF_SOAK_LINES").ok().and_then(|text| text.parse().ok());
    let lines: u32 = lines.unwrap_or(6_000);
    for firmware in Firmware::ALL {
        let mut line = Line::connected(Build::new(Settings::small_router_of(firmware)));
        let before = line.controller.device().controller().counts();
        let mut path = short_segments(lines, 0.4);
        // Fast enough to need many lines a second, slow enough for the line to feed it.
        path.elements.iter_mut().for_each(|element| element.feed_mm_per_min = Some(4_000.0));
        line.written.clear();
        line.start(path, 0);
        // Checks go among them; what was written is not kept longer than it takes to count.
        let mut checks = 0;
        while line.finished.is_none() {
            line.step();
            for (_, bytes) in line.written.drain(..) {
                checks += String::from_utf8_lossy(&bytes).matches("$G\n").count() as u64;
            }
        }
        let result = line.result();
        assert_eq!((result.outcome, result.last_line), (RunOutcome::Succeeded, lines));
        let after = line.controller.device().controller().counts();
        // With the question for the offsets, the preamble and the dwell at the end.
        let count = u64::from(lines);
        assert_eq!(after.lines_read - before.lines_read, count + 3 + checks, "{firmware:?}");
        assert_eq!(after.oks - before.oks, count + 3 + checks, "{firmware:?}");
        assert_eq!(after.motions_finished - before.motions_finished, count, "{firmware:?}");
        assert_eq!(
            (after.errors, after.bytes_lost, after.underruns, after.alarms),
            (0, 0, 0, 0),
            "{firmware:?}: {}",
            after.to_json()
        );
        let window = line.driver.window();
        assert!(after.receive_buffer_bytes_max <= window, "{firmware:?}: {}", after.to_json());
    }
}
