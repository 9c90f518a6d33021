//! The end of a stop: the controller has restarted, and is asked what it has kept.

use super::{StopStep, Stopping};
use crate::driver::context::config::ANSWER;
use crate::driver::context::queries::{QUERIES, WORDS_QUERY};
use crate::driver::context::{Context, Origin};
use crate::driver::next::Next;
use crate::driver::output::LogLevel;
use crate::link::LineKind;

impl Stopping {
    /// The start message came: the machine stands and has forgotten the program. Asks for
    /// the words in force and the offsets.
    pub(in crate::driver) fn on_banner(&mut self, context: &mut Context) {
        self.step = StopStep::Reporting { until: context.now + ANSWER };
        // Which offsets it has kept depends on the controller.
        self.shift_before = context.machine.whole_shift();
        let query = WORDS_QUERY;
        context.link.send_line(QUERIES[query], LineKind::Slow, Origin::Query(query));
    }

    /// One of these was answered.
    pub(super) fn on_query_answer(&mut self, context: &mut Context, query: usize) {
        if query + 1 < QUERIES.len() {
            context.machine.offsets.clear();
            let next = query + 1;
            return context.link.send_line(QUERIES[next], LineKind::Slow, Origin::Query(next));
        }
        if self.shift_before.is_other(&context.machine.whole_shift()) {
            let text = "the reset has dropped G92: the work frame has moved; set it again";
            context.log(LogLevel::Warn, text);
        }
        context.machine.work_out_offset();
        context.publish_settings();
        context.link.ask_status(context.now);
    }

    /// The first report after the answers has come.
    pub(super) fn finish(&mut self, context: &mut Context) -> Next {
        if context.machine.has_moved_since_start() {
            context.machine.is_homed = false;
        }
        if let Some(id) = self.reply.take() {
            context.reply(id, Ok("the controller was reset".into()));
        }
        Next::Ready
    }
}
