//! Which topics of a bag are colour, depth and cameras.

use std::collections::BTreeMap;

use super::compressed_depth::Fault;
use super::images::{COMPRESSED, IMAGE};
use super::messages::CAMERA_INFO;
use super::point_cloud::POINT_CLOUD;

/// Topics that are chosen, each with the name of its messages.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chosen {
    pub color: Option<Topic>,
    /// Depth, or a cloud.
    pub depth: Option<Topic>,
    pub camera_info: String,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Topic {
    pub name: String,
    pub schema: String,
}

/// What was asked for.
#[derive(Clone, Debug, Default)]
pub(super) struct Asked {
    pub color: Option<String>,
    pub depth: Option<String>,
    pub camera_info: Option<String>,
}

/// Chooses topics among those of a bag (name to schema): those asked for, else the only ones that can be meant.
pub(super) fn choose(topics: &BTreeMap<String, String>, asked: &Asked) -> Result<Chosen, Fault> {
    let is_picture = |schema: &str| schema == IMAGE || schema == COMPRESSED;
    let of = |kind: &str, wanted: &dyn Fn(&str, &str) -> bool, name: &Option<String>| {
        pick(topics, kind, wanted, name.as_deref())
    };
    let depth = of("depth", &|name, schema| is_picture(schema) && is_depth(name), &asked.depth)?;
    let depth = match depth {
        None => of("cloud", &|_, schema| schema == POINT_CLOUD, &None)?,
        depth => depth,
    };
    let color = of("colour", &|name, schema| is_picture(schema) && is_color(name), &asked.color)?;
    let Some(first) = color.as_ref().or(depth.as_ref()) else {
        return Err(Fault::new(
            "topics of sensor_msgs/Image, CompressedImage or PointCloud2",
            listed(topics),
        ));
    };
    let camera_info = match &asked.camera_info {
        Some(name) => name.clone(),
        None => camera_info_of(
            &depth.as_ref().filter(|d| d.schema != POINT_CLOUD).unwrap_or(first).name,
        ),
    };
    if topics.get(&camera_info).map(String::as_str) != Some(CAMERA_INFO) {
        let infos: Vec<&str> = topics
            .iter()
            .filter(|(_, s)| *s == CAMERA_INFO)
            .map(|(name, _)| name.as_str())
            .collect();
        let found = if infos.is_empty() { "none".into() } else { infos.join(", ") };
        return Err(Fault::new(format!("CameraInfo on `{camera_info}`"), found));
    }
    Ok(Chosen { color, depth, camera_info })
}

/// The topic asked for, or the only one of its kind. Several transports of one picture count as one: the raw one.
fn pick(
    topics: &BTreeMap<String, String>,
    kind: &str,
    is_wanted: &dyn Fn(&str, &str) -> bool,
    asked: Option<&str>,
) -> Result<Option<Topic>, Fault> {
    let topic = |name: &str| Topic { name: name.to_owned(), schema: topics[name].clone() };
    if let Some(name) = asked {
        let is_there = topics
            .get(name)
            .is_some_and(|s| [IMAGE, COMPRESSED, POINT_CLOUD].contains(&s.as_str()));
        return match is_there {
            true => Ok(Some(topic(name))),
            false => Err(Fault::new(format!("pictures or clouds on `{name}`"), listed(topics))),
        };
    }
    let mut names: Vec<&str> = topics
        .iter()
        .filter(|(name, schema)| is_wanted(name, schema))
        .map(|(n, _)| n.as_str())
        .collect();
    // Depth that is registered to the colour is the one that masks of the colour fit.
    if names.iter().any(|name| name.contains("aligned")) {
        names.retain(|name| name.contains("aligned"));
    }
    let mut bases: Vec<&str> = names.iter().map(|name| base(name)).collect();
    bases.sort_unstable();
    bases.dedup();
    // The same camera, once as it came and once without distortion.
    if bases.len() == 2 && bases.iter().filter(|name| name.contains("rect")).count() == 1 {
        bases.retain(|name| name.contains("rect"));
    }
    match bases[..] {
        [] => Ok(None),
        [one] => {
            let raw = names.iter().find(|name| **name == one);
            // By name `compressedDepth` comes after `compressed`, which loses depth.
            let packed = names.iter().rfind(|name| base(name) == one);
            Ok(raw.or(packed).map(|name| topic(name)))
        }
        _ => Err(Fault::new(format!("the name of one {kind} topic"), bases.join(", "))),
    }
}

fn is_depth(name: &str) -> bool {
    name.to_ascii_lowercase().contains("depth")
}

fn is_color(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    !["depth", "infra", "mask", "thermal", "theora", "/ir/", "confidence"]
        .iter()
        .any(|w| name.contains(w))
}

/// A topic without the name of its transport.
fn base(name: &str) -> &str {
    let transport =
        ["/compressed", "/compressedDepth"].iter().find_map(|end| name.strip_suffix(end));
    transport.unwrap_or(name)
}

/// The topic of the camera that stands beside pictures.
fn camera_info_of(name: &str) -> String {
    let folder = base(name).rsplit_once('/').map_or("", |(folder, _)| folder);
    format!("{folder}/camera_info")
}

/// Whether the pictures of a topic are without distortion, by its name.
pub(super) fn is_rectified(name: &str) -> bool {
    base(name).rsplit('/').next().is_some_and(|last| last.contains("rect"))
}

fn listed(topics: &BTreeMap<String, String>) -> String {
    const SHOWN: usize = 20;
    let mut words: Vec<String> =
        topics.iter().take(SHOWN).map(|(name, schema)| format!("{name} ({schema})")).collect();
    if topics.len() > SHOWN {
        words.push(format!("and {} more", topics.len() - SHOWN));
    }
    if words.is_empty() { "no topic at all".into() } else { words.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topics(names: &[(&str, &str)]) -> BTreeMap<String, String> {
        names.iter().map(|(name, schema)| ((*name).into(), (*schema).into())).collect()
    }

    #[test]
    fn the_usual_cameras_need_no_names() {
        let realsense = topics(&[
            ("/camera/color/image_raw", IMAGE),
            ("/camera/color/image_raw/compressed", COMPRESSED),
            ("/camera/color/camera_info", CAMERA_INFO),
            ("/camera/depth/image_rect_raw", IMAGE),
            ("/camera/aligned_depth_to_color/image_raw/compressedDepth", COMPRESSED),
            ("/camera/aligned_depth_to_color/camera_info", CAMERA_INFO),
            ("/camera/infra1/image_rect_raw", IMAGE),
        ]);
        let chosen = choose(&realsense, &Asked::default()).unwrap();
        assert_eq!(chosen.color.unwrap().name, "/camera/color/image_raw");
        let depth = chosen.depth.unwrap().name;
        assert_eq!(depth, "/camera/aligned_depth_to_color/image_raw/compressedDepth");
        assert_eq!(chosen.camera_info, "/camera/aligned_depth_to_color/camera_info");
        let packed = topics(&[
            ("/d/depth/image/compressed", COMPRESSED),
            ("/d/depth/image/compressedDepth", COMPRESSED),
            ("/d/depth/camera_info", CAMERA_INFO),
        ]);
        let depth = choose(&packed, &Asked::default()).unwrap().depth.unwrap().name;
        assert_eq!(depth, "/d/depth/image/compressedDepth");
        let lidar = topics(&[("/points", POINT_CLOUD), ("/camera_info", CAMERA_INFO)]);
        assert_eq!(choose(&lidar, &Asked::default()).unwrap().depth.unwrap().schema, POINT_CLOUD);
    }

    #[test]
    fn what_could_be_meant_twice_or_is_not_there_is_listed() {
        let two =
            topics(&[("/a/image", IMAGE), ("/b/image", IMAGE), ("/a/camera_info", CAMERA_INFO)]);
        assert_eq!(choose(&two, &Asked::default()).unwrap_err().found, "/a/image, /b/image");
        let asked = Asked { color: Some("/a/image".into()), ..Default::default() };
        assert_eq!(choose(&two, &asked).unwrap().camera_info, "/a/camera_info");
        let asked = Asked { color: Some("/b/image".into()), ..Default::default() };
        assert!(choose(&two, &asked).unwrap_err().expected.contains("/b/camera_info"));
        let asked = Asked { depth: Some("/c".into()), ..Default::default() };
        assert!(choose(&two, &asked).unwrap_err().found.contains("/a/image"));
        assert!(choose(&topics(&[]), &Asked::default()).unwrap_err().found.contains("no topic"));
        assert!(
            is_rectified("/camera/image_rect_color/compressed") && !is_rectified("/rect/image_raw")
        );
    }
}
