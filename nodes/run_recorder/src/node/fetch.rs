//! What the other nodes still have of the time before a bag was open.

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

/// Traffic that was had.
#[derive(Debug, Default)]
pub(super) struct FetchedTraffic {
    pub(super) batches: Vec<wire::ControllerTraffic>,
    /// Why there is not more.
    pub(super) problem: Option<String>,
}

/// What a service without success says.
fn taken<C>(success: bool, message: String, chunks: Vec<C>) -> Result<Vec<C>, String> {
    if success { Ok(chunks) } else { Err(message) }
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

    /// Everything that the driver has and `seen` has not.
    pub(super) async fn traffic(&self, seen: &Numbers) -> FetchedTraffic {
        let mut fetched = FetchedTraffic::default();
        if !self.traffic.has_server() {
            // When everything stops, the driver goes first: waiting would not bring it back.
            fetched.problem = Some("the driver is not there any more".into());
            return fetched;
        }
        let ranges = match (seen.first(), seen.last()) {
            // What is between, then whatever came after it.
            (Some(first), Some(last)) => {
                let gaps = seen.missing(first, last);
                let gaps = gaps.iter().map(|gap| (*gap.start(), *gap.end()));
                gaps.chain([(last + 1, u64::MAX)]).collect()
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
                    // What is older than the ring is gone; what is in it is not.
                    if response.oldest_sequence <= first || response.oldest_sequence > end {
                        break;
                    }
                    first = response.oldest_sequence;
                    continue;
                }
                let entries: Vec<_> =
                    response.entries.into_iter().filter(|entry| entry.sequence <= end).collect();
                let Some(newest) = entries.last().map(|entry| entry.sequence) else { break };
                fetched.batches.push(wire::ControllerTraffic { entries });
                if newest >= response.newest_sequence {
                    break;
                }
                first = newest + 1;
            }
        }
        fetched
    }
}
