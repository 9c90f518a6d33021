//! Samples that have arrived and wait to be taken.
//!
//! Zenoh hands samples over on its own threads. They wait here, the oldest being dropped when there
//! are more than the depth of the subscription, as in ROS.

use crate::process::lock;
use crate::samples::gid::Gid;
use crate::samples::sample::Sample;
use crate::zenoh::discovery::Announced;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use tokio::sync::Notify;
use zenoh::pubsub::Subscriber;
use zenoh::query::Queryable;
use zenoh_ext::AdvancedSubscriber;

/// A sample, or why what arrived is none.
type Item = Result<Sample, String>;

/// Samples that wait.
#[derive(Debug)]
pub(crate) struct Inbox {
    waiting: Mutex<VecDeque<Item>>,
    depth: usize,
    arrived: Notify,
}

impl Inbox {
    pub(crate) fn new(depth: usize) -> Arc<Self> {
        let waiting = Mutex::default();
        Arc::new(Self { waiting, depth: depth.max(1), arrived: Notify::new() })
    }

    /// Returns what is dropped for it.
    pub(crate) fn push(&self, item: Item) -> Option<Item> {
        let mut waiting = lock(&self.waiting);
        let dropped = if waiting.len() >= self.depth { waiting.pop_front() } else { None };
        waiting.push_back(item);
        drop(waiting);
        self.arrived.notify_one();
        dropped
    }

    fn take(&self) -> Option<Item> {
        lock(&self.waiting).pop_front()
    }

    /// May be dropped while it waits without losing an item.
    async fn next(&self) -> Item {
        loop {
            if let Some(item) = self.take() {
                return item;
            }
            // A permit is left when something arrived since.
            self.arrived.notified().await;
        }
    }
}

/// What fills an inbox, as long as it lives.
pub(crate) enum Source {
    Volatile {
        _subscriber: Subscriber<()>,
    },
    Latched {
        _subscriber: AdvancedSubscriber<()>,
    },
    Requests {
        _queryable: Queryable<()>,
    },
    /// Each call fills it by itself.
    Calls,
}

/// Takes samples out of an inbox.
pub(crate) struct Receiver {
    inbox: Arc<Inbox>,
    gid: Gid,
    _source: Source,
    /// None where what sends announces both.
    _announced: Option<Announced>,
}

impl Receiver {
    pub(crate) fn new(
        inbox: Arc<Inbox>,
        gid: Gid,
        source: Source,
        announced: Option<Announced>,
    ) -> Self {
        Self { inbox, gid, _source: source, _announced: announced }
    }

    pub(crate) async fn next(&mut self) -> Item {
        self.inbox.next().await
    }

    pub(crate) fn take(&mut self) -> Option<Item> {
        self.inbox.take()
    }

    pub(crate) fn gid(&self) -> Gid {
        self.gid
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn item(number: usize) -> Item {
        Err(number.to_string())
    }

    #[test]
    fn the_newest_wait_and_the_oldest_go() {
        let inbox = Inbox::new(3);
        (0..10).for_each(|number| drop(inbox.push(item(number))));
        let left: Vec<_> = std::iter::from_fn(|| inbox.take()).filter_map(Result::err).collect();
        assert_eq!(left, ["7", "8", "9"]);
    }

    #[tokio::test]
    async fn who_waits_gets_all_that_comes_even_if_it_gives_up_meanwhile() {
        let inbox = Inbox::new(100);
        let sender = Arc::clone(&inbox);
        let sending = std::thread::spawn(move || {
            for number in 0..50 {
                sender.push(item(number));
                std::thread::sleep(Duration::from_micros(200));
            }
        });
        let mut got = Vec::new();
        while got.len() < 50 {
            if let Ok(item) = tokio::time::timeout(Duration::from_micros(100), inbox.next()).await {
                got.extend(item.err());
            }
        }
        sending.join().expect("it only sends");
        assert!(got.iter().enumerate().all(|(number, text)| *text == number.to_string()));
    }
}
