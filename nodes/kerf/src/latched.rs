//! The newest message of a latched topic. A late joiner may get older ones first.

use cnc_msgs::interface::Message;
use runtime::Subscription;
use std::time::Duration;
use tokio::time::{Instant, timeout, timeout_at};

/// How long a latched message of a running node may take to arrive.
pub(crate) const LATCHED_WITHIN: Duration = Duration::from_secs(5);
/// Nodes that publish a state do so several times within this time.
const SETTLES: Duration = Duration::from_millis(500);

/// The newest message within a short time after the first, by its stamp; `None` when none comes.
pub(crate) async fn newest<M: Message, S: PartialOrd>(
    messages: &mut Subscription<M>,
    stamp: impl Fn(&M) -> S,
) -> Option<M> {
    newest_within(messages, stamp, LATCHED_WITHIN, SETTLES).await
}

/// The newest of the messages that are there already, by its stamp.
pub(crate) async fn newest_there<M: Message, S: PartialOrd>(
    messages: &mut Subscription<M>,
    stamp: impl Fn(&M) -> S,
) -> Option<M> {
    newest_within(messages, stamp, Duration::ZERO, Duration::ZERO).await
}

/// The first may take `first`; those that come within `settles` after it count, too.
async fn newest_within<M: Message, S: PartialOrd>(
    messages: &mut Subscription<M>,
    stamp: impl Fn(&M) -> S,
    first: Duration,
    settles: Duration,
) -> Option<M> {
    let (mut newest, _) = timeout(first, messages.next()).await.ok()?;
    let end = Instant::now() + settles;
    while let Ok((newer, _)) = timeout_at(end, messages.next()).await {
        if stamp(&newer) >= stamp(&newest) {
            newest = newer;
        }
    }
    Some(newest)
}
