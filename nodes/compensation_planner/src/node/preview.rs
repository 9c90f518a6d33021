//! The path for viewers: points instead of arcs, few enough for one message.

use crate::geometry::tessellate;
use cnc_msgs::geometry::Position;
use cnc_msgs::path::{CompensatedPath, Role};
use cnc_msgs::units::point_from_position;
use cnc_msgs::wire::geometry_msgs::msg::{Point, Pose, PoseStamped, Quaternion, Vector3};
use cnc_msgs::wire::nav_msgs::msg::Path;
use cnc_msgs::wire::std_msgs::msg::{ColorRGBA, Header};
use cnc_msgs::wire::visualization_msgs::msg::{Marker, MarkerArray};

/// The most points of a `nav_msgs/Path` below 60 kB.
const POINTS_MAX: usize = 600;

/// How a part of the path looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Look {
    Rapid,
    Cut,
    Lead,
}

/// The points of a path, in order, with the look of the line to each.
#[derive(Debug, Clone)]
pub(crate) struct View {
    points: Vec<(Position, Look)>,
    /// What was left out, when something was.
    pub note: Option<String>,
}

/// Turns a path into points; of very many, every nth.
pub(crate) fn view(path: &CompensatedPath, chord_error_mm: f64) -> View {
    let mut points = vec![(path.start, Look::Rapid)];
    let mut last = path.start;
    for element in &path.elements {
        let look = match (element.role, element.feed_mm_per_min) {
            (_, None) => Look::Rapid,
            (Role::LeadOn | Role::LeadOff | Role::Link, _) => Look::Lead,
            _ => Look::Cut,
        };
        tessellate::points(last, element, chord_error_mm, |point| points.push((point, look)));
        last = element.end;
    }
    let all = points.len();
    if all <= POINTS_MAX {
        return View { points, note: None };
    }
    let step = all.div_ceil(POINTS_MAX - 1);
    let end = points[all - 1];
    let mut kept: Vec<_> = points.into_iter().step_by(step).collect();
    if kept.last() != Some(&end) {
        kept.push(end);
    }
    let note = format!("the preview shows {} of {all} points of the path", kept.len());
    View { points: kept, note: Some(note) }
}

impl View {
    /// As `nav_msgs/Path`.
    pub(crate) fn path_message(&self, header: &Header) -> Path {
        let pose = |position| PoseStamped {
            header: header.clone(),
            pose: Pose {
                position: point_from_position(position),
                orientation: Quaternion { w: 1.0, ..Quaternion::default() },
            },
        };
        Path {
            header: header.clone(),
            poses: self.points.iter().map(|&(position, _)| pose(position)).collect(),
        }
    }

    /// As line lists, one marker a look, and a text when something was left out.
    pub(crate) fn marker_message(&self, header: &Header) -> MarkerArray {
        let looks = [
            (Look::Cut, 0.0006, [0.48, 0.18, 0.75]),
            (Look::Lead, 0.0006, [0.90, 0.55, 0.10]),
            (Look::Rapid, 0.0003, [0.18, 0.56, 0.36]),
        ];
        let mut markers: Vec<Marker> = looks
            .into_iter()
            .enumerate()
            .map(|(id, (look, width, rgb))| Marker {
                type_: Marker::LINE_LIST,
                points: self.segments(look),
                scale: Vector3 { x: width, ..Vector3::default() },
                ..marker(header, id as i32, rgb)
            })
            .collect();
        if let (Some(note), Some(&(position, _))) = (&self.note, self.points.first()) {
            let mut text = marker(header, looks.len() as i32, [0.5, 0.5, 0.5]);
            text.type_ = Marker::TEXT_VIEW_FACING;
            text.text = note.clone();
            text.scale = Vector3 { z: 0.004, ..Vector3::default() };
            text.pose.position = point_from_position(position);
            markers.push(text);
        }
        MarkerArray { markers }
    }

    fn segments(&self, look: Look) -> Vec<Point> {
        self.points
            .windows(2)
            .filter(|pair| pair[1].1 == look)
            .flat_map(|pair| [point_from_position(pair[0].0), point_from_position(pair[1].0)])
            .collect()
    }
}

fn marker(header: &Header, id: i32, [r, g, b]: [f32; 3]) -> Marker {
    Marker {
        header: header.clone(),
        ns: "compensated_path".into(),
        id,
        action: Marker::ADD,
        pose: Pose {
            orientation: Quaternion { w: 1.0, ..Quaternion::default() },
            ..Pose::default()
        },
        color: ColorRGBA { r, g, b, a: 1.0 },
        ..Marker::default()
    }
}
