//! The shutdown signal.

use std::sync::Arc;
use tokio::sync::watch;

/// Whatever ends a node, for its log.
pub type Error = Box<dyn std::error::Error + Send + Sync>;
/// The result of a node's run.
pub type NodeResult = Result<(), Error>;

/// All clones see it; a request cannot be undone.
#[derive(Debug, Clone)]
pub struct Shutdown {
    reason: Arc<watch::Sender<Option<Reason>>>,
}

#[derive(Debug, Clone)]
struct Reason {
    text: String,
    is_failure: bool,
}

impl Shutdown {
    pub(crate) fn new() -> Self {
        Self { reason: Arc::new(watch::Sender::new(None)) }
    }

    /// Requests the shutdown; the first reason is kept.
    pub fn request(&self, reason: &str) {
        self.set(reason, false);
    }

    /// Requests the shutdown because of a failure; the exit status shows it.
    pub fn fail(&self, reason: &str) {
        self.set(reason, true);
    }

    fn set(&self, text: &str, is_failure: bool) {
        self.reason.send_if_modified(|current| {
            let is_first = current.is_none();
            current.get_or_insert_with(|| Reason { text: text.to_owned(), is_failure });
            is_first
        });
    }

    /// Whether the shutdown was requested.
    pub fn is_requested(&self) -> bool {
        self.reason.borrow().is_some()
    }

    /// The reason, if the shutdown was requested.
    pub fn reason(&self) -> Option<String> {
        self.reason.borrow().as_ref().map(|reason| reason.text.clone())
    }

    /// Whether a failure requested the shutdown.
    pub fn is_failure(&self) -> bool {
        self.reason.borrow().as_ref().is_some_and(|reason| reason.is_failure)
    }

    /// Waits for the request; may be dropped and called again.
    pub async fn requested(&self) {
        let mut changes = self.reason.subscribe();
        // The sender lives as long as `self`.
        drop(changes.wait_for(Option::is_some).await);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_first_reason_is_kept_and_everyone_wakes() {
        let shutdown = Shutdown::new();
        let other = shutdown.clone();
        let waiting = tokio::spawn(async move { other.requested().await });
        assert!(!shutdown.is_requested());
        shutdown.request("SIGINT");
        shutdown.request("later");
        waiting.await.expect("wakes");
        shutdown.requested().await;
        assert_eq!(shutdown.reason().as_deref(), Some("SIGINT"));
        assert!(!shutdown.is_failure());
    }
}
