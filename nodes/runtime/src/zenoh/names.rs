//! Key expressions and liveliness tokens, as rmw_zenoh_cpp writes them.
//!
//! Pure. A topic or service is a key of domain, name, type and type hash: endpoints whose definitions
//! differ have different keys, and nothing passes between them. A token announces a node or an
//! endpoint, and its text is all that is known of it.

use crate::samples::gid::Gid;
use crate::samples::qos::Qos;
use crate::samples::type_names::{dds_type, ros_type};
use xxhash_rust::xxh3::xxh3_128;

/// The depth that a token leaves out.
const DEPTH_LEFT_OUT: usize = 42;

/// The key of a topic or service: what carries its samples or requests.
pub(crate) fn key(domain_id: u16, topic: &Topic) -> String {
    let name = topic.name.trim_matches('/');
    format!("{domain_id}/{name}/{}/{}", dds_type(&topic.type_name, ""), topic.type_hash)
}

/// All tokens of a domain.
pub(crate) fn all_tokens(domain_id: u16) -> String {
    format!("@ros2_lv/{domain_id}/**")
}

/// What a token announces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Node,
    Publisher,
    Subscription,
    Server,
    Client,
}

const KINDS: [(Kind, &str); 5] = [
    (Kind::Node, "NN"),
    (Kind::Publisher, "MP"),
    (Kind::Subscription, "MS"),
    (Kind::Server, "SS"),
    (Kind::Client, "SC"),
];

impl Kind {
    /// What it exchanges samples with.
    pub(crate) fn counterpart(self) -> Option<Self> {
        match self {
            Self::Node => None,
            Self::Publisher => Some(Self::Subscription),
            Self::Subscription => Some(Self::Publisher),
            Self::Server => Some(Self::Client),
            Self::Client => Some(Self::Server),
        }
    }
}

/// A topic or service, as an endpoint sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Topic {
    /// Absolute.
    pub(crate) name: String,
    /// `package/msg/Type`.
    pub(crate) type_name: String,
    /// `RIHS01_...`
    pub(crate) type_hash: String,
    pub(crate) qos: TokenQos,
}

/// The quality of service that a token announces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TokenQos {
    pub(crate) qos: Qos,
    /// In nanoseconds, if there is one.
    pub(crate) deadline_ns: Option<i64>,
    pub(crate) lifespan_ns: Option<i64>,
}

impl From<Qos> for TokenQos {
    fn from(qos: Qos) -> Self {
        Self { qos, deadline_ns: None, lifespan_ns: None }
    }
}

/// A node or an endpoint in the graph.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Token {
    pub(crate) domain_id: u16,
    /// The session, in hexadecimal digits.
    pub(crate) zid: String,
    /// The number of the node in its session, and of the entity.
    pub(crate) node_id: u32,
    pub(crate) id: u32,
    pub(crate) kind: Kind,
    /// `/` and names below it.
    pub(crate) enclave: String,
    pub(crate) namespace: String,
    pub(crate) node: String,
    /// None for a node.
    pub(crate) topic: Option<Topic>,
}

impl Token {
    /// The text that announces it.
    pub(crate) fn text(&self) -> String {
        let kind = KINDS.iter().find(|(kind, _)| *kind == self.kind).map_or("", |(_, text)| text);
        let mut text = format!(
            "@ros2_lv/{}/{}/{}/{}/{kind}/{}/{}/{}",
            self.domain_id,
            self.zid,
            self.node_id,
            self.id,
            mangled(&self.enclave),
            mangled(&self.namespace),
            self.node
        );
        if let Some(topic) = &self.topic {
            let kind = dds_type(&topic.type_name, "");
            let (name, qos) = (mangled(&topic.name), qos_text(topic.qos));
            text.push_str(&format!("/{name}/{kind}/{}/{qos}", topic.type_hash));
        }
        text
    }

    /// What a text announces; none for what is no token, or one of a later version.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split('/');
        let mut next = || parts.next().filter(|part| !part.is_empty());
        (next()? == "@ros2_lv").then_some(())?;
        let domain_id = next()?.parse().ok()?;
        let zid = next()?.to_owned();
        u128::from_str_radix(&zid, 16).ok()?;
        let (node_id, id) = (next()?.parse().ok()?, next()?.parse().ok()?);
        let kind = next()?;
        let (kind, _) = *KINDS.iter().find(|(_, text)| *text == kind)?;
        let (enclave, namespace) = (demangled(next()?), demangled(next()?));
        let node = next()?.to_owned();
        let topic = match kind {
            Kind::Node => None,
            _ => Some(Topic {
                name: demangled(next()?),
                type_name: ros_type(next()?),
                type_hash: next()?.to_owned(),
                qos: qos_of(next()?)?,
            }),
        };
        Some(Self { domain_id, zid, node_id, id, kind, enclave, namespace, node, topic })
    }

    /// The name of the node, with its namespace.
    pub(crate) fn node_name(&self) -> String {
        format!("{}/{}", self.namespace.trim_end_matches('/'), self.node)
    }

    /// The address here: the first twelve bytes are those of the session.
    pub(crate) fn gid(&self) -> Gid {
        let zid = u128::from_str_radix(&self.zid, 16).unwrap_or_default();
        gid_of(zid.to_le_bytes(), self.id)
    }
}

/// The address here of an entity of a session.
pub(crate) fn gid_of(zid: [u8; 16], id: u32) -> Gid {
    let mut gid = zid;
    gid[12..].copy_from_slice(&id.to_le_bytes());
    Gid(gid)
}

/// The address that travels with samples: a hash of the token.
pub(crate) fn wire_gid(token: &str) -> [u8; 16] {
    xxh3_128(token.as_bytes()).to_le_bytes()
}

fn mangled(name: &str) -> String {
    name.replace('/', "%")
}

fn demangled(name: &str) -> String {
    name.replace('%', "/")
}

/// What differs from the default of rmw_zenoh_cpp: reliable, volatile, the last 42.
fn qos_text(TokenQos { qos, deadline_ns, lifespan_ns }: TokenQos) -> String {
    let reliability = if qos.reliable { "" } else { "2" };
    let durability = if qos.transient_local { "1" } else { "" };
    let depth = match qos.depth {
        DEPTH_LEFT_OUT => String::new(),
        depth => depth.to_string(),
    };
    let time = |ns: Option<i64>| {
        let parts = ns.map(|ns| (ns / 1_000_000_000, ns % 1_000_000_000));
        parts.map_or(",".to_owned(), |(seconds, rest)| format!("{seconds},{rest}"))
    };
    let (deadline, lifespan) = (time(deadline_ns), time(lifespan_ns));
    format!("{reliability}:{durability}:,{depth}:{deadline}:{lifespan}:,,")
}

fn qos_of(text: &str) -> Option<TokenQos> {
    let parts: Vec<&str> = text.split(':').collect();
    let [reliability, durability, history, deadline, lifespan, _liveliness, ..] = parts[..] else {
        return None;
    };
    let (_, depth) = history.split_once(',')?;
    let depth = if depth.is_empty() { DEPTH_LEFT_OUT } else { depth.parse().ok()? };
    let time = |text: &str| -> Option<Option<i64>> {
        let (seconds, rest) = text.split_once(',')?;
        let number = |text: &str| match text {
            "" => Some(0),
            text => text.parse::<i64>().ok(),
        };
        let (seconds, rest) = (number(seconds)?, number(rest)?);
        let ns = seconds.checked_mul(1_000_000_000)?.checked_add(rest)?;
        Some((ns > 0 && ns < i64::MAX).then_some(ns))
    };
    Some(TokenQos {
        qos: Qos { reliable: reliability != "2", transient_local: durability == "1", depth },
        deadline_ns: time(deadline)?,
        lifespan_ns: time(lifespan)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRING: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";
    const SUM: &str = "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a";

    fn topic(name: &str, type_name: &str, type_hash: &str, depth: usize) -> Topic {
        let qos = Qos::DEFAULT.with_depth(depth).into();
        Topic { name: name.into(), type_name: type_name.into(), type_hash: type_hash.into(), qos }
    }

    #[test]
    fn keys_are_those_of_the_documentation_of_rmw_zenoh() {
        let chatter = |name| topic(name, "std_msgs/msg/String", STRING, 10);
        let sum = topic("/add_two_ints", "example_interfaces/srv/AddTwoInts", SUM, 10);
        let table = [
            (0, chatter("/chatter"), "0/chatter/std_msgs::msg::dds_::String_/"),
            (0, chatter("/robot1/chatter"), "0/robot1/chatter/std_msgs::msg::dds_::String_/"),
            (2, sum, "2/add_two_ints/example_interfaces::srv::dds_::AddTwoInts_/"),
        ];
        for (domain_id, topic, expected) in table {
            assert_eq!(key(domain_id, &topic), format!("{expected}{}", topic.type_hash));
        }
    }

    fn token(zid: &str, id: u32, kind: Kind, node: &str, topic: Option<Topic>) -> Token {
        Token {
            domain_id: 2,
            zid: zid.into(),
            node_id: 0,
            id,
            kind,
            enclave: "/".into(),
            namespace: "/".into(),
            node: node.into(),
            topic,
        }
    }

    #[test]
    fn tokens_are_those_of_the_documentation_of_rmw_zenoh() {
        let chatter = |depth| Some(topic("/chatter", "std_msgs/msg/String", STRING, depth));
        let sum = || Some(topic("/add_two_ints", "example_interfaces/srv/AddTwoInts", SUM, 10));
        let listener = "aac3178e146ba6f1fc6e6a4085e77f21";
        let table = [
            (
                token(listener, 0, Kind::Node, "listener", None),
                "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener".to_owned(),
            ),
            (
                token(listener, 10, Kind::Subscription, "listener", chatter(10)),
                format!(
                    "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MS/%/%/listener/%chatter/\
                     std_msgs::msg::dds_::String_/{STRING}/::,10:,:,:,,"
                ),
            ),
            (
                token(
                    "8b20917502ee955ac4476e0266340d5c",
                    10,
                    Kind::Publisher,
                    "talker",
                    chatter(7),
                ),
                format!(
                    "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/\
                     std_msgs::msg::dds_::String_/{STRING}/::,7:,:,:,,"
                ),
            ),
            (
                token(
                    "f9980ee0495eaafb3e38f0d19e2eae12",
                    10,
                    Kind::Server,
                    "add_two_ints_server",
                    sum(),
                ),
                format!(
                    "@ros2_lv/2/f9980ee0495eaafb3e38f0d19e2eae12/0/10/SS/%/%/add_two_ints_server/\
                     %add_two_ints/example_interfaces::srv::dds_::AddTwoInts_/{SUM}/::,10:,:,:,,"
                ),
            ),
            (
                token(
                    "e1dc8d1b45ae8717fce78689cc655685",
                    10,
                    Kind::Client,
                    "add_two_ints_client",
                    sum(),
                ),
                format!(
                    "@ros2_lv/2/e1dc8d1b45ae8717fce78689cc655685/0/10/SC/%/%/add_two_ints_client/\
                     %add_two_ints/example_interfaces::srv::dds_::AddTwoInts_/{SUM}/::,10:,:,:,,"
                ),
            ),
        ];
        for (token, text) in table {
            assert_eq!(token.text(), text);
            assert_eq!(Token::parse(&text), Some(token));
        }
    }

    #[test]
    fn qualities_of_service_survive_their_text() {
        let table = [
            (Qos::LATCHED.into(), ":1:,1:,:,:,,"),
            (Qos::SENSOR.into(), "2::,5:,:,:,,"),
            (Qos::DEFAULT.with_depth(42).into(), "::,:,:,:,,"),
            (
                TokenQos {
                    qos: Qos::DEFAULT,
                    deadline_ns: Some(2_500_000_000),
                    lifespan_ns: Some(30),
                },
                "::,10:2,500000000:0,30:,,",
            ),
        ];
        for (qos, text) in table {
            assert_eq!(qos_text(qos), text);
            assert_eq!(qos_of(text), Some(qos), "{text}");
        }
        // What others may write: all numbers, and times without end.
        let all = qos_of("1:2:1,10:9223372036,854775807:0,0:1,9223372036,854775807");
        assert_eq!(all, Some(Qos::DEFAULT.into()));
        for text in ["", "::", "::10:,:,:,,", "::,x:,:,:,,", "::,1:a,:,:,,", "::,1:,:,"] {
            assert_eq!(qos_of(text), None, "{text}");
        }
    }

    #[test]
    fn a_token_in_a_namespace_names_its_node() {
        let text = "@ros2_lv/0/1f/0/3/NN/%cell/%cell%mill/axis_driver";
        let token = Token::parse(text).expect("a token");
        assert_eq!(token.node_name(), "/cell/mill/axis_driver");
        assert_eq!((token.enclave.as_str(), token.text().as_str()), ("/cell", text));
        let root = Token::parse("@ros2_lv/0/1f/0/3/NN/%/%/talker").expect("a token");
        assert_eq!(root.node_name(), "/talker");
    }

    #[test]
    fn endpoints_of_a_session_share_the_address_of_their_process() {
        let of = |zid, id| token(zid, id, Kind::Node, "n", None).gid();
        assert_eq!(of("1f", 3).0, [0x1f, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0]);
        let long = "aac3178e146ba6f1fc6e6a4085e77f21";
        assert_eq!(of(long, 1).participant(), of(long, 2).participant());
        assert_ne!(of(long, 1), of(long, 2));
        assert_ne!(of(long, 1).participant(), of("1f", 1).participant());
    }

    #[test]
    fn the_address_of_a_sample_is_the_hash_of_the_token() {
        // XXH3 of the empty text is in the documentation of xxHash: low half, then high half.
        let mut expected = 0x6001_c324_468d_497f_u64.to_le_bytes().to_vec();
        expected.extend(0x99aa_06d3_0147_98d8_u64.to_le_bytes());
        assert_eq!(wire_gid("").to_vec(), expected);
    }

    #[test]
    fn no_text_whatever_is_taken_for_a_token_by_mistake() {
        for text in [
            "",
            "@ros2_lv",
            "@ros2/0/1f/0/3/NN/%/%/n",
            "@ros2_lv/70000/1f/0/3/NN/%/%/n",
            "@ros2_lv/0/xyz/0/3/NN/%/%/n",
            "@ros2_lv/0/1f/0/-3/NN/%/%/n",
            "@ros2_lv/0/1f/0/3/XX/%/%/n",
            "@ros2_lv/0/1f/0/3/NN/%/%",
            "@ros2_lv/0/1f/0/3/NN//%/n",
            "@ros2_lv/0/1f/0/3/MP/%/%/n",
            "@ros2_lv/0/1f/0/3/MP/%/%/n/%t/T/H",
            "@ros2_lv/0/1f/0/3/MP/%/%/n/%t/T/H/junk",
        ] {
            assert_eq!(Token::parse(text), None, "{text}");
        }
    }
}
