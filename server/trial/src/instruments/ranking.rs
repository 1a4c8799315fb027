//! A ranking of all settings. Without ties, the answer lists the settings, best first. With ties, it lists the place of
//! each setting, in the order of the settings' numbers. Settings that share a place get the mean of the ranks that they
//! occupy together, as rank statistics require (Friedman 1937, Journal of the American Statistical Association 32:675).

use super::measure::{self, Measure};

/// Whether `order` lists each of the settings 1 to `settings` exactly once.
pub fn is_order(order: &[u8], settings: usize) -> bool {
    let mut sorted = order.to_vec();
    sorted.sort_unstable();
    sorted.len() == settings
        && sorted.iter().zip(1_usize..).all(|(&setting, expected)| usize::from(setting) == expected)
}

/// Whether `places` holds the places of `settings` settings. Some, but not all, may be 0, which means not given.
pub fn are_places(places: &[u8], settings: usize) -> bool {
    places.len() == settings
        && places.iter().all(|place| usize::from(*place) <= settings)
        && places.iter().any(|place| *place > 0)
}

/// The rank of each setting, 1 for the best.
pub fn measures(points: &[u8], ties: bool) -> Vec<Measure> {
    let ranks = if ties { shared_ranks(points) } else { ranks(points) };
    let measure = |(setting, rank): (usize, Option<f64>)| {
        Measure::item(format!("rank-of-setting-{setting}"), format!("Rank of setting {setting}"), rank)
    };
    (1..).zip(ranks).map(measure).collect()
}

/// The rank of each setting in `order`, which lists settings from best to worst.
fn ranks(order: &[u8]) -> Vec<Option<f64>> {
    let rank = |setting: usize| {
        let place = order.iter().position(|named| usize::from(*named) == setting)?;
        Some(place as f64 + 1.0)
    };
    (1..=order.len()).map(rank).collect()
}

/// The rank of each setting, computed from the places. If one place is missing, all ranks are, because they depend on
/// it.
fn shared_ranks(places: &[u8]) -> Vec<Option<f64>> {
    if places.contains(&0) {
        return vec![None; places.len()];
    }
    // Settings in better places occupy the ranks up to `better`. Those in this place occupy the next ranks, up to
    // `up_to_it`.
    let rank = |place: &u8| {
        let better = places.iter().filter(|other| *other < place).count();
        let up_to_it = places.iter().filter(|other| *other <= place).count();
        Some(f64::midpoint(better as f64 + 1.0, up_to_it as f64))
    };
    places.iter().map(rank).collect()
}

/// Each setting with its place.
pub fn in_words(places: &[u8]) -> String {
    let part = |(setting, place): (usize, &u8)| format!("setting {setting}: {}", measure::in_words(*place));
    (1..).zip(places).map(part).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(points: &[u8], ties: bool) -> Vec<Option<f64>> {
        measures(points, ties).iter().map(|measure| measure.value).collect()
    }

    #[test]
    fn each_setting_has_its_place_in_the_order() {
        // Setting 3 is best, then 1, then 2.
        assert_eq!(values(&[3, 1, 2], false), [Some(2.0), Some(3.0), Some(1.0)]);
    }

    #[test]
    fn settings_that_share_a_place_share_their_ranks() {
        // The ranks are those of scipy.stats.rankdata for the same places.
        assert_eq!(values(&[1, 2, 2, 4], true), [Some(1.0), Some(2.5), Some(2.5), Some(4.0)]);
        assert_eq!(values(&[1, 1, 1, 2], true), [Some(2.0), Some(2.0), Some(2.0), Some(4.0)]);
        assert_eq!(values(&[2, 3, 3], true), [Some(1.0), Some(2.5), Some(2.5)]);
    }

    #[test]
    fn a_setting_without_a_place_leaves_no_ranks() {
        assert_eq!(values(&[1, 0, 2], true), [None, None, None]);
        assert!(are_places(&[1, 0, 2], 3) && !are_places(&[0, 0, 0], 3) && !are_places(&[1, 4, 1], 3));
    }
}
