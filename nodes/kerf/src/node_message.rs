//! Messages of nodes for people at a terminal. Nodes name their services; people type commands.

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
/// `` `kerf reset` to go on ``. Part of another name stays: `/mill/soft_reset`, `o<set_tool>`, `set_tool.ngc`. Texts
/// that a program shows are not told apart.
pub(crate) fn with_commands(message: &str) -> String {
    COMMANDS.iter().fold(message.to_owned(), |text, (service, command)| {
        let mut named = String::new();
        let mut rest = text.as_str();
        while let Some(at) = rest.find(service) {
            let (before, after) = (&rest[..at], &rest[at + service.len()..]);
            named.push_str(before);
            match before.ends_with(is_of_name) || continues_name(after) {
                true => named.push_str(service),
                false => named.push_str(&format!("`kerf {command}`")),
            }
            rest = after;
        }
        named + rest
    })
}

fn is_of_name(character: char) -> bool {
    character.is_alphanumeric() || "_/`<>#-.\"".contains(character)
}

fn continues_name(after: &str) -> bool {
    match after.strip_prefix('.') {
        // The end of a sentence, or of a file's name.
        Some(after) => after.starts_with(is_of_name),
        None => after.starts_with(is_of_name),
    }
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
            ("use soft_reset.", "use `kerf reset`."),
            ("in o<set_tool>, called from line 3", "in o<set_tool>, called from line 3"),
            ("#<feed_hold> and set_tool.ngc", "#<feed_hold> and set_tool.ngc"),
            ("soft_reset-2 \"set_tool\"", "soft_reset-2 \"set_tool\""),
            ("`kerf reset` or soft_reset", "`kerf reset` or `kerf reset`"),
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
