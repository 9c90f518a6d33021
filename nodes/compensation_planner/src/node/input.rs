//! Fetches the contour to plan, if this node has the memory for it.

use cnc_msgs::chunk::Collector;
use cnc_msgs::contour::{ProgrammedContour, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::profile::Profile;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::cnc_msgs::srv::{GetContourChunks, GetContourChunksRequest};
use runtime::Client;
use runtime::chunks::pull;
use std::sync::Arc;

/// The least memory that an event of a contour takes until it is planned, bytes. Measured with 3
/// and 5 million lines without compensation; compensated ones take up to 800.
const EVENT_BYTES: u64 = 450;
/// The memory that the node takes besides, bytes.
const BESIDES_BYTES: u64 = 24 << 20;
const MB: u64 = 1 << 20;

/// A contour and the profile that it is planned by.
#[derive(Clone)]
pub(super) struct Input {
    pub(super) manifest: wire::ProgrammedContour,
    /// Empty if it is too long.
    pub(super) contour: Arc<ProgrammedContour>,
    pub(super) profile: Arc<Profile>,
    /// Why it is not planned.
    pub(super) too_long: Option<Finding>,
}

/// Fetches a contour, unless it needs more memory than this process may take.
pub(super) async fn fetch(
    client: &Client<GetContourChunks>,
    manifest: wire::ProgrammedContour,
    memory_bytes_max: u64,
) -> Result<Input, runtime::Error> {
    let profile = Arc::new(settings::profile_from_yaml(&manifest.profile)?);
    let mut collector = Collector::for_contour(&manifest)?;
    let too_long = too_long(manifest.event_count, memory_bytes_max);
    if too_long.is_some() {
        return Ok(Input { manifest, contour: Arc::default(), profile, too_long });
    }
    let request =
        |first| GetContourChunksRequest { program_id: manifest.program_id.clone(), first };
    pull(client, &mut collector, request, |response| {
        if response.success { Ok(response.chunks) } else { Err(response.message) }
    })
    .await?;
    let contour = tokio::task::spawn_blocking({
        let manifest = manifest.clone();
        move || collector.finish(&manifest)
    })
    .await??;
    Ok(Input { manifest, contour: Arc::new(contour), profile, too_long })
}

/// Why a contour with so many events cannot be planned within this memory.
fn too_long(event_count: u64, memory_bytes_max: u64) -> Option<Finding> {
    let needed = event_count.saturating_mul(EVENT_BYTES).saturating_add(BESIDES_BYTES);
    if needed <= memory_bytes_max {
        return None;
    }
    let message = format!(
        "planning {event_count} events takes {} MB of memory or more; the planner may take {} MB",
        needed / MB,
        memory_bytes_max / MB
    );
    let help = "split the program into several, or start the planner with a larger memory_mb_max";
    Some(Finding::error(Code::Limit, Source::default(), message).help(help))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contour_for_which_there_is_too_little_memory_is_refused_with_numbers() {
        let usual = 2_048 * MB;
        // Three million lines were planned within 1.4 GB; eight million ended the node again and
        // again.
        assert_eq!(too_long(3_000_000, usual), None);
        let limit = too_long(8_000_000, usual).expect("a limit");
        assert!(limit.is_error() && limit.code == Code::Limit, "{limit:?}");
        assert!(limit.message.contains("takes 3457 MB of memory or more"), "{limit:?}");
        assert!(limit.message.contains("may take 2048 MB"), "{limit:?}");
        assert!(limit.help.contains("memory_mb_max"), "{limit:?}");
        assert!(too_long(u64::MAX, usual).is_some());
    }
}
