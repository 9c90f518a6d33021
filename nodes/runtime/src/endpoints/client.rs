//! Service clients.
//!
//! One task receives all replies and passes each to its call, so that any number of calls
//! may wait at once. A call first waits for a server, and a little longer than the match
//! takes on this side: a server that has not yet matched this client loses the request.

use crate::endpoints::graph::Graph;
use crate::endpoints::requests::{Requests, Sent};
use crate::endpoints::subscription::Reader;
use crate::endpoints::wire::CycloneHeader;
use crate::samples::gid::Gid;
use crate::samples::sample::{Received, Sample};
use cnc_msgs::cdr;
use cnc_msgs::interface::Service;
use std::any::Any;
use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;

/// How long a call waits for a server to appear.
pub const SERVER_WITHIN: Duration = Duration::from_secs(5);
/// How long [`Client::call`] waits for the answer.
pub const ANSWER_WITHIN: Duration = Duration::from_secs(5);
/// How long a server needs to match the client (a Cyclone server lost 5 of 5 requests
/// without this wait, none with it).
const SETTLE: Duration = Duration::from_millis(100);
/// How long a router of Zenoh may take to say that there is a way to a server that has been announced.
const WAY_WITHIN: Duration = Duration::from_secs(3);
/// Between two looks for it.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// After this long an idempotent request is sent again, or as soon after as it is known to be lost.
const RESEND_AFTER: Duration = Duration::from_secs(1);

/// The two endpoints of a client.
pub(crate) struct Endpoints {
    pub(crate) name: String,
    pub(crate) reader: Reader,
    pub(crate) requests: Requests,
}

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CallError {
    /// There is no server.
    #[error(
        "no answer from {service} within {} s; start its node, or use its ROS_DOMAIN_ID and \
         namespace", waited.as_secs_f64()
    )]
    NoServer { service: String, waited: Duration },
    /// There is a server, but it did not answer.
    #[error(
        "{service} did not answer within {} s (is the node alive, and its RMW_IMPLEMENTATION \
         the same?)", waited.as_secs_f64()
    )]
    NoAnswer { service: String, waited: Duration },
    /// It had the request, and is gone or has dropped it.
    #[error(
        "{service} did not answer, and will not: its node has ended or has dropped the request, or the connection \
         to it was lost; if something was to be done, see whether it was before you ask again"
    )]
    Lost { service: String },
    /// There is a server, but requests do not get there.
    #[error(
        "no router of Zenoh passes requests of this node on to {service}, which there is: the node \
         has no right to it (is --enclave the right one?), or its router has lost the others \
         (docs/security.md)"
    )]
    NoWay { service: String },
    /// The request could not be sent.
    #[error("the request to {service} was not sent: {reason}")]
    NotSent { service: String, reason: String },
}

/// A client of a service; clones share the endpoint, calls may overlap.
pub struct Client<S: Service> {
    shared: Arc<Shared>,
    service: PhantomData<fn() -> S>,
}

struct Shared {
    name: String,
    graph: Arc<Graph>,
    /// What sends requests, and what receives replies.
    endpoints: [Gid; 2],
    calls: Mutex<Calls>,
}

/// A response of the service's type and the endpoint that sent it.
type Answer = (Box<dyn Any + Send>, Gid);

/// Decodes a reply to the header of its mapping and the response.
type DecodeReply =
    fn(&Received, bool) -> Result<(Option<CycloneHeader>, Box<dyn Any + Send>), String>;

struct Calls {
    requests: Requests,
    waiting: BTreeMap<i64, oneshot::Sender<Answer>>,
}

impl<S: Service> Clone for Client<S> {
    fn clone(&self) -> Self {
        Self { shared: Arc::clone(&self.shared), service: PhantomData }
    }
}

impl<S: Service> std::fmt::Debug for Client<S> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Client").field("service", &self.shared.name).finish_non_exhaustive()
    }
}

impl<S: Service + 'static> Client<S> {
    /// The client and the task that takes in its replies.
    pub(crate) fn new(
        endpoints: Endpoints,
        graph: Arc<Graph>,
    ) -> (Self, impl Future<Output = ()> + Send + 'static) {
        let Endpoints { name, reader, requests } = endpoints;
        let shared = Arc::new(Shared {
            name,
            graph,
            endpoints: [requests.gid(), reader.gid()],
            calls: Mutex::new(Calls { requests, waiting: BTreeMap::new() }),
        });
        let decode: DecodeReply = |reply, has_header| {
            let framed = reply.decode::<S::Response>(has_header)?;
            Ok((framed.header, Box::new(framed.body)))
        };
        let dispatch = dispatch(Arc::clone(&shared), reader, decode);
        (Self { shared, service: PhantomData }, dispatch)
    }

    /// Asks once, and waits up to [`SERVER_WITHIN`] for a server and then up
    /// to [`ANSWER_WITHIN`] for its answer.
    ///
    /// # Errors
    /// See [`CallError`].
    pub async fn call(&self, request: S::Request) -> Result<S::Response, CallError> {
        self.call_within(request, ANSWER_WITHIN).await
    }

    /// As [`Self::call`], with another time limit for the answer.
    ///
    /// # Errors
    /// See [`CallError`].
    pub async fn call_within(
        &self,
        request: S::Request,
        answer_within: Duration,
    ) -> Result<S::Response, CallError> {
        let answer = self.shared.call_once(&cdr::body(&request), answer_within).await?;
        Ok(response(answer).0)
    }

    /// Repeats the request every second until an answer comes; only for idempotent requests.
    ///
    /// # Errors
    /// See [`CallError`].
    pub async fn call_idempotent(
        &self,
        request: &S::Request,
        answer_within: Duration,
    ) -> Result<S::Response, CallError> {
        self.call_for_server(request, answer_within).await.map(|(response, _)| response)
    }

    /// As [`Self::call_idempotent`]; also returns which endpoint answered.
    ///
    /// # Errors
    /// See [`CallError`].
    pub async fn call_for_server(
        &self,
        request: &S::Request,
        answer_within: Duration,
    ) -> Result<(S::Response, Gid), CallError> {
        self.call_again(request, answer_within, |_| RESEND_AFTER).await
    }

    /// Repeats the request after the time that `resend_after` returns for the number of
    /// requests so far.
    pub(crate) async fn call_again(
        &self,
        request: &S::Request,
        answer_within: Duration,
        resend_after: fn(usize) -> Duration,
    ) -> Result<(S::Response, Gid), CallError> {
        let body = cdr::body(request);
        self.shared.call_again(&body, answer_within, resend_after).await.map(response)
    }

    /// How many servers are matched now. Over DDS each of them gets each request.
    pub fn servers(&self) -> usize {
        let matches = |gid: &Gid| self.shared.graph.matches(*gid);
        self.shared.endpoints.iter().map(matches).min().unwrap_or(0)
    }

    /// Waits for a server; false when `deadline` came first.
    pub async fn wait_for_server(&self, deadline: Duration) -> bool {
        self.shared.wait_for_server(deadline).await
    }

    /// The absolute name of the service.
    pub fn name(&self) -> &str {
        &self.shared.name
    }
}

/// The response of an answer to a client of `S`.
fn response<R: 'static>((response, server): Answer) -> (R, Gid) {
    let response = response.downcast().expect("the client decodes responses of its own type");
    (*response, server)
}

impl Shared {
    fn calls(&self) -> MutexGuard<'_, Calls> {
        self.calls.lock().unwrap_or_else(PoisonError::into_inner)
    }

    async fn wait_for_server(&self, deadline: Duration) -> bool {
        self.graph.wait_for_peers(&self.endpoints, SETTLE, deadline).await
    }

    /// Waits for a server, and until requests reach it.
    async fn wait_for_way(&self, server_within: Duration) -> Result<(), CallError> {
        if !self.wait_for_server(server_within).await {
            return Err(CallError::NoServer { service: self.name.clone(), waited: server_within });
        }
        let start = Instant::now();
        while !self.calls().requests.reach_a_server() {
            if start.elapsed() >= WAY_WITHIN {
                return Err(CallError::NoWay { service: self.name.clone() });
            }
            tokio::time::sleep(LOOK_AGAIN).await;
        }
        Ok(())
    }

    async fn call_once(
        &self,
        request: &[u8],
        answer_within: Duration,
    ) -> Result<Answer, CallError> {
        self.wait_for_way(SERVER_WITHIN).await?;
        let (Sent { sequence, end }, answer) = self.send(request)?;
        let _forget = Forget { shared: self, sequences: vec![sequence] };
        tokio::select! {
            biased;
            Ok(answer) = answer => Ok(answer),
            () = lost(end) => Err(CallError::Lost { service: self.name.clone() }),
            () = tokio::time::sleep(answer_within) => Err(self.no_answer(answer_within)),
        }
    }

    async fn call_again(
        &self,
        request: &[u8],
        answer_within: Duration,
        resend_after: fn(usize) -> Duration,
    ) -> Result<Answer, CallError> {
        let start = Instant::now();
        let mut forget = Forget { shared: self, sequences: Vec::new() };
        let mut answers = Vec::new();
        self.wait_for_way(answer_within.min(SERVER_WITHIN)).await?;
        loop {
            let (Sent { sequence, end }, answer) = self.send(request)?;
            forget.sequences.push(sequence);
            answers.push(answer);
            let left = answer_within.saturating_sub(start.elapsed());
            // An answer to any of the attempts counts.
            let any = futures::future::select_ok(answers.iter_mut());
            let period = resend_after(forget.sequences.len());
            let is_lost = async {
                lost(end).await;
                tokio::time::sleep(RESEND_AFTER).await;
            };
            tokio::select! {
                biased;
                Ok((answer, _)) = any => return Ok(answer),
                () = tokio::time::sleep(left) => return Err(self.no_answer(answer_within)),
                () = is_lost => {}
                () = tokio::time::sleep(period) => {}
            }
        }
    }

    fn send(&self, request: &[u8]) -> Result<(Sent, oneshot::Receiver<Answer>), CallError> {
        let mut calls = self.calls();
        let not_sent = |reason| CallError::NotSent { service: self.name.clone(), reason };
        let sent = calls.requests.send(request).map_err(not_sent)?;
        // The reply cannot overtake this: its receiver needs the same lock.
        let (sender, receiver) = oneshot::channel();
        calls.waiting.insert(sent.sequence, sender);
        Ok((sent, receiver))
    }

    fn no_answer(&self, waited: Duration) -> CallError {
        CallError::NoAnswer { service: self.name.clone(), waited }
    }
}

/// Waits until no reply will come; for ever where one has come, or the middleware does not say so.
async fn lost(end: Option<oneshot::Receiver<()>>) {
    if let Some(end) = end
        && end.await.is_err()
    {
        return;
    }
    std::future::pending().await
}

/// Removes calls whose caller has given up.
struct Forget<'a> {
    shared: &'a Shared,
    sequences: Vec<i64>,
}

impl Drop for Forget<'_> {
    fn drop(&mut self) {
        let mut calls = self.shared.calls();
        for sequence in &self.sequences {
            calls.waiting.remove(sequence);
        }
    }
}

/// Passes replies to their calls; skips replies to other clients and late ones.
async fn dispatch(shared: Arc<Shared>, mut replies: Reader, decode: DecodeReply) {
    let me = shared.endpoints[0];
    loop {
        let Sample { received, info, request } = replies.next_received().await;
        let decoded = decode(&received, replies.has_header());
        let Some((header, response)) = replies.valid(decoded, info.publisher) else { continue };
        let sequence = match (header, request) {
            (Some(header), _) if header.client(me) == me => header.sequence(),
            (None, Some(id)) if id.client == me => id.sequence,
            _ => continue,
        };
        if let Some(caller) = shared.calls().waiting.remove(&sequence) {
            // The caller may have given up meanwhile.
            drop(caller.send((response, info.publisher)));
        }
    }
}
