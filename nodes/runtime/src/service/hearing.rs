//! Whether a client can hear its answer yet.
//!
//! Pure: readers that are matched in, yes or no out. A client asks as soon as it has
//! found the server; the server finds the client's reader a moment later, and what it
//! sends before is lost. A request does not name the reader, so that each new client
//! of a process takes one of those that no other client of it has taken.

use crate::wire::Gid;
use std::collections::BTreeMap;

/// Clients that are remembered; one that is forgotten takes its reader anew.
const CLIENTS_MAX: usize = 1024;

/// The readers of the clients that have asked.
#[derive(Debug, Default)]
pub(super) struct Hearing {
    /// `None`: it was waited for in vain, and is not waited for again.
    readers: BTreeMap<Gid, Option<Gid>>,
}

impl Hearing {
    /// Whether `client` can hear, where `matched` are the readers of its process.
    pub(super) fn can_hear(&mut self, client: Gid, matched: &[Gid]) -> bool {
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

    /// Its reader was not found in time: it may ask in another way than is known here.
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
    fn a_client_hears_when_its_process_has_a_reader() {
        let mut hearing = Hearing::default();
        assert!(!hearing.can_hear(A, &[]));
        assert!(hearing.can_hear(A, &[R]));
        // From then on, whatever comes and goes.
        assert!(hearing.can_hear(A, &[]));
    }

    #[test]
    fn each_client_of_a_process_needs_a_reader_of_its_own() {
        let mut hearing = Hearing::default();
        assert!(hearing.can_hear(A, &[R]));
        assert!(!hearing.can_hear(B, &[R]));
        assert!(hearing.can_hear(B, &[R, S]));
    }

    #[test]
    fn one_that_is_not_found_is_waited_for_once() {
        let mut hearing = Hearing::default();
        hearing.give_up(A);
        assert!(hearing.can_hear(A, &[]));
        // It keeps nobody's place.
        assert!(hearing.can_hear(B, &[R]));
    }

    #[test]
    fn what_is_remembered_is_bounded() {
        let mut hearing = Hearing::default();
        for index in 0..5_000_u32 {
            let mut client = A;
            client.0[..4].copy_from_slice(&index.to_be_bytes());
            hearing.give_up(client);
        }
        assert_eq!(hearing.readers.len(), CLIENTS_MAX);
    }
}
