//! How the programs of each control differ, as far as they are drawn: one row for each control.
//!
//! A new control does not compile without its row.

use settings::Control;

/// What is drawn for one control, and how it is written.
#[derive(Debug, Clone, Copy)]
pub(super) struct Language {
    /// A lathe: X is a diameter, there is no height, and the table has the radius of a nose.
    pub is_lathe: bool,
    /// The axes of the only plane; `None`: any plane.
    pub only_plane: Option<[usize; 3]>,
    /// A tool may have a negative radius.
    pub has_negative_radius: bool,
    /// Sizes of what is drawn, in radii of the tool.
    pub sizes: [f64; 4],
    /// The letter of the radius of an arc; `None`: arcs have a centre only.
    pub radius_letter: Option<&'static str>,
    /// A contour may be one full circle.
    pub has_full_circle: bool,
    /// A contour may be cut again at another depth.
    pub has_depths: bool,
    /// A contour may be led on to with an arc.
    pub has_arc_leads: bool,
    /// A contour may be led on to at rapid.
    pub has_rapid_leads: bool,
    /// The feed is written again before a lead at rapid.
    pub repeats_feed: bool,
    /// An arc that the tool runs inside of has twice its radius at least.
    pub refuses_tight_arcs: bool,
    pub change_of_side: ChangeOfSide,
    /// Another tool may be called in the middle of a contour.
    pub has_change_of_tool: bool,
    /// The last blocks.
    pub end: &'static [&'static str],
}

/// How G41 becomes G42 without G40.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ChangeOfSide {
    Never,
    /// On the first block of the other side.
    OnContour,
    /// On a move of its own.
    OnOwnMove,
}

impl Language {
    pub(super) const fn of(control: Control) -> Self {
        let common = Self {
            is_lathe: false,
            only_plane: None,
            has_negative_radius: true,
            sizes: [1.0, 2.0, 4.0, 8.0],
            radius_letter: Some("R"),
            has_full_circle: true,
            has_depths: true,
            has_arc_leads: false,
            has_rapid_leads: true,
            repeats_feed: false,
            refuses_tight_arcs: false,
            change_of_side: ChangeOfSide::Never,
            has_change_of_tool: false,
            end: &["M2"],
        };
        match control {
            Control::Rs274 => Self { has_arc_leads: true, ..common },
            Control::Masso => Self {
                only_plane: Some([0, 1, 2]),
                has_full_circle: false,
                has_depths: false,
                ..common
            },
            Control::Automation1 => Self {
                has_negative_radius: false,
                radius_letter: None,
                has_rapid_leads: false,
                ..common
            },
            Control::OspLathe => Self {
                is_lathe: true,
                only_plane: Some([2, 0, 1]),
                has_negative_radius: false,
                sizes: [2.0, 2.01, 4.0, 8.0],
                radius_letter: Some("L"),
                has_depths: false,
                repeats_feed: true,
                refuses_tight_arcs: true,
                change_of_side: ChangeOfSide::OnContour,
                end: &["M5", "M2"],
                ..common
            },
            Control::Sinumerik840c => Self {
                radius_letter: None,
                change_of_side: ChangeOfSide::OnOwnMove,
                has_change_of_tool: true,
                end: &["M5", "M30"],
                ..common
            },
            Control::Nct => {
                Self { change_of_side: ChangeOfSide::OnContour, has_change_of_tool: true, ..common }
            }
        }
    }
}
