//! Messages of nodes for whoever sits at a terminal. Nodes name their services; here it is commands that
//! people type.

/// Services that messages name, each with its command.
const COMMANDS: [(&str, &str); 9] = [
    ("confirm_tool_change", "confirm"),
    ("door_hold", "door-hold"),
    ("execute_mdi", "mdi"),
    ("feed_hold", "hold"),
    ("set_overrides", "override"),
    ("set_tool", "tool"),
    ("set_work_offset", "zero"),
    ("single_block", "single-block"),
    ("soft_reset", "reset"),
];

/// The message with the command in place of each service: `soft_reset to go on` becomes
/// `` `kerf reset` to go on ``. The full name of a service (`/mill/soft_reset`) stays.
pub(crate) fn with_commands(message: &str) -> String {
    let is_of_word = |character: char| character.is_alphanumeric() || "_/`".contains(character);
    let words = message.split_inclusive(|character| !is_of_word(character));
    let named = words.map(|part| {
        let word = part.trim_end_matches(|character| !is_of_word(character));
        let end = &part[word.len()..];
        match COMMANDS.iter().find(|(service, _)| *service == word) {
            Some((_, command)) => format!("`kerf {command}`{end}"),
            None => part.to_owned(),
        }
    });
    named.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn a_service_is_named_as_its_command() {
        for (message, expected) in [
            ("ALARM:5; soft_reset to go on", "ALARM:5; `kerf reset` to go on"),
            ("only soft_reset stops it", "only `kerf reset` stops it"),
            ("confirm_tool_change or cancel first", "`kerf confirm` or cancel first"),
            (
                "enter it with set_tool and confirm again",
                "enter it with `kerf tool` and confirm again",
            ),
            ("then soft_reset", "then `kerf reset`"),
            (
                "(soft_reset), soft_reset: soft_reset;",
                "(`kerf reset`), `kerf reset`: `kerf reset`;",
            ),
            (
                "no answer from /mill/soft_reset within 5 s",
                "no answer from /mill/soft_reset within 5 s",
            ),
            ("stopped by a soft reset", "stopped by a soft reset"),
            ("my_soft_reset äsoft_reset", "my_soft_reset äsoft_reset"),
            ("FEED_HOLD", "FEED_HOLD"),
            ("", ""),
        ] {
            assert_eq!(with_commands(message), expected);
        }
    }

    #[test]
    fn every_command_in_place_of_a_service_is_there() {
        let kerf = crate::Cli::command();
        for (service, command) in COMMANDS {
            assert!(kerf.find_subcommand(command).is_some(), "{service}: {command}");
        }
    }
}
