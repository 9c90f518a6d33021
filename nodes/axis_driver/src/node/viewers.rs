//! The machine for viewers: state, joints, frames, the tool's pose.

use crate::address::is_networked;
use crate::codes::setting_name;
use crate::driver::ControllerSettings;
use cnc_msgs::convert::{further_to_wire, machine_state_to_wire};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AXIS_LETTERS, Position};
use cnc_msgs::machine::MachineState;
use cnc_msgs::units::{m_from_mm, point_from_position};
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::cnc_msgs::msg::{
    ControllerSetting, ControllerSettings as ControllerSettingsMessage,
    MachineState as MachineStateMessage, WorkOffset,
};
use cnc_msgs::wire::geometry_msgs::msg::{
    Pose, PoseStamped, Quaternion, Transform, TransformStamped, Vector3,
};
use cnc_msgs::wire::sensor_msgs::msg::JointState;
use cnc_msgs::wire::std_msgs::msg::Header;
use cnc_msgs::wire::tf2_msgs::msg::TFMessage;
use runtime::{Handle, NodeError, Publisher, Qos, RosTime};

/// The topics on which the state goes out.
pub(super) struct Viewers {
    prefix: String,
    /// Of the names of joints, which are in `joint_states` of one machine.
    joint_prefix: String,
    baud: u32,
    is_networked: bool,
    state: Publisher<MachineStateMessage>,
    joints: Publisher<JointState>,
    frames: Publisher<TFMessage>,
    pose: Publisher<PoseStamped>,
    settings: Publisher<ControllerSettingsMessage>,
}

/// What the controller said of itself, as a message.
pub fn settings_to_wire(
    stamp: Time,
    baud: u32,
    settings: &ControllerSettings,
) -> ControllerSettingsMessage {
    let rows = settings.settings.iter().map(|(number, value)| {
        let (name, unit) = setting_name(settings.firmware, *number).unwrap_or_default();
        ControllerSetting {
            number: (*number).into(),
            value: value.clone(),
            name: name.into(),
            unit: unit.into(),
        }
    });
    let offsets = settings.offsets.iter().map(|offset| WorkOffset {
        name: offset.name.clone(),
        position: point_from_position(offset.position),
        further_axes: offset.further.bits(),
        further_position: further_to_wire(offset.further),
    });
    ControllerSettingsMessage {
        stamp,
        firmware: settings.firmware.traits().name.into(),
        version: settings.version.clone(),
        options: settings.options.clone(),
        planner_blocks: settings.planner_blocks.into(),
        axes: settings.axes.clone(),
        receive_buffer_size: settings.receive_bytes.into(),
        window: u32::try_from(settings.window).unwrap_or(u32::MAX),
        hold_latency: settings.window as f64 * 10.0 / f64::from(baud.max(1)),
        settings: rows.collect(),
        offsets: offsets.collect(),
    }
}

impl Viewers {
    pub(super) fn new(node: &Handle) -> Result<Self, NodeError> {
        let wanted: String = node.parameter("frame_prefix");
        Ok(Self {
            prefix: node.names().frame_prefix(&wanted),
            joint_prefix: if wanted == "/" { String::new() } else { wanted },
            baud: u32::try_from(node.parameter::<i64>("baud")).unwrap_or(115_200),
            is_networked: is_networked(&node.parameter::<String>("port")),
            state: node.publisher("machine_state", Qos::LATCHED)?,
            joints: node.publisher("joint_states", Qos::DEFAULT)?,
            frames: node.publisher("/tf", Qos::DEFAULT.with_depth(100))?,
            pose: node.publisher("tool_pose", Qos::DEFAULT)?,
            settings: node.publisher("controller_settings", Qos::LATCHED)?,
        })
    }

    fn header(&self, stamp: RosTime, frame: &str) -> Header {
        Header { stamp: stamp.into(), frame_id: format!("{}{frame}", self.prefix) }
    }

    /// Publishes what the controller said of itself.
    pub(super) fn publish_settings(&self, stamp: RosTime, settings: &ControllerSettings) {
        let mut message = settings_to_wire(stamp.into(), self.baud, settings);
        if self.is_networked {
            // `baud` says nothing of a network.
            message.hold_latency = 0.0;
        }
        self.settings.publish(message);
    }

    /// Publishes the state; positions only when they are known.
    pub(super) fn publish(&self, stamp: RosTime, state: &MachineState) {
        self.state.publish(machine_state_to_wire(self.header(stamp, "machine"), state));
        let (Some(machine), Some(work)) = (state.machine_position, state.work_position) else {
            return;
        };
        self.joints.publish(JointState {
            header: self.header(stamp, "machine"),
            name: joint_names(state).map(|axis| format!("{}{axis}", self.joint_prefix)).collect(),
            position: joint_positions(machine, state.further().machine),
            ..JointState::default()
        });
        let offset = std::array::from_fn(|axis| machine[axis] - work[axis]);
        self.frames.publish(TFMessage {
            transforms: vec![
                self.transform(stamp, "machine", "work", offset),
                self.transform(stamp, "work", "tool0", work),
            ],
        });
        self.pose.publish(PoseStamped {
            header: self.header(stamp, "work"),
            pose: Pose { position: point_from_position(work), orientation: upright() },
        });
    }

    fn transform(
        &self,
        stamp: RosTime,
        parent: &str,
        child: &str,
        offset_mm: [f64; 3],
    ) -> TransformStamped {
        let [x, y, z] = offset_mm.map(m_from_mm);
        TransformStamped {
            header: self.header(stamp, parent),
            child_frame_id: format!("{}{child}", self.prefix),
            transform: Transform { translation: Vector3 { x, y, z }, rotation: upright() },
        }
    }
}

/// X, Y and Z, then the others that the controller reports.
fn joint_names(state: &MachineState) -> impl Iterator<Item = char> {
    let further = state.further().machine.letters();
    AXIS_LETTERS
        .into_iter()
        .chain(further.chars().collect::<Vec<_>>())
        .map(|it| it.to_ascii_lowercase())
}

/// Metres, and radians of axes that turn.
fn joint_positions(machine: Position, further: FurtherAxes) -> Vec<f64> {
    machine.map(m_from_mm).into_iter().chain(further_to_wire(further)).collect()
}

fn upright() -> Quaternion {
    Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::machine::FurtherPlaces;

    #[test]
    fn joints_are_x_y_and_z_and_what_else_the_controller_reports() {
        let mut state = MachineState::default();
        assert_eq!(joint_names(&state).collect::<String>(), "xyz");
        let machine = FurtherAxes::NONE.with(0, 180.0).with(3, 50.0);
        state.further = Some(Box::new(FurtherPlaces { machine, ..FurtherPlaces::default() }));
        assert_eq!(joint_names(&state).collect::<String>(), "xyzau");
        let positions = joint_positions([1000.0, 0.0, -2.0], state.further().machine);
        assert_eq!(positions, [1.0, 0.0, -0.002, std::f64::consts::PI, 0.05]);
    }
}
