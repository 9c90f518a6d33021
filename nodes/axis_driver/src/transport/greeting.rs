//! Distinguishes a controller from other services on a network port by its first bytes.

/// The bytes of a greeting that are looked at.
pub(super) const GREETING_BYTES: usize = 5;

/// What speaks there, where it can be no controller; the text is for people.
///
/// `first` are the first bytes that came, at most [`GREETING_BYTES`].
pub(super) fn foreign(first: &[u8]) -> Option<&'static str> {
    match first {
        // Some answer with a page and no head what they cannot read.
        [b'H', b'T', b'T', b'P', b'/', ..] | b"<!DOC" | b"<html" | b"<HTML" => Some(
            "a web server answers there, not a controller; check the port number, or write ws://",
        ),
        // Records of handshakes and of alerts; no controller begins with such a byte.
        [0x15 | 0x16, 0x03, 0..=4, ..] => Some(
            "that port speaks TLS, which the driver does not; use the plain port of the controller",
        ),
        [b'S', b'S', b'H', b'-', ..] => Some("an SSH server answers there, not a controller"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn web_servers_tls_and_ssh_are_recognised_and_controllers_are_not() {
        let rows: [(&[u8], Option<&str>); 12] = [
            (b"HTTP/", Some("ws://")),
            (b"<!DOC", Some("web server")),
            (b"<html", Some("web server")),
            (b"\x15\x03\x03\x00\x02", Some("TLS")),
            (b"\x16\x03\x01\x02\x00", Some("TLS")),
            (b"SSH-2", Some("SSH")),
            (b"", None),
            (b"HTT", None),
            (b"\r\nGrb", None),
            (b"<Idle", None),
            (b"ok\r\n", None),
            (b"\x15\x20\x03\x00\x02", None),
        ];
        for (first, wanted) in rows {
            let found = foreign(first);
            assert_eq!(found.is_some(), wanted.is_some(), "{first:?}");
            assert!(found.unwrap_or_default().contains(wanted.unwrap_or_default()), "{found:?}");
        }
    }
}
