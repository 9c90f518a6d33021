//! The graph: which endpoints there are, and which exchange samples with ours.
//!
//! Pure. Endpoints are matched when their name, type and type hash are the same. An endpoint of the
//! same name with another definition is reported, once.

use crate::samples::gid::Gid;
use crate::zenoh::names::{Kind, Token, Topic, wire_gid};
use std::collections::{BTreeMap, BTreeSet};

/// Entities of others that are remembered. A cell has some hundreds; any peer may announce millions.
const REMOTE_MAX: usize = 20_000;
/// Endpoints with other definitions that are reported.
const REPORTED_MAX: usize = 100;

/// The entities of a domain.
#[derive(Debug)]
pub(crate) struct Table {
    /// The session of this process.
    zid: String,
    locals: Vec<Token>,
    /// By the text of their tokens.
    remotes: BTreeMap<String, Token>,
    /// Addresses here by those that travel.
    gids: BTreeMap<[u8; 16], Gid>,
    /// Our endpoint and the other, by which a difference was reported.
    reported: BTreeSet<(Gid, Gid)>,
}

/// What follows from a new entity.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Arrival {
    /// Endpoints of ours, and those that they exchange samples with now.
    pub(crate) matched: Vec<(Gid, Gid)>,
    /// Sentences about endpoints that they do not reach, though they have the name.
    pub(crate) differences: Vec<String>,
}

impl Table {
    pub(crate) fn new(zid: &str) -> Self {
        Self {
            zid: zid.to_owned(),
            locals: Vec::new(),
            remotes: BTreeMap::new(),
            gids: BTreeMap::new(),
            reported: BTreeSet::new(),
        }
    }

    /// An entity of this process.
    pub(crate) fn add_local(&mut self, token: Token) -> Arrival {
        let mut arrival = Arrival::default();
        for other in &self.locals {
            if fits(&token, other) {
                arrival.matched.extend([(token.gid(), other.gid()), (other.gid(), token.gid())]);
            }
        }
        for remote in self.remotes.values() {
            meet(&token, remote, &mut self.reported, &mut arrival);
        }
        self.gids.insert(wire_gid(&token.text()), token.gid());
        self.locals.push(token);
        arrival
    }

    /// An entity of this process has gone.
    pub(crate) fn remove_local(&mut self, gid: Gid) {
        self.locals.retain(|token| token.gid() != gid);
        self.gids.retain(|_, known| *known != gid);
    }

    /// The token of another process has arrived; none for what is no token, is ours or is known.
    pub(crate) fn arrived(&mut self, text: &str) -> Option<Arrival> {
        let token = Token::parse(text)?;
        if token.zid == self.zid
            || self.remotes.contains_key(text)
            || self.remotes.len() >= REMOTE_MAX
        {
            return None;
        }
        let mut arrival = Arrival::default();
        for local in &self.locals {
            meet(local, &token, &mut self.reported, &mut arrival);
        }
        self.gids.insert(wire_gid(text), token.gid());
        self.remotes.insert(text.to_owned(), token);
        Some(arrival)
    }

    /// The token of another process has gone; returns whose it was. None as long as another token
    /// announces the same endpoint: any peer can announce that of another, and take it back.
    pub(crate) fn left(&mut self, text: &str) -> Option<Gid> {
        let gid = self.remotes.remove(text)?.gid();
        self.gids.remove(&wire_gid(text));
        self.remotes.values().all(|token| token.gid() != gid).then_some(gid)
    }

    /// The address here of an endpoint that is known; that which travels, of any other.
    pub(crate) fn gid_of(&self, wire_gid: [u8; 16]) -> Gid {
        self.gids.get(&wire_gid).copied().unwrap_or(Gid(wire_gid))
    }

    /// The publishers of other processes.
    pub(crate) fn publishers(&self) -> Vec<(Topic, Gid)> {
        let publishers = self.remotes.values().filter(|token| token.kind == Kind::Publisher);
        publishers.filter_map(|token| Some((token.topic.clone()?, token.gid()))).collect()
    }

    /// The hash of a type as the endpoints of others announce it, those of this topic before others.
    pub(crate) fn type_hash(&self, topic: &str, type_name: &str) -> Option<&str> {
        let topics = self.remotes.values().filter_map(|token| token.topic.as_ref());
        let of_type = topics.filter(|known| known.type_name == type_name);
        let found = of_type.max_by_key(|known| known.name == topic)?;
        Some(&found.type_hash)
    }
}

/// Whether two endpoints exchange samples.
fn fits(one: &Token, other: &Token) -> bool {
    let key =
        |topic: &Topic| (topic.name.clone(), topic.type_name.clone(), topic.type_hash.clone());
    one.kind.counterpart() == Some(other.kind)
        && one.topic.as_ref().map(key) == other.topic.as_ref().map(key)
}

fn meet(local: &Token, remote: &Token, reported: &mut BTreeSet<(Gid, Gid)>, arrival: &mut Arrival) {
    if fits(local, remote) {
        arrival.matched.push((local.gid(), remote.gid()));
    } else if let Some(difference) = difference(local, remote)
        && reported.len() < REPORTED_MAX
        && reported.insert((local.gid(), remote.gid()))
    {
        arrival.differences.push(difference);
    }
}

/// Why two endpoints of the same name do not reach each other.
fn difference(local: &Token, remote: &Token) -> Option<String> {
    let (ours, theirs) = (local.topic.as_ref()?, remote.topic.as_ref()?);
    if local.kind.counterpart() != Some(remote.kind) || ours.name != theirs.name {
        return None;
    }
    let what = match local.kind {
        Kind::Publisher => "does not get the messages of this node",
        Kind::Subscription => "sends messages that this node does not get",
        Kind::Server => "cannot call this service",
        _ => "offers a service that this node cannot call",
    };
    let node = remote.node_name();
    Some(if ours.type_name == theirs.type_name {
        format!(
            "{}: {node} {what}: its definition of {} is another one ({} there, {} here); build both \
             from the same definitions",
            ours.name, ours.type_name, theirs.type_hash, ours.type_hash
        )
    } else {
        format!(
            "{}: {node} {what}: its type is {}, and {} here",
            ours.name, theirs.type_name, ours.type_name
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::qos::Qos;

    fn token(zid: &str, id: u32, kind: Kind, type_name: &str, type_hash: &str) -> Token {
        let topic = Topic {
            name: "/mill/state".into(),
            type_name: type_name.into(),
            type_hash: type_hash.into(),
            qos: Qos::DEFAULT.into(),
        };
        Token {
            domain_id: 0,
            zid: zid.into(),
            node_id: 0,
            id,
            kind,
            enclave: "/".into(),
            namespace: "/mill".into(),
            node: "driver".into(),
            topic: Some(topic),
        }
    }

    const STATE: &str = "cnc_msgs/msg/MachineState";

    #[test]
    fn endpoints_meet_whoever_comes_first_and_part() {
        let ours = token("1", 1, Kind::Publisher, STATE, "RIHS01_a");
        let theirs = token("2", 1, Kind::Subscription, STATE, "RIHS01_a");
        let pair = vec![(ours.gid(), theirs.gid())];
        let mut table = Table::new("1");
        assert_eq!(table.add_local(ours.clone()), Arrival::default());
        assert_eq!(table.arrived(&theirs.text()).expect("new").matched, pair);
        // The history and the announcement may both announce it.
        assert_eq!(table.arrived(&theirs.text()), None);
        assert_eq!(table.left(&theirs.text()), Some(theirs.gid()));
        assert_eq!(table.left(&theirs.text()), None);

        let mut table = Table::new("1");
        assert_eq!(table.arrived(&theirs.text()), Some(Arrival::default()));
        assert_eq!(table.add_local(ours).matched, pair);
    }

    #[test]
    fn endpoints_of_this_process_meet_too_and_are_not_taken_from_the_network() {
        let publisher = token("1", 1, Kind::Publisher, STATE, "RIHS01_a");
        let subscription = token("1", 2, Kind::Subscription, STATE, "RIHS01_a");
        let mut table = Table::new("1");
        table.add_local(publisher.clone());
        let (one, other) = (publisher.gid(), subscription.gid());
        assert_eq!(table.add_local(subscription.clone()).matched, [(other, one), (one, other)]);
        assert_eq!(table.arrived(&subscription.text()), None);
        table.remove_local(one);
        assert_eq!(table.add_local(subscription), Arrival::default());
    }

    #[test]
    fn another_definition_does_not_meet_and_is_reported_once() {
        let mut table = Table::new("1");
        table.add_local(token("1", 1, Kind::Publisher, STATE, "RIHS01_a"));
        let other = token("2", 1, Kind::Subscription, STATE, "RIHS01_b");
        let arrival = table.arrived(&other.text()).expect("new");
        assert!(arrival.matched.is_empty());
        let [difference] = &arrival.differences[..] else { panic!("{arrival:?}") };
        for part in ["/mill/state", "/mill/driver", STATE, "RIHS01_b there", "RIHS01_a here"] {
            assert!(difference.contains(part), "{difference}");
        }
        table.left(&other.text());
        assert!(table.arrived(&other.text()).expect("again").differences.is_empty());
        let text = token("2", 2, Kind::Subscription, "std_msgs/msg/Bool", "RIHS01_a").text();
        let arrival = table.arrived(&text).expect("new");
        assert!(arrival.differences[0].contains("its type is std_msgs/msg/Bool"), "{arrival:?}");
        // Two publishers have nothing to say to each other.
        let text = token("2", 3, Kind::Publisher, STATE, "RIHS01_b").text();
        assert_eq!(table.arrived(&text), Some(Arrival::default()));
    }

    #[test]
    fn a_sender_is_known_by_its_process_once_its_token_is() {
        let mut table = Table::new("1");
        let theirs = token("2", 7, Kind::Publisher, STATE, "RIHS01_a");
        let wire = wire_gid(&theirs.text());
        assert_eq!(table.gid_of(wire), Gid(wire));
        table.arrived(&theirs.text());
        assert_eq!(table.gid_of(wire), theirs.gid());
        assert_eq!(table.publishers().len(), 1);
        assert_eq!(table.type_hash("/state", STATE), Some("RIHS01_a"));
        assert_eq!(table.type_hash("/state", "std_msgs/msg/Bool"), None);
        table.left(&theirs.text());
        assert_eq!(table.gid_of(wire), Gid(wire));
        assert!(table.publishers().is_empty());
    }

    #[test]
    fn what_is_remembered_is_bounded() {
        let mut table = Table::new("1");
        table.add_local(token("1", 1, Kind::Publisher, STATE, "RIHS01_a"));
        let mut differences = 0;
        for id in 0..REMOTE_MAX as u32 + 10 {
            let text = token("2", id, Kind::Subscription, STATE, "RIHS01_b").text();
            differences += table.arrived(&text).map_or(0, |arrival| arrival.differences.len());
        }
        assert_eq!((table.remotes.len(), differences), (REMOTE_MAX, REPORTED_MAX));
    }
}
