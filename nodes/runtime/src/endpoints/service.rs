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
use crate::endpoints::subscription::{Reader, sample_info};
use crate::endpoints::wire::{CycloneHeader, Gid};
use crate::process::time::RosTime;
use answers::Answers;
use cnc_msgs::interface::Service;
pub(crate) use replies::{Replies, UNACKNOWLEDGED_MAX};
use ros2_client::MessageInfo;
use std::collections::VecDeque;
use std::future::Future;
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

/// A service server.
pub(crate) struct Server<S: Service> {
    reader: Reader<S::Request>,
    answers: Answers<S>,
}

impl<S: Service + 'static> Server<S> {
    pub(crate) fn new(reader: Reader<S::Request>, replies: Replies<S>, graph: Arc<Graph>) -> Self {
        Self { reader, answers: Answers::new(replies, graph) }
    }

    /// The next request.
    async fn next(&mut self) -> (S::Request, RequestInfo) {
        let (framed, info) = self.reader.next().await;
        let request = request_info(framed.header, &info);
        (framed.body, request)
    }

    /// Answers requests one after the other; never returns.
    pub(crate) async fn serve<F, Fut>(mut self, mut handler: F)
    where
        F: FnMut(S::Request, RequestInfo) -> Fut,
        Fut: Future<Output = S::Response>,
    {
        loop {
            let (request, info) = self.next().await;
            let response = handler(request, info).await;
            self.answers.send(info, response);
        }
    }

    /// Answers requests concurrently, first those that the previous process left; never returns.
    pub(crate) async fn serve_concurrently<F, Fut>(
        mut self,
        overload: Overload,
        earlier: Vec<(S::Request, RequestInfo)>,
        handler: F,
    ) where
        F: Fn(S::Request, RequestInfo) -> Fut,
        Fut: Future<Output = S::Response> + Send + 'static,
    {
        let mut making = JoinSet::new();
        let mut oldest_first: VecDeque<AbortHandle> = VecDeque::new();
        let mut earlier = earlier.into_iter();
        loop {
            let (request, info) = match earlier.next() {
                Some(request) => request,
                None => self.next().await,
            };
            while making.try_join_next().is_some() {}
            match overload {
                Overload::Wait if making.len() >= CONCURRENT_MAX => drop(making.join_next().await),
                Overload::DropOldest if oldest_first.len() >= CONCURRENT_MAX => {
                    // Requests that can be answered now are not dropped.
                    tokio::task::yield_now().await;
                    oldest_first.retain(|task| !task.is_finished());
                    if oldest_first.len() >= CONCURRENT_MAX {
                        oldest_first.pop_front().inspect(AbortHandle::abort);
                    }
                }
                _ => {}
            }
            let (answer, answers) = (handler(request, info), self.answers.clone());
            let task = making.spawn(async move { answers.send(info, answer.await) });
            if overload == Overload::DropOldest {
                oldest_first.push_back(task);
            }
        }
    }
}

fn request_info(header: Option<CycloneHeader>, info: &MessageInfo) -> RequestInfo {
    let sample = sample_info(info);
    let (client, sequence) = match (header, info.related_request_id()) {
        (Some(header), _) => (header.client(sample.publisher), header.sequence()),
        // Fast DDS names the client and leaves the number to the sample.
        (None, Some(id)) if id.sequence_number == UNKNOWN_SEQUENCE => {
            (id.writer_gid.into(), sample.sequence)
        }
        (None, Some(id)) => (id.writer_gid.into(), id.sequence_number),
        (None, None) => (sample.publisher, sample.sequence),
    };
    let reception_time = sample.reception_time;
    RequestInfo { writer: sample.publisher, client, sequence, reception_time }
}

/// `SEQUENCENUMBER_UNKNOWN` of RTPS: the high half -1, the low half 0.
const UNKNOWN_SEQUENCE: i64 = -(1 << 32);
