//! What reports say of the receive buffer, compared with what was sent.

use super::*;

/// A link that knows the size of the buffer: the controller reports it, and two reports at rest
/// agree with it.
fn sized(free: u16) -> Link<u32> {
    let mut link = started();
    link.set_receive_bytes(Some(128));
    for now in [200, 400, 600, 800] {
        assert_eq!(report(&mut link, now, "Idle", free), []);
    }
    link
}

/// Asks for a report and gets this; gives the faults.
fn report(link: &mut Link<u32>, now: u64, state: &str, free: u16) -> Vec<LinkFault> {
    link.handle_time(ms(now));
    assert!(link.poll_transmit().is_some_and(|bytes| bytes.starts_with(b"?")), "at {now}");
    say(link, now, state, free)
}

fn say(link: &mut Link<u32>, now: u64, state: &str, free: u16) -> Vec<LinkFault> {
    let text = format!("<{state}|MPos:0.000,0.000,0.000|Bf:15,{free}|FS:0,0>\r\n");
    link.receive(ms(now + 5), text.as_bytes());
    faults(link)
}

/// Lines of 20 bytes.
fn send(link: &mut Link<u32>, lines: usize) {
    for _ in 0..lines {
        link.send_line(&"X".repeat(19), LineKind::Motion, 0);
    }
}

fn send_now(link: &mut Link<u32>, lines: usize) {
    send(link, lines);
    link.poll_transmit();
}

#[test]
fn an_answer_that_came_twice_shows_as_more_bytes_held_than_sent() {
    let mut link = started();
    let report = b"<Run|MPos:0.000,0.000,0.000|Bf:0,28|FS:0,0>\r\n";
    link.send_line(&"X".repeat(99), LineKind::Motion, 1);
    link.receive(ms(1), report);
    link.receive(ms(2), b"ok\r\n");
    link.receive(ms(200), report);
    assert_eq!(faults(&mut link), []);
    link.receive(ms(400), report);
    link.receive(ms(600), report);
    assert!(matches!(faults(&mut link)[..], [LinkFault::Overfilled { held: 100, .. }, ..]));
}

#[test]
fn an_answer_that_was_lost_shows_as_fewer_bytes_held_than_sent() {
    let mut link = sized(128);
    send_now(&mut link, 5);
    // One line is being worked on, the next three are held, and one was answered unheard.
    for now in [1000, 1200] {
        assert_eq!(report(&mut link, now, "Run", 128 - 60), []);
    }
    let fault = LinkFault::Underfilled { held: 60, sent: 80 };
    assert_eq!(report(&mut link, 1400, "Run", 128 - 60), [fault]);
}

#[test]
fn the_line_that_is_worked_on_is_not_held_and_not_lost() {
    let mut link = sized(128);
    send_now(&mut link, 5);
    for now in (1000..6400).step_by(200) {
        let held = 80 + if now % 400 == 0 { 20 } else { 0 };
        assert_eq!(report(&mut link, now, "Run", 128 - held), []);
    }
}

#[test]
fn what_was_sent_after_the_request_need_not_have_arrived() {
    let mut link = sized(128);
    for now in (1000..6400).step_by(200) {
        link.handle_time(ms(now));
        send(&mut link, 3);
        assert!(link.poll_transmit().unwrap().starts_with(b"?XX"));
        send_now(&mut link, 2);
        assert_eq!(say(&mut link, now, "Run", 128), []);
        (0..5).for_each(|_| link.receive(ms(now + 9), b"ok\r\n"));
    }
}

/// On a slow line each request waits after lines for longer than the next one is away,
/// so that each report answers the request before the last.
#[test]
fn a_report_answers_the_oldest_request_that_has_none() {
    let mut link = sized(128);
    link.handle_time(ms(1000));
    link.poll_transmit();
    for now in (1200..9400).step_by(200) {
        send_now(&mut link, 5);
        assert_eq!(report(&mut link, now, "Run", 128), []);
        (0..5).for_each(|_| link.receive(ms(now + 9), b"ok\r\n"));
    }
}

#[test]
fn a_request_that_was_lost_leaves_one_that_proves_less() {
    let mut link = sized(128);
    send_now(&mut link, 5);
    // Without a report.
    link.handle_time(ms(1000));
    link.poll_transmit();
    let report_at = |link: &mut Link<u32>, now| report(link, now, "Run", 128 - 60);
    assert_eq!(report_at(&mut link, 1200), []);
    assert_eq!(report_at(&mut link, 1400), []);
    let fault = LinkFault::Underfilled { held: 60, sent: 80 };
    assert_eq!(report_at(&mut link, 1600), [fault]);
}

#[test]
fn requests_without_reports_are_forgotten_when_nothing_is_under_way() {
    let mut link = sized(128);
    send_now(&mut link, 1);
    for now in [1000, 1200, 1400, 1600, 1800] {
        link.handle_time(ms(now));
        link.poll_transmit();
    }
    link.receive(ms(1900), b"ok\r\n");
    events(&mut link);
    for now in [2000, 2200, 2400, 2600] {
        assert_eq!(report(&mut link, now, "Idle", 128), []);
    }
    send_now(&mut link, 5);
    for now in [2800, 3000] {
        assert_eq!(report(&mut link, now, "Run", 128 - 60), []);
    }
    assert_eq!(report(&mut link, 3200, "Run", 128 - 60).len(), 1);
}

/// A report of 100 bytes takes 104 ms there, and the next request comes after 200.
#[test]
fn a_slow_line_never_shows_which_request_a_report_answers() {
    let mut link = sized(128);
    link.config.baud = 9600;
    link.receive(ms(900), b"Grbl 1.1h ['$' for help]\r\n");
    for now in (1100..3000).step_by(200) {
        assert_eq!(report(&mut link, now, "Idle", 128), []);
    }
    send_now(&mut link, 5);
    for now in (3100..5000).step_by(200) {
        assert_eq!(report(&mut link, now, "Run", 128 - 60), []);
    }
}

#[test]
fn reports_are_compared_with_requests_only_where_that_says_something() {
    // FluidNC reports no size and reads ahead.
    let mut reading_ahead = started();
    reading_ahead.set_receive_bytes(None);
    for now in [200, 400, 600, 800] {
        assert_eq!(report(&mut reading_ahead, now, "Idle", 256), []);
    }
    // grblHAL puts its buffer aside while a tool is changed.
    let changing = sized(128);
    for (mut link, state, free) in [(reading_ahead, "Run", 256), (changing, "Tool", 128)] {
        send_now(&mut link, 5);
        for now in (1000..4400).step_by(200) {
            assert_eq!(report(&mut link, now, state, free), []);
        }
    }
    // Automatic reports, which come between request and report.
    let mut link = sized(128);
    send_now(&mut link, 5);
    for now in (1000..4400).step_by(200) {
        assert_eq!(report(&mut link, now, "Run", 128), []);
        assert_eq!(say(&mut link, now + 50, "Run", 128 - 80), []);
    }
}

#[test]
fn the_window_is_never_more_than_what_was_free_at_rest() {
    let config = LinkConfig { hold_latency_ms_max: 1000, ..CONFIG };
    let mut link: Link<u32> = Link::new(config, ms(0));
    link.receive(ms(0), b"Grbl 1.1h ['$' for help]\r\n");
    events(&mut link);
    link.set_receive_bytes(Some(1024));
    assert_eq!(link.window(), 1023);
    // Once may be a digit that was lost on the way.
    for (now, free, window) in [(200, 100, 1023), (400, 1000, 1023), (600, 1000, 1000)] {
        assert_eq!(report(&mut link, now, "Idle", free), []);
        assert_eq!(link.window(), window, "at {now}");
    }
    // A buffer that is bigger than reported is not used.
    for now in [800, 1000] {
        assert_eq!(report(&mut link, now, "Idle", 1300), []);
    }
    assert_eq!(link.window(), 1023);
    // A restart makes it no larger; another build may.
    link.receive(ms(1100), b"Grbl 1.1h ['$' for help]\r\n");
    for now in [1400, 1600] {
        assert_eq!(report(&mut link, now, "Idle", 1010), []);
    }
    assert_eq!(link.window(), 1023);
    link.set_receive_bytes(Some(512));
    assert_eq!(link.window(), 511);
}

#[test]
fn a_buffer_that_holds_what_was_never_sent_is_no_buffer_at_rest() {
    let mut link = sized(128);
    send_now(&mut link, 1);
    link.receive(ms(410), b"ok\r\n");
    events(&mut link);
    for now in [1000, 1200] {
        assert_eq!(report(&mut link, now, "Run", 100), []);
    }
    assert_eq!(link.window(), 127);
    let fault = LinkFault::Overfilled { held: 28, sent: 0 };
    assert_eq!(report(&mut link, 1400, "Run", 100), [fault]);
}

#[test]
fn an_answer_before_its_line_was_written_is_no_trouble() {
    let mut link = sized(128);
    send(&mut link, 2);
    link.receive(ms(500), b"ok\r\nok\r\n");
    link.handle_time(ms(1000));
    assert_eq!(link.poll_transmit().map(|bytes| bytes.len()), Some(41));
}
