//! Where a controller listens on a network, and what it speaks there.

use std::fmt;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::str::FromStr;

/// What a network port speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protocol {
    /// Bytes as they are.
    Tcp,
    /// A WebSocket on any path.
    WebSocket,
    /// A serial port behind a gateway of RFC 2217.
    Rfc2217,
}

impl Protocol {
    const NAMES: [(&'static str, Self); 3] =
        [("tcp", Self::Tcp), ("ws", Self::WebSocket), ("rfc2217", Self::Rfc2217)];
}

/// `tcp://127.0.0.1:7023`: an address of this host and a protocol; port 0 is any free one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Listen {
    /// What it speaks.
    pub protocol: Protocol,
    /// Where.
    pub address: SocketAddr,
}

impl Listen {
    /// Begins to listen; the address has its true port number then.
    pub(super) fn bind(self) -> io::Result<(Self, TcpListener)> {
        let listener = TcpListener::bind(self.address)?;
        listener.set_nonblocking(true)?;
        Ok((Self { address: listener.local_addr()?, ..self }, listener))
    }
}

impl FromStr for Listen {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "write tcp://127.0.0.1:7023, ws://127.0.0.1:7081 or rfc2217://127.0.0.1:7217";
        let (scheme, rest) =
            text.split_once("://").ok_or_else(|| format!("`{text}` is not a URL; {form}"))?;
        let protocol = Protocol::NAMES
            .into_iter()
            .find_map(|(name, protocol)| (name == scheme).then_some(protocol))
            .ok_or_else(|| format!("`{scheme}://` is not served; {form}"))?;
        let address = rest.trim_end_matches('/').parse().map_err(|_| {
            format!("`{rest}` is not an address of this host with a port number; {form}")
        })?;
        Ok(Self { protocol, address })
    }
}

impl fmt::Display for Listen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Protocol::NAMES.iter().find(|(_, protocol)| *protocol == self.protocol);
        write!(f, "{}://{}", name.expect("each has a name").0, self.address)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_read_and_written_alike() {
        for text in ["tcp://127.0.0.1:7023", "ws://[::1]:0", "rfc2217://0.0.0.0:4000"] {
            assert_eq!(text.parse::<Listen>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn what_cannot_be_listened_on_is_refused_with_what_to_write() {
        for (text, wanted) in [
            ("127.0.0.1:7023", "is not a URL"),
            ("wss://127.0.0.1:7023", "is not served"),
            ("tcp://localhost:7023", "is not an address"),
            ("tcp://127.0.0.1", "is not an address"),
            ("tcp://127.0.0.1:70000", "is not an address"),
        ] {
            let error = text.parse::<Listen>().unwrap_err();
            assert!(error.contains(wanted) && error.contains("tcp://127.0.0.1:7023"), "{error}");
        }
    }
}
