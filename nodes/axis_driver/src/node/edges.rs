//! Hold requests by topic: only a change to true counts.

use runtime::Gid;
use std::collections::BTreeSet;

/// Who wishes a hold at present: one peer's wish does not hide another's.
#[derive(Debug, Default)]
pub(super) struct Edges {
    wishing: BTreeSet<Gid>,
}

/// Peers that are remembered; beyond them every wish counts.
const PEERS_MAX: usize = 256;

impl Edges {
    /// Takes what a peer says; true when it begins to wish.
    pub(super) fn rises(&mut self, peer: Gid, wishes: bool) -> bool {
        if !wishes {
            self.wishing.remove(&peer);
            return false;
        }
        let is_full = self.wishing.len() >= PEERS_MAX && !self.wishing.contains(&peer);
        is_full || self.wishing.insert(peer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wish_to_hold_is_an_edge_of_each_peer_by_itself() {
        let (first, second) = (Gid::default(), Gid([7; 16]));
        let mut edges = Edges::default();
        assert!(edges.rises(first, true));
        assert!(!edges.rises(first, true));
        assert!(edges.rises(second, true));
        assert!(!edges.rises(first, false));
        assert!(edges.rises(first, true));
    }
}
