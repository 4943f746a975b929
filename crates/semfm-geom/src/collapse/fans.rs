//! The triangles around each vertex while vertices are merged.

use super::{GONE, third};

/// The triangles around each vertex, one list after the other in one array.
pub(super) struct Fans {
    places: Vec<FanPlace>,
    faces: Vec<u32>,
    /// Scratch of `merge`.
    moved: Vec<u32>,
}

/// Where the triangles around a vertex stand, and for how many there is room.
#[derive(Clone, Copy, Default)]
struct FanPlace {
    start: usize,
    count: u32,
    room: u32,
}

impl Fans {
    pub(super) fn new(n_vertices: usize, faces: &[[u32; 3]]) -> Self {
        let mut places = vec![FanPlace::default(); n_vertices];
        for &id in faces.iter().flatten() {
            places[id as usize].room += 1;
        }
        let mut start = 0;
        for place in &mut places {
            place.start = start;
            start += place.room as usize;
        }
        let mut all = vec![0; start];
        for (face, ids) in (0u32..).zip(faces) {
            for &id in ids {
                let place = &mut places[id as usize];
                all[place.start + place.count as usize] = face;
                place.count += 1;
            }
        }
        Self { places, faces: all, moved: Vec::new() }
    }

    pub(super) fn of(&self, id: u32) -> &[u32] {
        let FanPlace { start, count, .. } = self.places[id as usize];
        &self.faces[start..start + count as usize]
    }

    /// Vertices that have a triangle.
    pub(super) fn n_in_use(&self) -> usize {
        self.places.iter().filter(|place| place.count > 0).count()
    }

    /// Takes one triangle from a vertex.
    fn remove(&mut self, id: u32, face: u32) {
        let FanPlace { start, count, .. } = self.places[id as usize];
        let fan = &mut self.faces[start..start + count as usize];
        if let Some(at) = fan.iter().position(|&other| other == face) {
            fan.copy_within(at + 1.., at);
            self.places[id as usize].count -= 1;
        }
    }

    /// Gives the triangles of `from` to `to`; those with both become [`GONE`].
    pub(super) fn merge(&mut self, from: u32, to: u32, faces: &mut [[u32; 3]]) {
        let mut moved = std::mem::take(&mut self.moved);
        moved.clear();
        moved.extend_from_slice(self.of(from));
        moved.retain(|&face| {
            let ids = &mut faces[face as usize];
            let stays = !ids.contains(&to);
            if stays {
                *ids = ids.map(|id| if id == from { to } else { id });
            } else {
                for id in [to, third(*ids, from, to)] {
                    self.remove(id, face);
                }
                *ids = GONE;
            }
            stays
        });
        let (free, mut place) = (self.places[from as usize], self.places[to as usize]);
        let count = place.count as usize + moved.len();
        if count > place.room as usize {
            let old = place.start..place.start + place.count as usize;
            if count <= free.room as usize {
                self.faces.copy_within(old, free.start);
                (place.start, place.room) = (free.start, free.room);
            } else {
                place.start = self.faces.len();
                self.faces.extend_from_within(old);
                place.room = (count + count / 2) as u32;
                self.faces.resize(place.start + place.room as usize, 0);
            }
        }
        let end = place.start + place.count as usize;
        self.faces[end..end + moved.len()].copy_from_slice(&moved);
        place.count = count as u32;
        self.places[to as usize] = place;
        self.places[from as usize] = FanPlace::default();
        self.moved = moved;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn merged_fans_hold_each_triangle_once_and_those_between_are_gone() {
        // A fan of six around 0; 0 moves onto 1, then onto 2.
        let mut faces: Vec<[u32; 3]> = (1..=6).map(|i| [0, i, i % 6 + 1]).collect();
        let mut fans = Fans::new(7, &faces);
        assert_eq!(fans.n_in_use(), 7);
        fans.merge(0, 1, &mut faces);
        assert_eq!((fans.of(0), fans.of(1)), (&[][..], &[1, 2, 3, 4][..]));
        assert_eq!((faces[0], faces[5], faces[1]), (GONE, GONE, [1, 2, 3]));
        assert_eq!((fans.of(2), fans.of(6)), (&[1][..], &[4][..]));
        fans.merge(1, 2, &mut faces);
        assert_eq!((fans.of(2), fans.of(3)), (&[2, 3, 4][..], &[2][..]));
        assert_eq!(fans.n_in_use(), 5);
        assert_eq!(faces[2..5], [[2, 3, 4], [2, 4, 5], [2, 5, 6]]);
    }
}
