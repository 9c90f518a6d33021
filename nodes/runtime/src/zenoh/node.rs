//! A node on a session of Zenoh: makes its endpoints.

use crate::process::time::RosTime;
use crate::process::watchdog::{Deafness, EndOfProcess, Watchdog};
use crate::samples::gid::Gid;
use crate::samples::qos::Qos;
use crate::samples::sample::{Sample, SampleInfo};
use crate::zenoh::attachment::{Attachment, received};
use crate::zenoh::client::Requests;
use crate::zenoh::discovery::{Announced, Discovery};
use crate::zenoh::error::ZenohError;
use crate::zenoh::inbox::{Inbox, Receiver, Source};
use crate::zenoh::names::{Kind, Token, Topic, key, wire_gid};
use crate::zenoh::publisher::{Publisher, Writer};
use crate::zenoh::server::Answers;
use cnc_msgs::schema;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use tokio::sync::watch;
use zenoh::pubsub::Subscriber;
use zenoh::qos::{CongestionControl, Reliability};
use zenoh::query::{ConsolidationMode, Query, QueryTarget};
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};
use zenoh_ext::{
    AdvancedPublisherBuilderExt, AdvancedSubscriberBuilderExt, CacheConfig, HistoryConfig,
    MissDetectionConfig, RecoveryConfig,
};

/// How often a latched publisher says which sample was its last, if there was a new one.
const HEARTBEAT: Duration = Duration::from_millis(500);
/// How long the result of a goal may take.
const RESULT_WITHIN: Duration = Duration::from_secs(24 * 3600);
/// How long any other answer may take: a block by hand is answered when it has been cut. The caller
/// gives up sooner.
const ANSWER_WITHIN: Duration = Duration::from_secs(2 * 3600);
/// Replies that may wait to be taken; as many calls may overlap.
const REPLIES_MAX: usize = 1000;

/// The node's side of Zenoh.
pub(crate) struct Node {
    session: Session,
    discovery: Arc<Discovery>,
    /// What all tokens of this node have in common.
    token: Token,
    next_id: AtomicU32,
    _follower: Subscriber<()>,
    _announced: Announced,
}

impl Node {
    /// Announces a node.
    pub(crate) fn new(
        session: Session,
        (discovery, follower): (Arc<Discovery>, Subscriber<()>),
        token: Token,
    ) -> Result<Self, ZenohError> {
        let announced = discovery.announce(&session, token.clone())?;
        let next_id = AtomicU32::new(token.id + 1);
        Ok(Self { session, discovery, token, next_id, _follower: follower, _announced: announced })
    }

    /// The token and the key of a new endpoint.
    fn endpoint(
        &self,
        kind: Kind,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<(Token, String), ZenohError> {
        let type_hash = schema::lookup(type_name)
            .map(|info| info.rihs01.to_owned())
            .or_else(|| self.discovery.type_hash(name, type_name))
            .ok_or_else(|| {
                let reason = format!(
                    "the type hash of {type_name} is not known: it is not built in, and no node \
                     announces it"
                );
                ZenohError::new(name, &reason)
            })?;
        let (name, type_name) = (name.to_owned(), type_name.to_owned());
        let topic = Topic { name, type_name, type_hash, qos: qos.into() };
        let key = key(self.token.domain_id, &topic);
        let id = self.next_id.fetch_add(1, Ordering::Relaxed);
        Ok((Token { id, kind, topic: Some(topic), ..self.token.clone() }, key))
    }

    /// Publishes on an absolute topic.
    pub(crate) fn publisher(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<Publisher, ZenohError> {
        let failed = |error: zenoh::Error| ZenohError::new(name, &error);
        let (token, key) = self.endpoint(Kind::Publisher, name, type_name, qos)?;
        let reliability =
            if qos.reliable { Reliability::Reliable } else { Reliability::BestEffort };
        let builder = self
            .session
            .declare_publisher(key)
            .congestion_control(CongestionControl::Drop)
            .reliability(reliability);
        let writer = if qos.transient_local {
            let mut builder =
                builder.cache(CacheConfig::default().max_samples(qos.depth)).publisher_detection();
            if qos.reliable {
                let heartbeat = MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT);
                builder = builder.sample_miss_detection(heartbeat);
            }
            Writer::Latched(builder.wait().map_err(failed)?)
        } else {
            Writer::Volatile(builder.wait().map_err(failed)?)
        };
        let (gid, wire_gid) = (token.gid(), wire_gid(&token.text()));
        let announced = self.discovery.announce(&self.session, token)?;
        Ok(Publisher::new(writer, gid, wire_gid, announced))
    }

    /// Subscribes an absolute topic.
    pub(crate) fn subscription(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<Receiver, ZenohError> {
        let failed = |error: zenoh::Error| ZenohError::new(name, &error);
        let (token, key) = self.endpoint(Kind::Subscription, name, type_name, qos)?;
        let inbox = Inbox::new(qos.depth);
        let (filled, discovery) = (Arc::clone(&inbox), Arc::clone(&self.discovery));
        let own_key = key.clone();
        let builder =
            self.session.declare_subscriber(key).callback(move |sample: zenoh::sample::Sample| {
                drop(filled.push(taken(&sample, &own_key, &discovery)));
            });
        let source = if qos.transient_local {
            let history = HistoryConfig::default().detect_late_publishers();
            let mut builder =
                builder.history(history.max_samples(qos.depth)).subscriber_detection();
            if qos.reliable {
                builder = builder.recovery(RecoveryConfig::default().heartbeat());
            }
            Source::Latched { _subscriber: builder.wait().map_err(failed)? }
        } else {
            Source::Volatile { _subscriber: builder.wait().map_err(failed)? }
        };
        let gid = token.gid();
        let announced = self.discovery.announce(&self.session, token)?;
        Ok(Receiver::new(inbox, gid, source, Some(announced)))
    }

    /// Receives the requests of a service.
    pub(crate) fn server(
        &self,
        name: &str,
        type_name: &str,
        depth: usize,
    ) -> Result<(Receiver, Answers), ZenohError> {
        let (token, key) = self.endpoint(Kind::Server, name, type_name, Qos::DEFAULT)?;
        let inbox = Inbox::new(depth);
        let answers = Answers::new(&key);
        let (filled, taking) = (Arc::clone(&inbox), answers.clone());
        let discovery = Arc::clone(&self.discovery);
        let queryable = self
            .session
            .declare_queryable(key)
            .complete(true)
            .callback(move |query: Query| {
                if taking.is_meant(&query) {
                    let dropped = filled.push(taking.take(query, &discovery));
                    for request in dropped.into_iter().flatten().filter_map(|it| it.request) {
                        taking.forget(request);
                    }
                }
            })
            .wait()
            .map_err(|error| ZenohError::new(name, &error))?;
        let gid = token.gid();
        let announced = self.discovery.announce(&self.session, token)?;
        let source = Source::Requests { _queryable: queryable };
        Ok((Receiver::new(inbox, gid, source, Some(announced)), answers))
    }

    /// Sends requests to a service.
    pub(crate) fn client(
        &self,
        name: &str,
        type_name: &str,
    ) -> Result<(Receiver, Requests), ZenohError> {
        let (token, key) = self.endpoint(Kind::Client, name, type_name, Qos::DEFAULT)?;
        let within = match name.ends_with("/_action/get_result") {
            true => RESULT_WITHIN,
            false => ANSWER_WITHIN,
        };
        let querier = self
            .session
            .declare_querier(key)
            .target(QueryTarget::AllComplete)
            .consolidation(ConsolidationMode::None)
            .timeout(within)
            .wait()
            .map_err(|error| ZenohError::new(name, &error))?;
        let (gid, wire_gid) = (token.gid(), wire_gid(&token.text()));
        let announced = self.discovery.announce(&self.session, token)?;
        let inbox = Inbox::new(REPLIES_MAX);
        let requests = Requests::new(querier, (gid, wire_gid), Arc::clone(&inbox), announced);
        Ok((Receiver::new(inbox, gid, Source::Calls, None), requests))
    }

    /// The publishers of other processes.
    pub(crate) fn publishers(&self) -> Vec<(Topic, Gid)> {
        self.discovery.publishers()
    }

    /// Watches the session; `deaf` gets the reason once when it is closed, unless the process exits.
    pub(crate) fn watch(
        &self,
        deaf: watch::Sender<Option<Deafness>>,
        end: Option<EndOfProcess>,
    ) -> std::io::Result<Watchdog> {
        let session = self.session.clone();
        Watchdog::start("zenoh-watch", deaf, end, move || match session.is_closed() {
            true => Err("the session of Zenoh is closed".to_owned()),
            false => Ok(()),
        })
    }

    /// Closes the session.
    pub(crate) fn stop(&self) {
        // A thread without an executor: Zenoh does not wait on one that has a single thread.
        std::thread::scope(|scope| {
            let closing = scope.spawn(|| self.session.close().wait());
            if let Ok(Err(error)) = closing.join() {
                tracing::debug!("the session of Zenoh was not closed: {error}");
            }
        });
    }
}

/// A sample of a topic, or why it is none.
fn taken(
    sample: &zenoh::sample::Sample,
    own_key: &str,
    discovery: &Discovery,
) -> Result<Sample, String> {
    // Sent to `**`, it reaches every topic, of whatever type.
    if sample.key_expr().as_str() != own_key {
        return Err(format!("a sample for {} is no message", sample.key_expr()));
    }
    if sample.kind() != SampleKind::Put {
        return Err("a deletion is no message".to_owned());
    }
    let attachment = sample.attachment().and_then(|it| Attachment::parse(&it.to_bytes()));
    let Some(Attachment { sequence, source_time, wire_gid }) = attachment else {
        return Err("a message without number, time and sender".to_owned());
    };
    Ok(Sample {
        received: received(&sample.payload().to_bytes())?,
        info: SampleInfo {
            publisher: discovery.gid_of(wire_gid),
            sequence,
            source_time: Some(RosTime::from_nanos(source_time)),
            reception_time: RosTime::wall(),
        },
        request: None,
    })
}
