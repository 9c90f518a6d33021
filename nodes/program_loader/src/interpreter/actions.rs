//! The actions of a block apart from motion: feed, spindle, tool, coolant, offsets, dwell, stops
//! and the machine's own functions.

use super::axes::Cause;
use super::{After, Interpreter, Scene};
use crate::dialect::{FeedMode, GWord, Group, MWord, RadiusWord};
use crate::limits::{DWELL_SECONDS_MAX, DWELL_SECONDS_SUSPICIOUS, FEED_MM_PER_MIN_MAX, NUMBER_MAX};
use cnc_msgs::contour::{Action, ContourEventKind, CoolantMode, RadiusSource, SpindleMode};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::text::Words;

/// The words of the work systems.
const WORK_SYSTEMS: [&str; 9] =
    ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];

impl Interpreter<'_> {
    /// F.
    #[inline]
    pub(super) fn feed(&mut self, scene: &mut Scene<'_>) {
        let scale = self.scale();
        let is_per_minute = self.modal.feed_mode == FeedMode::PerMinute;
        let max = if is_per_minute { f64::INFINITY } else { FEED_MM_PER_MIN_MAX };
        let Some(mut feed) = self.take_within(scene, b'F', scale, max, "mm/min") else {
            return;
        };
        if feed > FEED_MM_PER_MIN_MAX {
            feed = FEED_MM_PER_MIN_MAX;
            self.fast_feed(scene);
        }
        self.modal.feed_is_poisoned = feed < 0.0 || feed.is_nan();
        self.modal.feed_mm_per_min = if self.modal.feed_is_poisoned { 0.0 } else { feed };
        self.modal.programmed_feed_mm = self.modal.feed_mm_per_min;
        self.modal.programmed_feed = self.modal.feed_mm_per_min / scale;
        self.feed_in_mode();
        if feed < 0.0 {
            self.negative(scene, b'F');
        }
    }

    /// Warns once of a feed that stands for "as fast as it can", or lacks its decimal point.
    #[cold]
    fn fast_feed(&mut self, scene: &mut Scene<'_>) {
        if std::mem::replace(&mut self.modal.fast_feed_is_reported, true) {
            return;
        }
        let source = scene.source_of(self.request.word(b'F'));
        let word = scene.quote(self.request.word(b'F'));
        let message =
            format!("{word} is faster than any machine: F is at most {FEED_MM_PER_MIN_MAX} mm/min");
        let help =
            "look for a missing decimal point; the controller moves as fast as its settings allow";
        scene.findings.push(Finding::warning(Code::SuspiciousValue, source, message).help(help));
    }

    /// S, T, M6, M3 to M9 and the machine's functions, in the order of RS-274.
    #[inline]
    pub(super) fn functions_before_motion(&mut self, scene: &mut Scene<'_>) {
        self.spindle_speed(scene);
        if self.request.present.contains(b'T')
            && let Some(tool) = self.take_number(scene, b'T')
        {
            if self.rules.radius_word == RadiusWord::Nose {
                self.turret(scene, tool);
            } else {
                self.modal.selected_tool = Some(tool);
                self.act(Action::SelectTool { tool });
            }
        }
        if self.request.m_at(0).is_some() {
            self.m_functions(scene);
        }
        if let Some((letter, times)) = self.rules.dialect.lexer.programs.and_then(|it| it.call)
            && self.request.present.contains(letter)
        {
            self.call_by_word(scene, letter, times);
        }
        let auxiliary = self.rules.dialect.auxiliary.intersection(self.request.present);
        if !auxiliary.is_empty() {
            for letter in auxiliary.iter() {
                if let Some(number) = self.take_within(scene, letter, 1.0, NUMBER_MAX, "") {
                    let letter = char::from(letter);
                    self.act(Action::Auxiliary { letter, number, words: Words::EMPTY });
                }
            }
        }
    }

    /// `TNNMMOO`: the numbers of nose radius, tool and tool offset. The turret turns at once;
    /// the machine applies the offset of the tool.
    fn turret(&mut self, scene: &mut Scene<'_>, digits: u32) {
        if digits > 999_999 {
            let quote = scene.quote(self.request.word(b'T'));
            let message = format!("{quote} has more than six digits");
            let help =
                "write the numbers of nose radius, tool and offset with two digits each: T010101";
            return self.report(scene, b'T', Code::BadNumber, message, help);
        }
        let (nose, tool) = (digits / 10_000, digits / 100 % 100);
        if self.modal.spindle_tool != Some(tool) {
            self.modal.selected_tool = Some(tool);
            self.modal.spindle_tool = Some(tool);
            self.act(Action::SelectTool { tool });
            self.act(Action::ChangeTool { tool });
        }
        self.emit(ContourEventKind::Radius(RadiusSource::Nose(nose)));
    }

    /// P and L of M98.
    fn program_to_call(&mut self, scene: &mut Scene<'_>, at: usize) {
        let program = self.take_number(scene, b'P');
        let times = self.take_number(scene, b'L');
        if self.rules.dialect.lexer.programs.is_some() && times == Some(0) {
            self.no_times(scene, b'L');
        }
        self.called = program.map(|program| (program, times.unwrap_or(1)));
        if program.is_none() && !self.request.present.contains(b'P') {
            let message = format!("{} without P", scene.quote(at));
            let help = "write P with the number of the program";
            self.report_at(scene, at, Code::MissingWord, message, help);
        }
    }

    /// L and P of a block that calls a program with L.
    #[cold]
    pub(super) fn call_by_word(&mut self, scene: &mut Scene<'_>, letter: u8, times: u8) {
        if self.request.present != self.rules.call_letters.intersection(self.request.present)
            || self.request.has_codes()
        {
            let message = format!(
                "{} calls a program, and its block has other words",
                scene.quote(self.request.word(letter))
            );
            let help = "write the call into a block of its own";
            self.report(scene, letter, Code::ModalConflict, message, help);
        }
        let program = self.take_number(scene, letter);
        let passes = self.take_number(scene, times);
        if passes == Some(0) {
            self.no_times(scene, times);
        }
        self.called = program.map(|program| (program, passes.unwrap_or(1)));
    }

    fn no_times(&mut self, scene: &mut Scene<'_>, letter: u8) {
        let quote = scene.quote(self.request.word(letter));
        let message = format!("{quote} calls the program no time");
        let help = "write how many times it is to run, or delete the call";
        self.report(scene, letter, Code::BadNumber, message, help);
    }

    /// A return that says where to.
    fn return_elsewhere(&mut self, scene: &mut Scene<'_>, at: usize) {
        let word = scene.quote(at);
        for letter in [b'P', b'L'] {
            if self.take(letter).is_some() {
                let target = scene.quote(self.request.word(letter));
                let message = format!("{word} {target} is not supported");
                let help = "return without P and L, to the block after the call; write what is \
                            skipped or repeated as the blocks that run";
                self.report(scene, letter, Code::Unsupported, message, help);
            }
        }
    }

    fn m_functions(&mut self, scene: &mut Scene<'_>) {
        let call = self.request.m().find(|(meaning, _, _)| *meaning == MWord::CallProgram);
        if let Some((_, _, at)) = call {
            self.program_to_call(scene, at);
        } else if let Some(at) = self.return_without_o_words() {
            self.return_elsewhere(scene, at);
        }
        let state = self.request.m().find(|(meaning, _, _)| matches!(meaning, MWord::State(_)));
        if let Some((MWord::State(word), _, at)) = state {
            self.saved_words(scene, word, at);
        }
        let change = self.request.m().find(|(meaning, _, _)| *meaning == MWord::ChangeTool);
        if let Some((_, _, at)) = change {
            self.change_tool(scene, at);
        }
        // One kind after the other, in a fixed order.
        for kind in 0..3 {
            let mut next = 0;
            while let Some((meaning, number, at)) = self.request.m_at(next) {
                next += 1;
                match (kind, meaning) {
                    (0, MWord::Spindle(mode)) => {
                        self.modal.spindle = mode;
                        self.act(Action::Spindle(mode));
                    }
                    (1, MWord::Coolant(mode)) => {
                        self.modal.mist = mode == CoolantMode::Mist
                            || self.modal.mist && mode != CoolantMode::Off;
                        self.modal.flood = mode == CoolantMode::Flood
                            || self.modal.flood && mode != CoolantMode::Off;
                        self.act(Action::Coolant(mode));
                    }
                    (2, MWord::Auxiliary { after_motion: false }) => {
                        self.act_auxiliary(number);
                    }
                    (2, MWord::Machine) => self.machine_word(scene, number, at),
                    (2, MWord::NameTool) => self.name_tool(scene, at),
                    _ => {}
                }
            }
        }
    }

    /// The return of a language without O words.
    fn return_without_o_words(&self) -> Option<usize> {
        self.rules.dialect.lexer.programs?;
        self.request.m().find(|(meaning, _, _)| *meaning == MWord::EndProgram).map(|it| it.2)
    }

    fn act_auxiliary(&mut self, number: u16) {
        let number = f64::from(number);
        self.act(Action::Auxiliary { letter: 'M', number, words: Words::EMPTY });
    }

    fn change_tool(&mut self, scene: &mut Scene<'_>, at: usize) {
        if let Some(tool) = self.modal.selected_tool {
            self.modal.spindle_tool = Some(tool);
            self.modal.is_tool_named = false;
            // The change stops the spindle.
            self.modal.spindle = SpindleMode::Off;
            self.act(Action::ChangeTool { tool });
            self.axes.end_drift(Cause { source: self.source, word: "M6" });
        } else if !self.request.present.contains(b'T') {
            let message = "M6 without a tool: no T has been programmed".to_owned();
            let help = "write T with the number of the tool into this block or before it";
            self.report_at(scene, at, Code::MissingWord, message, help);
        }
    }

    /// M functions after the motion, and stops; returns what follows.
    #[inline]
    pub(super) fn functions_after_motion(&mut self) -> After {
        let mut next = 0;
        let mut after = After::Block;
        while let Some((meaning, number, _)) = self.request.m_at(next) {
            next += 1;
            match meaning {
                MWord::Auxiliary { after_motion: true } => self.act_auxiliary(number),
                MWord::Stop { .. } | MWord::ProgramEnd { .. } if self.stop(meaning) => {
                    after = After::End;
                }
                MWord::EndProgram => after = After::EndOfProgram,
                MWord::CallProgram => after = self.called_program(),
                _ => {}
            }
        }
        after
    }

    /// M98: P and L have been taken by `m_functions`.
    pub(super) fn called_program(&self) -> After {
        match self.called {
            Some((program, times)) if !self.request.is_damaged => After::Call { program, times },
            _ => After::Block,
        }
    }

    fn stop(&mut self, meaning: MWord) -> bool {
        match meaning {
            MWord::Stop { optional } => self.act(Action::Stop { optional }),
            MWord::ProgramEnd { rewind } => {
                self.act(Action::ProgramEnd { rewind });
                return true;
            }
            _ => {}
        }
        false
    }

    /// G4.
    pub(super) fn dwell(&mut self, scene: &mut Scene<'_>) {
        let dwell = self.rules.dialect.dwell;
        let at = self.request.g_place(Group::NonModal);
        let mut letters = dwell.intersection(self.request.present).iter();
        let Some(letter) = letters.next() else {
            if !self.request.has_refused_word {
                let names: Vec<String> =
                    dwell.iter().map(|letter| char::from(letter).to_string()).collect();
                let message = format!("{} without a time", scene.quote(at));
                let help = format!("write the seconds after {}", names.join(" or "));
                self.report_at(scene, at, Code::MissingWord, message, &help);
            }
            return;
        };
        let Some(seconds) = self.take_within(scene, letter, 1.0, DWELL_SECONDS_MAX, "s") else {
            return;
        };
        if seconds < 0.0 {
            return self.negative(scene, letter);
        }
        if seconds >= DWELL_SECONDS_SUSPICIOUS {
            self.long_dwell(scene, letter, seconds);
        }
        self.act(Action::Dwell { seconds });
    }

    /// Warns of a dwell that may be meant in milliseconds.
    #[cold]
    pub(super) fn long_dwell(&mut self, scene: &mut Scene<'_>, letter: u8, seconds: f64) {
        let source = scene.source_of(self.request.word(letter));
        let message = format!("the machine waits {seconds} s here");
        let help = format!("{} is in seconds, not in milliseconds", char::from(letter));
        scene.findings.push(Finding::warning(Code::SuspiciousValue, source, message).help(help));
    }

    /// G54 to G59.3.
    #[inline]
    pub(super) fn work_offset(&mut self) {
        if let Some((GWord::WorkOffset(system), _)) = self.request.g(Group::WorkOffset) {
            self.select_work_offset(system);
        }
    }

    pub(super) fn select_work_offset(&mut self, system: u8) {
        self.act(Action::WorkOffset { system });
        if self.modal.work_offset != system {
            self.modal.work_offset = system;
            let word = WORK_SYSTEMS[usize::from(system.clamp(1, 9) - 1)];
            let cause = Cause { source: self.source, word };
            self.axes.lose(AxisSet::ALL, cause);
            self.further.lose_known(cause);
            self.turn_to(u32::from(system), cause);
        }
    }

    #[cold]
    pub(super) fn negative(&mut self, scene: &mut Scene<'_>, letter: u8) {
        let message = format!("{} is negative", scene.quote(self.request.word(letter)));
        self.report(scene, letter, Code::BadNumber, message, "write a number above 0");
    }
}
