//! What begins a run, a check or a manual operation, and what keeps it from beginning.

use super::answer::{Answer, Refusal, done, refused};
use super::context::overrides::Overrides;
use super::manual::ManualOrder;
use super::manual::configure::{Configuration, configure};
use super::manual::lines::{JogRequest, OffsetRequest, ProbeRequest};
use super::output::LogLevel;
use super::run::ProgramRun;
use super::run::beginning::{Descent, beginning_of, not_homed_text};
use super::run::exit::RunVerdict;
use super::run::proof::{Check, Proof};
use super::run::replan::ReplanRequest;
use super::run::request::RunRequest;
use super::run::tool_change::check_block;
use super::run::workplace::WorkplaceCheck;
use super::{Driver, Phase};
use crate::codes::error_code;
use crate::cycle_time::CycleTime;
use crate::encoder::{StartProblem, is_whole, start_at};
use crate::envelope::{Approach, Beginning};
use cnc_msgs::machine::Mode;

impl Driver {
    pub(super) fn run_program(&mut self, id: u64, request: RunRequest) -> Answer {
        if self.check.is_some() {
            return refused(error_code::BUSY, "another program is being checked");
        }
        let is_only_encoded = request.is_only_encoded(&self.context);
        let is_in_change = request.is_mdi() && self.is_tool_awaited();
        if is_in_change && let Err(refusal) = check_block(&request.path) {
            return Some(Err(refusal));
        }
        if request.check_only
            && self.context.config.check_in_controller
            && let Some(because) = request.not_for_check_mode()
        {
            let text =
                format!("the controller does not read this program in its check mode: {because}");
            self.context.log(LogLevel::Warn, text);
        }
        if !is_only_encoded
            && !is_in_change
            && let Some(refusal) = self.obstacle()
        {
            return Some(Err(refusal));
        }
        if let Some(refusal) = request.stretch_obstacle() {
            return Some(Err(refusal));
        }
        if !is_only_encoded && let Some(refusal) = request.frame_obstacle(&self.context.machine) {
            return Some(Err(refusal));
        }
        if !is_only_encoded && !is_in_change {
            self.context.not_checked.clear();
        }
        let config = self.context.encoder_config();
        let started = start_at(
            request.path.clone(),
            config,
            (request.start_line, request.occurrence),
            request.in_span,
        );
        let (encoder, first_element) = match started {
            Ok(started) => started,
            Err(StartProblem::Encode(problem)) => {
                return refused(error_code::NOT_ENCODABLE, problem.to_string());
            }
            Err(problem) => return refused(error_code::START_LINE, problem.to_string()),
        };
        // A block during a tool change moves in a frame that the program has set.
        let is_in_span = first_element > 0 && request.path.begins_in_span(first_element);
        let is_bound = !encoder.start_axes().is_empty() || !encoder.start_further().at.is_empty();
        let descent = match encoder.is_lifted() {
            true => Descent::FromAbove,
            false => Descent::unlifted(is_in_span, request.in_span, is_bound),
        };
        let height_mm = config.approach_z_mm.filter(|_| encoder.is_lifted());
        let (axes, further) = (encoder.known_axes(), encoder.further_place().at);
        let approach = height_mm.map(|height_mm| Approach { height_mm, axes, further });
        let (element, event) = (first_element, encoder.events_begun());
        let workplace = match is_in_change {
            true => None,
            false => {
                let beginning = Beginning { element, event, approach };
                WorkplaceCheck::begin(&mut self.context, &request, beginning, None)
            }
        };
        let limits = self.context.machine.limits_for_time();
        // Who types a block asks for no time.
        if !request.is_mdi() {
            for doubt in CycleTime::doubts(&limits, &request.path) {
                self.context.log(LogLevel::Warn, format!("not judged: {doubt}"));
            }
        }
        let machine = &self.context.machine;
        let here = machine.machine_position().filter(|_| !is_in_change);
        // In the middle the tool stands where the element begins, or comes there from here.
        let start = here.filter(|_| first_element == 0 && approach.is_none());
        let mut time = CycleTime::new(&limits, &request.path, first_element, start);
        if let Some((approach, here)) = approach.zip(here) {
            let feed = encoder.plunge_feed(first_element);
            let Approach { height_mm, axes, further } = approach;
            let is = machine.further_work();
            let way = further.iter().filter_map(|(axis, to)| Some((axis, to - is.get(axis)?)));
            let here = (here, way.collect());
            time.come_from_above(&request.path, here, (height_mm, axes), feed);
        }
        let proof = Proof::new(encoder.clone(), time.clone(), workplace);
        if is_only_encoded {
            let beginning = match is_whole((request.start_line, request.occurrence)) {
                true => Vec::new(),
                false => {
                    let from = request.path.start_of(first_element);
                    let elsewhere = match self.obstacle() {
                        None => machine.start_obstacle(&encoder, from, encoder.start_axes()),
                        // It may move until the run begins.
                        Some(_) => None,
                    };
                    let text = approach.map(|approach| {
                        machine.approach_text(&request.path, (element, event), approach, &encoder)
                    });
                    let not_homed = machine.not_homed(encoder.sent_further());
                    let mut parts = beginning_of(&request.path, encoder, descent, text);
                    parts.extend(not_homed_text(not_homed));
                    parts.extend(elsewhere.map(|it| it.message));
                    parts
                }
            };
            self.check = Some(Check { id, request, proof, beginning });
            return None;
        }
        let mut run = ProgramRun::new(id, request, encoder, first_element, proof, time, machine);
        run.job.is_in_tool_change = is_in_change;
        // If this cannot be known yet, it is looked at again after the first words.
        if !is_in_change && let Err(refusal) = run.check_start_early(machine) {
            return Some(Err(refusal));
        }
        self.pause_run();
        self.phase = Phase::Running(Box::new(run));
        None
    }

    /// Takes another path for what is left of the run that is under way.
    pub(super) fn replan(&mut self, id: u64, request: ReplanRequest) -> Answer {
        match &mut self.phase {
            Phase::Running(run) => run.replan(&mut self.context, id, request),
            Phase::Stopping(stopping) => stopping.replan(&request),
            _ => refused(error_code::NOTHING_TO_DO, "no program is running"),
        }
    }

    /// Takes what the loader has made of the results of probes.
    pub(super) fn on_program_continued(
        &mut self,
        of: u64,
        answer: Result<String, String>,
    ) -> Answer {
        if let Phase::Running(run) = &mut self.phase {
            run.on_program_continued(of, answer, self.context.now);
        }
        done("heard")
    }

    /// Takes what a node says of a function of the user.
    pub(super) fn on_user_function(
        &mut self,
        call: (u64, u32),
        answer: Result<String, String>,
    ) -> Answer {
        match &mut self.phase {
            Phase::Running(run) if run.waits_for(call) => {
                let exit = run.on_user_function(&mut self.context, &answer);
                self.leave_run(exit);
                done("heard")
            }
            _ => refused(error_code::NOTHING_TO_DO, "no run waits for it any more"),
        }
    }

    /// The ROS side has come or gone.
    pub(super) fn on_ros_face(&mut self, is_there: bool) -> Answer {
        if let (Phase::Running(run), false) = (&mut self.phase, is_there) {
            let exit = run.lose_user_function();
            self.leave_run(exit);
        }
        self.context.on_ros_face(is_there)
    }

    pub(super) fn cancel_run(&mut self, run: Option<u64>) -> Answer {
        if let Some(answer) = self.cancel_paused(run) {
            return answer;
        }
        let is_meant = |id: u64| run.is_none_or(|run| run == id);
        let check = self.check.take_if(|check| is_meant(check.id));
        if let Some(check) = &check {
            let text = "canceled while being checked";
            self.context.reply(check.id, Err(Refusal::new(error_code::CANCELED, text)));
        }
        if self.phase.job().is_some_and(|job| is_meant(job.id)) {
            self.stop_run(RunVerdict::canceled("canceled"));
            return done("the run is being stopped");
        }
        match (&mut self.phase, check) {
            (Phase::Manual(operation), None)
                if is_meant(operation.id) && operation.task.moves() =>
            {
                let refusal = Refusal::new(error_code::CANCELED, "canceled");
                operation.stop(&mut self.context, refusal);
                done("the move is being stopped")
            }
            (_, Some(_)) => done("the check was canceled"),
            (_, None) => refused(error_code::NOTHING_TO_DO, "no such program is running"),
        }
    }

    pub(super) fn set_single_block(&mut self, is_on: bool) -> Answer {
        self.context.is_single_block = is_on;
        done(match (is_on, &self.phase) {
            (true, Phase::Running(_) | Phase::Stopping(_)) => {
                "single block is on: blocks that were sent already are cut first, then the \
                 machine stops after every block"
            }
            (true, _) => "single block is on: the machine stops after every block until resume",
            (false, Phase::Running(run)) if run.is_at_block_end() => {
                "single block is off: resume to go on"
            }
            (false, _) => "single block is off",
        })
    }

    pub(super) fn set_overrides(&mut self, id: u64, wanted: Overrides) -> Answer {
        if let Phase::Running(run) = &self.phase
            && let Some(refusal) = run.override_obstacle(&wanted)
        {
            return Some(Err(refusal));
        }
        match &self.phase {
            Phase::Ready | Phase::Running(_) | Phase::Stopping(_) | Phase::Manual(_) => {
                self.context.set_overrides(id, wanted)
            }
            _ => self.obstacle().map(Err),
        }
    }

    pub(super) fn jog(&mut self, id: u64, request: JogRequest) -> Answer {
        if let Some(refusal) = self.manual_obstacle() {
            return Some(Err(refusal));
        }
        let order = ManualOrder::jog(&self.context, request, self.is_tool_awaited());
        self.begin_move(id, order, "the jog has begun")
    }

    pub(super) fn probe(&mut self, id: u64, request: ProbeRequest) -> Answer {
        if let Some(refusal) = self.manual_obstacle() {
            return Some(Err(refusal));
        }
        let order = ManualOrder::probe(&self.context, request, self.is_tool_awaited());
        self.begin_move(id, order, "the probe has begun")
    }

    fn begin_move(&mut self, id: u64, order: Result<ManualOrder, Refusal>, text: &str) -> Answer {
        Some(order.map(|order| {
            self.begin_manual(id, order);
            text.to_owned()
        }))
    }

    pub(super) fn set_work_offset(&mut self, id: u64, request: OffsetRequest) -> Answer {
        if let Some(refusal) = self.manual_obstacle() {
            return Some(Err(refusal));
        }
        if !request.further.is_empty() && self.is_tool_awaited() {
            let text = "only X, Y and Z are set during a tool change: the program goes on with \
                        the other axes as it left them";
            return refused(error_code::INVALID_REQUEST, text);
        }
        match ManualOrder::set_work_offset(&self.context, request) {
            Ok(order) => self.begin_manual(id, order),
            Err(refusal) => return Some(Err(refusal)),
        }
        if let Some(paused) = &mut self.paused {
            paused.frame = request.axes;
        }
        None
    }

    /// Says which setting would be written, or writes it and reads it back.
    pub(super) fn configure(&mut self, id: u64, write: bool) -> Answer {
        if let Some(refusal) = self.obstacle() {
            return Some(Err(refusal));
        }
        match configure(&self.context, write) {
            Ok(Configuration::WouldWrite(text)) => return done(&text),
            Ok(Configuration::Write(order)) => self.begin_manual(id, order),
            Err(refusal) => return Some(Err(refusal)),
        }
        None
    }

    pub(super) fn unlock(&mut self, id: u64) -> Answer {
        match (&self.phase, self.context.machine.mode()) {
            (Phase::Ready, Mode::Alarm) => {
                self.begin_manual(id, ManualOrder::unlock());
                None
            }
            (Phase::Ready, mode) => {
                let text = format!("the machine is not in alarm; it is in {}", mode.name());
                refused(error_code::NOTHING_TO_DO, text)
            }
            _ => self.obstacle().map(Err),
        }
    }

    pub(super) fn home(&mut self, id: u64) -> Answer {
        match (&self.phase, self.context.machine.mode()) {
            (Phase::Ready, Mode::Idle | Mode::Alarm) => {}
            _ => return self.obstacle().map(Err),
        }
        if !self.context.machine.has_homing() {
            let text = "homing is switched off in the controller ($22=0)";
            return refused(error_code::NO_HOMING, text);
        }
        self.context.machine.is_homed = false;
        self.begin_manual(id, ManualOrder::home());
        None
    }

    pub(super) fn sleep(&mut self, id: u64) -> Answer {
        match (&self.phase, self.context.machine.mode()) {
            (Phase::Ready, Mode::Idle | Mode::Alarm) => {
                self.begin_manual(id, ManualOrder::sleep());
                None
            }
            _ => self.obstacle().map(Err),
        }
    }

    /// Why no manual operation can begin now.
    fn manual_obstacle(&self) -> Option<Refusal> {
        match self.check {
            Some(_) => Some(Refusal::new(error_code::BUSY, "a program is being checked")),
            None if self.is_tool_awaited() => None,
            None => self.obstacle(),
        }
    }

    /// Why no program can be run now, as far as the link and the machine go.
    pub(super) fn obstacle(&self) -> Option<Refusal> {
        let refuse = |code, text: String| Some(Refusal::new(code, text));
        match &self.phase {
            Phase::Closed { reason } => refuse(error_code::NOT_CONNECTED, reason.clone()),
            Phase::Connecting(connecting) => {
                refuse(error_code::CONNECTING, format!("still {}", connecting.describe()))
            }
            Phase::Adrift { reason } => refuse(error_code::NEEDS_RESET, reason.clone()),
            Phase::Manual(operation) => refuse(error_code::BUSY, operation.describe()),
            Phase::Running(_) | Phase::Stopping(_) => {
                refuse(error_code::BUSY, "a program is running".into())
            }
            Phase::Ready => match self.context.machine.mode() {
                Mode::Idle => None,
                Mode::Alarm => refuse(error_code::ALARM, self.compose().reason),
                Mode::Unknown => {
                    refuse(error_code::CONNECTING, "no status report has been received yet".into())
                }
                mode => refuse(error_code::BUSY, format!("the machine is in {}", mode.name())),
            },
        }
    }
}
