//! The cables between driver and controller: each carries a program, and each fails in its ways.

mod fault_rows;
mod rig;

use axis_driver::codes::error_code;
use axis_driver::driver::{Command, DriverConfig, RunOutcome, RunResult};
use cnc_msgs::machine::Mode;
use rig::{Board, Network, Shell, Stranger, config};
use std::time::{Duration, Instant};
use virtual_controller::Firmware;

const TCP: &str = "tcp://127.0.0.1:0";
const WS: &str = "ws://127.0.0.1:0";
const RFC2217: &str = "rfc2217://127.0.0.1:0";

fn board(listen: &str) -> Board {
    Board::start(Some(listen), Firmware::GrblHal, Duration::ZERO)
}

/// In the midst of a run of many lines, over a relay.
fn in_a_run(listen: &str) -> (Board, Network, Shell) {
    let board = board(listen);
    let network = Network::to(&board.url);
    let mut shell = Shell::new(&network.url);
    shell.until_mode(Mode::Idle);
    shell.run(4000);
    shell.until("a line", |shell| shell.state.line > 20);
    (board, network, shell)
}

/// Waits for the end of a run whose line is lost.
#[track_caller]
fn lost(shell: &mut Shell) -> RunResult {
    let result = shell.result();
    let end = (result.outcome, result.error_code);
    assert_eq!(end, (RunOutcome::Aborted, error_code::LINK_LOST), "{result:?}");
    result
}

#[test]
fn a_program_runs_over_each_cable_and_overruns_no_buffer() {
    for firmware in [Firmware::Grbl, Firmware::GrblHal, Firmware::FluidNc] {
        for listen in [None, Some(TCP), Some(WS), Some(RFC2217)] {
            let board = Board::start(listen, firmware, Duration::ZERO);
            let what = format!("{firmware} over {}", board.url);
            let mut shell = Shell::new(&board.url);
            shell.until_mode(Mode::Idle);
            shell.run(600);
            let result = shell.result();
            assert_eq!(result.outcome, RunOutcome::Succeeded, "{what}: {result:?}");
            shell.command(Command::Shutdown).expect("it stands");
            drop(shell);
            let counts = board.counts();
            assert_eq!(counts["bytes_lost"], 0, "{what}: {counts}");
            assert_eq!(counts["errors"], 0, "{what}: {counts}");
            // Without a baud rate the board's own buffer bounds what is under way.
            let held = counts["receive_buffer_bytes_max"].as_u64().expect("a number");
            let is_network = listen.is_some_and(|listen| listen != RFC2217);
            if is_network && firmware == Firmware::GrblHal {
                assert!((900..=1023).contains(&held), "{what}: {counts}");
            }
        }
    }
}

#[test]
fn a_hold_stops_a_run_over_each_cable_and_a_resume_ends_it() {
    for listen in [TCP, WS, RFC2217] {
        let board = board(listen);
        let mut shell = Shell::new(&board.url);
        shell.until_mode(Mode::Idle);
        shell.run(600);
        shell.until("a line", |shell| shell.state.line > 20);
        shell.command(Command::FeedHold).expect("it moves");
        shell.until_mode(Mode::Hold);
        shell.command(Command::Resume).expect("it is held");
        assert_eq!(shell.result().outcome, RunOutcome::Succeeded, "{listen}");
    }
}

#[test]
fn overrides_reach_a_board_as_bytes_over_each_cable() {
    use axis_driver::driver::Overrides;
    for listen in [TCP, WS, RFC2217] {
        let board = board(listen);
        let mut shell = Shell::new(&board.url);
        shell.until_mode(Mode::Idle);
        // Bytes from 0x80 on, which a text frame cannot carry.
        let wanted = Overrides { feed: Some(73), ..Overrides::default() };
        shell.command(Command::SetOverrides(wanted)).expect("a report shows it");
    }
}

#[test]
fn a_connection_that_is_reset_in_a_run_is_unknown_and_a_moving_machine_is_held_when_it_is_back() {
    for listen in [TCP, WS, RFC2217] {
        let (_board, network, mut shell) = in_a_run(listen);
        network.reset();
        let result = lost(&mut shell);
        assert!(result.message.contains("motion may continue"), "{listen}: {result:?}");
        let unknown = shell.states.iter().any(|state| state.mode == Mode::Unknown);
        assert!(unknown, "{listen}: a lost line is never idle");
        let restarted = shell.log.contains("restarted when its port was opened");
        assert!(!restarted, "{listen}: grblHAL greets each session: {}", shell.log);
        // It is connected again by itself, and resumes nothing by itself.
        shell.until("a machine that waits for the operator", |shell| {
            matches!(shell.state.mode, Mode::Hold | Mode::Idle)
                && shell.state.reason.contains("soft_reset")
        });
        shell.command(Command::SoftReset).expect("the operator has looked");
        shell.until("a machine that may run", |shell| {
            matches!(shell.state.mode, Mode::Idle | Mode::Alarm)
        });
    }
}

#[test]
fn a_connection_that_is_open_and_carries_nothing_is_unknown_and_holds_when_it_goes_on() {
    for listen in [TCP, WS, RFC2217] {
        let (_board, network, mut shell) = in_a_run(listen);
        network.pause();
        let begin = Instant::now();
        lost(&mut shell);
        let after = begin.elapsed();
        assert!(after < Duration::from_secs(2), "{listen}: noticed after {after:?}");
        shell.until_mode(Mode::Unknown);
        // The hold is the first thing that counts when the network is back, after the lines
        // that were under way.
        network.go_on();
        shell.until("a machine that stands", |shell| {
            matches!(shell.state.mode, Mode::Hold | Mode::Idle)
        });
        let refused = shell.command(Command::Resume).expect_err("nothing resumes by itself");
        assert!(refused.message.contains("soft_reset"), "{listen}: {refused:?}");
    }
}

#[test]
fn a_pause_of_two_seconds_is_ridden_out_where_the_driver_asks_once_a_second() {
    for listen in [TCP, WS] {
        let board = board(listen);
        let network = Network::to(&board.url);
        let patient = DriverConfig { poll_interval_ms: 1000, ..config(&network.url) };
        let mut shell = Shell::with(&network.url, patient);
        shell.until_mode(Mode::Idle);
        shell.run(2000);
        shell.until("a line", |shell| shell.state.line > 20);
        network.pause();
        std::thread::sleep(Duration::from_secs(2));
        network.go_on();
        let result = shell.result();
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{listen}: {result:?}");
        drop(shell);
        assert_eq!(board.counts()["bytes_lost"], 0, "{listen}");
    }
}

#[test]
fn a_second_client_is_refused_with_the_likely_reason_and_disturbs_nothing() {
    for listen in [TCP, WS, RFC2217] {
        let board = board(listen);
        let mut first = Shell::new(&board.url);
        first.until_mode(Mode::Idle);
        first.run(600);
        let mut second = Shell::new(&board.url);
        second.until_reason("before anything was heard: the controller may have another client");
        assert_eq!(first.result().outcome, RunOutcome::Succeeded, "{listen}");
        // It gets its turn when the first has left.
        drop(first);
        second.until_mode(Mode::Idle);
    }
}

#[test]
fn a_board_that_keeps_a_dead_session_is_connected_to_when_it_lets_go() {
    let keeps = Duration::from_millis(1500);
    for listen in [TCP, WS, RFC2217] {
        let board = Board::start(Some(listen), Firmware::GrblHal, keeps);
        let mut first = Shell::new(&board.url);
        first.until_mode(Mode::Idle);
        drop(first);
        let begin = Instant::now();
        let mut second = Shell::new(&board.url);
        second.until_reason("the controller may have another client");
        second.until_mode(Mode::Idle);
        assert!(begin.elapsed() > keeps / 2, "{listen}");
    }
}

#[test]
fn what_is_no_controller_is_named_and_hears_nothing_but_questions() {
    let web = b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n";
    let tls = b"\x15\x03\x03\x00\x02\x02\x0a";
    let rows: [(&str, &'static [u8], usize, bool, &str); 12] = [
        ("tcp", web, 1, true, "a web server answers there"),
        ("tcp", tls, 1, true, "speaks TLS"),
        ("tcp", b"", 0, true, "before anything was heard"),
        ("tcp", b"", 0, false, "nothing answered within 2.5 s; check the port number"),
        ("tcp", b"SSH-2.0-OpenSSH\r\n", 0, false, "an SSH server"),
        ("ws", web, 1, true, "answered 400 Bad Request and no WebSocket"),
        ("ws", tls, 1, true, "it may speak TLS"),
        ("ws", b"", 0, false, "no WebSocket answered within 3 s"),
        ("ws", b"Grbl 1.1h ['$' for help]\r\n", 0, false, "a Telnet port"),
        ("rfc2217", web, 1, true, "a web server answers there"),
        ("rfc2217", tls, 1, true, "speaks TLS"),
        ("rfc2217", b"", 0, false, "no answer to the option COM-PORT of RFC 2217 within 3 s"),
    ];
    for (scheme, says, after, closes, wanted) in rows {
        let stranger = Stranger::new(says, after, closes);
        let mut shell = Shell::new(&format!("{scheme}://{}", stranger.address));
        shell.until_reason(wanted);
        assert!(
            matches!(shell.state.mode, Mode::Disconnected | Mode::Unknown),
            "{scheme} {wanted}: {:?}",
            shell.state
        );
        // What it has been sent may still be on its way to it.
        let least = match scheme {
            "ws" => b"GET / HTTP/1.1\r\n".len(),
            "rfc2217" => 3,
            _ => 0,
        };
        let begin = Instant::now();
        while stranger.heard().len() < least && begin.elapsed() < Duration::from_secs(10) {
            std::thread::sleep(Duration::from_millis(10));
        }
        let heard = stranger.heard();
        let is_harmless = match scheme {
            "ws" => heard.starts_with(b"GET / HTTP/1.1\r\n"),
            "rfc2217" => heard.starts_with(b"\xff\xfb\x2c"),
            _ => heard.iter().all(|byte| *byte == b'?'),
        };
        assert!(is_harmless, "{scheme} {wanted}: {:?}", heard.escape_ascii().to_string());
    }
}

#[test]
fn a_port_that_is_not_there_or_cannot_be_named_is_a_clear_reason() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let gone = listener.local_addr().unwrap();
    drop(listener);
    for (url, wanted) in [
        (format!("tcp://{gone}"), format!("cannot open tcp://{gone}: connection refused")),
        (format!("ws://{gone}"), format!("cannot open ws://{gone}: connection refused")),
        (format!("rfc2217://{gone}"), format!("cannot open rfc2217://{gone}: connection refused")),
        ("tcp://no-such-host.invalid".into(), "no host no-such-host.invalid".into()),
        ("wss://mill".into(), "speaks no TLS".into()),
        ("udp://mill:23".into(), "udp:// is not known; write a device".into()),
    ] {
        let mut shell = Shell::new(&url);
        shell.until_reason(&wanted);
        assert_eq!(shell.state.mode, Mode::Disconnected);
        let refusal = shell.command(Command::Home).expect_err("there is no controller");
        assert_eq!(refusal.error_code, error_code::NOT_CONNECTED);
    }
}

#[test]
fn a_host_that_takes_its_time_stops_nobody_here() {
    let stranger = Stranger::new(b"", 0, false);
    let mut shell = Shell::new(&format!("rfc2217://{}", stranger.address));
    let begin = Instant::now();
    while stranger.heard().is_empty() {
        assert!(begin.elapsed() < rig::PATIENCE, "it is never asked");
        std::thread::sleep(Duration::from_millis(5));
    }
    let begin = Instant::now();
    shell.command(Command::Home).expect_err("there is no controller yet");
    assert!(begin.elapsed() < Duration::from_secs(1), "{:?}", begin.elapsed());
    let begin = Instant::now();
    drop(shell);
    assert!(begin.elapsed() < Duration::from_secs(1), "{:?}", begin.elapsed());
}
