//! Removes expired bags and reports them.

use super::Recorder;
use super::parameters;
use crate::retention::ExceededLimit;
use crate::stored_bags::{RemovedBags, remove_old_bags};
use runtime::{Health, HealthLevel};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError};

const BYTES_PER_MB: f64 = 1e6;

impl Recorder {
    /// Removes expired bags in the background: at the start, and when a bag is closed.
    pub(super) fn spawn_removal_of_old_bags(self: &Arc<Self>) {
        let shared = Arc::clone(self);
        self.node.spawn("old bags", async move { shared.remove_old_bags().await });
    }

    async fn remove_old_bags(self: &Arc<Self>) {
        let keep = parameters::keep(&self.node);
        let directory = self.directory();
        let searched = directory.clone();
        let shared = Arc::clone(self);
        let removal = tokio::task::spawn_blocking(move || {
            let one_at_a_time = shared.removal_lock.lock().unwrap_or_else(PoisonError::into_inner);
            // By the wall clock, as the times of files, not by the clock of the run.
            let now_ns = u64::try_from(runtime::RosTime::wall().as_nanos()).unwrap_or(0);
            let removal = remove_old_bags(&searched, keep, now_ns, &shared.due_for_fleet());
            *shared.stuck.lock().unwrap_or_else(PoisonError::into_inner) = match &removal {
                Ok(removal) => removal.stuck.iter().map(not_removed).collect(),
                Err(error) => vec![not_listed(&searched, error)],
            };
            drop(one_at_a_time);
            removal
        });
        match removal.await {
            Ok(Ok(removal)) => log(&removal),
            Ok(Err(error)) => tracing::warn!("{}", not_listed(&directory, &error)),
            Err(error) => tracing::error!("removing old bags failed: {error}"),
        }
    }

    /// The health of the retention: whether all expired bags were removed.
    pub(super) fn health_of_old_bags(&self) -> Health {
        health(&self.stuck.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

fn health(stuck: &[String]) -> Health {
    let (level, message) = match stuck {
        [] => (HealthLevel::Ok, "no bag is due for removal".to_owned()),
        [only] => (HealthLevel::Warn, only.clone()),
        [first, others @ ..] => (HealthLevel::Warn, format!("{first}; and {} more", others.len())),
    };
    let values = vec![("problems".to_owned(), stuck.len().to_string())];
    Health { component: "old bags".into(), level, message, values, ..Health::default() }
}

fn not_removed((path, why): &(PathBuf, String)) -> String {
    format!("{} is due for removal, but cannot be removed: {why}", path.display())
}

fn not_listed(directory: &Path, error: &io::Error) -> String {
    format!("cannot look for old bags in {}: {error}", directory.display())
}

fn log(removal: &RemovedBags) {
    for removal in &removal.removed {
        let (path, size) = (removal.path.display(), removal.size as f64 / BYTES_PER_MB);
        match removal.beyond {
            ExceededLimit::Age(age) => tracing::info!(
                "removed {path} ({size:.1} MB): it is {:.1} days old",
                age.as_secs_f64() / 86_400.0
            ),
            ExceededLimit::Space(total) => tracing::info!(
                "removed {path} ({size:.1} MB): bags took {:.1} MB",
                total as f64 / BYTES_PER_MB
            ),
        }
    }
    for stuck in &removal.stuck {
        tracing::warn!("{}", not_removed(stuck));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_of_old_bags_is_a_warning() {
        let bag = |name: &str| not_removed(&(name.into(), "permission denied".to_owned()));
        let listing = not_listed(Path::new("bags"), &io::ErrorKind::PermissionDenied.into());
        let one = "a is due for removal, but cannot be removed: permission denied";
        let table = [
            (vec![], HealthLevel::Ok, "no bag is due for removal".to_owned()),
            (vec![bag("a")], HealthLevel::Warn, one.to_owned()),
            (vec![bag("a"), bag("b"), bag("c")], HealthLevel::Warn, format!("{one}; and 2 more")),
            (vec![listing.clone()], HealthLevel::Warn, listing),
        ];
        for (stuck, level, message) in table {
            let health = health(&stuck);
            assert_eq!((health.level, health.message), (level, message));
        }
    }
}
