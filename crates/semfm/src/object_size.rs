//! How large an object is in metres, in words, and whether its unit is in doubt.

use std::fmt;

use semfm_geom::Mesh;

use crate::{Error, Result};

/// The sides of an object's box, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectSize {
    /// Along x, y and z of the mesh.
    pub sides: [f64; 3],
    /// Metres per unit of the mesh that this came from.
    pub scale: f64,
}

/// Longest side of what a parallel gripper grasps, metres: beyond these two the unit is in doubt. A
/// broom has 1.4 m, a sewing needle 3 cm.
const USUAL: [f64; 2] = [0.01, 1.5];

/// Beyond these two nothing is grasped, and a unit is wrong.
const POSSIBLE: [f64; 2] = [0.001, 15.0];

impl ObjectSize {
    /// The size of a mesh at `scale` metres per unit.
    pub fn of(mesh: &Mesh, scale: f64) -> Self {
        let (low, high) = mesh.bounds();
        Self { sides: ((high - low) * scale).to_array(), scale }
    }

    /// The longest side, metres.
    pub fn longest(&self) -> f64 {
        self.sides.into_iter().fold(0.0, f64::max)
    }

    /// What to ask the user where an object of this size is unusual in a gripper; `None` for others.
    pub fn question(&self) -> Option<String> {
        let longest = self.longest();
        if (USUAL[0]..=USUAL[1]).contains(&longest) || !longest.is_finite() {
            return None;
        }
        let units =
            [("millimetres", 0.001), ("centimetres", 0.01), ("inches", 0.0254), ("metres", 1.0)];
        let fits = units.into_iter().find(|(_, scale)| {
            let as_read = longest / self.scale;
            (USUAL[0]..=USUAL[1]).contains(&(as_read * scale)) && *scale != self.scale
        });
        let doubt =
            format!("at {} metres per unit the object is {} long", self.scale, length(longest));
        Some(match fits {
            Some((unit, scale)) => {
                format!("{doubt}: is the mesh in {unit}? Then its scale is {scale} metres per unit")
            }
            None => format!("{doubt}: is that its true size?"),
        })
    }

    /// Refuses a size at which nothing can be grasped.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the question that helps.
    pub fn check(&self) -> Result<()> {
        let longest = self.longest();
        if (POSSIBLE[0]..=POSSIBLE[1]).contains(&longest) {
            return Ok(());
        }
        let expected = format!("an object of {} to {}", length(POSSIBLE[0]), length(POSSIBLE[1]));
        let found = self.question().unwrap_or_else(|| format!("{longest} m"));
        Err(Error::invalid("object scale", expected, found))
    }
}

impl fmt::Display for ObjectSize {
    /// As `95 × 110 × 80 mm`, or in metres where a side has one or more.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.sides;
        let (factor, unit) = unit_of(self.longest());
        let digits = if unit == "mm" && self.longest() >= 0.01 { 0 } else { 2 };
        write!(
            f,
            "{:.digits$} × {:.digits$} × {:.digits$} {unit}",
            x * factor,
            y * factor,
            z * factor
        )
    }
}

fn unit_of(longest: f64) -> (f64, &'static str) {
    if longest < 1.0 { (1e3, "mm") } else { (1.0, "m") }
}

fn length(metres: f64) -> String {
    let (factor, unit) = unit_of(metres);
    let value = metres * factor;
    if (0.1..1e5).contains(&value) {
        // Three digits that count.
        let digits = (2.0 - value.log10().floor()).clamp(0.0, 3.0) as usize;
        let text = format!("{value:.digits$}");
        let text = if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.')
        } else {
            &text
        };
        return format!("{text} {unit}");
    }
    format!("{value:.3e} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::math::DVec3;
    use semfm_geom::zoo;

    fn size(longest: f64, scale: f64) -> ObjectSize {
        let mesh = zoo::tetrahedron();
        let factor = longest / ObjectSize::of(&mesh, 1.0).longest();
        let vertices: Vec<DVec3> = mesh.vertices().iter().map(|&p| p * factor).collect();
        ObjectSize::of(&Mesh::new(vertices, mesh.faces().to_vec()).unwrap(), scale)
    }

    #[test]
    fn the_unit_is_asked_for_where_it_is_in_doubt() {
        assert_eq!(size(0.095, 1.0).question(), None);
        for (longest, scale, words) in [
            (95.0, 1.0, "millimetres? Then its scale is 0.001"),
            (1.8, 1.0, "1.8 m long"),
            (0.12, 0.001, "in metres? Then its scale is 1 "),
        ] {
            let question = size(longest, scale).question().unwrap();
            assert!(question.contains(words), "{question}");
        }
        assert!(size(1.8, 1.0).check().is_ok() && size(95.0, 0.001).check().is_ok());
        for (longest, scale) in [(95.0, 1.0), (0.12, 0.001), (0.1, 1e6), (0.1, 0.0)] {
            assert!(size(longest, scale).check().is_err(), "{longest} {scale}");
        }
    }

    #[test]
    fn sizes_are_written_as_people_measure() {
        assert!(
            size(0.095, 1.0).to_string().contains("95 × ")
                || size(0.095, 1.0).to_string().contains(" 95")
        );
        assert!(size(0.095, 1.0).to_string().ends_with(" mm"));
        assert!(size(1.8, 1.0).to_string().ends_with(" m"));
        assert_eq!(length(1.8), "1.8 m");
        assert_eq!(length(0.095), "95 mm");
        assert_eq!(length(120.0), "120 m");
    }
}
