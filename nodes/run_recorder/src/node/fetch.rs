//! Fetches messages from before a bag was open that other nodes still have.

use super::numbers::Numbers;
use cnc_msgs::chunk::Collector;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::cnc_msgs::srv::{
    GetContourChunks, GetContourChunksRequest, GetPathChunks, GetPathChunksRequest,
    GetProgramChunks, GetProgramChunksRequest, GetTraffic, GetTrafficRequest,
};
use runtime::chunks::{PullError, pull};
use runtime::{Client, Handle, NodeError};

/// The services that are asked.
pub(super) struct Sources {
    program: Client<GetProgramChunks>,
    contour: Client<GetContourChunks>,
    path: Client<GetPathChunks>,
    traffic: Client<GetTraffic>,
}

/// Traffic that was fetched.
#[derive(Debug, Default)]
pub(super) struct FetchedTraffic {
    pub(super) batches: Vec<wire::ControllerTraffic>,
    /// Why it is not complete.
    pub(super) problem: Option<String>,
}

/// The reason of a service that answers without success.
fn taken<C>(success: bool, message: String, chunks: Vec<C>) -> Result<Vec<C>, String> {
    if success { Ok(chunks) } else { Err(message) }
}

/// The next number to request after an answer to `first` whose newest entry is `got`; `None`
/// when there are no more entries or no progress.
fn next_wanted(first: u64, got: Option<u64>, newest: u64) -> Option<u64> {
    got.filter(|&got| got >= first && got < newest).and_then(|got| got.checked_add(1))
}

impl Sources {
    pub(super) fn new(node: &Handle) -> Result<Self, NodeError> {
        Ok(Self {
            program: node.client("program/get_chunks")?,
            contour: node.client("programmed_contour/get_chunks")?,
            path: node.client("compensated_path/get_chunks")?,
            traffic: node.client("get_traffic")?,
        })
    }

    pub(super) async fn program(
        &self,
        manifest: &wire::Program,
    ) -> Result<Vec<wire::ProgramChunk>, PullError> {
        let mut collector = Collector::for_program(manifest)?;
        let program_id = &manifest.program_id;
        let request = |first| GetProgramChunksRequest { program_id: program_id.clone(), first };
        pull(&self.program, &mut collector, request, |r| taken(r.success, r.message, r.chunks))
            .await?;
        Ok(collector.into_chunks())
    }

    pub(super) async fn contour(
        &self,
        manifest: &wire::ProgrammedContour,
    ) -> Result<Vec<wire::ContourChunk>, PullError> {
        let mut collector = Collector::for_contour(manifest)?;
        let program_id = &manifest.program_id;
        let request = |first| GetContourChunksRequest { program_id: program_id.clone(), first };
        pull(&self.contour, &mut collector, request, |r| taken(r.success, r.message, r.chunks))
            .await?;
        Ok(collector.into_chunks())
    }

    pub(super) async fn path(
        &self,
        manifest: &wire::CompensatedPath,
    ) -> Result<Vec<wire::PathChunk>, PullError> {
        let mut collector = Collector::for_path(manifest)?;
        let (program_id, revision) = (&manifest.program_id, manifest.revision);
        let request =
            |first| GetPathChunksRequest { program_id: program_id.clone(), revision, first };
        pull(&self.path, &mut collector, request, |r| taken(r.success, r.message, r.chunks))
            .await?;
        Ok(collector.into_chunks())
    }

    /// Fetches every entry that the driver has and `seen` has not.
    pub(super) async fn traffic(&self, seen: &Numbers) -> FetchedTraffic {
        let mut fetched = FetchedTraffic::default();
        if self.traffic.servers() == 0 {
            // At a shutdown the driver may have stopped already: do not wait for it.
            fetched.problem = Some("the driver no longer answers".into());
            return fetched;
        }
        let ranges = match (seen.first(), seen.last()) {
            // The gaps, then everything after them.
            (Some(first), Some(last)) => {
                let gaps = seen.missing(first, last);
                let gaps = gaps.iter().map(|gap| (*gap.start(), *gap.end()));
                // There is no number after the largest one.
                gaps.chain(last.checked_add(1).map(|next| (next, u64::MAX))).collect()
            }
            // From the checkpoint that the driver made for this run.
            _ => vec![(0, u64::MAX)],
        };
        for (mut first, end) in ranges {
            while first <= end {
                let request = GetTrafficRequest { first_sequence: first };
                let response = match self.traffic.call(request).await {
                    Ok(response) => response,
                    Err(error) => {
                        fetched.problem = Some(error.to_string());
                        return fetched;
                    }
                };
                if !response.success {
                    fetched.problem = Some(response.message);
                    // Entries older than the ring buffer are lost; those in it are not.
                    if response.oldest_sequence <= first || response.oldest_sequence > end {
                        break;
                    }
                    first = response.oldest_sequence;
                    continue;
                }
                let entries: Vec<_> =
                    response.entries.into_iter().filter(|entry| entry.sequence <= end).collect();
                let newest = entries.iter().map(|entry| entry.sequence).max();
                let next = next_wanted(first, newest, response.newest_sequence);
                if !entries.is_empty() {
                    fetched.batches.push(wire::ControllerTraffic { entries });
                }
                match next {
                    Some(next) => first = next,
                    None => break,
                }
            }
        }
        fetched
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn asking_goes_on_only_while_it_gets_further() {
        const MAX: u64 = u64::MAX;
        // asked from, newest of the answer, newest there is, asked from next
        let table = [
            (5, Some(9), 20, Some(10)),
            (5, Some(5), 20, Some(6)),
            (5, Some(20), 20, None),
            // Older than requested, or nothing.
            (5, Some(4), 20, None),
            (5, None, 20, None),
            (0, Some(MAX), MAX, None),
            (MAX, Some(MAX), MAX, None),
            (0, Some(MAX - 1), MAX, Some(MAX)),
        ];
        for (first, got, newest, expected) in table {
            assert_eq!(next_wanted(first, got, newest), expected, "{first}, {got:?}, {newest}");
        }
    }
}
