//! Pictures turned by quarters, and grids turned back.

use semfm_geom::Pinhole;

use crate::{Error, Result};

/// A square or oblong array (height × width) whose places may be read as if it were turned by
/// quarters, counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Turned {
    /// Height and width of the array as it is.
    height: usize,
    width: usize,
    /// Quarters, 0 to 3.
    quarters: u32,
}

impl Turned {
    /// The quarters that a number of rolls stands for.
    ///
    /// # Errors
    /// [`Error::Invalid`] for other numbers than 1, 2 and 4.
    pub fn quarters_of(rolls: u32) -> Result<&'static [u32]> {
        match rolls {
            1 => Ok(&[0]),
            2 => Ok(&[0, 2]),
            4 => Ok(&[0, 1, 2, 3]),
            _ => Err(Error::invalid("rolls", "1, 2 or 4", rolls.to_string())),
        }
    }

    pub fn new(height: usize, width: usize, quarters: u32) -> Self {
        Self { height, width, quarters }
    }

    /// Height and width once turned.
    pub fn size(self) -> (usize, usize) {
        if self.quarters.is_multiple_of(2) {
            (self.height, self.width)
        } else {
            (self.width, self.height)
        }
    }

    /// The place, in the array as it is, of each place of the turned one, row by row.
    pub fn places(self) -> impl Iterator<Item = usize> {
        let (height, width) = self.size();
        (0..height * width).map(move |place| {
            let (row, column) = (place / width, place % width);
            let (row, column) = match self.quarters {
                0 => (row, column),
                1 => (column, self.width - 1 - row),
                2 => (self.height - 1 - row, self.width - 1 - column),
                _ => (self.height - 1 - column, row),
            };
            row * self.width + column
        })
    }
}

/// Height and width of a camera's picture.
pub(crate) fn picture_size(camera: &Pinhole) -> (usize, usize) {
    (camera.height() as usize, camera.width() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turns_the_right_edge_up() {
        // 1 2 3      3 6
        // 4 5 6  →   2 5
        //            1 4
        let array = [1, 2, 3, 4, 5, 6];
        let turned = Turned::new(2, 3, 1);
        assert_eq!(turned.size(), (3, 2));
        let values: Vec<i32> = turned.places().map(|place| array[place]).collect();
        assert_eq!(values, [3, 6, 2, 5, 1, 4]);
    }

    #[test]
    fn four_quarters_are_none() {
        let array: Vec<usize> = (0..15).collect();
        for quarters in 0..4 {
            let there = Turned::new(3, 5, quarters);
            let turned: Vec<usize> = there.places().map(|place| array[place]).collect();
            let (height, width) = there.size();
            let back = Turned::new(height, width, (4 - quarters) % 4);
            let again: Vec<usize> = back.places().map(|place| turned[place]).collect();
            assert_eq!(again, array);
        }
    }
}
