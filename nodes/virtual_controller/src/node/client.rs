//! One client of a network port: a connection, in whatever it speaks.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::os::fd::{AsFd, BorrowedFd};

use tungstenite::handshake::server::{Callback, ErrorResponse, Request, Response};
use tungstenite::handshake::{HandshakeError, MidHandshake, server::ServerHandshake};
use tungstenite::http::HeaderValue;
use tungstenite::{Error, Message, WebSocket};

use super::gateway::{Gateway, escape};
use super::listen::Protocol;
use crate::firmware::Greeting;

/// Bytes to a client that does not read, before it counts as gone.
const UNREAD_BYTES_MAX: usize = 256 * 1024;
/// A connection that was accepted.
#[derive(Debug)]
pub(super) struct Client {
    speaks: Speaks,
    /// Bytes that the system has not taken yet.
    unwritten: Vec<u8>,
    greeting: Greeting,
}

#[derive(Debug)]
enum Speaks {
    Bytes(TcpStream),
    ComPort(TcpStream, Gateway),
    /// `None` while a step is taken.
    ShakingHands(Option<MidHandshake<ServerHandshake<TcpStream, Arduino>>>),
    WebSocket(WebSocket<TcpStream>),
}

/// Confirms the protocol that a client names, as the firmware does.
#[derive(Debug)]
struct Arduino;

impl Callback for Arduino {
    #[allow(clippy::result_large_err, reason = "the trait says so")]
    fn on_request(
        self,
        request: &Request,
        mut response: Response,
    ) -> Result<Response, ErrorResponse> {
        const PROTOCOL: &str = "Sec-WebSocket-Protocol";
        if request.headers().contains_key(PROTOCOL) {
            response.headers_mut().insert(PROTOCOL, HeaderValue::from_static("arduino"));
        }
        Ok(response)
    }
}

impl Client {
    pub(super) fn new(
        stream: TcpStream,
        protocol: Protocol,
        greeting: Greeting,
    ) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        let speaks = match protocol {
            Protocol::Tcp => Speaks::Bytes(stream),
            Protocol::Rfc2217 => Speaks::ComPort(stream, Gateway::default()),
            Protocol::WebSocket => {
                Speaks::ShakingHands(Some(ServerHandshake::start(stream, Arduino, None)))
            }
        };
        let mut client = Self { speaks, unwritten: Vec::new(), greeting };
        // A gateway is not the board, which knows of no session.
        if protocol == Protocol::Tcp {
            client.greet()?;
        }
        Ok(client)
    }

    fn greet(&mut self) -> io::Result<()> {
        let line = self.greeting.line.map(|line| format!("\r\n{line}\r\n"));
        line.map_or(Ok(()), |line| self.write(line.as_bytes()))
    }

    /// The connection; `None` for one that has failed.
    pub(super) fn stream(&self) -> Option<&TcpStream> {
        match &self.speaks {
            Speaks::Bytes(stream) | Speaks::ComPort(stream, _) => Some(stream),
            Speaks::ShakingHands(step) => step.as_ref().map(|step| step.get_ref().get_ref()),
            Speaks::WebSocket(socket) => Some(socket.get_ref()),
        }
    }

    pub(super) fn fd(&self) -> Option<BorrowedFd<'_>> {
        self.stream().map(AsFd::as_fd)
    }

    pub(super) fn has_unwritten(&self) -> bool {
        !self.unwritten.is_empty()
    }

    /// Reads bytes for the board; an error means that the client is gone.
    pub(super) fn read(&mut self) -> io::Result<Vec<u8>> {
        match &mut self.speaks {
            Speaks::Bytes(stream) => read(stream),
            Speaks::ComPort(stream, gateway) => {
                let bytes = read(stream)?;
                let data = gateway.receive(&bytes, &mut self.unwritten);
                self.flush()?;
                Ok(data)
            }
            Speaks::ShakingHands(step) => {
                let step = step.take().ok_or(ErrorKind::ConnectionAborted)?;
                match step.handshake() {
                    Ok(mut socket) => {
                        for notice in self.greeting.notices {
                            taken(socket.write(Message::text(*notice)))?;
                        }
                        self.speaks = Speaks::WebSocket(socket);
                        self.greet()?;
                    }
                    Err(HandshakeError::Interrupted(step)) => {
                        self.speaks = Speaks::ShakingHands(Some(step));
                    }
                    Err(HandshakeError::Failure(_)) => return Err(ErrorKind::InvalidData.into()),
                }
                Ok(Vec::new())
            }
            Speaks::WebSocket(socket) => {
                let mut bytes = Vec::new();
                loop {
                    match socket.read() {
                        Ok(message @ (Message::Binary(_) | Message::Text(_))) => {
                            bytes.extend(message.into_data());
                        }
                        Ok(_) => {}
                        Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => break,
                        // What came before its end is still for the board.
                        Err(_) if !bytes.is_empty() => break,
                        Err(error) => return Err(io::Error::other(error)),
                    }
                }
                taken(socket.flush())?;
                Ok(bytes)
            }
        }
    }

    /// Sends bytes of the board. Those that a client does not read wait, up to a limit.
    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match &mut self.speaks {
            Speaks::Bytes(_) => self.unwritten.extend_from_slice(bytes),
            Speaks::ComPort(..) => self.unwritten.extend(escape(bytes)),
            // Nobody listens yet.
            Speaks::ShakingHands(_) => {}
            Speaks::WebSocket(socket) => {
                return taken(socket.write(Message::binary(bytes.to_vec())))
                    .and_then(|()| taken(socket.flush()));
            }
        }
        self.flush()
    }

    pub(super) fn flush(&mut self) -> io::Result<()> {
        let (Speaks::Bytes(stream) | Speaks::ComPort(stream, _)) = &mut self.speaks else {
            return Ok(());
        };
        while !self.unwritten.is_empty() {
            match stream.write(&self.unwritten) {
                Ok(count) => drop(self.unwritten.drain(..count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) => return Err(error),
            }
        }
        match self.unwritten.len() > UNREAD_BYTES_MAX {
            true => Err(ErrorKind::TimedOut.into()),
            false => Ok(()),
        }
    }
}

fn read(stream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let mut buffer = [0; 1024];
    match stream.read(&mut buffer) {
        Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
        Ok(count) => Ok(buffer[..count].to_vec()),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
            Ok(Vec::new())
        }
        Err(error) => Err(error),
    }
}

/// What the system does not take now is kept by the socket.
fn taken(result: Result<(), Error>) -> io::Result<()> {
    match result {
        Ok(()) => Ok(()),
        Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => Ok(()),
        Err(error) => Err(io::Error::other(error)),
    }
}
