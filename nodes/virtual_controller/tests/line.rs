//! Bytes take their time on the line, and faults spoil them on schedule.

mod common;
use common::{settings, settings_of};
use proptest::prelude::*;
use std::time::Duration;
use virtual_controller::{
    Build, Controller, Device, Fault, FaultAction, FaultInjector, Firmware, Pace, PacedLine,
};

fn controller(lines: &[&str]) -> Controller {
    Controller::with_build(Build::new(settings(lines)))
}

fn injector(faults: &[&str], seed: u64) -> FaultInjector {
    let faults = faults.iter().map(|fault| fault.parse::<Fault>().unwrap()).collect();
    FaultInjector::new(controller(&[]), faults, seed)
}

/// Everything heard until nothing is awaited, with the time of the last byte.
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
        Pace { baud: Some(1000), time_factor: 1.0, scales_bytes: false },
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
            Pace { baud: Some(1000), time_factor: 10.0, scales_bytes },
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
    let mut line = PacedLine::new(controller(&[]), Pace::default());
    settle(&mut line, T0);
    // 15 blocks fill the planner, one more waits, 128 bytes lie in the buffer.
    let program: String = (1..=60).map(|x| format!("G1X{:03}F60\n", x % 100)).collect();
    line.receive(T0, program.as_bytes());
    let (answers, _) = settle(&mut line, T0);
    let bytes = 60 * 10 - (16 * 10 + 128);
    assert_eq!(line.device().overrun_bytes(), bytes);
    assert_eq!(answers.matches("ok/").count(), 16 + 12);
}

#[test]
fn the_outcome_does_not_depend_on_how_often_one_looks() {
    let program = b"G1X10F600\nG1Y10\n?G2X0I-5\nG4P0.2\n!~?M8\n$G\n";
    let run = |slice: Duration| {
        let mut line = PacedLine::new(controller(&[]), Pace::default());
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
    let mut line = PacedLine::new(controller(&[]), Pace::default());
    settle(&mut line, T0);
    line.receive(Duration::from_secs(1), &[b'?'; 2000]);
    let (reports, at) = settle(&mut line, Duration::from_secs(1));
    let count = reports.matches('>').count();
    // 2000 bytes take 174 ms to come in; a report takes 3.3 ms to go out.
    assert!((48..60).contains(&count), "{count} reports");
    assert!(at < Duration::from_millis(1210), "{at:?}");
}

/// Everything a device has to say now.
fn hear(device: &mut FaultInjector) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut before = usize::MAX;
    while before != bytes.len() {
        before = bytes.len();
        device.transmit(&mut bytes);
    }
    bytes
}

/// Says lines to a controller in trouble, half a second apart.
fn say(mut device: FaultInjector, lines: &[&str]) -> String {
    hear(&mut device);
    let mut bytes = Vec::new();
    for (index, line) in lines.iter().enumerate() {
        let now = Duration::from_millis(500 * index as u64);
        device.receive(now, format!("{line}\n").as_bytes());
        bytes.extend(hear(&mut device));
    }
    device.advance(Duration::from_millis(500 * lines.len() as u64));
    bytes.extend(hear(&mut device));
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
    ];
    for (faults, expected) in cases {
        assert_eq!(say(injector(faults, 1), &lines), *expected, "{faults:?}");
    }
}

#[test]
fn a_tripped_limit_is_an_alarm_when_hard_limits_are_on() {
    let build = Build::new(settings(&["$21=1"]));
    let faults = vec!["limit:y@line=2".parse().unwrap()];
    let device = FaultInjector::new(Controller::with_build(build), faults, 1);
    assert_eq!(say(device, &["G21", "G90", "G91"]), "ok/ok/ALARM:1/[MSG:Reset to continue]/");
}

#[test]
fn a_corrupted_byte_differs_in_one_bit() {
    let mut device = injector(&["tx-corrupt@byte=29"], 7);
    device.receive(T0, b"\n");
    let bytes = hear(&mut device);
    let answer = &bytes[28..];
    let wrong: u32 = answer.iter().zip(b"ok\r\n").map(|(a, b)| (a ^ b).count_ones()).sum();
    assert_eq!((answer.len(), wrong), (4, 1), "{answer:?}");
}

#[test]
fn a_pulled_cable_is_seen() {
    let mut device = injector(&["close@line=2"], 1);
    device.receive(T0, b"\n");
    hear(&mut device);
    assert!(!device.is_closed());
    device.receive(T0, b"\n");
    hear(&mut device);
    assert!(device.is_closed());
}

#[test]
fn faults_by_command_strike_at_once_or_at_the_next_chance() {
    let mut device = injector(&[], 1);
    hear(&mut device);
    device.inject(T0, FaultAction::LoseOk);
    device.receive(T0, b"\n\n");
    device.inject(T0, FaultAction::ExtraOk);
    assert_eq!(hear(&mut device), b"ok\r\nok\r\n");
}

#[test]
fn the_same_seed_gives_the_same_trouble() {
    let lines: Vec<String> = (0..50).map(|x| format!("G0X{x}")).collect();
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    let run = |seed| say(injector(&["rx-corrupt@rate=0.02", "lose-ok@rate=0.1"], seed), &lines);
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
        settings_lines in prop::sample::subsequence(vec!["$22=1", "$21=1", "$13=1", "$10=2", "$32=1"], 0..=5),
    ) {
        let build = Build {
            probe_surface_z_mm: Some(-5.0),
            has_mist: true,
            has_line_numbers: true,
            ..Build::new(settings_of(firmware, &settings_lines))
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
        // A board that comes up is not listening yet.
        now += Duration::from_secs(1);
        // A reset and an unlock bring it back from anywhere.
        device.receive(now, b"\x18");
        device.receive(now, b"$X\n");
        hear(&mut device);
        device.receive(now, b"?");
        let text = String::from_utf8(hear(&mut device)).unwrap();
        let last = text.lines().last().unwrap_or_default();
        prop_assert!(last.starts_with("<Idle") || last.starts_with("<Run"), "{last}");
    }
}
