//! Service servers.
//!
//! Knows how a request's identity travels in each mapping, and sends the
//! answer back to its client. Decides nothing about the content.
//!
//! Requests are answered one after the other, in the order of arrival, so that two
//! settings are applied as they were sent. A concurrent service is for answers that take
//! long and do not depend on each other.

mod answers;
mod client_readers;
mod replies;

use crate::endpoints::graph::Graph;
use crate::endpoints::subscription::Reader;
use crate::endpoints::wire::CycloneHeader;
use crate::process::time::RosTime;
use crate::samples::gid::Gid;
use crate::samples::sample::{Received, RequestId, Sample};
use answers::Answers;
use cnc_msgs::cdr;
use cnc_msgs::interface::Service;
pub(crate) use replies::{Replies, UNACKNOWLEDGED_MAX};
use std::collections::VecDeque;
use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use tokio::task::{AbortHandle, JoinSet};

/// Requests that a concurrent service handles at the same time, at most.
const CONCURRENT_MAX: usize = 256;

/// What a concurrent service does with further requests when it handles that many.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Overload {
    /// They wait until one is answered: no answer takes long.
    Wait,
    /// It drops the oldest, whose answer may take any time. So a client that asks again and
    /// again does not block the others.
    DropOldest,
}

/// The sender of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RequestInfo {
    /// The endpoint that sent the request; the first twelve bytes identify its
    /// process, in either mapping.
    pub writer: Gid,
    /// The client, as its middleware names it in the request; the answer goes by it.
    pub client: Gid,
    /// The client's number for the request.
    pub sequence: i64,
    /// Wall time at which the request arrived here.
    pub reception_time: RosTime,
}

impl From<&RequestInfo> for Gid {
    fn from(info: &RequestInfo) -> Self {
        info.writer
    }
}

/// A request and its sender.
pub(crate) type Request<S> = (<S as Service>::Request, RequestInfo);

/// What sends the replies of a service.
pub(crate) enum Replying {
    Dds(Replies),
    #[cfg(feature = "zenoh")]
    Zenoh(crate::zenoh::server::Answers),
}

/// The same, once it serves.
#[derive(Clone)]
enum Answering {
    Dds(Answers),
    #[cfg(feature = "zenoh")]
    Zenoh(crate::zenoh::server::Answers),
}

impl Answering {
    /// There will be no answer.
    fn forget(&self, RequestInfo { client, sequence, .. }: RequestInfo) {
        let request = RequestId { client, sequence };
        match self {
            Self::Dds(_) => {
                tracing::debug!("{request:?} has no answer; its client goes by the time")
            }
            #[cfg(feature = "zenoh")]
            Self::Zenoh(answers) => answers.forget(request),
        }
    }

    /// Sends an answer, the CDR of a response.
    fn send(&self, to: RequestInfo, response: Vec<u8>) {
        match self {
            Self::Dds(answers) => answers.send(to, response),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(answers) => {
                answers.send(RequestId { client: to.client, sequence: to.sequence }, &response);
            }
        }
    }
}

/// Makes the answer to a request: the CDR of the response.
///
/// Of one type for all services, so that serving is compiled once.
type Handler = Box<dyn FnMut(&Received, RequestInfo) -> Result<MakingAnswer, String> + Send>;
type MakingAnswer = Pin<Box<dyn Future<Output = Vec<u8>> + Send>>;

/// A service server.
pub(crate) struct Server {
    reader: Reader,
    answers: Answering,
    handler: Handler,
    /// What is asked again of requests that the previous process did not answer.
    earlier: Vec<(MakingAnswer, RequestInfo)>,
}

impl Server {
    /// The handler also gets the `earlier` requests, first.
    pub(crate) fn new<S, F, Fut>(
        reader: Reader,
        replies: Replying,
        graph: Arc<Graph>,
        earlier: Vec<Request<S>>,
        mut handler: F,
    ) -> Self
    where
        S: Service,
        F: FnMut(S::Request, RequestInfo) -> Fut + Send + 'static,
        Fut: Future<Output = S::Response> + Send + 'static,
    {
        let has_header = reader.has_header();
        let mut answer = move |request, info| -> MakingAnswer {
            let response = handler(request, info);
            Box::pin(async move { cdr::body(&response.await) })
        };
        let earlier = earlier.into_iter().map(|(request, info)| (answer(request, info), info));
        let earlier = earlier.collect();
        let handler: Handler = Box::new(move |request, info| {
            Ok(answer(request.decode::<S::Request>(has_header)?.body, info))
        });
        let answers = match replies {
            Replying::Dds(replies) => Answering::Dds(Answers::new(replies, graph)),
            #[cfg(feature = "zenoh")]
            Replying::Zenoh(answers) => Answering::Zenoh(answers),
        };
        Self { reader, answers, handler, earlier }
    }

    /// The next valid request, with the future that makes its answer.
    async fn next(&mut self) -> (MakingAnswer, RequestInfo) {
        loop {
            let sample = self.reader.next_received().await;
            let header = sample.received.header(self.reader.has_header());
            let info = request_info(header, &sample);
            let answer = (self.handler)(&sample.received, info);
            if let Some(answer) = self.reader.valid(answer, info.writer) {
                return (answer, info);
            }
            self.answers.forget(info);
        }
    }

    /// Answers requests one after the other; never returns.
    pub(crate) async fn serve(mut self) {
        loop {
            let (answer, info) = self.next().await;
            let response = answer.await;
            self.answers.send(info, response);
        }
    }

    /// Answers requests concurrently, first those that the previous process left; never returns.
    pub(crate) async fn serve_concurrently(mut self, overload: Overload) {
        let mut making = JoinSet::new();
        let mut oldest_first: VecDeque<(AbortHandle, RequestInfo)> = VecDeque::new();
        let mut earlier = std::mem::take(&mut self.earlier).into_iter();
        loop {
            let (answer, info) = match earlier.next() {
                Some(request) => request,
                None => self.next().await,
            };
            while making.try_join_next().is_some() {}
            match overload {
                Overload::Wait if making.len() >= CONCURRENT_MAX => drop(making.join_next().await),
                Overload::DropOldest if oldest_first.len() >= CONCURRENT_MAX => {
                    // Requests that can be answered now are not dropped.
                    tokio::task::yield_now().await;
                    oldest_first.retain(|(task, _)| !task.is_finished());
                    if oldest_first.len() >= CONCURRENT_MAX
                        && let Some((task, info)) = oldest_first.pop_front()
                    {
                        task.abort();
                        self.answers.forget(info);
                    }
                }
                _ => {}
            }
            let answers = self.answers.clone();
            let task = making.spawn(async move { answers.send(info, answer.await) });
            if overload == Overload::DropOldest {
                oldest_first.push_back((task, info));
            }
        }
    }
}

fn request_info(header: Option<CycloneHeader>, sample: &Sample) -> RequestInfo {
    let info = sample.info;
    let id = match (header, sample.request) {
        (Some(header), _) => {
            RequestId { client: header.client(info.publisher), sequence: header.sequence() }
        }
        // Fast DDS names the client and leaves the number to the sample.
        (None, Some(id)) if id.sequence == UNKNOWN_SEQUENCE => {
            RequestId { client: id.client, sequence: info.sequence }
        }
        (None, Some(id)) => id,
        (None, None) => RequestId { client: info.publisher, sequence: info.sequence },
    };
    RequestInfo {
        writer: info.publisher,
        client: id.client,
        sequence: id.sequence,
        reception_time: info.reception_time,
    }
}

/// `SEQUENCENUMBER_UNKNOWN` of RTPS: the high half -1, the low half 0.
const UNKNOWN_SEQUENCE: i64 = -(1 << 32);
