//! What the loader says of the loaded program: which one it is, and the text of a block for messages.

use cnc_msgs::wire::cnc_msgs::srv::{GetProgramChunks, GetProgramChunksRequest};
use runtime::Client;
use std::time::Duration;

/// How long the loader may take; a result never waits longer for a text.
const ASK_WITHIN: Duration = Duration::from_millis(500);
/// No more of a block is shown.
const SHOWN_CHARS: usize = 80;

/// The text of a line of a program; `None` when the loader does not say.
pub(super) async fn text_of(
    client: &Client<GetProgramChunks>,
    program_id: &str,
    line: u32,
) -> Option<String> {
    let search = async {
        let (mut first, mut at, mut found) = (0, 1, Vec::new());
        loop {
            let request = GetProgramChunksRequest { program_id: program_id.to_owned(), first };
            let answer = client.call_within(request, ASK_WITHIN).await.ok()?;
            let is_last = answer.chunks.last()?.index + 1 >= answer.chunks.last()?.chunk_count;
            for byte in answer.chunks.iter().flat_map(|chunk| &chunk.data) {
                match byte {
                    b'\n' if at == line => return Some(found),
                    b'\n' => at += 1,
                    _ if at == line => found.push(*byte),
                    _ => {}
                }
            }
            if is_last {
                return (at == line).then_some(found);
            }
            first = answer.chunks.last()?.index + 1;
        }
    };
    let bytes = tokio::time::timeout(ASK_WITHIN, search).await.ok()??;
    let text: String = String::from_utf8_lossy(&bytes).trim().chars().take(SHOWN_CHARS).collect();
    (!text.is_empty()).then_some(text)
}

/// The program that the loader has loaded; `None` when it does not say, or has none.
pub(super) async fn loaded(client: &Client<GetProgramChunks>) -> Option<String> {
    let request = GetProgramChunksRequest::default();
    let answer = client.call_within(request, ASK_WITHIN).await.ok()?;
    Some(answer.chunks.into_iter().next()?.program_id)
}
