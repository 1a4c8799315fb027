//! The System Usability Scale (Brooke 1996, "SUS: a quick and dirty usability scale", in Usability Evaluation in
//! Industry).

use super::measure::{Measure, given};
use crate::question::QuestionKind;
use parfocal_language::Language;

/// Number of items.
pub const ITEMS: usize = 10;

/// The scale's wording in one language.
struct Wording {
    items: [&'static str; ITEMS],
    low: &'static str,
    high: &'static str,
}

/// Brooke 1996.
const ENGLISH: Wording = Wording {
    items: [
        "I think that I would like to use this system frequently.",
        "I found the system unnecessarily complex.",
        "I thought the system was easy to use.",
        "I think that I would need the support of a technical person to be able to use this system.",
        "I found the various functions in this system were well integrated.",
        "I thought there was too much inconsistency in this system.",
        "I would imagine that most people would learn to use this system very quickly.",
        "I found the system very cumbersome to use.",
        "I felt very confident using the system.",
        "I needed to learn a lot of things before I could get going with this system.",
    ],
    low: "Strongly disagree",
    high: "Strongly agree",
};

/// Rummel 2016, "System Usability Scale – jetzt auch auf Deutsch", SAP User Experience Community.
const GERMAN: Wording = Wording {
    items: [
        "Ich kann mir sehr gut vorstellen, das System regelmäßig zu nutzen.",
        "Ich empfinde das System als unnötig komplex.",
        "Ich empfinde das System als einfach zu nutzen.",
        "Ich denke, dass ich technischen Support brauchen würde, um das System zu nutzen.",
        "Ich finde, dass die verschiedenen Funktionen des Systems gut integriert sind.",
        "Ich finde, dass es im System zu viele Inkonsistenzen gibt.",
        "Ich kann mir vorstellen, dass die meisten Leute das System schnell zu beherrschen lernen.",
        "Ich empfinde die Bedienung als sehr umständlich.",
        "Ich habe mich bei der Nutzung des Systems sehr sicher gefühlt.",
        "Ich musste eine Menge Dinge lernen, bevor ich mit dem System arbeiten konnte.",
    ],
    low: "Stimme überhaupt nicht zu",
    high: "Stimme voll zu",
};

/// The F-SUS: Gronier & Baudet 2021, International Journal of Human-Computer Interaction 37:1571,
/// doi:10.1080/10447318.2021.1898828. Its authors let everybody use it who names them.
const FRENCH: Wording = Wording {
    items: [
        "Je voudrais utiliser ce système fréquemment",
        "Ce système est inutilement complexe",
        "Ce système est facile à utiliser",
        "J'aurais besoin du soutien d'un technicien pour être capable d'utiliser ce système",
        "Les différentes fonctionnalités de ce système sont bien intégrées",
        "Il y a trop d'incohérences dans ce système",
        "La plupart des gens apprendront à utiliser ce système très rapidement",
        "Ce système est très lourd à utiliser",
        "Je me suis senti·e très en confiance en utilisant ce système",
        "J'ai eu besoin d'apprendre beaucoup de choses avant de pouvoir utiliser ce système",
    ],
    low: "Pas du tout d'accord",
    high: "Tout à fait d'accord",
};

/// The question in `language`. `None` where we have no published translation whose wording is certain: there are
/// several Spanish ones (such as Sevilla-Gonzalez et al. 2020, JMIR Human Factors 7:e21161), which we have not seen in
/// print.
pub fn question(language: Language) -> Option<QuestionKind> {
    let Wording { items, low, high } = match language {
        Language::English => ENGLISH,
        Language::German => GERMAN,
        Language::French => FRENCH,
        Language::Spanish => return None,
    };
    Some(QuestionKind::Sus { items: items.map(str::to_owned).to_vec(), low: low.to_owned(), high: high.to_owned() })
}

/// Whether `items` are points of all items (1 to 5), or of some of them (0 for the others).
pub fn fits(items: &[u8]) -> bool {
    items.len() == ITEMS && items.iter().all(|item| *item <= 5) && items.iter().any(|item| *item > 0)
}

/// The score, 0..=100 in steps of 2.5, of ten items from 1 (strongly disagree) to 5 (strongly agree): odd items count
/// `item - 1`, even ones `5 - item`, and the sum is multiplied by 2.5 (Brooke 1996). `None` if an item is missing.
/// Brooke asks respondents to mark the middle point instead of omitting an item; we leave that to the surgeon.
pub fn score(items: &[u8]) -> Option<f64> {
    if items.len() != ITEMS || !items.iter().all(|item| (1..=5).contains(item)) {
        return None;
    }
    let sum: u8 = items.iter().enumerate().map(|(i, item)| if i % 2 == 0 { item - 1 } else { 5 - item }).sum();
    Some(f64::from(sum) * 2.5)
}

/// The ten items and the score.
pub fn measures(items: &[u8]) -> Vec<Measure> {
    let item = |(number, &point): (usize, &u8)| {
        Measure::item(format!("item-{number}"), format!("Item {number}"), given(point))
    };
    let mut measures: Vec<Measure> = (1..).zip(items).map(item).collect();
    measures.push(Measure::score("sus-score", "SUS score", score(items)));
    measures
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_score_is_that_of_the_papers_example() {
        // The completed form in Brooke 1996: contributions 4+1+1+4+1+2+1+1+4+3 = 22; 22 * 2.5 = 55.
        assert_eq!(score(&[5, 4, 2, 1, 2, 3, 2, 4, 5, 2]), Some(55.0));
    }

    #[test]
    fn the_score_goes_from_0_to_100_and_needs_every_item() {
        assert_eq!(score(&[5, 1, 5, 1, 5, 1, 5, 1, 5, 1]), Some(100.0));
        assert_eq!(score(&[1, 5, 1, 5, 1, 5, 1, 5, 1, 5]), Some(0.0));
        assert_eq!(score(&[3; 10]), Some(50.0));
        // By hand: odd items (4+3+4+2+4) - 5 = 12, even items 25 - (2+1+3+2+2) = 15; 27 * 2.5 = 67.5.
        assert_eq!(score(&[4, 2, 3, 1, 4, 3, 2, 2, 4, 2]), Some(67.5));
        assert_eq!(score(&[3; 9]), None);
        assert_eq!(score(&[0; 10]), None);
    }

    #[test]
    fn a_missing_item_is_missing_and_so_is_the_score() {
        let measures = measures(&[4, 2, 3, 0, 4, 3, 2, 2, 4, 2]);
        assert_eq!((measures[2].value, measures[3].value), (Some(3.0), None));
        let score = measures.last().unwrap();
        assert_eq!((score.name.as_str(), score.value, score.score), ("sus-score", None, true));
    }
}
