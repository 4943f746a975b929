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
    /// A picture.
    Image,
    /// A camera.
    CameraInfo,
    /// Shapes for RViz, in frames.
    MarkerArray,
    /// A pose in a frame and how sure it is.
    PoseWithCovarianceStamped,
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
static POSE_WITH_COVARIANCE: Definition = Definition {
    name: "geometry_msgs/PoseWithCovariance",
    fields: "geometry_msgs/Pose pose\nfloat64[36] covariance\n",
    parts: &[&POSE],
};
static POSE_WITH_COVARIANCE_STAMPED: Definition = Definition {
    name: "geometry_msgs/msg/PoseWithCovarianceStamped",
    fields: "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n",
    parts: &[&HEADER, &POSE_WITH_COVARIANCE],
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
static COLOR: Definition = Definition {
    name: "std_msgs/ColorRGBA",
    fields: "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n",
    parts: &[],
};
static COMPRESSED_IMAGE: Definition = Definition {
    name: "sensor_msgs/CompressedImage",
    fields: "std_msgs/Header header\nstring format\nuint8[] data\n",
    parts: &[&HEADER],
};
static UV_COORDINATE: Definition = Definition {
    name: "visualization_msgs/UVCoordinate",
    fields: "float32 u\nfloat32 v\n",
    parts: &[],
};
static MESH_FILE: Definition = Definition {
    name: "visualization_msgs/MeshFile",
    fields: "string filename\nuint8[] data\n",
    parts: &[],
};
static MARKER: Definition = Definition {
    name: "visualization_msgs/Marker",
    fields: "int32 ARROW=0\nint32 CUBE=1\nint32 SPHERE=2\nint32 CYLINDER=3\nint32 LINE_STRIP=4\n\
             int32 LINE_LIST=5\nint32 CUBE_LIST=6\nint32 SPHERE_LIST=7\nint32 POINTS=8\n\
             int32 TEXT_VIEW_FACING=9\nint32 MESH_RESOURCE=10\nint32 TRIANGLE_LIST=11\n\
             int32 ADD=0\nint32 MODIFY=0\nint32 DELETE=2\nint32 DELETEALL=3\n\
             std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\n\
             geometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\n\
             builtin_interfaces/Duration lifetime\nbool frame_locked\ngeometry_msgs/Point[] points\n\
             std_msgs/ColorRGBA[] colors\nstring texture_resource\n\
             sensor_msgs/CompressedImage texture\nvisualization_msgs/UVCoordinate[] uv_coordinates\n\
             string text\nstring mesh_resource\nvisualization_msgs/MeshFile mesh_file\n\
             bool mesh_use_embedded_materials\n",
    parts: &[
        &HEADER,
        &POSE,
        &VECTOR,
        &COLOR,
        &DURATION,
        &POINT,
        &COMPRESSED_IMAGE,
        &UV_COORDINATE,
        &MESH_FILE,
    ],
};
static MARKER_ARRAY: Definition = Definition {
    name: "visualization_msgs/msg/MarkerArray",
    fields: "visualization_msgs/Marker[] markers\n",
    parts: &[&MARKER],
};

static IMAGE: Definition = Definition {
    name: "sensor_msgs/msg/Image",
    fields: "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\n\
             uint8 is_bigendian\nuint32 step\nuint8[] data\n",
    parts: &[&HEADER],
};
static REGION_OF_INTEREST: Definition = Definition {
    name: "sensor_msgs/RegionOfInterest",
    fields: "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n",
    parts: &[],
};
static CAMERA_INFO: Definition = Definition {
    name: "sensor_msgs/msg/CameraInfo",
    fields: "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\n\
             float64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\n\
             uint32 binning_y\nsensor_msgs/RegionOfInterest roi\n",
    parts: &[&HEADER, &REGION_OF_INTEREST],
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
            Self::Image => &IMAGE,
            Self::CameraInfo => &CAMERA_INFO,
            Self::MarkerArray => &MARKER_ARRAY,
            Self::PoseWithCovarianceStamped => &POSE_WITH_COVARIANCE_STAMPED,
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
            Ros2Message::MarkerArray,
            Ros2Message::PoseWithCovarianceStamped,
        ] {
            let text = String::from_utf8(message.schema().data.to_vec()).unwrap();
            let defined: Vec<&str> =
                text.lines().filter_map(|line| line.strip_prefix("MSG: ")).collect();
            for (i, name) in defined.iter().enumerate() {
                assert!(!defined[..i].contains(name), "{name} twice");
            }
            let types = text.lines().filter(|line| !line.starts_with(['=', 'M']));
            for kind in types.filter_map(|line| line.split_whitespace().next()) {
                let kind = kind.split('[').next().unwrap_or(kind);
                assert!(!kind.contains('/') || defined.contains(&kind), "{kind} of {text}");
            }
        }
    }
}
