//! The link against scripted bytes and a clock in the test's hand.

mod buffers;

use super::*;
use crate::report::ControllerState;
use proptest::prelude::*;

const CONFIG: LinkConfig = LinkConfig {
    baud: 115_200,
    hold_latency_ms_max: 20,
    receive_buffer_bytes: None,
    poll_interval_ms: 200,
    busy_poll_interval_ms: 0,
    line_check_interval_ms: 0,
    watches_path: false,
};

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// A link that has seen a banner and no status request yet.
fn started() -> Link<u32> {
    let mut link = Link::new(CONFIG, ms(0));
    link.receive(ms(0), b"\r\nGrbl 1.1h ['$' for help]\r\n");
    assert!(matches!(link.poll_event(), Some(LinkEvent::Banner { .. })));
    link
}

fn events(link: &mut Link<u32>) -> Vec<LinkEvent<u32>> {
    std::iter::from_fn(|| link.poll_event()).collect()
}

fn faults(link: &mut Link<u32>) -> Vec<LinkFault> {
    let fault = |event| match event {
        LinkEvent::Fault(fault) => Some(fault),
        _ => None,
    };
    events(link).into_iter().filter_map(fault).collect()
}

#[test]
fn lines_are_answered_in_the_order_they_were_sent() {
    let mut link = started();
    link.send_line("G1X1", LineKind::Motion, 1);
    link.send_line("G41", LineKind::Motion, 2);
    assert_eq!(link.poll_transmit(), Some(b"G1X1\nG41\n".to_vec()));
    assert_eq!((link.unanswered(), link.unanswered_bytes()), (2, 9));
    link.receive(ms(5), b"ok\r\nerr");
    link.receive(ms(6), b"or:20\r\n");
    assert_eq!(
        events(&mut link),
        [LinkEvent::Answer { tag: 1, error: None }, LinkEvent::Answer { tag: 2, error: Some(20) }]
    );
    assert_eq!((link.unanswered(), link.unanswered_bytes()), (0, 0));
}

#[test]
fn a_line_that_the_controller_has_read_otherwise_is_a_fault() {
    let read_otherwise = |sent: &str, read: &str| {
        [LinkFault::ReadOtherwise { sent: sent.into(), read: read.into() }]
    };
    let mut link = started();
    for text in ["G1 X1.5", "G1X2", "$J=G91X1F100"] {
        link.send_line(text, LineKind::Motion, 0);
    }
    link.receive(ms(5), b"[echo: G1X1.5]\r\nok\r\n[echo: g1 x2]\r\nok\r\n");
    assert_eq!(faults(&mut link), []);
    link.receive(ms(6), b"[echo: $J=G91X7F100]\r\n");
    assert_eq!(faults(&mut link), read_otherwise("$J=G91X1F100", "$J=G91X7F100"));
    link.receive(ms(7), b"ok\r\n[echo: ]\r\n");
    assert_eq!(faults(&mut link), [], "nothing is under way: the answer says more");
    // A line that was lost on its way: the one after it comes in its place.
    link.send_line("G1X3", LineKind::Motion, 0);
    link.send_line("G1X4", LineKind::Motion, 0);
    link.receive(ms(8), b"[echo: G1X4]\r\n");
    assert_eq!(faults(&mut link), read_otherwise("G1X3", "G1X4"));
    // A tool change runs the lines of its macro before its answer.
    link.receive(ms(8), b"ok\r\n[echo: G1X4]\r\nok\r\n");
    link.send_line("N7M6T2", LineKind::Slow, 0);
    link.receive(ms(8), b"[echo: N7M6T2]\r\n[echo: G53G0Z0]\r\n[echo: G4P1]\r\n");
    assert_eq!(faults(&mut link), []);
    link.receive(ms(8), b"ok\r\n");
    link.send_line("N8M6T2", LineKind::Slow, 0);
    link.receive(ms(8), b"[echo: N8M6T3]\r\n");
    assert_eq!(faults(&mut link), read_otherwise("N8M6T2", "N8M6T3"));
    // After an alarm nobody knows which line it is.
    link.receive(ms(9), b"ALARM:1\r\n[echo: G1X9]\r\n");
    assert_eq!(faults(&mut link), []);
}

#[test]
fn the_window_is_the_receive_buffer_less_one_or_the_latency() {
    let mut link: Link<u32> = Link::new(CONFIG, ms(0));
    assert_eq!(link.window(), 127);
    link.set_receive_bytes(Some(1024));
    assert_eq!(link.window(), 230);
    link.set_receive_bytes(Some(254));
    assert_eq!(link.window(), 230);
    let slow: Link<u32> = Link::new(LinkConfig { baud: 9600, ..CONFIG }, ms(0));
    assert_eq!(slow.window(), 19);
}

#[test]
fn a_configured_buffer_is_never_more_than_the_controller_reports() {
    let latency = LinkConfig { hold_latency_ms_max: 1000, ..CONFIG };
    for (configured, reported, window) in [
        (None, None, 127),
        // FluidNC, as its owner knows it.
        (Some(256), None, 255),
        (Some(64), Some(1024), 63),
        (Some(1024), Some(254), 253),
        (None, Some(254), 253),
        // No buffer is so small.
        (None, Some(0), 127),
        (None, Some(1), 127),
    ] {
        let config = LinkConfig { receive_buffer_bytes: configured, ..latency };
        let mut link: Link<u32> = Link::new(config, ms(0));
        link.set_receive_bytes(reported);
        assert_eq!(link.window(), window, "{configured:?} {reported:?}");
    }
}

#[test]
fn a_line_longer_than_the_window_goes_alone() {
    let mut link: Link<u32> = Link::new(LinkConfig { baud: 9600, ..CONFIG }, ms(0));
    assert!(link.has_room(60));
    link.send_line(&"X".repeat(60), LineKind::Motion, 1);
    assert!(!link.has_room(1));
}

#[test]
fn realtime_bytes_go_first_and_are_not_counted() {
    let mut link = started();
    link.send_line("G1X1", LineKind::Motion, 1);
    link.send_realtime(realtime::FEED_HOLD);
    assert_eq!(link.poll_transmit(), Some(b"!G1X1\n".to_vec()));
    assert_eq!(link.unanswered_bytes(), 5);
}

#[test]
fn an_answer_to_nothing_is_a_fault_but_not_between_alarm_and_banner() {
    let mut link = started();
    link.receive(ms(1), b"ok\r\n");
    assert_eq!(faults(&mut link), [LinkFault::UnexpectedAnswer]);
    link.receive(ms(2), b"ALARM:3\r\nok\r\n\r\nGrbl 1.1h ['$' for help]\r\n");
    assert_eq!(faults(&mut link), []);
    link.receive(ms(3), b"ok\r\n");
    assert_eq!(faults(&mut link), [LinkFault::UnexpectedAnswer]);
}

#[test]
fn a_reset_forgets_lines_that_were_not_even_written() {
    let mut link = started();
    link.send_line("G1X1", LineKind::Motion, 1);
    link.send_reset(ms(10));
    assert_eq!(link.poll_transmit(), Some(vec![0x18]));
    assert_eq!((link.unanswered(), link.unanswered_bytes()), (0, 0));
    link.receive(ms(11), b"ok\r\n");
    assert_eq!(events(&mut link), []);
}

#[test]
fn a_banner_nobody_asked_for_empties_the_count() {
    let mut link = started();
    link.send_line("G1X1", LineKind::Motion, 1);
    link.receive(ms(1), b"Grbl 1.1h ['$' for help]\r\n");
    assert!(matches!(events(&mut link)[..], [LinkEvent::Banner { .. }]));
    assert_eq!(link.unanswered(), 0);
}

#[test]
fn damage_is_a_fault_and_other_text_is_not() {
    for (bytes, is_fault) in [
        (&b"o\r\n"[..], true),
        (b"okok\r\n", true),
        (b"<Idle|MPos:0.0\r\n", true),
        (b"\xff\xfe\r\n", true),
        (b"[MSG:Pgm End]\r\n", false),
        (b"hello\r\n", false),
        (b"\r\n", false),
    ] {
        let mut link = started();
        link.receive(ms(1), bytes);
        assert_eq!(!faults(&mut link).is_empty(), is_fault, "{bytes:?}");
    }
}

#[test]
fn a_line_end_in_the_middle_of_an_answer_is_damage_and_flow_control_is_none() {
    let mut link = started();
    link.send_line("G1X1", LineKind::Motion, 1);
    link.receive(ms(1), b"o\rk\r\n");
    assert!(matches!(faults(&mut link)[..], [LinkFault::Damaged { .. }]));
    link.receive(ms(2), b"\x13\x11ok\r\n\x11");
    assert_eq!(events(&mut link), [LinkEvent::Answer { tag: 1, error: None }]);
}

#[test]
fn garbage_without_a_line_end_is_seen_and_not_hoarded() {
    let mut link = started();
    link.receive(ms(1), &[b'U'; 5000]);
    assert_eq!(events(&mut link).len(), 4);
}

#[test]
fn status_is_asked_for_five_times_a_second_with_one_request_under_way() {
    let mut link: Link<u32> = Link::new(CONFIG, ms(0));
    let mut asked = 0;
    for now in (0..1000).step_by(10) {
        link.handle_time(ms(now));
        if let Some(bytes) = link.poll_transmit() {
            assert_eq!(bytes, b"?");
            asked += 1;
            link.receive(ms(now + 9), b"<Idle|MPos:0.000,0.000,0.000|FS:0,0>\r\n");
        }
    }
    assert_eq!(asked, 5);
}

#[test]
fn three_requests_without_an_answer_are_silence_said_once() {
    let mut link = started();
    let mut silent_at = Vec::new();
    for now in (0..5000).step_by(10) {
        link.handle_time(ms(now));
        if events(&mut link).contains(&LinkEvent::Silent) {
            silent_at.push(now);
        }
    }
    assert_eq!(silent_at, [800]);
}

#[test]
fn whoever_answers_lines_is_not_silent() {
    let mut link = started();
    for now in (0..3000).step_by(10) {
        link.handle_time(ms(now));
        if now % 300 == 0 {
            link.send_line("X1", LineKind::Motion, 1);
            link.receive(ms(now), b"ok\r\n");
        }
        assert!(!events(&mut link).contains(&LinkEvent::Silent), "at {now}");
    }
}

#[test]
fn silence_while_homing_or_deaf_is_expected() {
    let mut link = started();
    link.send_line("$H", LineKind::Silent, 1);
    (0..3000).step_by(10).for_each(|now| link.handle_time(ms(now)));
    assert!(!events(&mut link).contains(&LinkEvent::Silent));
    let mut link = started();
    link.expect_deafness();
    (0..3000).step_by(10).for_each(|now| link.handle_time(ms(now)));
    assert!(!events(&mut link).contains(&LinkEvent::Silent));
}

#[test]
fn silence_while_a_thread_waits_for_its_spindle_is_expected_and_no_longer() {
    let kind = LineKind::Thread { milliseconds: 3_000 };
    // The wait begins with the line, or after a hold of a minute.
    for held_until in [0, 60_000] {
        let mut link = started();
        link.send_line("G33Z-5K1", kind, 1);
        link.send_line("G4P0", kind, 2);
        link.receive(ms(0), b"ok\r\n");
        assert!(link.is_threading());
        let mut silent_at = Vec::new();
        for now in (0..held_until + 8_000).step_by(10) {
            link.handle_time(ms(now));
            if now < held_until && now % 100 == 0 {
                link.receive(ms(now), b"<Hold:0|MPos:0.000,0.000,0.000|FS:0,0>\r\n");
            }
            if events(&mut link).contains(&LinkEvent::Silent) {
                silent_at.push(now);
            }
        }
        let [at] = silent_at[..] else { panic!("{held_until}: {silent_at:?}") };
        assert!((held_until + 3_000..held_until + 4_000).contains(&at), "{held_until}: {at}");
    }
}

#[test]
fn a_lost_answer_shows_when_the_machine_stays_idle() {
    let mut link = started();
    link.send_line("G1X1", LineKind::Motion, 1);
    let report = b"<Idle|MPos:0.000,0.000,0.000|FS:0,0>\r\n";
    for now in [200, 400, 600] {
        link.receive(ms(now), report);
        assert_eq!(faults(&mut link), [], "at {now}");
    }
    link.receive(ms(800), report);
    assert_eq!(faults(&mut link), [LinkFault::LostAnswer { lines: 1 }]);
}

#[test]
fn a_dwell_is_idle_without_an_answer_and_no_fault() {
    let mut link = started();
    link.send_line("G4P10", LineKind::Dwell { milliseconds: 10_000 }, 1);
    for now in (0..10_000).step_by(200) {
        link.receive(ms(now), b"<Idle|MPos:0.000,0.000,0.000|Bf:15,128|FS:0,0>\r\n");
    }
    assert_eq!(faults(&mut link), []);
}

#[test]
fn reports_reach_the_caller_in_millimetres() {
    let mut link = started();
    link.set_units(ReportUnits::Inches);
    link.receive(ms(1), b"<Idle|MPos:1.0000,0.0000,0.0000|FS:0,0>\r\n");
    let Some(LinkEvent::Status { report, .. }) = link.poll_event() else { panic!() };
    assert_eq!(report.state, ControllerState::Idle);
    assert_eq!(report.machine_position, Some([25.4, 0.0, 0.0]));
}

#[test]
#[should_panic(expected = "not a line")]
fn a_line_can_never_carry_a_realtime_byte() {
    started().send_line("G1X1!", LineKind::Motion, 1);
}

#[test]
fn bytes_that_act_at_once_are_named() {
    let mut link = started();
    let named: Vec<u8> = (0..=u8::MAX).filter(|byte| realtime::is_named(*byte)).collect();
    for &byte in &named {
        link.send_realtime(byte);
    }
    assert_eq!(link.poll_transmit(), Some(named.clone()));
    assert!(named.iter().all(|byte| *byte < 0xc0 && !byte.is_ascii_alphanumeric()));
}

#[test]
#[should_panic(expected = "not a real-time byte: 0x11")]
fn flow_control_is_never_switched_on() {
    started().send_realtime(0x11);
}

#[test]
#[should_panic(expected = "not a real-time byte: 0xc3")]
fn a_pin_event_is_never_sent() {
    started().send_realtime(0xc3);
}

/// A wire of 115 200 Bd with a millisecond of latency each way, a controller that
/// answers as soon as it has read a line, and short lines.
#[test]
fn the_wire_is_never_idle_while_there_is_something_to_send() {
    const STEP: Duration = Duration::from_micros(100);
    const LATENCY: Duration = Duration::from_millis(1);
    const BYTE: Duration = Duration::from_nanos(86_806);
    let mut link = started();
    let mut to_send: VecDeque<u8> = VecDeque::new();
    let mut answers: VecDeque<Duration> = VecDeque::new();
    let (mut wire_free_at, mut wire_back_free_at) = (ms(0), ms(0));
    let (mut now, mut on_the_wire) = (ms(0), 0u32);
    let end = ms(5000);
    while now < end {
        now += STEP;
        while answers.front().is_some_and(|at| *at <= now) {
            answers.pop_front();
            link.receive(now, b"ok\r\n");
        }
        events(&mut link);
        while link.has_room(17) {
            link.send_line("X123.456Y-12.3456", LineKind::Motion, 0);
        }
        to_send.extend(link.poll_transmit().unwrap_or_default());
        while wire_free_at < now {
            let Some(byte) = to_send.pop_front() else {
                wire_free_at = now;
                break;
            };
            wire_free_at += BYTE;
            on_the_wire += 1;
            if byte == b'\n' {
                wire_back_free_at = wire_back_free_at.max(wire_free_at + LATENCY) + BYTE * 4;
                answers.push_back(wire_back_free_at + LATENCY);
            }
        }
    }
    let used = f64::from(on_the_wire) * BYTE.as_secs_f64() / end.as_secs_f64();
    assert!(used > 0.99, "{used}");
}

proptest! {
    /// A controller with a ring of 127 free bytes reads and answers at random times.
    #[test]
    fn the_window_is_never_exceeded_whenever_answers_come(
        lengths in prop::collection::vec(1usize..79, 1..200),
        reads in prop::collection::vec(0usize..4, 1..100),
        receive_bytes in 40u16..300,
    ) {
        let mut link = started();
        link.set_receive_bytes(Some(receive_bytes));
        let window = link.window();
        let mut held: VecDeque<usize> = VecDeque::new();
        let mut lines = lengths.iter().copied().peekable();
        let mut answered = 0;
        for count in reads.iter().cycle().take(4000) {
            while let Some(length) = lines.next_if(|length| link.has_room(*length)) {
                link.send_line(&"X".repeat(length), LineKind::Motion, 0);
            }
            for line in link.poll_transmit().unwrap_or_default().split_inclusive(|b| *b == b'\n') {
                held.push_back(line.len());
            }
            let bytes: usize = held.iter().sum();
            prop_assert!(bytes <= window || held.len() == 1, "{bytes} of {window}");
            prop_assert_eq!(bytes, link.unanswered_bytes());
            for _ in 0..*count {
                if held.pop_front().is_some() {
                    link.receive(ms(0), b"ok\r\n");
                    answered += 1;
                }
            }
        }
        // Answers come now and then: everything got through.
        if reads.iter().sum::<usize>() * 10 >= reads.len() {
            prop_assert_eq!(answered, lengths.len());
        }
        prop_assert!(faults(&mut link).is_empty());
    }

    #[test]
    fn no_bytes_whatever_are_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let mut link = started();
        link.send_line("G1X1", LineKind::Motion, 1);
        link.receive(ms(1), &bytes);
        events(&mut link);
    }
}

#[test]
fn a_dwell_or_a_spindle_that_is_never_answered_is_a_lost_answer_in_the_end() {
    let report = b"<Idle|MPos:0.000,0.000,0.000|FS:0,0>\r\n";
    for (kind, seconds) in [(LineKind::Slow, 60), (LineKind::Dwell { milliseconds: 5_000 }, 65)] {
        let mut link = started();
        link.send_line("M3", kind, 1);
        for now in (0..seconds * 1_000).step_by(200) {
            link.receive(ms(now), report);
        }
        assert_eq!(faults(&mut link), []);
        link.receive(ms(seconds * 1_000), report);
        assert_eq!(faults(&mut link), [LinkFault::LostAnswer { lines: 1 }]);
    }
}

#[test]
fn after_a_check_nothing_is_sent_before_its_turn_where_it_would_end_the_passing_over() {
    for passes_over in [false, true] {
        let mut link = Link::new(LinkConfig { line_check_interval_ms: 200, ..CONFIG }, ms(0));
        link.receive(ms(0), b"\r\nGrblHAL 1.1f ['$' for help]\r\n");
        link.begin_stream(ms(0), passes_over);
        link.send_line("G1X1", LineKind::Motion, 1);
        link.send_line("X2", LineKind::Motion, 2);
        link.check_lines(ms(300));
        assert_eq!(link.poll_transmit(), Some(b"G1X1\nX2\n$G\n".to_vec()));
        assert_eq!(link.has_room(2), !passes_over, "two lines may be refused");
        link.receive(ms(301), b"ok\r\n");
        assert_eq!(link.has_room(2), !passes_over, "one may");
        link.receive(ms(302), b"ok\r\n");
        assert!(link.has_room(2), "the check is read next");
        link.send_line("X3", LineKind::Motion, 3);
        assert!(link.has_room(2));
        assert_eq!(faults(&mut link), []);
    }
}
