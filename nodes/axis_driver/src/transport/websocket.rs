//! A WebSocket to the board, as FluidNC and grblHAL serve one to browsers and senders.
//!
//! Everything goes out in binary frames: text has to be UTF-8, and real-time bytes from 0x80 on
//! are none. It is asked for as `arduino`, for which both answer in binary frames too; a
//! server that knows no such protocol is asked again without it.

use super::Transport;
use super::socket::{Heard, PATIENCE, abandon, connect};
use crate::address::Host;
use rustix::fd::{AsFd, BorrowedFd};
use std::io::ErrorKind;
use std::net::TcpStream;
use tungstenite::error::{ProtocolError, SubProtocolError};
use tungstenite::handshake::HandshakeError;
use tungstenite::handshake::client::ClientHandshake;
use tungstenite::http::Uri;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{ClientRequestBuilder, Error, Message, WebSocket};

/// The protocol for which grblHAL and FluidNC use binary frames.
const PROTOCOL: &str = "arduino";
/// No report is longer, and no more waits to be written.
const MESSAGE_BYTES_MAX: usize = 64 * 1024;
/// After so many bytes the driver has its turn before more is read.
const READ_BYTES_MAX: usize = 64 * 1024;
/// And after so many messages, which may have no bytes.
const READ_MESSAGES_MAX: usize = 256;
/// What FluidNC sends to its web interface in frames of their own, with what may follow.
const NOTICES: [&str; 6] =
    ["currentID:", "CURRENT_ID:", "activeID:", "ACTIVE_ID:", "PING", "ERROR:"];

/// A connection that is open. Dropping it closes it.
#[derive(Debug)]
pub(super) struct Ws {
    socket: WebSocket<TcpStream>,
    heard: Heard,
    has_unwritten: bool,
    has_unread: bool,
    /// Why it has ended; reported after everything before it was read.
    end: Option<String>,
}

impl Ws {
    /// Connects and shakes hands. The error is for people.
    pub(super) fn open(host: &Host, path: &str) -> Result<Self, String> {
        let socket = match shake_hands(host, path, Some(PROTOCOL)) {
            Err(Refusal::Protocol) => shake_hands(host, path, None),
            other => other,
        };
        let socket = socket.map_err(|refusal| match refusal {
            Refusal::Protocol => "the server names a protocol that nobody asked for".into(),
            Refusal::Other(text) => text,
        })?;
        socket.get_ref().set_nonblocking(true).map_err(|error| error.to_string())?;
        let heard = Heard::default();
        Ok(Self { socket, heard, has_unwritten: false, has_unread: false, end: None })
    }

    /// Keeps the reason of the end; what the system does not take now is no end.
    fn settle(&mut self, result: Result<(), Error>) -> Result<(), String> {
        self.has_unwritten = match result {
            Ok(()) => false,
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => true,
            Err(Error::WriteBufferFull(_)) => {
                return Err(
                    "the connection takes no more bytes: the controller does not read".into()
                );
            }
            Err(error) => return Err(self.reason(&error)),
        };
        Ok(())
    }

    fn reason(&self, error: &Error) -> String {
        match error {
            Error::ConnectionClosed
            | Error::AlreadyClosed
            | Error::Protocol(ProtocolError::ResetWithoutClosingHandshake) => self.heard.closed(),
            Error::Io(error) => self.heard.lost(error),
            error => self.heard.end(&format!("the WebSocket is damaged: {error}")),
        }
    }
}

/// Why hands were not shaken.
enum Refusal {
    /// The server does not know the protocol that was named, or names one.
    Protocol,
    Other(String),
}

fn shake_hands(
    host: &Host,
    path: &str,
    protocol: Option<&str>,
) -> Result<WebSocket<TcpStream>, Refusal> {
    let stream = connect(host).map_err(Refusal::Other)?;
    let other = |error: &dyn std::fmt::Display| Refusal::Other(error.to_string());
    stream
        .set_read_timeout(Some(PATIENCE))
        .and_then(|()| stream.set_write_timeout(Some(PATIENCE)))
        .map_err(|error| other(&error))?;
    let uri: Uri = format!("ws://{host}{path}").parse().map_err(|error| other(&error))?;
    let mut request = ClientRequestBuilder::new(uri);
    if let Some(protocol) = protocol {
        request = request.with_sub_protocol(protocol);
    }
    let config = WebSocketConfig::default()
        .write_buffer_size(0)
        .max_write_buffer_size(MESSAGE_BYTES_MAX)
        .max_message_size(Some(MESSAGE_BYTES_MAX))
        .max_frame_size(Some(MESSAGE_BYTES_MAX));
    let socket = tungstenite::client::client_with_config(request, stream, Some(config));
    socket.map(|(socket, _)| socket).map_err(refusal)
}

/// Says what answered in place of a WebSocket.
fn refusal(error: HandshakeError<ClientHandshake<TcpStream>>) -> Refusal {
    let error = match error {
        HandshakeError::Interrupted(_) => {
            let s = PATIENCE.as_secs();
            return Refusal::Other(format!(
                "the port is open and no WebSocket answered within {s} s; check the port number, or \
                 write tcp://"
            ));
        }
        HandshakeError::Failure(error) => error,
    };
    Refusal::Other(match error {
        Error::Protocol(ProtocolError::SecWebSocketSubProtocolError(
            SubProtocolError::NoSubProtocol
            | SubProtocolError::InvalidSubProtocol
            | SubProtocolError::ServerSentSubProtocolNoneRequested,
        )) => return Refusal::Protocol,
        Error::Http(answer) => format!(
            "the web server there answered {} and no WebSocket; check port number and path",
            answer.status()
        ),
        Error::Protocol(ProtocolError::WrongHttpVersion) => {
            "the web server there speaks HTTP/1.0, which has no WebSocket: it is not the controller's; check the \
             port number"
                .into()
        }
        Error::Protocol(ProtocolError::HttparseError(error)) => format!(
            "what answers there is no WebSocket ({error}): it may speak TLS, or be a Telnet port, which is \
             written tcp://"
        ),
        Error::Io(error) => Heard::default().lost(&error),
        error => format!("no WebSocket: {error}"),
    })
}

/// Whether a text is for the web interface of FluidNC and nothing of the controller's lines.
fn is_notice(text: &str) -> bool {
    let is_rest =
        |rest: &str| rest.trim_end().bytes().all(|byte| byte.is_ascii_digit() || byte == b':');
    NOTICES.iter().any(|notice| text.strip_prefix(notice).is_some_and(is_rest))
}

impl Transport for Ws {
    fn read(&mut self) -> Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        let mut messages: usize = 0;
        self.has_unread = false;
        while self.end.is_none() {
            match self.socket.read() {
                Ok(Message::Binary(data)) => bytes.extend_from_slice(&data),
                Ok(Message::Text(text)) if !is_notice(&text) => {
                    bytes.extend_from_slice(text.as_bytes());
                }
                Ok(Message::Close(_)) => self.end = Some(self.heard.closed()),
                // Pings are answered below.
                Ok(_) => {}
                Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => break,
                Err(Error::Io(error)) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => self.end = Some(self.reason(&error)),
            }
            messages += 1;
            if bytes.len() >= READ_BYTES_MAX || messages >= READ_MESSAGES_MAX {
                self.has_unread = true;
                break;
            }
        }
        if bytes.is_empty()
            && let Some(end) = &self.end
        {
            return Err(end.clone());
        }
        self.heard.take(&bytes)?;
        if self.end.is_none() {
            let flushed = self.socket.flush();
            if let Err(end) = self.settle(flushed) {
                // What was read goes first.
                self.end = Some(end);
            }
        }
        Ok(bytes)
    }

    fn write(&mut self, bytes: Vec<u8>) -> Result<(), String> {
        let written = self.socket.write(Message::binary(bytes));
        self.settle(written)?;
        self.flush()
    }

    fn has_unwritten(&self) -> bool {
        self.has_unwritten
    }

    fn has_unread(&self) -> bool {
        self.has_unread || self.end.is_some()
    }

    fn flush(&mut self) -> Result<(), String> {
        let flushed = self.socket.flush();
        self.settle(flushed)
    }

    fn abandon(&mut self) {
        abandon(self.socket.get_ref());
    }
}

impl AsFd for Ws {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.get_ref().as_fd()
    }
}

impl Drop for Ws {
    fn drop(&mut self) {
        // A word of goodbye, if the system takes it now.
        let _ = self.socket.close(None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_web_server_without_websockets_is_named() {
        let old = Error::Protocol(ProtocolError::WrongHttpVersion);
        match refusal(HandshakeError::Failure(old)) {
            Refusal::Other(text) => {
                assert!(text.contains("web server") && text.contains("port number"))
            }
            Refusal::Protocol => panic!("no protocol was named"),
        }
    }

    #[test]
    fn what_fluidnc_says_to_its_web_interface_is_no_line_of_the_controller() {
        let rows = [
            ("currentID:0", true),
            ("CURRENT_ID:12", true),
            ("ACTIVE_ID:3\r\n", true),
            ("PING\n", true),
            ("PING:60000:60000", true),
            ("ERROR:1", true),
            // grblHAL sends its lines as text where it is not asked for binary frames.
            ("ok\r\n", false),
            ("<Idle|MPos:0.000,0.000,0.000|FS:0,0>\r\n", false),
            ("error:20\r\n", false),
            ("[MSG:PING]\r\n", false),
            ("PINGED", false),
            ("", false),
        ];
        for (text, is) in rows {
            assert_eq!(is_notice(text), is, "{text:?}");
        }
    }

    /// Serves one connection after the other, in frames of text, and knows no protocol by name.
    #[test]
    fn a_server_that_knows_no_protocol_by_name_is_asked_again_without_one() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let server = std::thread::spawn(move || {
            let mut heard = Vec::new();
            for stream in listener.incoming() {
                let Ok(mut socket) = tungstenite::accept(stream.unwrap()) else { continue };
                let frames = [
                    Message::text("CURRENT_ID:0"),
                    Message::Ping("Hi".into()),
                    Message::text("ok\r\n"),
                ];
                // The first connection is given up.
                if frames.into_iter().any(|frame| socket.send(frame).is_err()) {
                    continue;
                }
                while let Ok(message) = socket.read() {
                    heard.push(message);
                    if heard.len() == 2 {
                        return heard;
                    }
                }
                heard.clear();
            }
            heard
        });
        let mut ws = Ws::open(&Host { name: "127.0.0.1".into(), port }, "/").unwrap();
        let mut bytes = Vec::new();
        while bytes != b"ok\r\n" {
            bytes.extend(ws.read().unwrap());
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        ws.write(vec![0x91, b'!']).unwrap();
        let heard = server.join().unwrap();
        assert_eq!(heard, [Message::Pong("Hi".into()), Message::binary(vec![0x91, b'!'])]);
    }
}
