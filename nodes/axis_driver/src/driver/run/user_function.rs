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

/// What the answer takes besides the function itself.
const ON_ITS_WAY: Duration = Duration::from_secs(5);

/// A call that is under way.
#[derive(Debug, Clone)]
pub(super) struct Calling {
    function: UserFunction,
    source: Source,
    pub(super) until: Duration,
}

impl ProgramRun {
    /// All motion has ended: has the function done.
    pub(super) fn call_function(
        &mut self,
        context: &mut Context,
        function: UserFunction,
        source: Source,
    ) {
        let most = Duration::from_secs(u64::from(context.config.user_function_s_max));
        self.calls += 1;
        let call = UserFunctionCall {
            run: self.job.id,
            call: self.calls,
            program_id: self.job.request.program_id.clone(),
            line: source.line,
            function,
        };
        let until = context.now + most + ON_ITS_WAY;
        self.stage = Stage::Calling(Calling { function, source, until });
        context.outputs.push_back(Output::UserFunction(call));
    }

    /// `FUNCTION: M101 P1 is being done (line 12)`
    pub(super) fn calling_reason(&self, calling: &Calling) -> String {
        let line = self.job.line_of(calling.source);
        format!("FUNCTION: {} is being done ({line})", calling.function)
    }

    /// Takes what the node says of a call; of another run or call it says nothing.
    pub(in crate::driver) fn on_user_function(
        &mut self,
        context: &mut Context,
        (run, call): (u64, u32),
        answer: Result<String, String>,
    ) -> Option<Exit> {
        let Stage::Calling(calling) = &self.stage else { return None };
        if (run, call) != (self.job.id, self.calls) {
            return None;
        }
        let Calling { function, source, .. } = *calling;
        let place = self.job.place_of(source);
        match answer {
            Ok(said) => {
                let said = if said.is_empty() { said } else { format!(": {said}") };
                context.log(LogLevel::Info, format!("{place}: {function} is done{said}"));
                self.go_on();
                None
            }
            Err(why) => Some(self.end_without_function(&why)),
        }
    }

    /// The node that has called a function is gone, and its answer with it.
    pub(in crate::driver) fn lose_user_function(&mut self) -> Option<Exit> {
        let why =
            "the ROS side of the driver has ended meanwhile, so whether it was done is not known";
        matches!(self.stage, Stage::Calling(_)).then(|| self.end_without_function(why))
    }

    /// The function was not done, or nobody knows.
    pub(super) fn end_without_function(&mut self, why: &str) -> Exit {
        let Stage::Calling(Calling { function, source, .. }) = self.stage else {
            return Exit::abort(error_code::USER_FUNCTION, why.to_owned());
        };
        self.job.blamed_line = source.line;
        let place = self.job.place_of(source);
        Exit::abort(error_code::USER_FUNCTION, format!("{place}: {function}: {why}"))
    }
}
