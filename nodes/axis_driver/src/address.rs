//! What the parameter `port` names: a device file, or a URL for each other cable.

/// The port that Telnet has.
const TELNET_PORT: u16 = 23;
/// The port that HTTP has.
const HTTP_PORT: u16 = 80;
/// The forms that are understood, for messages.
const FORMS: &str = "write a device such as /dev/ttyUSB0, tcp://HOST[:23], ws://HOST[:80][/PATH] or \
                     rfc2217://HOST:PORT";

/// A cable and what is at its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// A device file.
    Serial { path: String },
    /// Bytes as they are, or Telnet that negotiates nothing.
    Tcp(Host),
    /// A WebSocket; the path begins with a slash.
    WebSocket { host: Host, path: String },
    /// A serial port at the end of a network: Telnet with the option COM-PORT.
    Rfc2217(Host),
}

/// A host and a port number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Host {
    /// A name or an address; an IPv6 address without its brackets.
    pub name: String,
    pub port: u16,
}

impl std::fmt::Display for Host {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.name.contains(':') {
            true => write!(f, "[{}]:{}", self.name, self.port),
            false => write!(f, "{}:{}", self.name, self.port),
        }
    }
}

/// Whether the bytes travel over a network all the way to the board, and over no serial line.
pub fn is_networked(port: &str) -> bool {
    matches!(Address::parse(port), Ok(Address::Tcp(_) | Address::WebSocket { .. }))
}

impl Address {
    /// Reads the parameter. The error is for people, and does not repeat the text.
    pub fn parse(text: &str) -> Result<Self, String> {
        let Some((scheme, rest)) = text.split_once("://") else {
            return match text.is_empty() {
                true => Err(format!("no port is set; {FORMS}")),
                false => Ok(Self::Serial { path: text.to_owned() }),
            };
        };
        let (authority, path) = match rest.find('/') {
            Some(at) => rest.split_at(at),
            None => (rest, ""),
        };
        let bare = |address: Self| match path {
            "" | "/" => Ok(address),
            path => Err(format!("{scheme}:// takes no path, and {path:?} is one; {FORMS}")),
        };
        match scheme.to_ascii_lowercase().as_str() {
            "tcp" => bare(Self::Tcp(host(authority, Some(TELNET_PORT))?)),
            "rfc2217" => bare(Self::Rfc2217(host(authority, None)?)),
            "ws" => {
                let is_usable = path.bytes().all(|byte| byte.is_ascii_graphic() && byte != b'#');
                if !is_usable {
                    return Err(format!("the path {path:?} holds a blank, a # or no ASCII"));
                }
                let path = if path.is_empty() { "/" } else { path };
                Ok(Self::WebSocket { host: host(authority, Some(HTTP_PORT))?, path: path.into() })
            }
            "wss" | "https" => Err(no_tls(scheme, "ws://", "/PATH")),
            "tls" | "ssl" | "tcps" => Err(no_tls(scheme, "tcp://", "")),
            "telnet" => Err("telnet:// is written tcp:// here".into()),
            "http" => Err("http:// is no cable; a WebSocket is written ws://".into()),
            _ => Err(format!("{scheme}:// is not known; {FORMS}")),
        }
    }
}

/// What to do where a board or a gateway insists on encryption.
fn no_tls(scheme: &str, plain: &str, path: &str) -> String {
    format!(
        "{scheme}:// is encrypted, and the driver speaks no TLS: write {plain} and the plain port on a network of \
         the machine's own, or {plain}127.0.0.1:PORT{path} of a TLS tunnel that runs here (stunnel)"
    )
}

/// `HOST:PORT`, `[IPV6]:PORT`; without a port the default, where there is one.
fn host(text: &str, default: Option<u16>) -> Result<Host, String> {
    let (name, port) = match text.strip_prefix('[') {
        Some(rest) => {
            let (name, after) = rest
                .split_once(']')
                .ok_or_else(|| format!("{text:?} has a bracket that is not closed"))?;
            let is_address =
                name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b":.%".contains(&byte));
            if !is_address || !name.contains(':') {
                return Err(format!("{name:?} in brackets is not an IPv6 address"));
            }
            match (after, after.strip_prefix(':')) {
                ("", _) => (name, None),
                (_, Some(port)) => (name, Some(port)),
                (_, None) => return Err(format!("{after:?} after the bracket is not a port")),
            }
        }
        None => match text.split_once(':') {
            Some((_, port)) if port.contains(':') => {
                return Err(format!("write the IPv6 address {text:?} in brackets: [::1]:23"));
            }
            Some((name, port)) => (name, Some(port)),
            None => (text, None),
        },
    };
    if name.is_empty() {
        return Err(format!("the host is missing; {FORMS}"));
    }
    let is_name = |byte: u8| byte.is_ascii_alphanumeric() || b"-._:%".contains(&byte);
    if !name.bytes().all(is_name) || name.len() > 253 {
        return Err(format!("{name:?} is not the name of a host"));
    }
    let port = match (port, default) {
        (Some(port), _) => port
            .parse()
            .ok()
            .filter(|port| *port > 0)
            .ok_or_else(|| format!("{port:?} is not a port number from 1 to 65535"))?,
        (None, Some(port)) => port,
        (None, None) => return Err(format!("the port number of {name} is missing; {FORMS}")),
    };
    Ok(Host { name: name.to_owned(), port })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn to(name: &str, port: u16) -> Host {
        Host { name: name.into(), port }
    }

    #[test]
    fn a_port_is_a_device_or_a_url() {
        let rows = [
            ("/dev/ttyUSB0", Address::Serial { path: "/dev/ttyUSB0".into() }),
            ("/tmp/a:1", Address::Serial { path: "/tmp/a:1".into() }),
            ("tcp://mill", Address::Tcp(to("mill", 23))),
            ("TCP://10.0.0.7:2300/", Address::Tcp(to("10.0.0.7", 2300))),
            ("tcp://[fe80::1%eth0]:23", Address::Tcp(to("fe80::1%eth0", 23))),
            ("tcp://[::1]", Address::Tcp(to("::1", 23))),
            (
                "ws://mill.local",
                Address::WebSocket { host: to("mill.local", 80), path: "/".into() },
            ),
            ("ws://m:81/ws?a=1", Address::WebSocket { host: to("m", 81), path: "/ws?a=1".into() }),
            ("rfc2217://gate:4000", Address::Rfc2217(to("gate", 4000))),
        ];
        for (text, address) in rows {
            assert_eq!(Address::parse(text), Ok(address), "{text}");
        }
        assert_eq!(to("::1", 23).to_string(), "[::1]:23");
    }

    #[test]
    fn what_is_no_port_is_refused_with_what_to_write() {
        let rows = [
            ("", "no port is set; write a device"),
            ("tcp://", "the host is missing"),
            ("tcp://:23", "the host is missing"),
            ("tcp://mill:0", "\"0\" is not a port number from 1 to 65535"),
            ("tcp://mill:65536", "\"65536\" is not a port number"),
            ("tcp://mill:", "\"\" is not a port number"),
            ("tcp://user@mill:23", "\"user@mill\" is not the name of a host"),
            ("tcp://mill/port", "tcp:// takes no path, and \"/port\" is one"),
            ("tcp://fe80::1:23", "in brackets"),
            ("tcp://[fe80::1", "a bracket that is not closed"),
            ("tcp://[mill]:23", "is not an IPv6 address"),
            ("tcp://[::1]23", "\"23\" after the bracket is not a port"),
            ("rfc2217://gate", "the port number of gate is missing"),
            ("ws://mill/a b", "holds a blank"),
            (
                "wss://mill",
                "wss:// is encrypted, and the driver speaks no TLS: write ws:// and the plain port",
            ),
            (
                "WSS://mill/ws",
                "or ws://127.0.0.1:PORT/PATH of a TLS tunnel that runs here (stunnel)",
            ),
            ("https://mill", "write ws://"),
            ("tls://mill:23", "or tcp://127.0.0.1:PORT of a TLS tunnel"),
            ("ssl://mill:23", "the driver speaks no TLS: write tcp://"),
            ("http://mill", "written ws://"),
            ("telnet://mill", "written tcp://"),
            ("udp://mill:23", "udp:// is not known; write a device"),
        ];
        for (text, wanted) in rows {
            let error = Address::parse(text).unwrap_err();
            assert!(error.contains(wanted), "{text}: {error}");
        }
    }

    #[test]
    fn only_a_cable_without_a_serial_line_is_a_network() {
        for (text, is) in [
            ("/dev/ttyUSB0", false),
            ("tcp://mill", true),
            ("ws://mill", true),
            ("rfc2217://gate:4000", false),
            ("wss://mill", false),
        ] {
            assert_eq!(is_networked(text), is, "{text}");
        }
    }
}
