//! Bytes take time on the line, and faults hit them on schedule.

mod common;
use common::{settings, settings_of};
use proptest::prelude::*;
use std::time::Duration;
use virtual_controller::{
    Build, Controller, Device, Fault, FaultAction, FaultInjector, Firmware, LineTiming, PacedLine,
};

fn controller(lines: &[&str]) -> Controller {
    Controller::with_build(Build::new(settings(lines)))
}

fn injector(faults: &[&str], seed: u64) -> FaultInjector {
    let faults = faults.iter().map(|fault| fault.parse::<Fault>().unwrap()).collect();
    FaultInjector::new(controller(&[]), faults, seed)
}

/// Everything received until no event is left, with the time of the last byte.
fn settle<D: Device>(line: &mut PacedLine<D>, mut now: Duration) -> (String, Duration) {
    let mut bytes = Vec::new();
    line.advance(now);
    line.transmit(now, &mut bytes);
    let mut last = now;
    while let Some(event) = line.next_event() {
        now = now.max(event);
        line.advance(now);
        let before = bytes.len();
        line.transmit(now, &mut bytes);
        if bytes.len() > before {
            last = now;
        }
    }
    (String::from_utf8_lossy(&bytes).replace("\r\n", "/"), last)
}

const BANNER: &str = "/Grbl 1.1h ['$' for help]/";
const T0: Duration = Duration::ZERO;

#[test]
fn a_byte_takes_ten_bits_in_each_direction() {
    let mut line = PacedLine::new(
        controller(&[]),
        LineTiming { baud: Some(1000), time_factor: 1.0, scales_bytes: false },
    );
    let (banner, at) = settle(&mut line, T0);
    assert_eq!(banner, BANNER);
    assert_eq!(at, Duration::from_millis(10 * 28));
    let start = Duration::from_secs(1);
    line.receive(start, b"G21\n");
    let (answer, at) = settle(&mut line, start);
    assert_eq!(answer, "ok/");
    assert_eq!(at, start + Duration::from_millis(10 * (4 + 4)));
}

#[test]
fn the_time_factor_speeds_the_axes_and_the_bytes_only_if_asked() {
    for (scales_bytes, byte_ms) in [(false, 10.0), (true, 1.0)] {
        let mut line = PacedLine::new(
            controller(&[]),
            LineTiming { baud: Some(1000), time_factor: 10.0, scales_bytes },
        );
        settle(&mut line, T0);
        let start = Duration::from_secs(1);
        line.receive(start, b"G1X100F1200\nG4P0\n");
        let (answer, at) = settle(&mut line, start);
        assert_eq!(answer, "ok/ok/");
        // 5.2 s of motion from the 12th byte on, then 4 bytes of answer.
        let expected = 0.52 + (12.0 + 4.0) * byte_ms / 1000.0;
        let took = (at - start).as_secs_f64();
        assert!((took - expected).abs() < 1e-6, "{took} s instead of {expected} s");
    }
}

#[test]
fn more_than_the_receive_buffer_holds_is_lost_and_lines_join() {
    let mut line = PacedLine::new(controller(&[]), LineTiming::default());
    settle(&mut line, T0);
    // 15 blocks fill the planner, one more waits, 128 bytes are in the buffer.
    let program: String = (1..=60).map(|x| format!("G1X{:03}F60\n", x % 100)).collect();
    line.receive(T0, program.as_bytes());
    let (answers, _) = settle(&mut line, T0);
    let bytes = 60 * 10 - (16 * 10 + 128);
    assert_eq!(line.device().overrun_bytes(), bytes);
    assert_eq!(answers.matches("ok/").count(), 16 + 12);
}

#[test]
fn the_outcome_does_not_depend_on_how_often_the_line_is_polled() {
    let program = b"G1X10F600\nG1Y10\n?G2X0I-5\nG4P0.2\n!~?M8\n$G\n";
    let run = |slice: Duration| {
        let mut line = PacedLine::new(controller(&[]), LineTiming::default());
        line.receive(T0, program);
        let mut bytes = Vec::new();
        let mut now = T0;
        while now < Duration::from_secs(30) {
            now += slice;
            line.advance(now);
            line.transmit(now, &mut bytes);
        }
        (String::from_utf8(bytes).unwrap(), line.device().position())
    };
    assert_eq!(run(Duration::from_millis(1)), run(Duration::from_secs(7)));
}

#[test]
fn report_requests_that_find_no_room_are_answered_once() {
    let mut line = PacedLine::new(controller(&[]), LineTiming::default());
    settle(&mut line, T0);
    line.receive(Duration::from_secs(1), &[b'?'; 2000]);
    let (reports, at) = settle(&mut line, Duration::from_secs(1));
    let count = reports.matches('>').count();
    // 2000 bytes take 174 ms to come in; a report takes 3.3 ms to go out.
    assert!((48..60).contains(&count), "{count} reports");
    assert!(at < Duration::from_millis(1210), "{at:?}");
}

/// Everything that a device sends now.
fn received(device: &mut FaultInjector) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut before = usize::MAX;
    while before != bytes.len() {
        before = bytes.len();
        device.transmit(&mut bytes);
    }
    bytes
}

/// Sends lines to a controller with faults, half a second apart.
fn send_lines(mut device: FaultInjector, lines: &[&str]) -> String {
    received(&mut device);
    let mut bytes = Vec::new();
    for (index, line) in lines.iter().enumerate() {
        let now = Duration::from_millis(500 * index as u64);
        device.receive(now, format!("{line}\n").as_bytes());
        bytes.extend(received(&mut device));
    }
    device.advance(Duration::from_millis(500 * lines.len() as u64));
    bytes.extend(received(&mut device));
    String::from_utf8_lossy(&bytes).replace("\r\n", "/")
}

#[test]
fn each_fault_does_what_its_name_says() {
    let lines = ["G21", "G41", "G90", "M8"];
    let cases: &[(&[&str], &str)] = &[
        (&[], "ok/error:20/ok/ok/"),
        (&["lose-ok@line=3"], "ok/error:20/ok/"),
        (&["lose-ok@line=2"], "ok/ok/ok/"),
        (&["extra-ok@line=1"], "ok/ok/error:20/ok/ok/"),
        (&["extra-ok@time=0.7"], "ok/error:20/ok/ok/ok/"),
        // `G21` and newline are bytes 1 to 4, so the 8th ends `G41`.
        (&["rx-drop@byte=8"], "ok/error:20/ok/"),
        (&["rx-drop@byte=1"], "error:1/error:20/ok/ok/"),
        (&["rx-duplicate@byte=4"], "ok/ok/error:20/ok/ok/"),
        (&["silent@line=2"], "ok/error:20/"),
        (&["silent:0.6@line=2"], "ok/error:20/ok/"),
        (&["reset@line=2"], "ok/error:20//Grbl 1.1h ['$' for help]/ok/ok/"),
        (&["reset@time=1.2"], "ok/error:20/ok//Grbl 1.1h ['$' for help]/ok/"),
        (&["door@line=3"], "ok/error:20/ok/[MSG:Check Door]/"),
        (&["door@line=3", "close-door@time=1.2"], "ok/error:20/ok/[MSG:Check Door]/"),
        (&["limit:x@line=1"], "ok/error:20/ok/ok/"),
        (&["push:[MSG:Spindle hot]@line=2"], "ok/error:20/[MSG:Spindle hot]/ok/ok/"),
        (&["alarm:1@line=2"], "ok/error:20/ALARM:1/[MSG:Reset to continue]/"),
        (&["alarm:5@line=2"], "ok/error:20/ALARM:5/error:9/error:9/"),
        (
            &["alarm:9@line=3"],
            "ok/error:20/ok/ALARM:9//Grbl 1.1h ['$' for help]/[MSG:'$H'|'$X' to unlock]/error:9/",
        ),
        // The answer is in transit; the device is back in time for the last line.
        (&["vanish:0.6@line=2"], "ok/ok/"),
        (&["unplug:0.6@line=2"], "ok//Grbl 1.1h ['$' for help]/ok/"),
        (&["close@line=3"], "ok/error:20/"),
    ];
    for (faults, expected) in cases {
        assert_eq!(send_lines(injector(faults, 1), &lines), *expected, "{faults:?}");
    }
}

/// Seconds at which each of the answers to 20 empty lines, sent at once at t = 0, has arrived.
fn answer_times(fault: &str, timing: LineTiming) -> Vec<f64> {
    let mut line = PacedLine::new(injector(&[fault], 1), timing);
    // The banner, 28 bytes.
    settle(&mut line, T0);
    let start = Duration::from_secs(1);
    let mut now = start;
    line.receive(now, &[b'\n'; 20]);
    let mut times = Vec::new();
    let mut bytes = Vec::new();
    while let Some(event) = line.next_event() {
        now = now.max(event);
        line.advance(now);
        line.transmit(now, &mut bytes);
        let lines = bytes.iter().filter(|byte| **byte == b'\n').count();
        times.resize(lines.max(times.len()), (now - start).as_secs_f64());
    }
    assert_eq!(bytes, b"ok\r\n".repeat(20));
    times
}

#[test]
fn a_stalled_line_continues_in_order_and_at_its_rate() {
    // 10 ms a byte.
    let timing = LineTiming { baud: Some(1000), time_factor: 1.0, scales_bytes: false };
    let check = |fault: &str, expected: [f64; 3]| {
        let times = answer_times(fault, timing);
        for (at, expected) in [(0, expected[0]), (9, expected[1]), (19, expected[2])] {
            assert!(
                (times[at] - expected).abs() < 1e-6,
                "{fault}: {} s, not {expected} s",
                times[at]
            );
        }
    };
    // An answer takes 40 ms, a line 10 ms: answers queue up.
    check("rx-delay:0@byte=1", [0.05, 0.41, 0.81]);
    // The line stalls after the 5th byte; the waiting answers fill the gap.
    check("rx-delay:0.1@byte=5", [0.05, 0.41, 0.81]);
    check("rx-delay:2@byte=5", [0.05, 2.26, 2.66]);
    // From the 9th answer on, and in the middle of it.
    check("tx-delay:3@line=9", [0.05, 3.41, 3.81]);
    check("tx-delay:3@byte=62", [0.05, 3.41, 3.81]);
    check("tx-delay:3@line=20", [0.05, 0.41, 0.81]);
}

#[test]
fn a_stall_lasts_as_long_as_the_machine_says() {
    let timing = LineTiming { baud: None, time_factor: 10.0, scales_bytes: false };
    let times = answer_times("tx-delay:5@line=1", timing);
    assert!(times[0] < 1e-6 && (times[1] - 0.5).abs() < 1e-6, "{times:?}");
}

/// Position and report after a fault in the middle of 100 mm at 10 mm/s.
fn after(fault: &str) -> (f64, String) {
    let mut device = injector(&[fault], 1);
    device.receive(T0, b"G1X100F600\n");
    received(&mut device);
    device.advance(Duration::from_secs(8));
    let away = (device.is_plugged(), received(&mut device));
    assert_eq!(away, (false, Vec::new()), "{fault}");
    device.receive(Duration::from_secs(8), b"G91\n?\x18");
    assert!(received(&mut device).is_empty(), "{fault}: no bytes arrive");
    device.advance(Duration::from_secs(20));
    assert!(device.is_plugged() && device.pulls() == 1, "{fault}");
    received(&mut device);
    device.receive(Duration::from_secs(20), b"?");
    let report = String::from_utf8(received(&mut device)).unwrap();
    (device.controller().position()[0], report)
}

#[test]
fn a_cable_that_is_pulled_leaves_the_machine_moving_and_one_with_the_supply_does_not() {
    let (x, report) = after("vanish:10@time=5");
    assert!((x - 100.0).abs() < 1e-6 && report.starts_with("<Idle|MPos:100.000"), "{report}");
    let (x, report) = after("unplug:10@time=5");
    assert!(x.abs() < 1e-6 && report.starts_with("<Idle|MPos:0.000"), "{report}");
}

#[test]
fn startup_lines_run_when_the_supply_is_back_and_not_before() {
    let mut device = injector(&["unplug:10@time=5"], 1);
    device.receive(T0, b"$N0=G91G1X10F600\n");
    device.advance(Duration::from_secs(14));
    let x = device.controller().position()[0];
    assert!(x.abs() < 1e-6, "{x}");
    device.advance(Duration::from_secs(20));
    let x = device.controller().position()[0];
    assert!((x - 10.0).abs() < 1e-6, "{x}");
}

#[test]
fn a_tripped_limit_is_an_alarm_when_hard_limits_are_on() {
    let build = Build::new(settings(&["$21=1"]));
    let faults = vec!["limit:y@line=2".parse().unwrap()];
    let device = FaultInjector::new(Controller::with_build(build), faults, 1);
    assert_eq!(
        send_lines(device, &["G21", "G90", "G91"]),
        "ok/ok/ALARM:1/[MSG:Reset to continue]/"
    );
}

#[test]
fn a_corrupted_byte_differs_in_one_bit() {
    let mut device = injector(&["tx-corrupt@byte=29"], 7);
    device.receive(T0, b"\n");
    let bytes = received(&mut device);
    let answer = &bytes[28..];
    let wrong: u32 = answer.iter().zip(b"ok\r\n").map(|(a, b)| (a ^ b).count_ones()).sum();
    assert_eq!((answer.len(), wrong), (4, 1), "{answer:?}");
}

#[test]
fn a_pulled_cable_is_seen() {
    let mut device = injector(&["close@line=2"], 1);
    device.receive(T0, b"\n");
    received(&mut device);
    assert!(!device.is_closed());
    device.receive(T0, b"\n");
    received(&mut device);
    assert!(device.is_closed());
}

#[test]
fn faults_by_command_strike_at_once_or_at_the_next_chance() {
    let mut device = injector(&[], 1);
    received(&mut device);
    device.inject(T0, FaultAction::LoseOk);
    device.receive(T0, b"\n\n");
    device.inject(T0, FaultAction::ExtraOk);
    assert_eq!(received(&mut device), b"ok\r\nok\r\n");
}

#[test]
fn the_same_seed_gives_the_same_faults() {
    let lines: Vec<String> = (0..50).map(|x| format!("G0X{x}")).collect();
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    let run =
        |seed| send_lines(injector(&["rx-corrupt@rate=0.02", "lose-ok@rate=0.1"], seed), &lines);
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Whatever arrives, the controller neither panics nor hangs.
    #[test]
    fn any_bytes_are_survived(
        bytes in prop::collection::vec(prop_oneof![
            3 => prop::sample::select(b"GMXYZIJKRFSTNPL$=.-0123456789?!~\n\n ()".to_vec()),
            1 => any::<u8>(),
        ], 0..400),
        firmware in prop::sample::select(Firmware::ALL.to_vec()),
        settings_lines in prop::sample::subsequence(vec![
            "$22=1", "$21=1", "$13=1", "$10=2", "$32=1", "$41=1", "$62=1", "$39=0", "$341=4",
        ], 0..=9),
    ) {
        let mut settings = settings_of(firmware, &[]);
        for line in settings_lines {
            // Some are grblHAL's alone.
            let _ = settings.set_line(line);
        }
        let build = Build {
            probe_surface_z_mm: Some(-5.0),
            has_mist: true,
            echoes_lines: false,
            has_line_numbers: true,
            ..Build::new(settings)
        };
        let mut device = FaultInjector::new(Controller::with_build(build), Vec::new(), 1);
        let mut now = T0;
        for chunk in bytes.chunks(7) {
            device.receive(now, chunk);
            now += Duration::from_millis(137);
        }
        let mut sink = Vec::new();
        for _ in 0..2000 {
            device.transmit(&mut sink);
            let Some(event) = device.next_event(now) else { break };
            prop_assert!(event >= now);
            now = event;
            device.advance(now);
        }
        // A board that is starting does not receive.
        now += Duration::from_secs(1);
        // A reset and an unlock bring it back from every state.
        device.receive(now, b"\x18");
        device.receive(now, b"$X\n");
        received(&mut device);
        device.receive(now, b"?");
        let text = String::from_utf8(received(&mut device)).unwrap();
        let last = text.lines().last().unwrap_or_default();
        prop_assert!(last.starts_with("<Idle") || last.starts_with("<Run"), "{last}");
    }
}
