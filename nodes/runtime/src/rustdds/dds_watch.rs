//! The watchdog of the DDS layer: whether it still serves this process.
//!
//! Some packets make a thread of RustDDS panic or spin. The process then lives on but receives nothing. So a thread of our own
//! gives each of the two DDS threads some work four times a second, and checks that it waits for
//! more afterwards. The receiver gets a datagram on the participant's own port, the discovery
//! thread a command. This uses no endpoint, so it works the same with security, on any network,
//! with any number of peers.
//! The reports: docs/upstream/rustdds-nack-frag.md, docs/upstream/rustdds-heartbeat-range.md and
//! docs/upstream/rustdds-gap-range.md.
//!
//! Many messages may keep the receiver busy without a break; it serves as long as it takes the
//! datagrams from its socket.
//!
//! A thread that has ended is noticed at the next check; a thread that hangs, after
//! [`FAILED_CHECKS_MAX`] checks. Checks are counted, not seconds: a process that is stopped, or gets
//! no processor time, does not check either.

use crate::process::watchdog::{CHECK_PERIOD, Deafness, EndOfProcess, Watchdog};
use crate::rustdds::dds_threads::{DdsThreads, RECEIVING, ThreadState};
use rustdds::DomainParticipant;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::watch;

/// Checks in a row without progress: five seconds if this thread runs on time.
const FAILED_CHECKS_MAX: u32 = 20;
/// A thread that waited so often between two checks runs its loop. A thread that was woken and
/// got stuck waits at most once.
const WAITS_MIN: u64 = 2;
/// How long the probing thread may take to end, in hundredths of a second.
const PROBE_ENDS_WITHIN: u32 = 50;
/// A datagram of RTPS without content: protocol 2.4, no vendor, no sender. Receivers drop it.
const EMPTY_MESSAGE: [u8; 20] = *b"RTPS\x02\x04\0\0\0\0\0\0\0\0\0\0\0\0\0\0";

/// Starts to watch the threads of a participant; `deaf` gets the reason once, unless the process exits.
///
/// # Errors
/// The system has no thread left.
pub(crate) fn start(
    participant: DomainParticipant,
    domain_id: u16,
    threads: DdsThreads,
    deaf: watch::Sender<Option<Deafness>>,
    end: Option<EndOfProcess>,
) -> std::io::Result<Watchdog> {
    let port = metatraffic_port(domain_id, participant.participant_id());
    let probing = Probing::start(participant, port)?;
    let mut checks = Checks::new(threads.count());
    Watchdog::start("dds-watch", deaf, end, move || {
        let mut seen = threads.states();
        for (name, seen) in &mut seen {
            let is_busy = *name == RECEIVING && matches!(seen, ThreadState::Busy { .. });
            if is_busy && port.is_some_and(|port| is_read(port) == Some(true)) {
                *seen = ThreadState::Idle;
            }
        }
        match checks.take(&seen, probing.count.load(Ordering::Relaxed)) {
            Some(reason) => Err(reason),
            None => {
                probing.request();
                Ok(())
            }
        }
    })
}

/// A thread of its own that gives work to the threads of a participant: it blocks if the DDS layer takes none.
struct Probing {
    requests: Option<SyncSender<()>>,
    /// Requests that the DDS layer has taken.
    count: Arc<AtomicU64>,
    thread: JoinHandle<()>,
}

impl Probing {
    fn start(participant: DomainParticipant, port: Option<u16>) -> std::io::Result<Self> {
        let (requests, requested) = sync_channel(1);
        let count = Arc::new(AtomicU64::new(0));
        let counter = Arc::clone(&count);
        let thread = std::thread::Builder::new()
            .name("dds-probe".into())
            .spawn(move || probe(&participant, port, &requested, &counter))?;
        Ok(Self { requests: Some(requests), count, thread })
    }

    fn request(&self) {
        // No new request while one is pending.
        let _ = self.requests.as_ref().map(|requests| requests.try_send(()));
    }
}

impl Drop for Probing {
    /// Its participant must be dropped before the last other one. A thread that hangs in the DDS layer is left there.
    fn drop(&mut self) {
        self.requests.take();
        for _ in 0..PROBE_ENDS_WITHIN {
            if self.thread.is_finished() {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

/// Gives both threads some work at each request.
fn probe(
    participant: &DomainParticipant,
    port: Option<u16>,
    requested: &Receiver<()>,
    probes: &AtomicU64,
) {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).ok();
    while requested.recv().is_ok() {
        if let (Some(socket), Some(port)) = (&socket, port) {
            // If there is no such port, the thread still wakes by its timers.
            let _ = socket.send_to(&EMPTY_MESSAGE, (Ipv4Addr::LOCALHOST, port));
        }
        // An error means that the thread has ended, which is noticed anyway.
        let _ = participant.assert_liveliness();
        probes.fetch_add(1, Ordering::Relaxed);
    }
}

/// The port on which a participant receives the discovery of others: RTPS 2.5, 9.6.1.
fn metatraffic_port(domain_id: u16, participant_id: u16) -> Option<u16> {
    let port = 7_400 + 250 * u32::from(domain_id) + 10 + 2 * u32::from(participant_id);
    u16::try_from(port).ok()
}

/// Whether all that was sent to a port of this computer so far was taken from its socket.
fn is_read(port: u16) -> Option<bool> {
    waiting_bytes(&std::fs::read_to_string("/proc/self/net/udp").ok()?, port).map(|it| it == 0)
}

/// The bytes that wait at a port, from the system's table of sockets.
fn waiting_bytes(table: &str, port: u16) -> Option<u64> {
    table.lines().skip(1).find_map(|line| {
        let mut words = line.split_ascii_whitespace();
        let own = words.nth(1)?.rsplit_once(':')?.1;
        let queues = words.nth(2)?;
        let is_ours = u16::from_str_radix(own, 16) == Ok(port);
        is_ours.then(|| u64::from_str_radix(queues.rsplit_once(':')?.1, 16).ok())?
    })
}

/// The checks so far: a pure core.
#[derive(Debug)]
struct Checks {
    threads: Vec<Progress>,
    /// The thread that sends the requests, which the DDS layer may block too.
    probing: Progress,
}

#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    count: u64,
    failed_checks: u32,
}

impl Progress {
    /// Whether there was none for too long.
    fn is_overdue(&mut self, count: u64, progress_min: u64) -> bool {
        let is_served = count >= self.count.saturating_add(progress_min);
        self.failed_checks = if is_served { 0 } else { self.failed_checks + 1 };
        self.count = count;
        self.failed_checks > FAILED_CHECKS_MAX
    }
}

impl Checks {
    fn new(threads: usize) -> Self {
        Self { threads: vec![Progress::default(); threads], probing: Progress::default() }
    }

    /// Takes one check; the reason when the process is deaf.
    fn take(&mut self, seen: &[(&'static str, ThreadState)], probes: u64) -> Option<String> {
        for ((name, seen), progress) in seen.iter().zip(&mut self.threads) {
            match *seen {
                ThreadState::Ended => {
                    return Some(format!(
                        "the {name} thread of the DDS layer has ended (on a packet it cannot handle)"
                    ));
                }
                ThreadState::Idle => progress.failed_checks = 0,
                ThreadState::Busy { waits } => {
                    if progress.is_overdue(waits, WAITS_MIN) {
                        return Some(format!(
                            "the {name} thread of the DDS layer has not been idle for \
                             {FAILED_CHECKS_MAX} checks, {} ms apart",
                            CHECK_PERIOD.as_millis()
                        ));
                    }
                }
            }
        }
        self.probing.is_overdue(probes, 1).then(|| {
            format!(
                "the DDS layer has accepted nothing for {FAILED_CHECKS_MAX} checks, {} ms apart",
                CHECK_PERIOD.as_millis()
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looks(
        seen: impl Fn(u64) -> ThreadState,
        probes: impl Fn(u64) -> u64,
    ) -> Option<(u64, String)> {
        let mut checks = Checks::new(2);
        (0..1_000).find_map(|look| {
            let seen = [("receiving", ThreadState::Idle), ("discovery", seen(look))];
            checks.take(&seen, probes(look)).map(|reason| (look, reason))
        })
    }

    #[test]
    fn threads_that_come_to_rest_or_go_round_serve() {
        assert_eq!(looks(|_| ThreadState::Idle, |look| look), None);
        assert_eq!(looks(|look| ThreadState::Busy { waits: 2 * look + 5 }, |look| look), None);
        // Busy most of the time, idle now and then.
        let seldom =
            |look| if look % 15 == 0 { ThreadState::Idle } else { ThreadState::Busy { waits: 3 } };
        assert_eq!(looks(seldom, |look| look), None);
    }

    #[test]
    fn a_thread_that_ended_is_noticed_at_once() {
        let ends = |look| if look < 7 { ThreadState::Idle } else { ThreadState::Ended };
        let (look, reason) = looks(ends, |look| look).expect("deaf");
        assert_eq!(look, 7);
        assert!(reason.starts_with("the discovery thread of the DDS layer has ended"), "{reason}");
    }

    #[test]
    fn a_thread_that_spins_or_waits_for_a_lock_is_given_its_looks_and_no_more() {
        let limit = u64::from(FAILED_CHECKS_MAX);
        let spins = |_| ThreadState::Busy { waits: 40 };
        // The first look may see progress: the count is new to it.
        assert_eq!(looks(spins, |look| look).expect("deaf").0, limit + 1);
        // Woken once by a request, stuck since.
        let stuck = |look: u64| ThreadState::Busy { waits: 40 + look.min(1) };
        assert_eq!(looks(stuck, |look| look).expect("deaf").0, limit + 1);
    }

    #[test]
    fn a_request_that_is_not_taken_is_deafness_too() {
        let (look, reason) = looks(|_| ThreadState::Idle, |look| look.min(9)).expect("deaf");
        assert_eq!(look, 9 + u64::from(FAILED_CHECKS_MAX) + 1);
        assert!(reason.contains("accepted nothing"), "{reason}");
    }

    #[test]
    fn what_waits_at_a_port_is_read_from_the_table_of_sockets() {
        let table = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt\n\
             10: 0100007F:4ADE 00000000:0000 07 00000000:00000300 00:00000000 00000000 0 0 9\n\
             11: 00000000:4AE0 00000000:0000 07 00000000:00000000 00:00000000 00000000 0 0 8\n";
        assert_eq!(waiting_bytes(table, 0x4ade), Some(0x300));
        assert_eq!(waiting_bytes(table, 0x4ae0), Some(0));
        assert_eq!(waiting_bytes(table, 7_410), None);
    }

    #[test]
    fn what_was_sent_to_a_socket_waits_until_it_is_taken() {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a socket");
        let port = socket.local_addr().expect("an address").port();
        assert_eq!(is_read(port), Some(true));
        socket.send_to(&EMPTY_MESSAGE, (Ipv4Addr::LOCALHOST, port)).expect("sent");
        assert_eq!(is_read(port), Some(false));
        socket.recv(&mut [0; 64]).expect("a datagram");
        assert_eq!(is_read(port), Some(true));
    }

    #[test]
    fn ports_are_those_of_rtps() {
        let table = [((0, 0), Some(7_410)), ((47, 3), Some(19_166)), ((232, 200), None)];
        for ((domain, participant), expected) in table {
            assert_eq!(metatraffic_port(domain, participant), expected);
        }
    }
}
