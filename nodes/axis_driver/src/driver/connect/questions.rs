//! What a controller that has just started is asked, and what follows from its answers.

use super::{ConnectStep, Connecting};
use crate::codes;
use crate::driver::context::config::ANSWER;
use crate::driver::context::place::PlaceWatch;
use crate::driver::context::queries::{BUILD_QUERY, QUERIES, SETTINGS_QUERY};
use crate::driver::context::{Context, Origin};
use crate::driver::next::Next;
use crate::driver::output::LogLevel;
use crate::link::{LineKind, realtime};
use crate::report::ReportUnits;
use cnc_msgs::machine::Mode;

impl Connecting {
    /// Asks everything of a controller that has just started.
    pub(in crate::driver) fn begin_queries(&mut self, context: &mut Context) {
        // It may be another board than before.
        context.machine.forget_board();
        let Self { restarts, reply, .. } = *self;
        *self = Self { restarts, ..Self::new(ConnectStep::Asking(0), context.now, reply) };
        self.ask(context, 0);
    }

    fn ask(&mut self, context: &mut Context, query: usize) {
        context.link.send_line(QUERIES[query], LineKind::Slow, Origin::Query(query));
        self.step = ConnectStep::Asking(query);
        self.until = context.now + ANSWER;
    }

    pub(in crate::driver) fn on_answer(
        &mut self,
        context: &mut Context,
        query: usize,
        error: Option<u16>,
    ) {
        if let Some(code) = error {
            let text = codes::describe_error(context.machine.firmware, code);
            context.log(LogLevel::Warn, format!("{} was refused: {text}", QUERIES[query]));
        }
        if query == SETTINGS_QUERY {
            let is_inch = context.machine.reports_in_inches();
            let units = if is_inch { ReportUnits::Inches } else { ReportUnits::Millimetres };
            // Where the setting was not reported, decimals may have shown the unit.
            let is_reported = context.machine.settings.contains_key(&13);
            if (is_reported || !context.machine.has_units) && units != context.link.units() {
                // What was heard before was read in the other unit.
                context.machine.status = None;
                context.machine.place = PlaceWatch::default();
                context.link.set_units(units);
            }
            context.machine.has_units |= error.is_none();
            context.link.ask_for_everything(context.machine.reports_too_little());
        }
        let echoes = context.machine.firmware.traits().echoes_after_control_characters;
        if query == BUILD_QUERY && echoes {
            // A control character of an earlier sender has switched its echo on.
            context.link.send_realtime(realtime::ECHO_OFF);
        }
        if query + 1 < QUERIES.len() {
            return self.ask(context, query + 1);
        }
        context.machine.work_out_offset();
        // Whoever waits for this can rely on the state then.
        self.step = ConnectStep::AwaitingStatus;
        self.until = context.now + ANSWER;
        // An alarm that is announced while connecting leaves the answers in order.
        context.link.trust();
        context.link.ask_status(context.now);
    }

    /// Every question is answered, and a report has come.
    pub(in crate::driver) fn finish(&mut self, context: &mut Context) -> Next {
        let message = format!(
            "connected: {:?}, {} planner blocks, at most {} bytes under way",
            context.machine.firmware,
            context.machine.planner_blocks(),
            context.link.window()
        );
        context.log(LogLevel::Info, message);
        context.publish_settings();
        if let Some(id) = self.reply {
            context.reply(id, Ok("the controller was reset".into()));
        }
        // An alarm locks the machine by itself; without one nothing would.
        let has_moved = context.machine.has_moved_since_start();
        let is_lost = std::mem::take(&mut context.machine.lost_its_place) || has_moved;
        if has_moved {
            context.machine.is_homed = false;
        }
        let needs_reset = is_lost && context.machine.mode() != Mode::Alarm;
        if needs_reset && context.machine.is_moving() {
            context.send_hold();
        }
        if context.machine.needs_acknowledgement {
            return Next::adrift(
                "LINK_LOST: the controller was out of reach while the machine was \
                 moving, and is back; check the tool position, then soft_reset",
            );
        }
        if needs_reset {
            return Next::adrift(
                "RESTARTED: the controller started anew and may take the place where it \
                 stands for zero; soft_reset, then home, or set the work offset again",
            );
        }
        Next::Ready
    }
}
