//! What a camera saw at one moment.

use semfm_align::{DepthImage, DepthPoints, ObservedCloud};
use semfm_geom::Pinhole;
use semfm_geom::math::{DAffine3, DVec3};

use crate::distortion::{Distortion, picked, sampled};
use crate::{Error, Result};

/// What a camera saw at one moment: colour, depth and masks on one grid of pixels, the camera and its pose, and the
/// poses of objects where they are known. Whatever files it came from, depth is in metres, 0 is where nothing came
/// back, and the pictures are without distortion.
///
/// A value of this type is proof that everything in it has the camera's size.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    camera: Pinhole,
    color: Option<Vec<[u8; 3]>>,
    depth: Option<DepthImage>,
    cloud: Option<Vec<DVec3>>,
    masks: Vec<Mask>,
    objects: Vec<SeenObject>,
    /// When it was, in nanoseconds of its recorder's clock; `None` where nobody said.
    pub time_nanos: Option<u64>,
}

/// Which pixels show something.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// What it shows, as its file calls it.
    pub name: String,
    /// Row-major (height × width).
    pub marked: Vec<bool>,
}

/// An object whose pose somebody knew.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenObject {
    /// The number that its dataset gives it.
    pub id: u32,
    /// Rigid motion from the object's frame to the camera's, metres.
    pub camera_from_object: DAffine3,
    /// Its mask among those of the observation.
    pub mask: Option<usize>,
}

impl Observation {
    /// An observation of nothing yet.
    pub fn new(camera: Pinhole) -> Self {
        Self {
            camera,
            color: None,
            depth: None,
            cloud: None,
            masks: Vec::new(),
            objects: Vec::new(),
            time_nanos: None,
        }
    }

    /// With a colour picture (height × width, sRGB).
    ///
    /// # Errors
    /// [`Error::Invalid`] for another number of pixels than the camera's.
    pub fn with_color(self, color: Vec<[u8; 3]>) -> Result<Self> {
        self.check_pixels("colour", color.len())?;
        Ok(Self { color: Some(color), ..self })
    }

    /// With a depth image.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another size than the camera's.
    pub fn with_depth(self, depth: DepthImage) -> Result<Self> {
        let size = [depth.width(), depth.height()];
        if size != self.size() {
            let [width, height] = self.size();
            let expected = format!("{width} × {height} pixels, as the camera");
            return Err(Error::invalid("depth", expected, format!("{} × {}", size[0], size[1])));
        }
        Ok(Self { depth: Some(depth), ..self })
    }

    /// With a cloud of points in the camera's frame, metres, where the sensor gave one in place of a depth image.
    ///
    /// # Errors
    /// [`Error::Invalid`] for no points and for a coordinate that is not finite.
    pub fn with_cloud(self, cloud: Vec<DVec3>) -> Result<Self> {
        if cloud.is_empty() {
            return Err(Error::invalid("cloud", "at least one point", "none"));
        }
        if let Some(at) = cloud.iter().position(|p| !p.is_finite()) {
            return Err(Error::invalid(format!("cloud, point {at}"), "finite numbers", cloud[at]));
        }
        Ok(Self { cloud: Some(cloud), ..self })
    }

    /// With one more mask.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another number of pixels than the camera's, and for a mask that marks nothing.
    pub fn with_mask(mut self, name: impl Into<String>, marked: Vec<bool>) -> Result<Self> {
        let name = name.into();
        self.check_pixels(&format!("mask `{name}`"), marked.len())?;
        if !marked.contains(&true) {
            return Err(Error::invalid(
                format!("mask `{name}`"),
                "at least one marked pixel",
                "none",
            ));
        }
        self.masks.push(Mask { name, marked });
        Ok(self)
    }

    /// With one more object.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a mask that is not there.
    pub fn with_object(mut self, object: SeenObject) -> Result<Self> {
        if let Some(mask) = object.mask.filter(|&mask| mask >= self.masks.len()) {
            let expected = format!("one of {} masks", self.masks.len());
            return Err(Error::invalid("mask of an object", expected, mask));
        }
        self.objects.push(object);
        Ok(self)
    }

    /// The same pictures without the distortion of the lens: colour between four neighbours, depth and masks at the
    /// nearest pixel, since a depth between a cup and the wall behind it is a depth of nothing.
    ///
    /// # Errors
    /// [`Error::Invalid`] where a mask is left without a pixel.
    pub fn undistorted(self, lens: &Distortion) -> Result<Self> {
        let sources = lens.sources(&self.camera);
        let [width, height] = self.size();
        let Self { camera, color, depth, cloud, masks, objects, time_nanos } = self;
        let mut new = Self { cloud, time_nanos, ..Self::new(camera) };
        if let Some(color) = color {
            new = new.with_color(sampled(&color, [width, height], &sources))?;
        }
        if let Some(depth) = depth {
            let values = picked(depth.metres(), width, &sources, 0.0);
            new = new.with_depth(DepthImage::new(width, height, values)?)?;
        }
        for Mask { name, marked } in masks {
            new = new.with_mask(name, picked(&marked, width, &sources, false))?;
        }
        objects.into_iter().try_fold(new, Self::with_object)
    }

    /// The same observation by a camera that stands elsewhere: the pictures stay.
    ///
    /// # Errors
    /// [`Error::Geom`] where the pose is no rotation and shift.
    pub fn posed(mut self, camera_from_world: DAffine3) -> Result<Self> {
        self.camera = self.camera.posed(camera_from_world)?;
        Ok(self)
    }

    /// The camera. Its world is what its files say; the camera's own frame where they say nothing.
    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// Colours (height × width, sRGB), where there are any.
    pub fn color(&self) -> Option<&[[u8; 3]]> {
        self.color.as_deref()
    }

    /// Depth, where there is any.
    pub fn depth(&self) -> Option<&DepthImage> {
        self.depth.as_ref()
    }

    /// The depth image.
    ///
    /// # Errors
    /// [`Error::Invalid`] where there is none.
    pub fn depth_image(&self) -> Result<&DepthImage> {
        let found = if self.cloud.is_some() { "a cloud of points" } else { "colour alone" };
        let none = || Error::invalid("observation", "a depth image", found);
        self.depth.as_ref().ok_or_else(none)
    }

    /// The cloud that the sensor gave in place of a depth image.
    pub fn cloud(&self) -> Option<&[DVec3]> {
        self.cloud.as_deref()
    }

    /// The masks, in the order of their files.
    pub fn masks(&self) -> &[Mask] {
        &self.masks
    }

    /// The mask of a name.
    ///
    /// # Errors
    /// [`Error::Invalid`], with the names that there are.
    pub fn mask(&self, name: &str) -> Result<&Mask> {
        self.masks.iter().find(|mask| mask.name == name).ok_or_else(|| {
            let names: Vec<&str> = self.masks.iter().map(|mask| mask.name.as_str()).collect();
            let expected = format!("one of the {} masks: {}", names.len(), names.join(", "));
            Error::invalid("mask", expected, format!("`{name}`"))
        })
    }

    /// The mask of an object: the one of this name, or the only one that there is; `None` where nobody names one and there
    /// is none.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a name that no mask has, and where several masks may be meant.
    pub fn mask_of_object(&self, name: Option<&str>) -> Result<Option<&Mask>> {
        if let Some(name) = name {
            return self.mask(name).map(Some);
        }
        match &self.masks[..] {
            [] => Ok(None),
            [only] => Ok(Some(only)),
            several => {
                let names: Vec<&str> = several.iter().map(|mask| mask.name.as_str()).collect();
                let expected = format!("one of the masks {}", names.join(", "));
                Err(Error::invalid("mask of the object", expected, "none"))
            }
        }
    }

    /// The same in one of many frames. That a frame has no mask of the name says that the object is not visible there.
    ///
    /// # Errors
    /// [`Error::Invalid`] where nobody names one and several masks may be meant.
    pub fn mask_where_visible(&self, name: Option<&str>) -> Result<Option<&Mask>> {
        match name {
            Some(name) => Ok(self.masks.iter().find(|mask| mask.name == name)),
            None => self.mask_of_object(None),
        }
    }

    /// The objects whose poses are known.
    pub fn objects(&self) -> &[SeenObject] {
        &self.objects
    }

    /// The points under a mask, and the others, in the camera's frame; all of them under no mask. A cloud has no pixels:
    /// its points are parted by where the camera sees them.
    ///
    /// # Errors
    /// [`Error::Invalid`] where there is neither depth nor a cloud; [`Error::Align`] where no pixel under the mask has
    /// a depth.
    pub fn points(&self, mask: Option<&Mask>) -> Result<DepthPoints> {
        if let Some(depth) = &self.depth {
            return Ok(depth.points(&self.camera, mask.map(|mask| &mask.marked[..]))?);
        }
        let Some(cloud) = &self.cloud else {
            return Err(Error::invalid("observation", "depth or a cloud", "colour alone"));
        };
        let own = self.camera.posed(DAffine3::IDENTITY)?;
        let [width, height] = self.size();
        let is_marked = |p: &DVec3| {
            let Some(mask) = mask else { return true };
            let seen = own.project(*p);
            let on_picture = seen.z > 0.0
                && (0.0..width as f64).contains(&seen.u)
                && (0.0..height as f64).contains(&seen.v);
            on_picture && mask.marked[seen.v as usize * width + seen.u as usize]
        };
        let (object, context): (Vec<DVec3>, Vec<DVec3>) = cloud.iter().partition(|p| is_marked(p));
        if object.is_empty() {
            return Err(Error::invalid("mask", "at least one point of the cloud under it", "none"));
        }
        Ok(DepthPoints { object, context })
    }

    /// What `semfm_align` searches a model in: the points under a mask, what is beside them, and what the picture covers.
    ///
    /// # Errors
    /// As [`points`](Self::points), and [`Error::Align`] for too few points and those that cannot be of an object in
    /// metres.
    pub fn observed_cloud(&self, mask: Option<&Mask>) -> Result<ObservedCloud> {
        if let Some(depth) = &self.depth {
            let marked = mask.map(|mask| &mask.marked[..]);
            return Ok(ObservedCloud::from_depth(depth, &self.camera, marked)?);
        }
        Ok(ObservedCloud::from_view(&self.points(mask)?.object, DVec3::ZERO)?)
    }

    /// Width and height in pixels.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.camera.width() as usize, self.camera.height() as usize]
    }

    fn check_pixels(&self, what: &str, found: usize) -> Result<()> {
        let [width, height] = self.size();
        if found == width * height {
            return Ok(());
        }
        let expected = format!("{} pixels ({width} × {height}, as the camera)", width * height);
        Err(Error::invalid(what, expected, found))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::Intrinsics;

    fn camera() -> Pinhole {
        let intrinsics = Intrinsics { width: 3, height: 2, fx: 2.0, fy: 2.0, cx: 1.5, cy: 1.0 };
        Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap()
    }

    #[test]
    fn everything_has_the_cameras_size() {
        let seen = Observation::new(camera());
        let words = |result: Result<Observation>| result.unwrap_err().to_string();
        assert!(words(seen.clone().with_color(vec![[0; 3]; 5])).contains("3 × 2"));
        let turned = DepthImage::new(2, 3, vec![1.0; 6]).unwrap();
        assert!(words(seen.clone().with_depth(turned)).contains("2 × 3"));
        assert!(words(seen.clone().with_mask("cup", vec![true; 7])).contains("cup"));
        assert!(words(seen.clone().with_mask("cup", vec![false; 6])).contains("cup"));
        let object = SeenObject { id: 1, camera_from_object: DAffine3::IDENTITY, mask: Some(0) };
        assert!(words(seen.clone().with_object(object)).contains("0 masks"));
        assert!(seen.points(None).unwrap_err().to_string().contains("colour alone"));
    }

    #[test]
    fn depth_and_cloud_give_the_same_points_under_a_mask() {
        let marked = vec![true, false, false, false, false, true];
        let depth = DepthImage::new(3, 2, vec![1.0, 2.0, 0.0, 1.0, 1.0, 0.5]).unwrap();
        let by_depth = Observation::new(camera()).with_depth(depth.clone()).unwrap();
        let by_depth = by_depth.with_mask("cup", marked.clone()).unwrap();
        let points = by_depth.points(Some(&by_depth.masks()[0])).unwrap();
        assert_eq!((points.object.len(), points.context.len()), (2, 3));
        let cloud = depth.points(&camera(), None).unwrap().object;
        let by_cloud = Observation::new(camera()).with_cloud(cloud).unwrap();
        let by_cloud = by_cloud.with_mask("cup", marked).unwrap();
        assert_eq!(by_cloud.points(by_cloud.mask("cup").ok()).unwrap(), points);
        assert!(by_cloud.mask("mug").unwrap_err().to_string().contains("cup"));
        assert_eq!(by_cloud.mask_of_object(None).unwrap(), by_cloud.mask("cup").ok());
        let two = by_cloud.with_mask("hand", vec![true; 6]).unwrap();
        let several = two.mask_of_object(None).unwrap_err().to_string();
        assert!(several.contains("cup, hand"), "{several}");
        assert_eq!(two.mask_of_object(Some("hand")).unwrap().unwrap().name, "hand");
        assert_eq!(two.mask_where_visible(Some("mug")).unwrap(), None);
    }
}
