//! Values that several Python objects share, whole or in part.

use std::ops::Deref;
use std::sync::Arc;

/// A value, or a part of a larger one, that lives as long as anything refers to it: the mesh of a
/// shape, the region of a transfer, without a copy.
pub struct Shared<T: 'static>(Arc<dyn Get<T>>);

trait Get<T>: Send + Sync {
    fn get(&self) -> &T;
}

struct Whole<T>(T);

impl<T: Send + Sync> Get<T> for Whole<T> {
    fn get(&self) -> &T {
        &self.0
    }
}

struct Part<U, T> {
    whole: Arc<U>,
    pick: fn(&U) -> &T,
}

impl<U: Send + Sync, T> Get<T> for Part<U, T> {
    fn get(&self) -> &T {
        (self.pick)(&self.whole)
    }
}

impl<T: Send + Sync> Shared<T> {
    /// A value of its own.
    pub fn new(value: T) -> Self {
        Self(Arc::new(Whole(value)))
    }
}

impl<T> Shared<T> {
    /// What `pick` finds in a shared value.
    pub fn part_of<U: Send + Sync + 'static>(whole: &Arc<U>, pick: fn(&U) -> &T) -> Self {
        Self(Arc::new(Part { whole: Arc::clone(whole), pick }))
    }
}

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Deref for Shared<T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.0.get()
    }
}
