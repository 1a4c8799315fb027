//! The surgeon's pages that are open, with what they report about themselves. The operator sees from this whether a
//! tablet is there, awake and well connected.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::doctor::Tablet;

/// The surgeon's pages that are open. Clone freely.
#[derive(Debug, Clone, Default)]
pub struct OpenTablets(Arc<Mutex<Pages>>);

#[derive(Debug, Default)]
struct Pages {
    /// Pages opened so far.
    count: u64,
    open: BTreeMap<u64, Tablet>,
}

impl OpenTablets {
    /// The pages that are open, the oldest first.
    #[must_use]
    pub fn open(&self) -> Vec<Tablet> {
        self.pages().open.values().cloned().collect()
    }

    /// Adds a page; `user_agent` is what its browser calls itself.
    pub(super) fn enter(&self, user_agent: &str) -> OpenTablet {
        let mut pages = self.pages();
        pages.count += 1;
        let number = pages.count;

        let user_agent = user_agent.to_owned();
        let tablet = Tablet { user_agent, picture_width: None, visible: true, carries_all: true };
        pages.open.insert(number, tablet);
        OpenTablet { tablets: self.clone(), number }
    }

    fn pages(&self) -> MutexGuard<'_, Pages> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A page's entry; removed when dropped.
#[derive(Debug)]
pub(super) struct OpenTablet {
    tablets: OpenTablets,
    number: u64,
}

impl OpenTablet {
    /// Updates the page's state.
    pub(super) fn note(&self, picture_width: Option<u32>, visible: bool, carries_all: bool) {
        if let Some(tablet) = self.tablets.pages().open.get_mut(&self.number) {
            tablet.picture_width = picture_width;
            tablet.visible = visible;
            tablet.carries_all = carries_all;
        }
    }
}

impl Drop for OpenTablet {
    fn drop(&mut self) {
        self.tablets.pages().open.remove(&self.number);
    }
}
