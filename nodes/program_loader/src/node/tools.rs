//! The tool table, as far as programs read it (`#5410`).
//!
//! The planner has the table. A program that computes with it is read again when it changes, so that what is loaded never
//! has the values of a tool that is not there any more.

use super::{Current, Loader, refusal};
use crate::tool_rows::{load_with_tools, with_tools};
use crate::{Loaded, load};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::wire::cnc_msgs::msg;
use runtime::{Handle, NodeError, Qos, WarningRateLimit};
use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

/// What is loaded in place of a program that is not, or not yet, read with a new table: a run of it stops with the reason, and
/// does not go on.
const WITHDRAWN: &[u8] = b"o1 repeat [100]\n\
    (MSG, the tool table has changed, and the program was not read with it: cancel, and see the log of the loader)\n\
    M0\no1 endrepeat\nM2\n";

/// A program that is read again from here.
pub(super) struct ReadAgain {
    pub(super) name: String,
    /// Without results of probes.
    pub(super) text: Vec<u8>,
    pub(super) profile: Profile,
    pub(super) expected_tools: Vec<u32>,
    /// Whether it goes on from the results of probes.
    pub(super) probes: bool,
    /// Whether it reads the tool table.
    tools: bool,
}

impl ReadAgain {
    /// `None` for a program that is read once.
    pub(super) fn of(
        loaded: &Loaded,
        name: &str,
        text: &[u8],
        profile: &Profile,
        expected_tools: &[u32],
    ) -> Option<Arc<Self>> {
        let (probes, tools) = (loaded.awaits.is_some(), loaded.reads_tools);
        (probes || tools).then(|| {
            Arc::new(Self {
                name: name.to_owned(),
                text: text.to_vec(),
                profile: profile.clone(),
                expected_tools: expected_tools.to_vec(),
                probes,
                tools,
            })
        })
    }
}

impl Loader {
    /// Reads a text with the tool table that there is.
    pub(super) fn load<'t>(&self, text: &'t [u8], profile: &Profile) -> (Cow<'t, [u8]>, Loaded) {
        let tools = self.state().tools.clone();
        match tools {
            Some(tools) => load_with_tools(text, profile, &self.options, &tools),
            None => (text.into(), load(text, profile, &self.options)),
        }
    }

    /// There is another table: a program that reads it is read again, from its beginning. A run that waits for its next
    /// stretch is refused that one, because it has begun with other values.
    fn on_tools(&self, tools: ToolTable) {
        self.state().tools = Some(tools);
        let current = self.state().current.clone();
        let again = current.as_ref().and_then(|current| current.first().again.clone());
        let Some(again) = again.filter(|it| it.tools) else { return };
        let ReadAgain { name, text, profile, expected_tools, .. } = &*again;
        let with_rows = self.state().tools.as_ref().map(|tools| with_tools(text, tools));
        let is_current = |text: &[u8]| {
            let program_id = super::id_of(profile, text);
            current.as_ref().is_some_and(|current| current.first().program_id == program_id)
        };
        if with_rows.as_deref().is_some_and(is_current) {
            return;
        }
        // It may take a while.
        self.withdraw(Arc::clone(&again));
        let (text, mut loaded) = self.load(text, profile);
        let program_id = super::id_of(profile, &text);
        loaded.allow_tools(expected_tools);
        if let Some(message) = refusal(name, &loaded) {
            let message = format!("the tool table has changed, and {message}");
            tracing::error!("{message}");
            self.state().refused = Some(message);
            return;
        }
        tracing::warn!("{name} reads the tool table, which has changed: it was loaded again");
        let again = ReadAgain::of(&loaded, name, &text, profile, expected_tools);
        self.remember_left(&program_id, &mut loaded);
        let read = self.current(name.clone(), text.into_owned(), profile, loaded);
        self.state().refused = None;
        self.publish(Current { again, ..read });
    }

    /// Loads a message in place of a program, so that nobody runs it with values that are not true any more. The next table may be
    /// one that it can be read with.
    fn withdraw(&self, again: Arc<ReadAgain>) {
        let name = format!("{} (withdrawn)", again.name);
        let instead = load(WITHDRAWN, &again.profile, &self.options);
        let current = self.current(name, WITHDRAWN.to_vec(), &again.profile, instead);
        self.publish(Current { again: Some(again), ..current });
    }
}

/// Follows the tool table of the planner.
pub(super) fn follow(node: &Handle, loader: &Arc<Loader>) -> Result<(), NodeError> {
    let mut tables = node.subscription::<msg::ToolTable>("tool_table", Qos::LATCHED)?;
    let loader = Arc::clone(loader);
    node.spawn("tool table", async move {
        let mut complaints = WarningRateLimit::default();
        loop {
            let (table, info) = tables.next().await;
            let tools = match ToolTable::try_from(&table) {
                Ok(tools) => tools,
                Err(error) => {
                    if complaints.are_due(info.publisher, Instant::now()) {
                        tracing::error!("invalid tool table from {}: {error}", info.publisher);
                    }
                    continue;
                }
            };
            let worker = Arc::clone(&loader);
            let _work = loader.work.lock().await;
            let done = tokio::task::spawn_blocking(move || worker.on_tools(tools));
            if let Err(error) = done.await {
                tracing::error!("the tool table was not followed: {error}");
            }
        }
    });
    Ok(())
}
