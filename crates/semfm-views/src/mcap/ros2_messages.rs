//! The definitions of the ROS 2 messages that we write, in the form that MCAP prescribes for `ros2msg`: the message's
//! own, then that of each message that it is made of. All are part of every ROS 2 installation.

use super::contents::Schema;

/// A message of ROS 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Ros2Message {
    /// Poses in a frame.
    PoseArray,
    /// Numbers.
    Float64MultiArray,
    /// Joints over time, as controllers take them.
    JointTrajectory,
    /// Where joints are and how fast they move.
    JointState,
    /// Text.
    String,
    /// How frames stand in each other.
    TfMessage,
}

/// A definition: its name, its fields, and the messages among them.
struct Definition {
    name: &'static str,
    fields: &'static str,
    parts: &'static [&'static Definition],
}

static TIME: Definition = Definition {
    name: "builtin_interfaces/Time",
    fields: "int32 sec\nuint32 nanosec\n",
    parts: &[],
};
static DURATION: Definition = Definition {
    name: "builtin_interfaces/Duration",
    fields: "int32 sec\nuint32 nanosec\n",
    parts: &[],
};
static HEADER: Definition = Definition {
    name: "std_msgs/Header",
    fields: "builtin_interfaces/Time stamp\nstring frame_id\n",
    parts: &[&TIME],
};
static POINT: Definition = Definition {
    name: "geometry_msgs/Point",
    fields: "float64 x\nfloat64 y\nfloat64 z\n",
    parts: &[],
};
static VECTOR: Definition = Definition {
    name: "geometry_msgs/Vector3",
    fields: "float64 x\nfloat64 y\nfloat64 z\n",
    parts: &[],
};
static QUATERNION: Definition = Definition {
    name: "geometry_msgs/Quaternion",
    fields: "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    parts: &[],
};
static POSE: Definition = Definition {
    name: "geometry_msgs/Pose",
    fields: "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    parts: &[&POINT, &QUATERNION],
};
static TRANSFORM: Definition = Definition {
    name: "geometry_msgs/Transform",
    fields: "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    parts: &[&VECTOR, &QUATERNION],
};
static TRANSFORM_STAMPED: Definition = Definition {
    name: "geometry_msgs/TransformStamped",
    fields: "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    parts: &[&HEADER, &TRANSFORM],
};
static DIMENSION: Definition = Definition {
    name: "std_msgs/MultiArrayDimension",
    fields: "string label\nuint32 size\nuint32 stride\n",
    parts: &[],
};
static LAYOUT: Definition = Definition {
    name: "std_msgs/MultiArrayLayout",
    fields: "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n",
    parts: &[&DIMENSION],
};
static TRAJECTORY_POINT: Definition = Definition {
    name: "trajectory_msgs/JointTrajectoryPoint",
    fields: "float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\nfloat64[] effort\n\
             builtin_interfaces/Duration time_from_start\n",
    parts: &[&DURATION],
};
static POSE_ARRAY: Definition = Definition {
    name: "geometry_msgs/msg/PoseArray",
    fields: "std_msgs/Header header\ngeometry_msgs/Pose[] poses\n",
    parts: &[&HEADER, &POSE],
};
static NUMBERS: Definition = Definition {
    name: "std_msgs/msg/Float64MultiArray",
    fields: "std_msgs/MultiArrayLayout layout\nfloat64[] data\n",
    parts: &[&LAYOUT],
};
static JOINT_TRAJECTORY: Definition = Definition {
    name: "trajectory_msgs/msg/JointTrajectory",
    fields: "std_msgs/Header header\nstring[] joint_names\n\
             trajectory_msgs/JointTrajectoryPoint[] points\n",
    parts: &[&HEADER, &TRAJECTORY_POINT],
};
static JOINT_STATE: Definition = Definition {
    name: "sensor_msgs/msg/JointState",
    fields: "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
             float64[] effort\n",
    parts: &[&HEADER],
};
static STRING: Definition =
    Definition { name: "std_msgs/msg/String", fields: "string data\n", parts: &[] };
static TF_MESSAGE: Definition = Definition {
    name: "tf2_msgs/msg/TFMessage",
    fields: "geometry_msgs/TransformStamped[] transforms\n",
    parts: &[&TRANSFORM_STAMPED],
};

impl Ros2Message {
    fn definition(self) -> &'static Definition {
        match self {
            Self::PoseArray => &POSE_ARRAY,
            Self::Float64MultiArray => &NUMBERS,
            Self::JointTrajectory => &JOINT_TRAJECTORY,
            Self::JointState => &JOINT_STATE,
            Self::String => &STRING,
            Self::TfMessage => &TF_MESSAGE,
        }
    }

    /// Its name, such as `std_msgs/msg/String`.
    pub fn name(self) -> &'static str {
        self.definition().name
    }

    /// Its schema: its own definition, then each that it is made of, once.
    pub fn schema(self) -> Schema {
        let definition = self.definition();
        let mut text = definition.fields.to_owned();
        let mut known: Vec<&str> = Vec::new();
        let mut waiting: Vec<&Definition> = definition.parts.iter().rev().copied().collect();
        while let Some(part) = waiting.pop() {
            if known.contains(&part.name) {
                continue;
            }
            known.push(part.name);
            text += &format!("{}\nMSG: {}\n{}", "=".repeat(80), part.name, part.fields);
            waiting.extend(part.parts.iter().rev().copied());
        }
        let (name, encoding) = (definition.name.to_owned(), "ros2msg".to_owned());
        Schema { name, encoding, data: text.into_bytes() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_message_that_a_definition_names_is_defined_once() {
        for message in [
            Ros2Message::PoseArray,
            Ros2Message::Float64MultiArray,
            Ros2Message::JointTrajectory,
            Ros2Message::JointState,
            Ros2Message::String,
            Ros2Message::TfMessage,
        ] {
            let text = String::from_utf8(message.schema().data.to_vec()).unwrap();
            let defined: Vec<&str> =
                text.lines().filter_map(|line| line.strip_prefix("MSG: ")).collect();
            for (i, name) in defined.iter().enumerate() {
                assert!(!defined[..i].contains(name), "{name} twice");
            }
            let types = text.lines().filter(|line| !line.starts_with(['=', 'M']));
            for kind in types.filter_map(|line| line.split_whitespace().next()) {
                let kind = kind.trim_end_matches("[]");
                assert!(!kind.contains('/') || defined.contains(&kind), "{kind} of {text}");
            }
        }
    }
}
