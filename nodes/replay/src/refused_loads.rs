//! Programs that the loader refused: today's loader must refuse them with the same message.
//!
//! A refused program is not published; its text is in the request on `command_log`.

use super::ReplayError;
use super::compare::Comparison;
use super::loader::{block_delete, flow, parameter};
use super::recording::Recording;
use cnc_msgs::cdr::{self, LITTLE_ENDIAN};
use cnc_msgs::interface::{Message as _, Service};
use cnc_msgs::profile::Profile;
use cnc_msgs::wire::cnc_msgs::msg::{Command, ContourChunk, PathChunk};
use cnc_msgs::wire::cnc_msgs::srv::{LoadProgram, LoadProgramRequest, LoadProgramResponse};
use program_loader::answer::refusal;
use program_loader::{LoadOptions, load};

/// Types that know the calls and passes of a line since messages name them as they do today.
const CALLS_SINCE: &[&str] = &[ContourChunk::TYPE_NAME, PathChunk::TYPE_NAME];

/// Of a refusal that no bag has the reason of.
const UNREAD_FILE: &str = " was not read: ";

/// The message without the calls and passes that older loaders wrote at its end: ` (pass 1 of the
/// loop in line 2)`, ` (in Opocket, called in line 40)`.
fn without_calls(message: &str) -> &str {
    let begin = [" (pass ", " (in O"].iter().filter_map(|begin| message.rfind(begin)).max();
    match (begin, message.strip_suffix(')')) {
        (Some(begin), Some(rest)) if !rest[begin..].contains(')') => &message[..begin],
        _ => message,
    }
}

/// The message as today's loader writes it: older ones counted one error, ` 1 errors, the first:`.
fn without_one(message: &str) -> String {
    message.replacen(" is refused: 1 errors, the first: ", " is refused: ", 1)
}

/// Loads the refused programs again.
pub(crate) fn replay(
    recording: &Recording,
    comparison: &mut Comparison,
) -> Result<(), ReplayError> {
    let refused = recording.commands.iter().filter(|command| {
        command.endpoint_type == LoadProgram::TYPE_NAME
            && command.error_code == LoadProgramResponse::PROGRAM_REFUSED
    });
    for command in refused {
        let (request, profile) = match again(recording, command)? {
            Ok(inputs) => inputs,
            Err(why) => {
                let text = format!("\"{}\" was not asked again: {why}", command.message);
                comparison.remark("load_program", text);
                continue;
            }
        };
        let options = LoadOptions {
            block_delete: block_delete(recording),
            flow: flow(recording),
            ..LoadOptions::default()
        };
        if command.message.contains(UNREAD_FILE) {
            let why = "the file of a subroutine was not read then";
            let text = format!("\"{}\" was not asked again: {why}", command.message);
            comparison.remark("load_program", text);
            continue;
        }
        let mut loaded = load(request.text.as_bytes(), &profile, &options);
        loaded.allow_tools(&request.expected_tools);
        comparison.count("refused programs", 1);
        let now = refusal(&request.name, &loaded);
        let recorded = without_one(&command.message);
        let is_same = match recording.definitions.is_older(CALLS_SINCE) {
            false => now.as_ref() == Some(&recorded),
            true => {
                loaded.findings.iter_mut().for_each(|finding| finding.calls.clear());
                let now = refusal(&request.name, &loaded);
                now.as_deref() == Some(without_calls(&recorded))
            }
        };
        if !is_same {
            let now = now.unwrap_or_else(|| format!("{} is loaded", request.name));
            let text = format!("\"{}\" became \"{now}\"", command.message);
            comparison.differs("load_program", "message", text);
        }
    }
    Ok(())
}

/// Loads a program again from its request; the inner error says why that is not possible.
fn again(
    recording: &Recording,
    command: &Command,
) -> Result<Result<(LoadProgramRequest, Profile), &'static str>, ReplayError> {
    if command.request_is_cut {
        return Ok(Err("its text was too long for the bag"));
    }
    let body = [&LITTLE_ENDIAN, &*command.request].concat();
    let request: LoadProgramRequest =
        cdr::decode(&body).map_err(|error| ReplayError::request(command, error))?;
    if request.text.is_empty() {
        return Ok(Err("its text came from a file or in pieces and is not in the bag"));
    }
    let control = match request.control.as_str() {
        "" => parameter(recording, "control").map_or("", |value| &value.string_value),
        name => name,
    };
    // A local file of that name may have other content.
    if settings::Control::named(control).is_none() {
        return Ok(Err("its profile came from a file"));
    }
    let problem = |reason: String| ReplayError::Input { of: command.message.clone(), reason };
    let mut profile =
        settings::load_profile(control).map_err(|error| problem(error.to_string()))?;
    if !request.interference.is_empty() {
        let reaction = request.interference.parse();
        profile.interference.react = reaction
            .map_err(|error: cnc_msgs::profile::UnknownReaction| problem(error.to_string()))?;
    }
    Ok(Ok((request, profile)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_error_of_older_messages_is_not_counted() {
        let now = "a.ngc is refused: line 3: division by zero";
        let older = "a.ngc is refused: 1 errors, the first: line 3: division by zero";
        let two = "a.ngc is refused: 2 errors, the first: line 3: division by zero";
        assert_eq!([older, now, two].map(without_one), [now, now, two]);
    }

    #[test]
    fn calls_of_older_messages_are_left_out() {
        let bare = "a.ngc is refused: line 3: division by zero";
        for calls in [
            "",
            " (pass 1 of the loop in line 2)",
            " (in Opocket, called in line 40 for the 2. time, pass 3 of the loop in line 12)",
            " (pass 1 of the loop in line 2, in O<a>, called in line 9, and 4 more)",
        ] {
            assert_eq!(without_calls(&format!("{bare}{calls}")), bare, "{calls}");
        }
        for other in ["G5 (spline) is not known", "the radius (pass 2) is 0 (mm)", "ends (in O"] {
            assert_eq!(without_calls(other), other);
        }
    }
}
