//! What the controller said of itself that decides how lines are drawn.

use super::machine::Machine;
use crate::driver::output::Offset;
use crate::encoder::{Board, Ports};
use crate::firmware::THREAD_SHARE;
use cnc_msgs::contour::work_system;
use cnc_msgs::geometry::Position;

impl Machine {
    /// Forgets what only some boards report.
    pub(in crate::driver) fn forget_board(&mut self) {
        self.offsets.retain(|offset| !offset.name.starts_with("G59."));
        self.has_spindle_sync = false;
        self.ports = Ports::default();
    }

    /// From `$12`, `$32` and `$#`.
    pub(in crate::driver) fn board(&self) -> Board {
        let usual = Board::default();
        let setting = |number: u16| self.settings.get(&number).copied();
        let place = |name: &str| -> Position {
            let stored = self.offsets.iter().find(|offset: &&Offset| offset.name == name);
            stored.map_or([0.0; 3], |offset| offset.position)
        };
        let shift = self.shift();
        let system = |index: usize| {
            let stored = place(&work_system(index as u8 + 1));
            std::array::from_fn(|axis| stored[axis] + shift[axis])
        };
        let tolerance = setting(12).filter(|tolerance| *tolerance > 0.0);
        Board {
            arc_tolerance_mm: tolerance.unwrap_or(usual.arc_tolerance_mm),
            is_laser: setting(32) == Some(1.0),
            work_offsets: std::array::from_fn(system),
            work_systems: self.work_systems(),
            further_axes: self.further_axes(),
            thread_mm_per_min_max: self.has_spindle_sync.then(|| {
                [110, 111, 112].map(|number| setting(number).map(|fastest| fastest * THREAD_SHARE))
            }),
            ports: self.ports,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Message;

    #[test]
    fn a_board_is_what_the_settings_and_offsets_say_and_usual_where_they_say_nothing() {
        let mut machine = Machine::default();
        assert_eq!(machine.board(), Board::default());
        machine.on_setting(12, "0.010");
        machine.on_setting(32, "1");
        for (name, position) in [("G55", [-300.0, -200.5, -40.0]), ("G92", [0.0, 0.5, 10.0])] {
            machine.on_message(&Message::Offset {
                name: name.into(),
                position,
                further: Vec::new(),
            });
        }
        let shift = [0.0, 0.5, 10.0];
        let mut work_offsets = [shift; 9];
        work_offsets[1] = [-300.0, -200.0, -30.0];
        machine.on_message(&Message::Axes("XYZAC".into()));
        let options = ["RT+", "TC", "SS", "SED"].map(str::to_owned).to_vec();
        machine.on_message(&Message::NewOptions(options));
        machine.on_message(&Message::AuxIo([2, 4, 0, 1]));
        machine.on_setting(110, "2000");
        machine.on_setting(112, "1000");
        let expected = Board {
            arc_tolerance_mm: 0.01,
            is_laser: true,
            work_offsets,
            work_systems: 6,
            further_axes: 0b101,
            thread_mm_per_min_max: Some([Some(1800.0), None, Some(900.0)]),
            ports: [2, 4, 0, 1].into(),
        };
        assert_eq!(machine.board(), expected);
        for name in ["G59.1", "G59.2", "G59.3"] {
            machine.remember(name, [1.0, 2.0, 3.0]);
        }
        assert_eq!(
            (machine.board().work_systems, machine.board().work_offsets[8]),
            (9, [1.0, 2.5, 13.0])
        );
        machine.forget_board();
        assert_eq!(machine.board().work_systems, 6);
        assert_eq!(machine.board().thread_mm_per_min_max, None);
        assert_eq!(machine.board().ports, Ports::default());
        machine.on_setting(12, "0");
        assert_eq!(machine.board().arc_tolerance_mm, Board::default().arc_tolerance_mm);
    }
}
