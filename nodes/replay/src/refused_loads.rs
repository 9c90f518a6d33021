//! Programs that the loader refused: today's loader must refuse them with the same message.
//!
//! A refused program is not published; its text is in the request on `command_log`.

use super::ReplayError;
use super::compare::Comparison;
use super::loader::{block_delete, parameter};
use super::recording::Recording;
use cnc_msgs::cdr::{self, LITTLE_ENDIAN};
use cnc_msgs::interface::Service;
use cnc_msgs::profile::Profile;
use cnc_msgs::wire::cnc_msgs::msg::Command;
use cnc_msgs::wire::cnc_msgs::srv::{LoadProgram, LoadProgramRequest, LoadProgramResponse};
use program_loader::node::refusal;
use program_loader::{LoadOptions, load};

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
        let options =
            LoadOptions { block_delete: block_delete(recording), ..LoadOptions::default() };
        let mut loaded = load(request.text.as_bytes(), &profile, &options);
        loaded.allow_tools(&request.expected_tools);
        comparison.count("refused programs", 1);
        let now = refusal(&request.name, &loaded);
        if now.as_ref() != Some(&command.message) {
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
