//! Tasks and threads of a node; a panic in one stops the node.

use crate::endpoints::node::Handle;
use crate::process::lock;
use futures::FutureExt;
use futures::future::BoxFuture;
use std::panic::AssertUnwindSafe;

impl Handle {
    /// Runs a task that ends with the node. If it panics, the node stops.
    pub fn spawn<F>(&self, name: &str, task: F)
    where
        F: Future<Output = ()> + Send + 'static,
    {
        self.spawn_boxed(name, Box::pin(task));
    }

    /// Of one type, so that what tokio needs of a task is compiled once.
    fn spawn_boxed(&self, name: &str, task: BoxFuture<'static, ()>) {
        let (name, shutdown) = (name.to_owned(), self.inner.shutdown.clone());
        let mut tasks = lock(&self.inner.tasks);
        while tasks.try_join_next().is_some() {}
        tasks.spawn(async move {
            if let Err(panic) = AssertUnwindSafe(task).catch_unwind().await {
                let reason = panic_text(&*panic);
                tracing::error!("task \"{name}\" panicked: {reason}; the node stops");
                shutdown.fail(&format!("task \"{name}\" panicked: {reason}"));
            }
        });
    }

    /// Runs a named thread, for work that must not wait for other tasks. It must end by itself
    /// when the node stops. If it panics, the node stops.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn spawn_thread(
        &self,
        name: &str,
        work: impl FnOnce() + Send + 'static,
    ) -> std::io::Result<std::thread::JoinHandle<()>> {
        let (label, shutdown) = (name.to_owned(), self.inner.shutdown.clone());
        std::thread::Builder::new().name(name.to_owned()).spawn(move || {
            if let Err(panic) = std::panic::catch_unwind(AssertUnwindSafe(work)) {
                let reason = panic_text(&*panic);
                tracing::error!("thread \"{label}\" panicked: {reason}; the node stops");
                shutdown.fail(&format!("thread \"{label}\" panicked: {reason}"));
            }
        })
    }
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_owned())
}
