//! A driver and a virtual controller with a real cable between them, and what can be done to it.

use axis_driver::driver::{Command, DriverConfig, Output, Refusal, RunRequest, RunResult};
use axis_driver::serial::{Event, Reopen, Serial, SerialConfig};
use cnc_msgs::contour::Source;
use cnc_msgs::geometry::{AxisSet, Shape};
use cnc_msgs::machine::{MachineState, Mode};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use virtual_controller::{Build, Firmware, LineTiming, ServeOptions, Settings, StopHandle};

/// Far more than anything takes; only a failure waits this long.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);
/// The machine lives so much faster than the clock.
const TIME_FACTOR: f64 = 20.0;

/// A virtual controller in a thread.
pub(crate) struct Board {
    pub(crate) url: String,
    stop: Option<StopHandle>,
    thread: Option<JoinHandle<()>>,
    folder: tempfile::TempDir,
}

impl Board {
    /// One that listens there (a pseudo-terminal without), with a session that outlives its client.
    pub(crate) fn start(listen: Option<&str>, firmware: Firmware, keeps_session: Duration) -> Self {
        Self::with(listen, firmware, |options| options.keeps_session = keeps_session)
    }

    /// The same with other options.
    pub(crate) fn with(
        listen: Option<&str>,
        firmware: Firmware,
        change: impl FnOnce(&mut ServeOptions),
    ) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let listen = listen.map(|url| url.parse().expect("a URL"));
        let settings = Settings::small_router_of(firmware);
        let mut options = ServeOptions {
            timing: LineTiming { baud: None, time_factor: TIME_FACTOR, scales_bytes: false },
            listen,
            report: Some(folder.path().join("report.json")),
            ..ServeOptions::new(Build::new(settings))
        };
        change(&mut options);
        let (handle, stop) = virtual_controller::stop_pair().expect("a pipe");
        let (ready, url) = sync_channel(1);
        let thread = std::thread::spawn(move || {
            virtual_controller::serve(options, &stop, |path| {
                // Only the first is waited for.
                let _ = ready.try_send(path.display().to_string());
                Ok(())
            })
            .expect("it serves to its end");
        });
        let url = url.recv_timeout(PATIENCE).expect("it is ready");
        Self { url, stop: Some(handle), thread: Some(thread), folder }
    }

    /// Ends it; returns what it has counted.
    pub(crate) fn counts(mut self) -> serde_json::Value {
        self.end();
        let text = std::fs::read_to_string(self.folder.path().join("report.json"));
        serde_json::from_str(&text.expect("a report")).expect("JSON")
    }

    fn end(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            thread.join().expect("it ends in order");
        }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.end();
    }
}

/// A driver in threads of its own.
pub(crate) struct Shell {
    serial: Serial,
    events: Receiver<Event>,
    pub(crate) state: MachineState,
    pub(crate) states: Vec<MachineState>,
    replies: Vec<(u64, Result<String, Refusal>)>,
    pub(crate) finished: Option<RunResult>,
    pub(crate) log: String,
    next_id: u64,
}

/// As the node makes it of a port with this name.
pub(crate) fn config(url: &str) -> DriverConfig {
    DriverConfig {
        is_networked: url.starts_with("tcp:") || url.starts_with("ws:"),
        rate_margin: 5.0 * TIME_FACTOR,
        ..DriverConfig::default()
    }
}

impl Shell {
    pub(crate) fn new(url: &str) -> Self {
        Self::with(url, config(url))
    }

    pub(crate) fn with(url: &str, driver: DriverConfig) -> Self {
        let reopen =
            Reopen::Backoff { first: Duration::from_millis(50), most: Duration::from_millis(200) };
        let config = SerialConfig { path: url.into(), dtr: None, rts: None, reopen, driver };
        let (events_in, events) = sync_channel(4096);
        let (journal, _) = sync_channel(1);
        let serial = Serial::start(config, events_in, journal).expect("threads");
        serial.open().expect("room");
        Self {
            serial,
            events,
            state: MachineState::default(),
            states: Vec::new(),
            replies: Vec::new(),
            finished: None,
            log: String::new(),
            next_id: 1,
        }
    }

    /// Takes events for so long, or until one has come.
    fn take(&mut self, patience: Duration) {
        let Ok(event) = self.events.recv_timeout(patience) else { return };
        match event.output {
            Output::State(state) => {
                self.states.push(state.clone());
                self.state = state;
            }
            Output::Reply { id, result } => self.replies.push((id, result)),
            Output::RunFinished(result) => self.finished = Some(result),
            Output::Log { message, .. } => self.log += &format!("{message}\n"),
            _ => {}
        }
    }

    #[track_caller]
    pub(crate) fn until(&mut self, what: &str, condition: impl Fn(&Self) -> bool) {
        let begin = Instant::now();
        while !condition(self) {
            assert!(
                begin.elapsed() < PATIENCE,
                "never: {what}; {:?}\n{:?}\n{}",
                self.state,
                self.finished,
                self.log
            );
            self.take(Duration::from_millis(20));
        }
    }

    #[track_caller]
    pub(crate) fn until_mode(&mut self, mode: Mode) {
        self.until(mode.name(), |shell| shell.state.mode == mode);
    }

    #[track_caller]
    pub(crate) fn until_reason(&mut self, text: &str) {
        self.until(text, |shell| shell.state.reason.contains(text));
    }

    #[track_caller]
    pub(crate) fn command(&mut self, command: Command) -> Result<String, Refusal> {
        let id = self.next_id;
        self.next_id += 1;
        self.serial.command(id, command).expect("room");
        self.until("a reply", |shell| shell.replies.iter().any(|(to, _)| *to == id));
        let index = self.replies.iter().position(|(to, _)| *to == id).expect("it is there");
        self.replies.remove(index).1
    }

    /// Begins a run of so many short lines.
    #[track_caller]
    pub(crate) fn run(&mut self, count: u32) {
        self.finished = None;
        let request = RunRequest {
            program_id: "part".into(),
            revision: 0,
            path: Arc::new(zigzag(count)),
            start_line: 0,
            occurrence: 0,
            in_span: Default::default(),
            check_only: false,
            tool_diameters_mm: Default::default(),
        };
        self.command(Command::RunProgram(request)).expect("it begins");
    }

    #[track_caller]
    pub(crate) fn result(&mut self) -> RunResult {
        self.until("the end", |shell| shell.finished.is_some());
        self.finished.clone().expect("it is there")
    }
}

fn zigzag(count: u32) -> CompensatedPath {
    let element = |line: u32| PathElement {
        side: None,
        shape: Shape::Line,
        end: [f64::from(line % 20), f64::from(line % 2), 0.0],
        feed_mm_per_min: Some(3000.0),
        role: Role::None,
        axes: AxisSet::NONE.with(0).with(1),
        source: Source { line, ..Source::default() },
    };
    CompensatedPath { elements: (1..=count).map(element).collect(), ..Default::default() }
}

/// A network between driver and board.
pub(crate) struct Network {
    pub(crate) url: String,
    shared: Arc<Shared>,
}

#[derive(Default)]
struct Shared {
    is_paused: AtomicBool,
    is_over: AtomicBool,
    sockets: Mutex<Vec<TcpStream>>,
}

impl Network {
    /// One that leads to the board of this URL.
    pub(crate) fn to(url: &str) -> Self {
        let (scheme, address) = url.split_once("://").expect("a URL");
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let shared = Arc::new(Shared::default());
        let own = format!("{scheme}://{}", listener.local_addr().expect("an address"));
        let (address, shares) = (address.to_owned(), shared.clone());
        std::thread::spawn(move || {
            for client in listener.incoming() {
                let Ok(client) = client else { return };
                if shares.is_over.load(Ordering::Relaxed) {
                    return;
                }
                // A board that refuses is seen as a connection that ends.
                let Ok(board) = TcpStream::connect(&address) else { continue };
                for socket in [&client, &board] {
                    socket.set_nodelay(true).expect("a socket");
                    let mut sockets = shares.sockets.lock().unwrap_or_else(PoisonError::into_inner);
                    sockets.push(socket.try_clone().expect("a socket"));
                }
                pump(&client, &board, &shares);
                pump(&board, &client, &shares);
            }
        });
        Self { url: own, shared }
    }

    /// Bytes stay where they are; both ends believe that they are connected.
    pub(crate) fn pause(&self) {
        self.shared.is_paused.store(true, Ordering::Relaxed);
    }

    pub(crate) fn go_on(&self) {
        self.shared.is_paused.store(false, Ordering::Relaxed);
    }

    /// All connections end with a reset, as when a router forgets them.
    pub(crate) fn reset(&self) {
        let mut sockets = self.shared.sockets.lock().unwrap_or_else(PoisonError::into_inner);
        for socket in sockets.drain(..) {
            socket2::SockRef::from(&socket).set_linger(Some(Duration::ZERO)).expect("a socket");
            // Wakes the thread that reads it; the reset comes when the last of them is closed.
            let _ = socket.shutdown(Shutdown::Read);
        }
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
        self.reset();
    }
}

fn pump(from: &TcpStream, to: &TcpStream, shared: &Arc<Shared>) {
    let mut from = from.try_clone().expect("a socket");
    let mut to = to.try_clone().expect("a socket");
    let shared = shared.clone();
    std::thread::spawn(move || {
        let mut bytes = [0; 4096];
        while let Ok(count @ 1..) = from.read(&mut bytes) {
            while shared.is_paused.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(1));
            }
            if to.write_all(&bytes[..count]).is_err() {
                break;
            }
        }
        // The end of one is the end of the other.
        let _ = to.shutdown(Shutdown::Both);
    });
}

/// Something else than a controller: says this to whoever connects, and keeps what it hears.
pub(crate) struct Stranger {
    pub(crate) address: String,
    pub(crate) heard: Arc<Mutex<Vec<u8>>>,
}

impl Stranger {
    /// `says` after so many bytes were heard; closes after that if `closes`.
    pub(crate) fn new(says: &'static [u8], after: usize, closes: bool) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address").to_string();
        let heard = Arc::new(Mutex::new(Vec::new()));
        let hears = heard.clone();
        std::thread::spawn(move || {
            for client in listener.incoming() {
                let Ok(mut client) = client else { return };
                let (mut count, mut has_said) = (0, false);
                let mut bytes = [0; 256];
                loop {
                    if count >= after && !has_said {
                        has_said = true;
                        let _ = client.write_all(says);
                        if closes {
                            break;
                        }
                    }
                    let Ok(more @ 1..) = client.read(&mut bytes) else { break };
                    count += more;
                    let mut heard = hears.lock().unwrap_or_else(PoisonError::into_inner);
                    heard.extend_from_slice(&bytes[..more]);
                }
            }
        });
        Self { address, heard }
    }

    pub(crate) fn heard(&self) -> Vec<u8> {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
