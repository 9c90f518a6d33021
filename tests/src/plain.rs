//! A plain character counter, as senders of G-code are written: the peer of the driver.
//!
//! It sends as many lines as the receive buffer holds, takes each answer for the oldest
//! line, asks for status five times a second, and knows nothing else.

use std::collections::VecDeque;
use std::time::Duration;
use virtual_controller::{FaultInjector, PacedLine};

/// Between two status requests.
const POLL: Duration = Duration::from_millis(200);
/// The longest that a program takes, machine time.
const TIMEOUT: Duration = Duration::from_secs(6 * 3_600);

/// Sends lines and waits for the last answer; when each line was written.
///
/// # Panics
/// When the controller refuses a line or never answers.
pub fn count_characters(
    controller: &mut PacedLine<FaultInjector>,
    start: Duration,
    lines: &[String],
    buffer_bytes: usize,
) -> Vec<Duration> {
    let (mut now, mut poll_at) = (start, start + POLL);
    let (mut sent, mut under_way) = (Vec::new(), VecDeque::new());
    let mut unread = Vec::new();
    loop {
        while let Some(line) = lines.get(sent.len())
            && under_way.iter().sum::<usize>() + line.len() < buffer_bytes
        {
            controller.receive(now, format!("{line}\n").as_bytes());
            under_way.push_back(line.len() + 1);
            sent.push(now);
        }
        if sent.len() == lines.len() && under_way.is_empty() {
            return sent;
        }
        assert!(now < start + TIMEOUT, "no answer to {:?}", lines.get(sent.len()));
        let event = controller.next_event().unwrap_or(poll_at);
        now = now.max(event.min(poll_at)) + Duration::from_nanos(1);
        controller.advance(now);
        if now >= poll_at {
            controller.receive(now, b"?");
            poll_at = now + POLL;
        }
        controller.transmit(now, &mut unread);
        while let Some(end) = unread.iter().position(|byte| *byte == b'\n') {
            let answer: Vec<u8> = unread.drain(..=end).collect();
            assert!(!answer.starts_with(b"error"), "{}", answer.escape_ascii());
            if answer == b"ok\r\n" {
                under_way.pop_front();
            }
        }
    }
}

/// A controller that is switched on and has said its banner, and the time then.
pub fn switched_on(build: virtual_controller::Build) -> (PacedLine<FaultInjector>, Duration) {
    let device = FaultInjector::new(virtual_controller::Controller::with_build(build), vec![], 1);
    let timing = virtual_controller::LineTiming { baud: Some(115_200), ..Default::default() };
    let mut controller = PacedLine::new(device, timing);
    let now = Duration::from_secs(3);
    controller.advance(now);
    controller.transmit(now, &mut Vec::new());
    (controller, now)
}
