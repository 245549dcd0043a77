//! How searches are watched and stopped.

use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

/// How a search is watched and stopped.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// When set, searches that have not begun are left out.
    pub stop: &'a AtomicBool,
    /// Called after every search with the number of those done, of all, and the lowest cost so far.
    pub progress: &'a (dyn Fn(usize, usize, f64) + Sync),
}

impl<'a> Watch<'a> {
    /// Nobody looks on.
    pub const fn quiet(stop: &'a AtomicBool) -> Self {
        let progress = &|_, _, _| {};
        Self { stop, progress }
    }

    /// Does a part of several that are watched as one, by its number from 0.
    pub(in crate::plan) fn part<T>(
        self,
        number: usize,
        parts: usize,
        work: impl FnOnce(Watch<'_>) -> T,
    ) -> T {
        let progress = |done, all, cost| (self.progress)(number * all + done, parts * all, cost);
        work(Watch {
            stop: self.stop,
            progress: &progress,
        })
    }

    /// Tells after each of so many searches with which cost it ended.
    pub(super) fn counted(self, all: usize) -> impl Fn(f64) + Sync + use<'a> {
        let seen = Mutex::new((0, f64::INFINITY));
        move |cost| {
            if let Ok(mut seen) = seen.lock() {
                *seen = (seen.0 + 1, cost.min(seen.1));
                (self.progress)(seen.0, all, seen.1);
            }
        }
    }
}
