//! The machine for viewers: state, joints, frames, the tool's pose.

use cnc_msgs::convert::machine_state_to_wire;
use cnc_msgs::machine::MachineState;
use cnc_msgs::units::{m_from_mm, point_from_position};
use cnc_msgs::wire::cnc_msgs::msg::MachineState as MachineStateMessage;
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
    state: Publisher<MachineStateMessage>,
    joints: Publisher<JointState>,
    frames: Publisher<TFMessage>,
    pose: Publisher<PoseStamped>,
}

impl Viewers {
    pub(super) fn new(node: &Handle) -> Result<Self, NodeError> {
        Ok(Self {
            prefix: node.parameter("frame_prefix"),
            state: node.publisher("machine_state", Qos::LATCHED)?,
            joints: node.publisher("joint_states", Qos::DEFAULT)?,
            frames: node.publisher("/tf", Qos::DEFAULT.with_depth(100))?,
            pose: node.publisher("tool_pose", Qos::DEFAULT)?,
        })
    }

    fn header(&self, stamp: RosTime, frame: &str) -> Header {
        Header { stamp: stamp.into(), frame_id: format!("{}{frame}", self.prefix) }
    }

    /// Publishes the state; positions only when they are known.
    pub(super) fn publish(&self, stamp: RosTime, state: &MachineState) {
        self.state.publish(machine_state_to_wire(self.header(stamp, "machine"), state));
        let (Some(machine), Some(work)) = (state.machine_position, state.work_position) else {
            return;
        };
        self.joints.publish(JointState {
            header: self.header(stamp, "machine"),
            name: ["x", "y", "z"].map(|axis| format!("{}{axis}", self.prefix)).to_vec(),
            position: machine.map(m_from_mm).to_vec(),
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

fn upright() -> Quaternion {
    Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
}
