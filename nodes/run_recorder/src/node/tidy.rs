//! Removing the bags that are not kept any more, and telling of it.

use super::Recorder;
use super::parameters;
use crate::retention::Beyond;
use crate::stored_bags::{Tidied, tidy};
use runtime::{Health, HealthLevel};
use std::sync::{Arc, PoisonError};

const BYTES_PER_MB: f64 = 1e6;

impl Recorder {
    /// Removes what is not kept, beside whatever else is to be done: at the start, and when a
    /// bag is closed.
    pub(super) fn begin_to_tidy(self: &Arc<Self>) {
        let shared = Arc::clone(self);
        self.node.spawn("old bags", async move { shared.tidy().await });
    }

    async fn tidy(self: &Arc<Self>) {
        let keep = parameters::keep(&self.node);
        let shared = Arc::clone(self);
        let tidied = tokio::task::spawn_blocking(move || {
            let one_at_a_time = shared.tidying.lock().unwrap_or_else(PoisonError::into_inner);
            // By the clock of the disk, not that of the run.
            let now_ns = u64::try_from(runtime::RosTime::wall().as_nanos()).unwrap_or(0);
            let tidied = tidy(&shared.directory, keep, now_ns);
            drop(one_at_a_time);
            if let Ok(tidied) = &tidied {
                let mut stuck = shared.stuck.lock().unwrap_or_else(PoisonError::into_inner);
                stuck.clone_from(&tidied.stuck);
            }
            tidied
        });
        match tidied.await {
            Ok(Ok(tidied)) => log(&tidied),
            Ok(Err(error)) => tracing::warn!(
                "old bags in {} are not looked for: {error}",
                self.directory.display()
            ),
            Err(error) => tracing::error!("removing old bags failed: {error}"),
        }
    }

    /// Whether all bags went that were to go.
    pub(super) fn health_of_old_bags(&self) -> Health {
        let stuck = self.stuck.lock().unwrap_or_else(PoisonError::into_inner);
        let (level, message) = match stuck.first() {
            None => (HealthLevel::Ok, "none is left that is not kept".to_owned()),
            Some((path, why)) => {
                let others = match stuck.len() - 1 {
                    0 => String::new(),
                    count => format!(", nor can {count} others"),
                };
                let path = path.display();
                (HealthLevel::Warn, format!("{path} cannot be removed: {why}{others}"))
            }
        };
        let values = vec![("not removed".to_owned(), stuck.len().to_string())];
        Health { component: "old bags".into(), level, message, values, ..Health::default() }
    }
}

fn log(tidied: &Tidied) {
    for removal in &tidied.removed {
        let (path, size) = (removal.path.display(), removal.size as f64 / BYTES_PER_MB);
        match removal.beyond {
            Beyond::Age(age) => tracing::info!(
                "removed {path} ({size:.1} MB): it is {:.1} days old",
                age.as_secs_f64() / 86_400.0
            ),
            Beyond::Space(total) => tracing::info!(
                "removed {path} ({size:.1} MB): bags took {:.1} MB",
                total as f64 / BYTES_PER_MB
            ),
        }
    }
    for (path, why) in &tidied.stuck {
        tracing::warn!("{} is not kept any more and cannot be removed: {why}", path.display());
    }
}
