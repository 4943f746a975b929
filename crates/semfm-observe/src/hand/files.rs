//! Hands out of files.

use std::path::Path;

use semfm_geom::io::{FormatError, MeshOrPoints, read_file, read_json, read_mesh_or_points};
use semfm_geom::math::DVec3;

use super::{Hand, from_opengl};
use crate::npz::NumpyArchive;
use crate::numpy_array::{Numbers, NumpyArray};
use crate::{Error, Result};

/// Names of the arrays, as pose estimators write them.
const VERTICES: [&str; 6] =
    ["vertices", "verts", "pred_vertices", "v", "hand_verts", "vertices_3d"];
const FACES: [&str; 4] = ["faces", "f", "mano_faces", "faces_right"];
const JOINTS: [&str; 6] =
    ["joints", "pred_keypoints_3d", "keypoints_3d", "joints_3d", "joint_3d", "j3d"];

/// Reads a hand: a mesh (HaMeR and WiLoR write OBJ, SAM 3D Body PLY), a cloud of points, or arrays (`.npz`) of `vertices`,
/// and of `faces` and 21 `joints` where there are any, under the names in use. A hand all of whose points lie behind the
/// camera is one in OpenGL's axes (y up, z towards the viewer), and is turned into ours.
///
/// # Errors
/// [`Error::Geom`] where the file cannot be read; [`Error::Format`] with the array at fault; a file of MANO's pose and shape
/// alone among them, which is no surface without MANO's model.
pub fn read_hand(path: &Path) -> Result<Hand> {
    let is_npz = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npz"));
    if is_npz {
        return from_arrays(path);
    }
    let (mut points, faces) = match read_mesh_or_points(path)? {
        MeshOrPoints::Mesh(file) => (file.mesh.vertices().to_vec(), file.mesh.faces().to_vec()),
        MeshOrPoints::Points(cloud) => (cloud.points, Vec::new()),
    };
    from_opengl(&mut points);
    Hand::new(points, faces).map_err(|error| named(path, error))
}

fn from_arrays(path: &Path) -> Result<Hand> {
    let archive = NumpyArchive::read(path)?;
    let array = |names: &[&str]| -> Result<Option<(String, NumpyArray)>> {
        for name in names {
            if let Some(array) = archive.array(name)? {
                return Ok(Some(((*name).to_owned(), array)));
            }
        }
        Ok(None)
    };
    let Some((name, vertices)) = array(&VERTICES)? else {
        let names: Vec<&str> = archive.names().collect();
        let parameters = names.iter().any(|name| name.contains("pose") || name.contains("betas"));
        let expected = format!("an array of vertices ({})", VERTICES.join(", "));
        let mut found = names.join(", ");
        if parameters {
            found += " (pose and shape are no surface: save the vertices that MANO gives for them)";
        }
        return Err(FormatError::new(path, "arrays", expected, found).into());
    };
    let mut points = rows(path, &name, vertices)?;
    let is_turned = from_opengl(&mut points);
    let faces = match array(&FACES)? {
        Some((name, faces)) => {
            let whole = rows(path, &name, faces)?;
            let ids = whole.iter().map(|row| {
                let [a, b, c] = row.to_array().map(id_of);
                a.zip(b).zip(c).map(|((a, b), c)| [a, b, c]).ok_or(row)
            });
            ids.collect::<std::result::Result<_, _>>().map_err(|row| {
                FormatError::new(path, &name, "ids of vertices, from 0", row.to_string())
            })?
        }
        None => Vec::new(),
    };
    let hand = Hand::new(points, faces).map_err(|error| named(path, error))?;
    match array(&JOINTS)? {
        Some((name, joints)) => {
            let mut joints = rows(path, &name, joints)?;
            if is_turned {
                joints.iter_mut().for_each(|p| *p = DVec3::new(p.x, -p.y, -p.z));
            }
            // Estimators that give other joints, too, list these first or under another name.
            if joints.len() == 21 { hand.with_joints(&joints) } else { Ok(hand) }
        }
        None => Ok(hand),
    }
}

/// An array (n × 3), or (1 × n × 3) as networks give for one hand.
fn rows(path: &Path, name: &str, array: NumpyArray) -> Result<Vec<DVec3>> {
    let shape = array.shape_in_words();
    let is_rows = matches!(array.shape[..], [_, 3] | [1, _, 3]);
    if !is_rows || matches!(array.numbers, Numbers::Bool(_)) {
        let expected = "(n, 3), or (1, n, 3) of one hand";
        return Err(FormatError::new(path, name, expected, shape).into());
    }
    Ok(array.into_f64().as_chunks::<3>().0.iter().map(|&row| DVec3::from_array(row)).collect())
}

/// An error with the file that it is about.
pub(super) fn named(path: &Path, error: Error) -> Error {
    match error {
        Error::Invalid { what, expected, found } => {
            FormatError::new(path, what, expected, found).into()
        }
        other => other,
    }
}

/// Reads ids of vertices: a JSON list, a NumPy array, or numbers between white space.
///
/// # Errors
/// [`Error::Geom`] where the file cannot be read; [`Error::Format`] for what is no whole number.
pub fn read_vertex_ids(path: &Path) -> Result<Vec<u32>> {
    let fault = |place: String, found: String| {
        Error::from(FormatError::new(path, place, "ids of vertices, from 0", found))
    };
    let numbers: Vec<f64> = match path.extension().and_then(|e| e.to_str()).unwrap_or("") {
        "json" => read_json(path)?,
        "npy" => NumpyArray::read(path)?.into_f64(),
        _ => {
            let bytes = read_file(path)?;
            let text = String::from_utf8_lossy(&bytes);
            let number = |(at, word): (usize, &str)| {
                word.parse().map_err(|_| {
                    fault(format!("word {}", at + 1), format!("`{}`", word.escape_debug()))
                })
            };
            let words =
                text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
            words.enumerate().map(number).collect::<Result<_>>()?
        }
    };
    let id = |(at, &x): (usize, &f64)| {
        id_of(x).ok_or_else(|| fault(format!("number {}", at + 1), x.to_string()))
    };
    numbers.iter().enumerate().map(id).collect()
}

/// A number as the id of a vertex, where it can be one.
fn id_of(x: f64) -> Option<u32> {
    (x >= 0.0 && x < f64::from(u32::MAX) && x.fract() == 0.0).then_some(x as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::HandPart;
    use crate::npz::testing::{npy, zip};

    #[test]
    fn arrays_meshes_and_clouds_are_hands() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let vertices = [0.0f32, 0.0, 0.5, 0.1, 0.0, 0.5, 0.0, 0.1, 0.5];
        let joints: Vec<f32> =
            (0..63).map(|i| if i % 3 == 2 { 0.5 } else { i as f32 / 100.0 }).collect();
        let files = [
            ("verts.npy", npy(&[1, 3, 3], &vertices)),
            ("faces.npy", npy(&[1, 3], &[0i32, 1, 2])),
            ("pred_keypoints_3d.npy", npy(&[21, 3], &joints)),
        ];
        std::fs::write(at("h.npz"), zip(&files, true)).unwrap();
        let hand = read_hand(&at("h.npz")).unwrap();
        assert_eq!((hand.points().len(), hand.faces()), (3, &[[0, 1, 2]][..]));
        assert_eq!(hand.parts().unwrap()[0], HandPart::Palm);
        // OpenGL's axes.
        std::fs::write(at("h.obj"), "v 0 0.1 -0.5\nv 0.1 0 -0.5\nv 0 0 -0.5\nf 1 2 3\n").unwrap();
        assert_eq!(read_hand(&at("h.obj")).unwrap().points()[0], DVec3::new(0.0, -0.1, 0.5));
        let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                   end_header\n0 0 1\n1 0 1\n0 1 1\n";
        std::fs::write(at("h.ply"), ply).unwrap();
        assert!(read_hand(&at("h.ply")).unwrap().faces().is_empty());
        let parameters = [("pose_m.npy", npy(&[1, 51], &[0.0f32; 51]))];
        std::fs::write(at("p.npz"), zip(&parameters, false)).unwrap();
        assert!(read_hand(&at("p.npz")).unwrap_err().to_string().contains("no surface"));
        let flat = [("vertices.npy", npy(&[9], &vertices))];
        std::fs::write(at("f.npz"), zip(&flat, false)).unwrap();
        assert!(read_hand(&at("f.npz")).unwrap_err().to_string().contains("(9)"));
    }

    #[test]
    fn ids_come_in_three_forms() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("a.json"), "[3, 1]").unwrap();
        std::fs::write(at("a.npy"), npy(&[2], &[3i64, 1])).unwrap();
        std::fs::write(at("a.txt"), "3,\n1\n").unwrap();
        for name in ["a.json", "a.npy", "a.txt"] {
            assert_eq!(read_vertex_ids(&at(name)).unwrap(), [3, 1]);
        }
        std::fs::write(at("b.json"), "[3, -1]").unwrap();
        std::fs::write(at("b.txt"), "3 cup").unwrap();
        assert!(read_vertex_ids(&at("b.json")).unwrap_err().to_string().contains("number 2"));
        assert!(read_vertex_ids(&at("b.txt")).unwrap_err().to_string().contains("`cup`"));
    }
}
