//! Whether a run may begin where the tool and the machine are.

use super::exit::Exit;
use super::request::RunRequest;
use super::workplace::WorkplaceCheck;
use super::{ProgramRun, Stage};
use crate::approach::ApproachText;
use crate::codes::error_code;
use crate::driver::answer::Refusal;
use crate::driver::context::Context;
use crate::driver::context::config::{ANSWER, START_TOLERANCE_MM};
use crate::driver::context::machine::Machine;
use crate::encoder::{Encoder, EncoderConfig, StartFurther};
use crate::envelope::Approach;
use crate::machine_path::MachinePath;
use crate::path_watch::is_same_place;
use cnc_msgs::contour::Action;
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Position};
use cnc_msgs::path::{CompensatedPath, PathEvent};
use cnc_msgs::port_word::PortWord;

impl RunRequest {
    /// Whether the path is only encoded, so that the machine does not matter.
    pub(in crate::driver) fn is_only_encoded(&self, context: &Context) -> bool {
        let is_left_out = self.not_for_check_mode().is_some();
        self.check_only && (!context.config.check_in_controller || is_left_out)
    }

    /// Why the controller cannot read the path in its check mode: it would store offsets and switch outputs
    /// all the same, and where a probe ends it does not know.
    pub(in crate::driver) fn not_for_check_mode(&self) -> Option<String> {
        let because = |action: &Action| match action {
            Action::SetWorkOffset { .. } | Action::StoreReference { .. } => {
                Some("would be stored there, too")
            }
            Action::Probe(_) => Some("probes nothing there"),
            Action::SpindleSync { .. } => Some("needs a spindle that turns, which none does there"),
            action if PortWord::of(action).is_some_and(|it| !it.reads()) => {
                Some("would be switched there, too")
            }
            _ => None,
        };
        self.path.events.iter().find_map(|event| {
            let (action, line) = (event.action.text(), event.source.line);
            Some(format!("{action} in line {line} {}", because(&event.action)?))
        })
    }

    /// Why no run can begin with a path that has a stretch from the results of another run.
    pub(in crate::driver) fn stretch_obstacle(&self) -> Option<Refusal> {
        let (last, before) = self.path.events.split_last()?;
        let is_at_end = last.at_element == self.path.elements.len();
        let is_stretch = |event: &&PathEvent| matches!(event.action, Action::Stretch { .. });
        let found = before
            .iter()
            .find(is_stretch)
            .or(Some(last).filter(is_stretch).filter(|_| !is_at_end))?;
        let text = format!(
            "what follows line {} was planned from what another run has measured: load the program again",
            found.source.line
        );
        Some(Refusal::new(error_code::START_POSITION, text))
    }

    /// Why a path cannot be run where the machine's zero is not known: it goes to places of
    /// the machine frame before it homes.
    pub(in crate::driver) fn frame_obstacle(&self, machine: &Machine) -> Option<Refusal> {
        let first = self.path.events.iter().find_map(|event| match event.action {
            action if action.homes_all() => Some(None),
            Action::MachineMove { .. } => Some(Some(("G53", event.source.line))),
            Action::SetWorkOffset { by_position: false, .. } => {
                Some(Some(("G10 L2", event.source.line)))
            }
            Action::StoreReference { second } => {
                Some(Some((if second { "G30.1" } else { "G28.1" }, event.source.line)))
            }
            Action::Reference { second, .. } => {
                Some(Some((if second { "G30" } else { "G28" }, event.source.line)))
            }
            _ => None,
        });
        let (word, line) = first??;
        machine.home_obstacle(&format!("{word} in line {line}"))
    }
}

impl Context {
    /// What may be sent to this controller now.
    pub(in crate::driver) fn encoder_config(&self) -> EncoderConfig {
        let Self { config, machine, .. } = self;
        EncoderConfig {
            has_mist: config.encoder.has_mist || machine.has_mist,
            has_user_functions: config.user_function_s_max > 0,
            homing: machine.homing(),
            board: machine.board(),
            // The others have no M6: the driver waits for the tool.
            controller_changes_tools: config.encoder.controller_changes_tools
                && machine.firmware.traits().has_tool_change,
            // A height means nothing before the axes are home; nothing is lifted downwards.
            approach_z_mm: config
                .encoder
                .approach_z_mm
                .filter(|_| machine.is_homed)
                .map(|height| machine.machine_position().map_or(height, |at| height.max(at[2]))),
            ..config.encoder
        }
    }
}

impl Machine {
    /// Why these axes are not where a path begins, work frame, if that can be known before the first words
    /// are sent: because those in force are the same.
    pub(in crate::driver) fn start_obstacle(
        &self,
        encoder: &Encoder,
        start: Position,
        axes: AxisSet,
    ) -> Option<Refusal> {
        let is_frame_known = !encoder.checks_start()
            && self.work_system == Some(1)
            && self.has_tool_length == Some(false);
        let at = self.work_position().filter(|_| is_frame_known)?;
        let further = encoder.start_further();
        let checked = check_start(at, start, axes).and_then(|()| self.check_further_start(further));
        checked.err()
    }

    /// How the tool comes to where a run begins in the middle: before this element and this event.
    pub(in crate::driver) fn approach_text(
        &self,
        path: &CompensatedPath,
        (element, event): (usize, usize),
        approach: Approach,
        encoder: &Encoder,
    ) -> ApproachText {
        let Approach { height_mm, axes, further } = approach;
        let mut walk = MachinePath::new(path, &self.known_offsets(), [None; 3]);
        walk.go_before(path, element, event);
        let start = path.start_of(element);
        let from = self.machine_position().zip(walk.whole_offset());
        ApproachText {
            from: from.map(|(at, offset)| {
                let in_work = std::array::from_fn(|axis| at[axis] - offset[axis]);
                (in_work, height_mm - offset[2])
            }),
            height_in_machine: height_mm,
            further,
            to: std::array::from_fn(|axis| axes.contains(axis).then_some(start[axis])),
            feed_mm_per_min: encoder.plunge_feed(element),
        }
    }

    /// Whether A to W are where a run begins, as far as reports say where they are. A whole turn off
    /// counts: the next line would turn back by it.
    fn check_further_start(&self, start: StartFurther) -> Result<(), Refusal> {
        let StartFurther { at, is_sent } = start;
        let is = self.further_work();
        let off = at.iter().find_map(|(axis, wanted)| {
            let is = is.get(axis)?;
            let leaves_out_turns = is_sent && FurtherAxes::is_rotary(axis);
            let is_there = is_same_place(is, wanted, self.further_step(axis), leaves_out_turns);
            (!is_there).then_some((FURTHER_LETTERS[axis], wanted, is))
        });
        let Some((letter, wanted, is)) = off else { return Ok(()) };
        let message = format!(
            "the path begins at {letter}{wanted:.3} but {letter} is at {is:.3} in the work frame: \
             move it there first (kerf jog)"
        );
        Err(Refusal::new(error_code::START_POSITION, message))
    }
}

impl ProgramRun {
    /// Whether the tool is where the path begins, if that can be known before the first words
    /// are sent: because those in force are the same.
    pub(in crate::driver) fn check_start_early(&self, machine: &Machine) -> Result<(), Refusal> {
        machine.start_obstacle(&self.encoder, self.start(), self.assumed_axes()).map_or(Ok(()), Err)
    }

    /// Judges the path anew where the stored positions are others than those that it was judged by;
    /// true when there is something to judge.
    pub(super) fn judge_again(&mut self, context: &mut Context) -> bool {
        let Some(judged_by) = self.judged_by else { return false };
        if judged_by.is_near(&context.machine.known_offsets()) {
            return false;
        }
        let workplace = WorkplaceCheck::begin(context, &self.job.request, self.beginning, None);
        self.judged_again = workplace.map(Box::new);
        self.judged_again.is_some()
    }

    /// Judges a slice of it; the first words of the run follow at its end, or what comes after a probe.
    pub(super) fn step_judgement(&mut self, context: &mut Context) -> Option<Exit> {
        let workplace = self.judged_again.as_mut()?;
        let has_begun = matches!(self.stage, Stage::Probed { .. });
        if !has_begun {
            self.stage = Stage::Preparing { until: context.now + ANSWER };
        }
        if !workplace.step(&self.job.request.path) {
            return None;
        }
        let refusal = workplace.refusal(context);
        self.judged_again = None;
        match refusal {
            Some(refusal) if has_begun => Some(Exit::Stop(refusal.into())),
            Some(refusal) => Some(Exit::over(refusal.into())),
            None if has_begun => {
                self.go_on();
                None
            }
            None => {
                self.send_preamble(context);
                None
            }
        }
    }

    /// Whether the axes are where the path relies on them to be; `at` is in the work frame, mm.
    pub(super) fn check_start(&self, machine: &Machine, at: Position) -> Result<(), Refusal> {
        check_start(at, self.start(), self.assumed_axes())?;
        machine.check_further_start(self.start_further())
    }
}

fn check_start(at: Position, start: Position, axes: AxisSet) -> Result<(), Refusal> {
    let is_off = |axis: &usize| (at[*axis] - start[*axis]).abs() > START_TOLERANCE_MM + 1e-9;
    if !(0..3).filter(|axis| axes.contains(*axis)).any(|axis| is_off(&axis)) {
        return Ok(());
    }
    let show = |position: Position| {
        let words = (0..3).filter(|axis| axes.contains(*axis));
        words.map(|axis| format!("{}{:.3}", AXIS_LETTERS[axis], position[axis])).collect::<Vec<_>>()
    };
    let message = format!(
        "the path begins at {} but the tool is at {} in the work frame: move it there first",
        show(start).join(" "),
        show(at).join(" ")
    );
    Err(Refusal::new(error_code::START_POSITION, message))
}
