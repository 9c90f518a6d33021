//! Words that have no effect here: each is reported once, with its first place and how often it stands there.

use cnc_msgs::contour::Source;
use cnc_msgs::finding::{Code, Finding};

/// Why a word has no effect, and what to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NoEffect {
    because: &'static str,
    help: &'static str,
}

/// G61, G64.
pub(crate) const PATH: NoEffect = NoEffect {
    because: "the machine follows the programmed path, and a setting of its controller decides how fast it takes corners",
    help: "delete it, or leave it: the path is the same. Where the machine has to stop, write G4 P0",
};
/// G98, G99.
pub(crate) const RETRACT: NoEffect = NoEffect {
    because: "there are no cycles",
    help: "delete it, or leave it: no move depends on it",
};
/// G99 in a program without cycles. G98 says what holds anyway, and posts write it at the top.
pub(crate) const RETRACT_TO_R: NoEffect = NoEffect {
    because: "cycles return to R under it, and no cycle is executed",
    help: "delete it, unless a cycle that was not executed needs it. On lathes with a Fanuc control G99 is feed per revolution, which is G95 here",
};
/// Q of M66 that does not wait.
pub(crate) const WAIT: NoEffect = NoEffect {
    because: "M66 waits under L1 to L4, and reads the input at once without",
    help: "delete it, or write L with what to wait for: 1 rises, 2 falls, 3 high, 4 low",
};
/// Q of M66 with an analog input.
pub(crate) const WAIT_ANALOG: NoEffect =
    NoEffect { because: "an analog input is read at once", help: "delete it" };
/// F and S in the profile of a lathe cycle.
pub(crate) const PROFILE: NoEffect = NoEffect {
    because: "feed and speed of a lathe cycle are those in force at its own block",
    help: "write F and S into the block of the cycle, or before it",
};
/// G10 L0.
pub(crate) const TOOL_TABLE: NoEffect =
    NoEffect { because: "the planner reads the tool table when it plans", help: "delete it" };
/// `/` at the beginning of a line.
pub(crate) const EXECUTED: NoEffect = NoEffect {
    because: "lines that begin with it are executed",
    help: "to skip them, set the parameter block_delete of the loader, or delete them",
};
/// The same with `block_delete`.
pub(crate) const SKIPPED: NoEffect = NoEffect {
    because: "it begins with /, and block_delete is set",
    help: "to execute such lines, clear the parameter block_delete of the loader",
};

/// Words without an effect, in the order of their first places.
#[derive(Debug, Clone, Default)]
pub(crate) struct NoEffects(Vec<Entry>);

#[derive(Debug, Clone)]
struct Entry {
    /// A G word in tenths, or a letter.
    code: u16,
    why: NoEffect,
    first: Source,
    /// The word at its first place.
    word: String,
    count: u64,
}

impl NoEffects {
    /// Counts a word. Different codes are different words, however they are written.
    #[cold]
    pub(crate) fn add(
        &mut self,
        code: u16,
        why: NoEffect,
        first: Source,
        word: impl FnOnce() -> String,
    ) {
        match self.0.iter_mut().find(|it| (it.code, it.why) == (code, why)) {
            Some(entry) => entry.count += 1,
            None => self.0.push(Entry { code, why, first, word: word(), count: 1 }),
        }
    }

    /// What is reported: a warning for each word, but for those with this reason.
    pub(crate) fn findings(&self, but: Option<NoEffect>) -> impl Iterator<Item = Finding> {
        self.0.iter().filter(move |it| Some(it.why) != but).map(
            |Entry { why, first, word, count, .. }| {
                let times = match count {
                    1 => String::new(),
                    count => format!(" ({count} times in this program)"),
                };
                let message = format!("{word} has no effect{times}: {}", why.because);
                Finding::warning(Code::Unsupported, *first, message).help(why.help)
            },
        )
    }
}
