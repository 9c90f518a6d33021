//! Whether the reply reader of a client has been discovered yet.
//!
//! Pure. A client sends its request as soon as it has discovered the server. The server
//! discovers the client's reader a moment later, and a reply that it sends before is lost.
//! A request does not name the reader. So each new client of a process is assigned a matched
//! reader of that process that no other client has.

use crate::samples::gid::Gid;
use std::collections::BTreeMap;

/// Clients that are remembered; a forgotten client is assigned a reader again.
const CLIENTS_MAX: usize = 1024;

/// The readers of the clients that have sent requests.
#[derive(Debug, Default)]
pub(super) struct ClientReaders {
    /// `None`: it was not found in time, and is not waited for again.
    readers: BTreeMap<Gid, Option<Gid>>,
}

impl ClientReaders {
    /// Whether `client` has a reader; `matched` are the matched readers of its process.
    pub(super) fn has_reader(&mut self, client: Gid, matched: &[Gid]) -> bool {
        if self.readers.contains_key(&client) {
            return true;
        }
        let is_free = |reader: &&Gid| !self.readers.values().any(|taken| *taken == Some(**reader));
        let free = matched.iter().find(is_free).copied();
        if free.is_some() {
            self.remember(client, free);
        }
        free.is_some()
    }

    /// Its reader was not found in time: it may use a mapping that is not known here.
    pub(super) fn give_up(&mut self, client: Gid) {
        if !self.readers.contains_key(&client) {
            self.remember(client, None);
        }
    }

    fn remember(&mut self, client: Gid, reader: Option<Gid>) {
        if self.readers.len() >= CLIENTS_MAX {
            self.readers.pop_first();
        }
        self.readers.insert(client, reader);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Gid = Gid([1; 16]);
    const B: Gid = Gid([2; 16]);
    const R: Gid = Gid([8; 16]);
    const S: Gid = Gid([9; 16]);

    #[test]
    fn a_client_has_a_reader_when_its_process_has_one() {
        let mut client_readers = ClientReaders::default();
        assert!(!client_readers.has_reader(A, &[]));
        assert!(client_readers.has_reader(A, &[R]));
        // From then on the matched readers do not matter.
        assert!(client_readers.has_reader(A, &[]));
    }

    #[test]
    fn each_client_of_a_process_needs_a_reader_of_its_own() {
        let mut client_readers = ClientReaders::default();
        assert!(client_readers.has_reader(A, &[R]));
        assert!(!client_readers.has_reader(B, &[R]));
        assert!(client_readers.has_reader(B, &[R, S]));
    }

    #[test]
    fn a_reader_that_is_not_found_is_waited_for_once() {
        let mut client_readers = ClientReaders::default();
        client_readers.give_up(A);
        assert!(client_readers.has_reader(A, &[]));
        // It does not take the reader of another client.
        assert!(client_readers.has_reader(B, &[R]));
    }

    #[test]
    fn what_is_remembered_is_bounded() {
        let mut client_readers = ClientReaders::default();
        for index in 0..5_000_u32 {
            let mut client = A;
            client.0[..4].copy_from_slice(&index.to_be_bytes());
            client_readers.give_up(client);
        }
        assert_eq!(client_readers.readers.len(), CLIENTS_MAX);
    }
}
