//! A function of the user: the machine stands until a node of the cell has done it.
//!
//! It is called once. Where nobody can say any more whether it was done, the run ends.

use super::exit::Exit;
use super::{ProgramRun, Stage};
use crate::codes::error_code;
use crate::driver::context::Context;
use crate::driver::output::{LogLevel, Output, UserFunctionCall};
use crate::encoder::UserFunction;
use cnc_msgs::contour::Source;
use std::time::Duration;

/// What the call and its answer take besides the function itself: a client may have to find the server.
const ON_ITS_WAY: Duration = Duration::from_secs(10);

/// A call that is under way.
#[derive(Debug, Clone)]
pub(super) struct Calling {
    function: UserFunction,
    source: Source,
    pub(super) until: Duration,
}

impl Calling {
    /// It has the whole time again: while the machine is held its node may wait, too.
    pub(super) fn extend(&mut self, context: &Context) {
        let most = Duration::from_secs(u64::from(context.config.user_function_s_max));
        self.until = context.now + most + ON_ITS_WAY;
    }
}

impl ProgramRun {
    /// All motion has ended: has the function done.
    pub(super) fn call_function(
        &mut self,
        context: &mut Context,
        function: UserFunction,
        source: Source,
    ) -> Option<Exit> {
        let mut calling = Calling { function, source, until: context.now };
        calling.extend(context);
        if context.ros_loss.is_some() {
            let why = "it was not called, because the ROS side of the driver is away";
            return Some(self.end_without_function(&calling, why));
        }
        self.calls += 1;
        let call = UserFunctionCall {
            run: self.job.id,
            call: self.calls,
            program_id: self.job.request.program_id.clone(),
            line: source.line,
            function,
        };
        self.stage = Stage::Calling(calling);
        context.outputs.push_back(Output::UserFunction(call));
        None
    }

    /// `FUNCTION: M101 P1 is being done (line 12)`
    pub(super) fn calling_reason(&self, calling: &Calling) -> String {
        let line = self.job.line_of(calling.source);
        format!("FUNCTION: {} is being done ({line})", calling.function)
    }

    /// What goes on when the run ends now.
    pub(in crate::driver) fn goes_on_without(&self) -> Option<String> {
        let Stage::Calling(Calling { function, source, .. }) = self.stage else { return None };
        Some(format!("{}: {function} was called, and may go on", self.job.place_of(source)))
    }

    /// Whether it waits for the end of this call.
    pub(in crate::driver) fn waits_for(&self, (run, call): (u64, u32)) -> bool {
        matches!(self.stage, Stage::Calling(_)) && (run, call) == (self.job.id, self.calls)
    }

    /// Takes what the node says of the call that it waits for.
    pub(in crate::driver) fn on_user_function(
        &mut self,
        context: &mut Context,
        answer: &Result<String, String>,
    ) -> Option<Exit> {
        let Stage::Calling(calling) = &self.stage else { return None };
        let calling = calling.clone();
        match answer {
            Ok(said) => {
                let place = self.job.place_of(calling.source);
                let said = if said.is_empty() { "" } else { &format!(": {said}") };
                context.log(LogLevel::Info, format!("{place}: {} is done{said}", calling.function));
                self.go_on();
                None
            }
            Err(why) => Some(self.end_without_function(&calling, why)),
        }
    }

    /// The node that has called a function is gone, and its answer with it.
    pub(in crate::driver) fn lose_user_function(&mut self) -> Option<Exit> {
        let Stage::Calling(calling) = &self.stage else { return None };
        let calling = calling.clone();
        let why =
            "the ROS side of the driver has ended meanwhile, so whether it was done is not known";
        Some(self.end_without_function(&calling, why))
    }

    /// The function was not done, or nobody knows.
    pub(super) fn end_without_function(&mut self, calling: &Calling, why: &str) -> Exit {
        let Calling { function, source, .. } = *calling;
        // The end of the run says it already.
        self.go_on();
        self.job.blamed_line = source.line;
        let place = self.job.place_of(source);
        let text = format!(
            "{place}: {function}: {why}; to go on, begin at line {} to have it done, or after it if it was done",
            source.line
        );
        Exit::abort(error_code::USER_FUNCTION, text)
    }
}
