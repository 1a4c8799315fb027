//! Decides which answer to a question counts: the one that was given last, in whatever order the answers arrived.

use std::collections::BTreeMap;

use jiff::Timestamp;

use super::answers::on_top_of;
use super::question::AnswerValue;
use parfocal_base::ids::DeviceId;

/// An answer, with its origin and its time.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenAnswer {
    /// Device on which the answer was given; none if its page did not say.
    pub device: Option<DeviceId>,
    /// Number that grows with every comment or answer on that device; none if its page did not say.
    pub sequence: Option<i64>,
    /// When the answer was given, by the server's clocks: the time of arrival minus the wait on the device.
    pub at: Timestamp,
    /// Whether the answer arrived too late to count.
    pub late: bool,
    /// The answer, or the part of it that was given: unanswered items are 0.
    pub value: AnswerValue,
}

/// The standing of one of the answers to a question: its place among them, and whether it counts.
#[derive(Debug, Clone, PartialEq)]
pub struct AnswerStanding {
    /// Place of the answer in the order in which the answers were given, from 1.
    pub revision: usize,
    /// The combined answer after this one was given. For a late answer, only its own value.
    pub value: AnswerValue,
    /// Whether this is the answer that counts.
    pub counts: bool,
    /// Whether this is the last answer of its device, and the last answer of another device differs from it.
    pub disagrees: bool,
}

/// The standing of each of `answers`. All must be answers to the same question, in the order of their arrival.
pub fn standings(answers: &[GivenAnswer]) -> Vec<AnswerStanding> {
    let order = in_order(answers);

    let mut standings: Vec<AnswerStanding> = answers
        .iter()
        .map(|given| AnswerStanding { revision: 0, value: given.value.clone(), counts: false, disagrees: false })
        .collect();

    let mut latest: Option<usize> = None;
    for (&place, revision) in order.iter().zip(1..) {
        standings[place].revision = revision;
        if answers[place].late {
            continue;
        }
        let before = latest.map(|latest| standings[latest].value.clone());
        standings[place].value = on_top_of(before.as_ref(), answers[place].value.clone());
        latest = Some(place);
    }

    if let Some(latest) = latest {
        standings[latest].counts = true;
    }
    for place in disagreeing(answers, &order) {
        standings[place].disagrees = true;
    }
    standings
}

/// The standing of each of `answers`. Each comes with its question; they are in the order of their arrival.
pub fn by_question<Q: Ord>(answers: impl IntoIterator<Item = (Q, GivenAnswer)>) -> Vec<AnswerStanding> {
    let mut questions: BTreeMap<Q, (Vec<usize>, Vec<GivenAnswer>)> = BTreeMap::new();
    for (place, (question, given)) in answers.into_iter().enumerate() {
        let (places, all) = questions.entry(question).or_default();
        places.push(place);
        all.push(given);
    }

    let of_question = |(places, all): (Vec<usize>, Vec<GivenAnswer>)| places.into_iter().zip(standings(&all));
    let mut found: Vec<(usize, AnswerStanding)> = questions.into_values().flat_map(of_question).collect();
    found.sort_by_key(|(place, _)| *place);
    found.into_iter().map(|(_, standing)| standing).collect()
}

/// The combined answer that counts. `answers` must all answer the same question, in the order of their arrival. None if
/// no answer counts.
pub fn counted(answers: &[GivenAnswer]) -> Option<AnswerValue> {
    standings(answers).into_iter().find(|standing| standing.counts).map(|standing| standing.value)
}

/// The indices of `answers`, sorted by the order in which the answers were given.
fn in_order(answers: &[GivenAnswer]) -> Vec<usize> {
    let mut at: Vec<Timestamp> = answers.iter().map(|given| given.at).collect();

    // The order on one device is certain. Times are not: a wait may have been measured by a clock that was set in the
    // meantime.
    let place_on_device = |(place, given): (usize, &GivenAnswer)| Some((given.device?, given.sequence?, place));
    let mut on_devices: Vec<_> = answers.iter().enumerate().filter_map(place_on_device).collect();
    on_devices.sort_unstable();
    for pair in on_devices.windows(2) {
        let ((device, _, before), (same_device, _, after)) = (pair[0], pair[1]);
        if device == same_device {
            at[after] = at[after].max(at[before]);
        }
    }

    let mut order: Vec<usize> = (0..answers.len()).collect();
    order.sort_by_key(|&place| (at[place], answers[place].device, answers[place].sequence, place));
    order
}

/// The indices of each device's last answer, if the last answer of another device differs from it.
fn disagreeing(answers: &[GivenAnswer], order: &[usize]) -> Vec<usize> {
    let mut last_words: BTreeMap<DeviceId, (usize, AnswerValue)> = BTreeMap::new();
    for &place in order {
        let Some(device) = answers[place].device else { continue };
        let before = last_words.get(&device).map(|(_, value)| value);
        let value = on_top_of(before, answers[place].value.clone());
        last_words.insert(device, (place, value));
    }

    let differs_from_another = |value: &AnswerValue| last_words.values().any(|(_, other)| differ(value, other));
    last_words.values().filter(|(_, value)| differs_from_another(value)).map(|(place, _)| *place).collect()
}

/// Whether two answers differ. An item that one of them leaves open is no difference.
fn differ(one: &AnswerValue, other: &AnswerValue) -> bool {
    match (one, other) {
        (AnswerValue::Points(one), AnswerValue::Points(other)) if one.len() == other.len() => {
            one.iter().zip(other).any(|(one, other)| *one != 0 && *other != 0 && one != other)
        }
        _ => one != other,
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;
    use uuid::Uuid;

    use super::*;

    fn given(device: u128, sequence: i64, second: u64, point: u8) -> GivenAnswer {
        GivenAnswer {
            device: Some(DeviceId(Uuid::from_u128(device))),
            sequence: Some(sequence),
            at: Timestamp::UNIX_EPOCH + Duration::from_secs(second),
            late: false,
            value: AnswerValue::Point(point),
        }
    }

    fn counts(answers: &[GivenAnswer]) -> Option<AnswerValue> {
        counted(answers)
    }

    #[test]
    fn an_answer_that_arrives_late_does_not_replace_a_newer_one() {
        // A tablet without a network held the "3" while the "5" was given on another tablet.
        let answers = [given(2, 1, 60, 5), given(1, 1, 10, 3)];
        let standings = standings(&answers);
        assert_eq!(counts(&answers), Some(AnswerValue::Point(5)));
        let told: Vec<_> = standings.iter().map(|each| (each.revision, each.counts, each.disagrees)).collect();
        assert_eq!(told, [(2, true, true), (1, false, true)]);
    }

    #[test]
    fn on_one_device_its_own_order_counts_whatever_its_clock_did() {
        // Two tabs. While the second answer waited, the clock that measured the wait was set, so the answer looks
        // older.
        let answers = [given(1, 7, 100, 3), given(1, 8, 40, 5)];
        assert_eq!(counts(&answers), Some(AnswerValue::Point(5)));
        let arrived_the_other_way = [given(1, 8, 40, 5), given(1, 7, 100, 3)];
        assert_eq!(counts(&arrived_the_other_way), Some(AnswerValue::Point(5)));
        assert!(
            standings(&answers).iter().all(|standing| !standing.disagrees),
            "one device does not disagree with itself"
        );
    }

    #[test]
    fn a_late_answer_never_counts_and_is_shown_as_it_was_given() {
        let late = GivenAnswer { late: true, ..given(1, 9, 500, 1) };
        let answers = [given(1, 8, 40, 5), late.clone()];
        assert_eq!(counts(&answers), Some(AnswerValue::Point(5)));
        assert_eq!(standings(&answers)[1].value, AnswerValue::Point(1));
        assert_eq!(counts(&[late]), None);
    }

    #[test]
    fn items_of_a_questionnaire_given_on_two_devices_add_up_in_the_order_given() {
        let items = |device, second, items: [u8; 3]| GivenAnswer {
            value: AnswerValue::Points(items.to_vec()),
            ..given(device, i64::try_from(second).unwrap(), second, 0)
        };

        let apart = [items(2, 20, [0, 0, 2]), items(1, 10, [4, 0, 0]), items(1, 11, [0, 3, 0])];
        assert_eq!(counts(&apart), Some(AnswerValue::Points(vec![4, 3, 2])));
        assert!(standings(&apart).iter().all(|standing| !standing.disagrees), "each gave other items");
        let both = [items(2, 20, [1, 0, 2]), items(1, 10, [4, 0, 0])];
        assert_eq!(counts(&both), Some(AnswerValue::Points(vec![1, 0, 2])));
        assert!(standings(&both).iter().all(|standing| standing.disagrees));
    }

    proptest! {
        #[test]
        fn the_order_of_arrival_changes_nothing(
            answers in prop::collection::vec((1_u128..4, 0_u64..50, 1_u8..6), 1..8), turn in 0_usize..8,
        ) {
            let all: Vec<GivenAnswer> = answers
                .iter()
                .zip(0..)
                .map(|((device, second, point), sequence)| given(*device, sequence, *second, *point))
                .collect();

            let mut arrived = all.clone();
            let length = arrived.len();
            arrived.rotate_left(turn % length);
            prop_assert_eq!(counts(&all), counts(&arrived));
            arrived.reverse();
            prop_assert_eq!(counts(&all), counts(&arrived));
        }
    }
}
