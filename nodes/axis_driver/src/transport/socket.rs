//! A TCP connection: how it is made, how it is written to without waiting, how it is given up.

use super::greeting::{GREETING_BYTES, foreign};
use crate::address::Host;
use socket2::{SockRef, TcpKeepalive};
use std::io::{Error, ErrorKind, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

/// How long a host may take to accept a connection, and then a server to shake hands.
pub(super) const PATIENCE: Duration = Duration::from_secs(3);
/// How long bytes may be under way before the connection counts as lost. The driver
/// itself says far earlier that it hears nothing; a pause of Wi-Fi is over by then.
const UNDELIVERED_MAX: Duration = Duration::from_secs(10);
/// Bytes that may wait here, besides those that the system keeps.
const UNWRITTEN_BYTES_MAX: usize = 64 * 1024;

/// Connects. The error is for people.
pub(super) fn connect(host: &Host) -> Result<TcpStream, String> {
    let addresses: Vec<SocketAddr> = (host.name.as_str(), host.port)
        .to_socket_addrs()
        .map_err(|error| format!("no host {}: {error}", host.name))?
        .collect();
    let count = u32::try_from(addresses.len()).unwrap_or(u32::MAX);
    let begin = Instant::now();
    let mut problem = format!("the host {} has no address", host.name);
    for (address, to_come) in addresses.iter().zip((1..=count).rev()) {
        // An address that is silent leaves time for those after it.
        let left = PATIENCE.saturating_sub(begin.elapsed()) / to_come;
        if left.is_zero() {
            break;
        }
        match TcpStream::connect_timeout(address, left).and_then(prepare) {
            Ok(stream) => return Ok(stream),
            Err(error) => problem = refusal(&error),
        }
    }
    Err(problem)
}

fn refusal(error: &Error) -> String {
    match error.kind() {
        ErrorKind::ConnectionRefused => {
            "connection refused: nothing listens on that port; check the port number, and that the \
             controller's network service is on"
                .into()
        }
        ErrorKind::TimedOut | ErrorKind::WouldBlock => {
            format!("no answer within {} s; check host and network", PATIENCE.as_secs())
        }
        // It was accepted, and ended at once.
        ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::NotConnected => {
            Heard::default().lost(error)
        }
        _ => error.to_string(),
    }
}

/// Sends at once, and notices when the other side is gone.
fn prepare(stream: TcpStream) -> std::io::Result<TcpStream> {
    let own = stream.local_addr()?;
    if stream.peer_addr().is_ok_and(|peer| peer == own) {
        // Nothing listens there, and the system has connected the port to itself.
        abandon(&stream);
        return Err(ErrorKind::ConnectionRefused.into());
    }
    stream.set_nodelay(true)?;
    let socket = SockRef::from(&stream);
    let alive = TcpKeepalive::new()
        .with_time(Duration::from_secs(2))
        .with_interval(Duration::from_secs(2))
        .with_retries(4);
    socket.set_tcp_keepalive(&alive)?;
    socket.set_tcp_user_timeout(Some(UNDELIVERED_MAX))?;
    Ok(stream)
}

/// Ends the connection with a reset: what was not delivered never is.
///
/// Lines that wait in this computer would otherwise reach the board when the network is back,
/// long after they were reported as lost; and the board is free for another session at once.
pub(super) fn abandon(stream: &TcpStream) {
    // One that is gone already has nothing to give up.
    let _ = SockRef::from(stream).set_linger(Some(Duration::ZERO));
}

/// What has been heard on a connection, for the reason of its end.
#[derive(Debug, Default)]
pub(super) struct Heard {
    first: Vec<u8>,
}

impl Heard {
    /// Looks at bytes that came; the error is what else speaks there than a controller.
    pub(super) fn take(&mut self, bytes: &[u8]) -> Result<(), String> {
        let missing = GREETING_BYTES - self.first.len();
        if missing == 0 {
            return Ok(());
        }
        self.first.extend(bytes.iter().take(missing));
        foreign(&self.first).map_or(Ok(()), |text| Err(text.into()))
    }

    /// Why a connection has ended.
    pub(super) fn end(&self, why: &str) -> String {
        match self.first.is_empty() {
            true => format!(
                "{why} before anything was heard: the controller may have another client, or the port \
                 speaks TLS or HTTP"
            ),
            false => why.into(),
        }
    }

    pub(super) fn closed(&self) -> String {
        self.end("closed by the other side")
    }

    pub(super) fn lost(&self, error: &Error) -> String {
        self.end(&format!("connection lost: {error}"))
    }
}

/// Bytes that the system has not taken yet.
#[derive(Debug, Default)]
pub(super) struct Unwritten(Vec<u8>);

impl Unwritten {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Writes after what waits already.
    pub(super) fn write(&mut self, stream: &TcpStream, bytes: &[u8]) -> Result<(), String> {
        if self.0.len() + bytes.len() > UNWRITTEN_BYTES_MAX {
            return Err("the connection takes no more bytes: the controller does not read".into());
        }
        self.0.extend_from_slice(bytes);
        self.flush(stream)
    }

    /// Writes what waits, as far as the system takes it.
    pub(super) fn flush(&mut self, mut stream: &TcpStream) -> Result<(), String> {
        while !self.0.is_empty() {
            match stream.write(&self.0) {
                Ok(count) => drop(self.0.drain(..count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(format!("connection lost: {error}")),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    #[test]
    fn a_connection_sends_at_once_and_notices_a_peer_that_is_gone() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let stream = connect(&Host { name: "127.0.0.1".into(), port }).unwrap();
        let socket = SockRef::from(&stream);
        assert!(socket.tcp_nodelay().unwrap());
        assert!(socket.keepalive().unwrap());
        assert_eq!(socket.tcp_user_timeout().unwrap(), Some(UNDELIVERED_MAX));
    }

    #[test]
    fn a_host_or_a_port_that_is_not_there_is_named() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        drop(listener);
        let to = |name: &str| connect(&Host { name: name.into(), port }).unwrap_err();
        assert!(to("127.0.0.1").starts_with("connection refused: nothing listens"));
        assert!(to("no-such-host.invalid").starts_with("no host no-such-host.invalid: "));
    }

    #[test]
    fn a_peer_that_does_not_read_is_given_up_with_bounded_memory() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let stream = connect(&Host { name: "127.0.0.1".into(), port }).unwrap();
        stream.set_nonblocking(true).unwrap();
        let mut unwritten = Unwritten::default();
        let error = (0..1_000_000).find_map(|_| unwritten.write(&stream, &[b'?'; 1000]).err());
        assert!(error.unwrap().contains("does not read"));
        assert!(unwritten.0.len() <= UNWRITTEN_BYTES_MAX);
    }
}
