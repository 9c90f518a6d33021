//! What may wait for a link that is full.

use tokio::runtime::{Handle, RuntimeFlavor};

/// Does what Zenoh may hold up for some seconds, as long as a peer takes nothing in. Other tasks go on.
pub(crate) fn beside_other_tasks<T>(work: impl FnOnce() -> T) -> T {
    match Handle::try_current().map(|executor| executor.runtime_flavor()) {
        Ok(RuntimeFlavor::MultiThread) => tokio::task::block_in_place(work),
        _ => work(),
    }
}
