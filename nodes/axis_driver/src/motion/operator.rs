//! Local access to the machine without ROS: a socket on its own computer.
//!
//! The name of the socket is made of the ROS domain and the node. Only this user can write to its
//! folder, or a group that was given it: whoever may open the socket may stop the machine. It
//! accepts requests to stop and to report, and none that move.

use super::hub::Hub;
use crate::driver::{Command, Refusal};
use crate::protocol::{Answer, Deframer, OperatorRequest, ProtocolError, VERSION, Wish, frame};
use runtime::configuration::Configuration;
use runtime::environment::Environment;
use runtime::names::Names;
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::sync_channel;
use std::time::{Duration, Instant};

/// The folder of the sockets, where it is not that of the user.
const FOLDER_VARIABLE: &str = "KERF_RUNTIME_DIR";
/// The folder of a driver that systemd runs; see `config/systemd/`.
const SERVICE_FOLDER: &str = "/run/kerf";
/// Operators that are served at a time.
const OPERATORS_MAX: usize = 8;
/// How long an operator may take to say what it wishes, and to take the answer.
const SPEAK_WITHIN: Duration = Duration::from_secs(2);
/// How long a driver may take to accept an operator: one that is stopped never does.
const CONNECT_WITHIN: Duration = Duration::from_secs(2);
/// The pause after an operator could not be accepted: no descriptor is left, say.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);
/// How long the driver may take: a cancel waits for nothing, a reset for the banner.
const ANSWER_WITHIN: Duration = Duration::from_secs(10);
/// How long an operator waits for all of that.
const OPERATOR_WITHIN: Duration = Duration::from_secs(15);

/// Why the machine cannot be spoken to.
#[derive(Debug, thiserror::Error)]
pub enum OperatorError {
    #[error("no driver of this computer listens at {path}: {problem}")]
    Nobody { path: PathBuf, problem: io::Error },
    #[error("the driver at {path} does not answer: {problem}")]
    Silent { path: PathBuf, problem: io::Error },
    #[error("the driver at {path}: {problem}")]
    Protocol { path: PathBuf, problem: ProtocolError },
}

/// Asks the driver of this computer with these names: one of this user, or the service.
///
/// # Errors
/// There is none, or it does not answer.
pub fn ask_operator(
    environment: &Environment,
    names: &Names,
    wish: Wish,
) -> Result<Answer, OperatorError> {
    let path = |folder: &Path| socket_path(folder, environment.domain_id, &names.fully_qualified());
    let service = path(Path::new(SERVICE_FOLDER));
    let folder = folder();
    let own = match trusted(&folder) {
        Ok(()) => ask(path(&folder), wish),
        Err(problem) => Err(OperatorError::Nobody { path: path(&folder), problem }),
    };
    match own {
        // One that was killed leaves its socket.
        Err(OperatorError::Nobody { .. }) if service.exists() => ask(service, wish),
        answer => answer,
    }
}

fn ask(path: PathBuf, wish: Wish) -> Result<Answer, OperatorError> {
    let nobody = |problem| OperatorError::Nobody { path: path.clone(), problem };
    let silent = |problem| OperatorError::Silent { path: path.clone(), problem };
    let mut stream = match connect(&path) {
        Err(problem) if problem.kind() == io::ErrorKind::TimedOut => return Err(silent(problem)),
        connected => connected.map_err(nobody)?,
    };
    stream.set_write_timeout(Some(SPEAK_WITHIN)).map_err(silent)?;
    let protocol = |problem| OperatorError::Protocol { path: path.clone(), problem };
    let request = frame(&OperatorRequest { version: VERSION, wish }).map_err(protocol)?;
    stream.write_all(&request).map_err(silent)?;
    match receive(&mut stream, Instant::now() + OPERATOR_WITHIN) {
        Ok(answer) => Ok(answer),
        Err(Trouble::Io(problem)) => Err(silent(problem)),
        Err(Trouble::Protocol(problem)) => Err(protocol(problem)),
    }
}

/// Connects, unless the other end accepts nobody in time.
fn connect(path: &Path) -> io::Result<UnixStream> {
    let path = path.to_owned();
    within(CONNECT_WITHIN, move || UnixStream::connect(path))
}

/// Does what has no deadline of its own. Its thread stays when time is up, until it is
/// done or this process ends.
fn within<T: Send + 'static>(
    patience: Duration,
    work: impl FnOnce() -> io::Result<T> + Send + 'static,
) -> io::Result<T> {
    let (sender, done) = sync_channel(1);
    std::thread::Builder::new().name("connect".into()).spawn(move || {
        // Nobody may wait any more.
        let _ = sender.send(work());
    })?;
    done.recv_timeout(patience).unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))
}

/// Listens for operators as long as the process lives.
pub(super) fn listen(hub: &Arc<Hub>, configuration: &Configuration) -> io::Result<()> {
    let folder = folder();
    own(&folder)?;
    let path = socket_of(configuration);
    // One that nobody listens at is left from a process that was killed.
    let is_left = |error: io::Error| error.kind() == io::ErrorKind::ConnectionRefused;
    if path.exists() && connect(&path).is_err_and(is_left) {
        std::fs::remove_file(&path)?;
    }
    let listener = UnixListener::bind(&path)
        .map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", path.display())))?;
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o660))?;
    let hub = Arc::clone(hub);
    std::thread::Builder::new().name("operators".into()).spawn(move || {
        let served = Arc::new(AtomicUsize::new(0));
        loop {
            let stream = accepted(|| listener.accept());
            if served.load(Ordering::Relaxed) >= OPERATORS_MAX {
                continue;
            }
            served.fetch_add(1, Ordering::Relaxed);
            let (hub, place) = (Arc::clone(&hub), Arc::clone(&served));
            let serving = std::thread::Builder::new().name("operator".into()).spawn(move || {
                if let Err(error) = serve(&hub, stream) {
                    tracing::warn!("a local operator: {error}");
                }
                place.fetch_sub(1, Ordering::Relaxed);
            });
            if serving.is_err() {
                served.fetch_sub(1, Ordering::Relaxed);
            }
        }
    })?;
    Ok(())
}

/// The next operator; where one cannot be accepted the thread pauses, and says so once.
fn accepted<A>(mut accept: impl FnMut() -> io::Result<(UnixStream, A)>) -> UnixStream {
    let mut is_logged = false;
    loop {
        match accept() {
            Ok((stream, _)) => return stream,
            Err(error) => {
                if !std::mem::replace(&mut is_logged, true) {
                    tracing::error!("a local operator cannot be accepted: {error}");
                }
                std::thread::sleep(ACCEPT_PAUSE);
            }
        }
    }
}

/// Removes the name of the socket.
pub(super) fn forget(configuration: &Configuration) {
    // Whoever comes next would remove it too.
    let _ = std::fs::remove_file(socket_of(configuration));
}

fn socket_of(configuration: &Configuration) -> PathBuf {
    let Configuration { environment, names, .. } = configuration;
    socket_path(&folder(), environment.domain_id, &names.fully_qualified())
}

fn serve(hub: &Hub, mut stream: UnixStream) -> Result<(), Trouble> {
    stream.set_write_timeout(Some(SPEAK_WITHIN))?;
    let OperatorRequest { version, wish } = receive(&mut stream, Instant::now() + SPEAK_WITHIN)?;
    if version != VERSION {
        return Err(ProtocolError::Version { found: version }.into());
    }
    let command = match wish {
        Wish::FeedHold => Some(Command::FeedHold),
        Wish::Cancel => Some(Command::CancelRun { run: None }),
        Wish::SoftReset => Some(Command::SoftReset),
        Wish::State => None,
    };
    let result: Result<String, Refusal> = match command {
        Some(command) => {
            let result = hub.ask(command, ANSWER_WITHIN);
            tracing::info!("a local operator asked for {wish:?}");
            result
        }
        None => Ok(String::new()),
    };
    let answer = Answer { result, state: hub.machine_state(), has_face: hub.has_face() };
    stream.write_all(&frame(&answer)?)?;
    Ok(())
}

#[derive(Debug, thiserror::Error)]
enum Trouble {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
}

/// Takes one message, until a moment: one that comes in drops has no more time than another.
fn receive<T: serde::de::DeserializeOwned>(
    stream: &mut UnixStream,
    until: Instant,
) -> Result<T, Trouble> {
    let (mut deframer, mut buffer) = (Deframer::default(), [0; 4_096]);
    loop {
        if let Some(message) = deframer.take()? {
            return Ok(message);
        }
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::Error::from(io::ErrorKind::TimedOut).into());
        }
        stream.set_read_timeout(Some(left))?;
        match stream.read(&mut buffer)? {
            0 => return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into()),
            count => deframer.push(&buffer[..count]),
        }
    }
}

/// Where the sockets of this user are.
fn folder() -> PathBuf {
    let from = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    match (from(FOLDER_VARIABLE), from("XDG_RUNTIME_DIR")) {
        (Some(folder), _) => folder.into(),
        (None, Some(folder)) => Path::new(&folder).join("kerf"),
        (None, None) => {
            let user = rustix::process::getuid().as_raw();
            std::env::temp_dir().join(format!("kerf-{user}"))
        }
    }
}

/// A name in the folder that says which machine it is; names of sockets are short.
fn socket_path(folder: &Path, domain_id: u16, node: &str) -> PathBuf {
    const NAME_CHARS_MAX: usize = 60;
    let name = node.trim_start_matches('/').replace('/', ".");
    let name = match name.len() <= NAME_CHARS_MAX {
        true => name,
        false => cnc_msgs::chunk::sha256_hex(name.as_bytes())[..32].to_owned(),
    };
    folder.join(format!("{domain_id}.{name}.sock"))
}

/// Makes sure that nobody else can answer in the place of the driver: in `/tmp` anybody can make
/// the folder first. One that the variable names is the choice of whoever asks.
fn trusted(folder: &Path) -> io::Result<()> {
    let owner = std::fs::symlink_metadata(folder)?.uid();
    let user = rustix::process::getuid().as_raw();
    if owner == user || owner == 0 || std::env::var_os(FOLDER_VARIABLE).is_some() {
        return Ok(());
    }
    let text = format!("{} belongs to another user ({owner})", folder.display());
    Err(io::Error::new(io::ErrorKind::PermissionDenied, text))
}

/// Makes the folder, or makes sure that it is nobody else's.
fn own(folder: &Path) -> io::Result<()> {
    std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder)?;
    let found = std::fs::symlink_metadata(folder)?;
    let user = rustix::process::getuid().as_raw();
    let is_ours = found.is_dir() && found.uid() == user;
    if !is_ours || found.mode() & 0o002 != 0 {
        let text = format!(
            "{} belongs to somebody else or can be written by everybody; set {FOLDER_VARIABLE} \
             to a folder of the user that runs the driver",
            folder.display()
        );
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, text));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_machine_has_a_socket_of_its_own_with_a_name_that_fits() {
        let folder = Path::new("/run/user/1000/kerf");
        let path = |domain, node: &str| socket_path(folder, domain, node);
        assert_eq!(path(7, "/cell/mill/axis_driver"), folder.join("7.cell.mill.axis_driver.sock"));
        let long = format!("/{}/axis_driver", "a".repeat(300));
        let longer = format!("/{}/axis_driver", "a".repeat(301));
        assert!(path(0, &long).as_os_str().len() < 100);
        assert_ne!(path(0, &long), path(0, &longer));
    }

    #[test]
    fn an_operator_that_speaks_in_drops_gets_no_more_time() {
        let (mut ours, mut theirs) = UnixStream::pair().expect("a pair");
        let dripping = std::thread::spawn(move || {
            let request = OperatorRequest { version: VERSION, wish: Wish::State };
            for byte in frame(&request).expect("short") {
                std::thread::sleep(Duration::from_millis(100));
                // The other end has gone when it gave up.
                let _ = theirs.write_all(&[byte]);
            }
        });
        let began = Instant::now();
        let received = receive::<OperatorRequest>(&mut ours, began + Duration::from_millis(250));
        assert!(matches!(received, Err(Trouble::Io(_))), "{received:?}");
        drop(ours);
        dripping.join().expect("no panic");
    }

    #[test]
    fn a_driver_that_accepts_nobody_holds_an_operator_up_no_longer_than_the_deadline() {
        let began = Instant::now();
        let connected = within(Duration::from_millis(50), || {
            std::thread::sleep(Duration::from_secs(20));
            Ok(())
        });
        assert_eq!(connected.expect_err("too late").kind(), io::ErrorKind::TimedOut);
        assert!(began.elapsed() < Duration::from_secs(10));
        assert_eq!(within(Duration::from_secs(10), || Ok(7)).expect("in time"), 7);
    }

    #[test]
    fn an_operator_that_cannot_be_accepted_is_waited_for_without_spinning() {
        let (ours, _theirs) = UnixStream::pair().expect("a pair");
        let mut ours = Some(ours);
        let mut failures = 0..2;
        let began = Instant::now();
        accepted(|| match failures.next() {
            Some(_) => Err(io::Error::other("no descriptor is left")),
            None => Ok((ours.take().expect("asked once"), ())),
        });
        assert!(began.elapsed() >= 2 * ACCEPT_PAUSE);
    }

    #[test]
    fn a_folder_that_another_user_made_first_is_not_asked() {
        let place = std::env::temp_dir().join(format!("kerf-foreign-{}", std::process::id()));
        own(&place).expect("made");
        assert!(trusted(&place).is_ok());
        // Only root can give something away.
        if std::os::unix::fs::chown(&place, Some(65_534), None).is_ok() {
            let refused = trusted(&place).expect_err("it is of another user").to_string();
            assert!(refused.ends_with("belongs to another user (65534)"), "{refused}");
        }
        std::fs::remove_dir(&place).expect("empty");
    }

    #[test]
    fn a_folder_of_others_is_not_taken() {
        let place = std::env::temp_dir().join(format!("kerf-operator-{}", std::process::id()));
        own(&place).expect("made");
        assert_eq!(std::fs::metadata(&place).expect("there").mode() & 0o777, 0o700);
        std::fs::set_permissions(&place, std::fs::Permissions::from_mode(0o777)).expect("ours");
        assert!(own(&place).is_err());
        std::fs::remove_dir(&place).expect("empty");
    }
}
