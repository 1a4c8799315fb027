//! The results of the tablets that were tried since the server's start.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::doctor::TriedTablet;
use parfocal_base::ids::DeviceId;

/// Results of so many tablets are kept; of more, nobody would read them.
const MOST: usize = 24;

/// The results of the tablets that were tried since the server's start. Clone freely.
#[derive(Debug, Clone, Default)]
pub struct TabletTrials(Arc<Mutex<BTreeMap<DeviceId, TriedTablet>>>);

impl TabletTrials {
    /// The results, one for each tablet.
    pub fn all(&self) -> Vec<TriedTablet> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).values().cloned().collect()
    }

    pub(super) fn note(&self, device: DeviceId, tried: TriedTablet) {
        let mut trials = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if trials.len() >= MOST && !trials.contains_key(&device) {
            let oldest = trials.iter().min_by_key(|(_, tried)| tried.at).map(|(device, _)| *device);
            if let Some(device) = oldest {
                trials.remove(&device);
            }
        }
        trials.insert(device, tried);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jiff::Timestamp;
    use uuid::Uuid;

    #[test]
    fn a_tablet_that_is_tried_again_has_one_result_and_the_oldest_make_room() {
        let trials = TabletTrials::default();
        let note = |number: u32, second: i64| {
            let at = Timestamp::from_second(second).unwrap();
            let tried = TriedTablet { user_agent: String::new(), at, failing: Vec::new() };
            trials.note(DeviceId(Uuid::from_u128(u128::from(number))), tried);
        };
        for number in 0..30 {
            note(number, i64::from(number));
        }
        note(29, 100);
        let kept = trials.all();
        assert_eq!(kept.len(), MOST);
        assert_eq!(kept.iter().map(|tried| tried.at.as_second()).min(), Some(6));
    }
}
