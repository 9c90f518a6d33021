//! Chunks of programs and contours: receives uploads, serves the loaded program.

use super::{Current, Loader, Refusal, refuse};
use crate::upload::UploadError;
use cnc_msgs::wire::cnc_msgs::srv::{
    GetContourChunksRequest, GetContourChunksResponse, GetProgramChunksRequest,
    GetProgramChunksResponse, PutProgramChunkRequest, PutProgramChunkResponse,
};
use runtime::chunks::{Cut, page};
use std::sync::Arc;

impl Loader {
    pub(super) fn put_chunk(&self, request: PutProgramChunkRequest) -> PutProgramChunkResponse {
        use UploadError as E;
        type W = PutProgramChunkResponse;
        if let Err(message) = self.node.require_active() {
            return W { error_code: W::NOT_ACTIVE, message, ..W::default() };
        }
        match self.state().uploads.put(request) {
            Ok(received_count) => {
                PutProgramChunkResponse { success: true, received_count, ..W::default() }
            }
            Err(error) => PutProgramChunkResponse {
                error_code: match error {
                    E::Damaged { .. } => W::CHECKSUM,
                    E::TooLarge { .. } | E::ChunkTooLarge { .. } => W::TOO_LARGE,
                    _ => W::INVALID_REQUEST,
                },
                message: error.to_string(),
                ..W::default()
            },
        }
    }

    pub(super) fn program_chunks(
        &self,
        request: &GetProgramChunksRequest,
    ) -> GetProgramChunksResponse {
        type W = GetProgramChunksResponse;
        match self.chunks(&request.program_id, request.first, |current| &current.program) {
            Ok(chunks) => GetProgramChunksResponse { success: true, chunks, ..W::default() },
            Err(Refusal { code, message }) => {
                GetProgramChunksResponse { error_code: code, message, ..W::default() }
            }
        }
    }

    pub(super) fn contour_chunks(
        &self,
        request: &GetContourChunksRequest,
    ) -> GetContourChunksResponse {
        type W = GetContourChunksResponse;
        match self.chunks(&request.program_id, request.first, |current| &current.contour) {
            Ok(chunks) => GetContourChunksResponse { success: true, chunks, ..W::default() },
            Err(Refusal { code, message }) => {
                GetContourChunksResponse { error_code: code, message, ..W::default() }
            }
        }
    }

    /// A page of chunks of the loaded program; `cut` selects the text or the contour.
    fn chunks<C: cnc_msgs::interface::Message>(
        &self,
        wanted: &str,
        first: u32,
        cut: impl Fn(&Current) -> &Cut<C>,
    ) -> Result<Vec<C>, Refusal> {
        type W = GetContourChunksResponse;
        let state = self.state();
        let Some(current) = &state.current else {
            return refuse(W::UNKNOWN_PROGRAM, "no program is loaded");
        };
        let named = if wanted.is_empty() { Some(current) } else { current.named(wanted) };
        let Some(named) = named else {
            return refuse(
                W::UNKNOWN_PROGRAM,
                format_args!("program {wanted} is not loaded; {} is", current.program_id),
            );
        };
        let cut = Arc::clone(cut(named));
        drop(state);
        let chunks = page(first, &cut);
        if chunks.is_empty() {
            return refuse(W::UNKNOWN_CHUNK, format_args!("there is no chunk {first}"));
        }
        Ok(chunks)
    }
}
