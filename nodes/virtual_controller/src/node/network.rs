//! The port that peers see on a network: one session at a time, as boards have it.

use std::io::{self, ErrorKind};
use std::net::{TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

use rustix::event::PollFlags;

use super::client::Client;
use super::listen::Listen;
use super::serve::ServeError;
use crate::firmware::Greeting;

/// A port that may be gone for a while, and its session.
#[derive(Debug)]
pub(super) struct NetworkPort {
    listen: Listen,
    listener: Option<TcpListener>,
    session: Option<Session>,
    /// How long a session outlives its client.
    keeps_session: Duration,
    greeting: Greeting,
}

#[derive(Debug)]
enum Session {
    Alive(Box<Client>),
    /// The client is gone, and the board has not noticed.
    Dead {
        until: Instant,
    },
}

impl NetworkPort {
    pub(super) fn open(
        listen: Listen,
        keeps_session: Duration,
        greeting: Greeting,
    ) -> Result<Self, ServeError> {
        let mut port = Self { listen, listener: None, session: None, keeps_session, greeting };
        port.plug()?;
        Ok(port)
    }

    /// Where it listens, with its true port number.
    pub(super) fn listen(&self) -> Listen {
        self.listen
    }

    /// Ends the session with a reset, and refuses connections from now on.
    pub(super) fn pull(&mut self) {
        self.listener = None;
        if let Some(Session::Alive(client)) = self.session.take() {
            client.stream().map(reset);
        }
    }

    /// Listens again; returns whether it did not.
    pub(super) fn plug(&mut self) -> Result<bool, ServeError> {
        if self.listener.is_some() {
            return Ok(false);
        }
        let listen = self.listen;
        let (bound, listener) =
            listen.bind().map_err(|source| ServeError::Listen { listen, source })?;
        (self.listen, self.listener) = (bound, Some(listener));
        Ok(true)
    }

    /// Takes a new client, or refuses it while there is a session.
    pub(super) fn look(&mut self) -> io::Result<()> {
        let Some(listener) = &self.listener else { return Ok(()) };
        loop {
            let stream = match listener.accept() {
                Ok((stream, _)) => stream,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                // One that left before it was taken is no failure of the port.
                Err(error)
                    if matches!(
                        error.kind(),
                        ErrorKind::ConnectionAborted | ErrorKind::Interrupted
                    ) =>
                {
                    continue;
                }
                Err(error) => return Err(error),
            };
            if matches!(self.session, Some(Session::Dead { until }) if Instant::now() >= until) {
                self.session = None;
            }
            if self.session.is_some() {
                reset(&stream);
                continue;
            }
            let client = Client::new(stream, self.listen.protocol, self.greeting);
            self.session = client.ok().map(|client| Session::Alive(Box::new(client)));
        }
    }

    fn client(&mut self) -> Option<&mut Client> {
        match &mut self.session {
            Some(Session::Alive(client)) => Some(client),
            _ => None,
        }
    }

    /// The client is gone.
    fn end_session(&mut self) {
        let until = Instant::now() + self.keeps_session;
        self.session = (!self.keeps_session.is_zero()).then_some(Session::Dead { until });
    }

    /// Reads what the client has sent; one that is gone is no error.
    pub(super) fn read(&mut self) -> Vec<u8> {
        let Some(client) = self.client() else { return Vec::new() };
        client.read().unwrap_or_else(|_| {
            self.end_session();
            Vec::new()
        })
    }

    /// Sends bytes, which are lost without a client, as on a real board.
    pub(super) fn write(&mut self, bytes: &[u8]) {
        let Some(client) = self.client() else { return };
        let written = match bytes.is_empty() {
            true => client.flush(),
            false => client.write(bytes),
        };
        if written.is_err() {
            self.end_session();
        }
    }

    /// What to wait for: a new client, and bytes of the one that is there.
    pub(super) fn waits_for(&self, reads: bool) -> [Option<(BorrowedFd<'_>, PollFlags)>; 2] {
        let listener = self.listener.as_ref().map(|it| (it.as_fd(), PollFlags::IN));
        let client = match &self.session {
            Some(Session::Alive(client)) => Some(client),
            _ => None,
        };
        let client = client.and_then(|client| {
            let mut flags = PollFlags::empty();
            flags.set(PollFlags::IN, reads);
            flags.set(PollFlags::OUT, client.has_unwritten());
            client.fd().map(|fd| (fd, flags))
        });
        [client, listener]
    }
}

/// Lets the connection end with a reset when it is dropped.
fn reset(stream: &TcpStream) {
    // Without the option it ends as any other.
    let _ = rustix::net::sockopt::set_socket_linger(stream, Some(Duration::ZERO));
}
