//! Values that several Python objects share, whole or in part.

use std::ops::Deref;
use std::sync::Arc;

/// A value, or a part of one, that stays alive as long as somebody holds it: the mesh of a shape,
/// the basis of a prepared object, without a copy.
pub struct Held<T: 'static>(Arc<dyn Holds<T>>);

trait Holds<T>: Send + Sync {
    fn get(&self) -> &T;
}

struct Whole<T>(T);

impl<T: Send + Sync> Holds<T> for Whole<T> {
    fn get(&self) -> &T {
        &self.0
    }
}

struct Part<T: 'static, U> {
    whole: Held<T>,
    pick: fn(&T) -> &U,
}

impl<T, U> Holds<U> for Part<T, U> {
    fn get(&self) -> &U {
        (self.pick)(&self.whole)
    }
}

impl<T: Send + Sync> Held<T> {
    /// Holds a value.
    pub fn new(value: T) -> Self {
        Self(Arc::new(Whole(value)))
    }
}

impl<T> Held<T> {
    /// Holds what `pick` finds in this value.
    pub fn part<U: 'static>(&self, pick: fn(&T) -> &U) -> Held<U> {
        Held(Arc::new(Part { whole: self.clone(), pick }))
    }
}

impl<T> Clone for Held<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Deref for Held<T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.0.get()
    }
}
