//! The inputs of a core: the recorded ones, or in a chain what the core before it makes now.
//!
//! As in the running machine, contours and paths go from core to core as messages, which round
//! their millimetres. Everything else is taken from the bag at every level.

use super::ReplayError;
use super::recording::Recording;
use cnc_msgs::chunk::{Collector, ContourChunks, PathChunks};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The inputs of the cores.
#[derive(Debug)]
pub(crate) struct CoreInputs {
    pub(crate) recording: Recording,
    chain: Option<Chain>,
}

/// What the cores made now; `None` for what is refused now.
#[derive(Debug, Default)]
struct Chain {
    /// By program id.
    contours: BTreeMap<String, Option<Arc<ProgrammedContour>>>,
    /// By revision.
    paths: BTreeMap<u64, Option<Arc<CompensatedPath>>>,
}

impl CoreInputs {
    pub(crate) fn new(recording: Recording, is_chain: bool) -> Self {
        Self { recording, chain: is_chain.then(Chain::default) }
    }

    pub(crate) fn is_chain(&self) -> bool {
        self.chain.is_some()
    }

    /// The contour of a program; `None` when there is none (any more).
    pub(crate) fn contour(&self, id: &str) -> Option<Arc<ProgrammedContour>> {
        let recorded = || self.recording.programs.get(id).map(|program| program.contour.clone());
        match &self.chain {
            Some(chain) => chain.contours.get(id).cloned().unwrap_or_else(recorded),
            None => recorded(),
        }
    }

    /// The path of a plan; `None` when there is none (any more).
    pub(crate) fn path(&self, program_id: &str, revision: u64) -> Option<Arc<CompensatedPath>> {
        let recorded = self.recording.path(program_id, revision)?;
        match self.chain.as_ref().and_then(|chain| chain.paths.get(&revision)) {
            Some(path) => path.clone(),
            None => Some(recorded),
        }
    }

    /// Passes on today's contour; `None` for a program that is refused now.
    pub(crate) fn hand_on_contour(
        &mut self,
        id: &str,
        made: Option<(&wire::ProgrammedContour, &ContourChunks)>,
    ) -> Result<(), ReplayError> {
        let Some(chain) = &mut self.chain else { return Ok(()) };
        let contour = match made {
            None => None,
            Some((manifest, chunks)) => {
                let mut collector = Collector::for_contour(manifest)?;
                for chunk in (0..chunks.count()).filter_map(|index| chunks.chunk(index)) {
                    collector.add(chunk)?;
                }
                Some(Arc::new(collector.finish(manifest)?))
            }
        };
        chain.contours.insert(id.to_owned(), contour);
        Ok(())
    }

    /// Passes on today's path; `None` for a plan that is refused now.
    pub(crate) fn hand_on_path(
        &mut self,
        revision: u64,
        made: Option<(&wire::CompensatedPath, &PathChunks)>,
    ) -> Result<(), ReplayError> {
        let Some(chain) = &mut self.chain else { return Ok(()) };
        let path = match made {
            None => None,
            Some((manifest, chunks)) => {
                let mut collector = Collector::for_path(manifest)?;
                for chunk in (0..chunks.count()).filter_map(|index| chunks.chunk(index)) {
                    collector.add(chunk)?;
                }
                Some(Arc::new(collector.finish(manifest)?))
            }
        };
        chain.paths.insert(revision, path);
        Ok(())
    }
}
