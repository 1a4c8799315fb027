//! The NASA Task Load Index without weights, "raw TLX": the mean of six ratings from 0 to 100 in steps of 5 (Hart &
//! Staveland 1988; without weights: Hart 2006, Proceedings of the Human Factors and Ergonomics Society 50:904). The
//! scales and their wording are those of NASA's form.

use super::measure::Measure;
use super::workload;
use crate::question::{QuestionKind, Scale};
use parfocal_language::Language;

/// The question with its six scales in `language`. `None` where we have no published translation whose wording is
/// certain: the French one (Cegarra & Morgado 2009) and the Spanish one (Arquer & Nogareda 2001, INSST, NTP 544) are
/// published, but we have not seen all of their scales in print.
pub fn question(language: Language) -> Option<QuestionKind> {
    let scales = match language {
        Language::English => english(),
        Language::German => german(),
        Language::French | Language::Spanish => return None,
    };
    Some(QuestionKind::NasaTlx { scales })
}

fn english() -> Vec<Scale> {
    let from_low = |title: &str, text: &str| workload::scale(title, text, "Very low", "Very high");
    vec![
        from_low("Mental demand", "How mentally demanding was the task?"),
        from_low("Physical demand", "How physically demanding was the task?"),
        from_low("Temporal demand", "How hurried or rushed was the pace of the task?"),
        workload::scale(
            "Performance",
            "How successful were you in accomplishing what you were asked to do?",
            "Perfect",
            "Failure",
        ),
        from_low("Effort", "How hard did you have to work to accomplish your level of performance?"),
        from_low("Frustration", "How insecure, discouraged, irritated, stressed and annoyed were you?"),
    ]
}

/// The German form by Christian Lehsing and Katharina Seifert, which is published with Keith Vertanen's NASA-TLX for
/// browsers. It translates the longer descriptions of Hart & Staveland 1988.
const GERMAN: [[&str; 4]; 6] = [
    [
        "Geistige Anforderung",
        "Wie viel geistige Anforderung war bei der Informationsaufnahme und bei der Informationsverarbeitung \
         erforderlich (z.B. Denken, Entscheiden, Rechnen, Erinnern, Hinsehen, Suchen ...)? War die Aufgabe leicht oder \
         anspruchsvoll, einfach oder komplex, erfordert sie hohe Genauigkeit oder ist sie fehlertolerant?",
        "Gering",
        "Hoch",
    ],
    [
        "Körperliche Anforderung",
        "Wie viel körperliche Aktivität war erforderlich (z.B. ziehen, drücken, drehen, steuern, aktivieren ...)? War \
         die Aufgabe leicht oder schwer, einfach oder anstrengend, erholsam oder mühselig?",
        "Gering",
        "Hoch",
    ],
    [
        "Zeitliche Anforderung",
        "Wie viel Zeitdruck empfanden Sie hinsichtlich der Häufigkeit oder dem Takt mit dem die Aufgaben oder \
         Aufgabenelemente auftraten? War die Aufgabe langsam und geruhsam oder schnell und hektisch?",
        "Gering",
        "Hoch",
    ],
    [
        "Leistung",
        "Wie erfolgreich haben Sie Ihrer Meinung nach die vom Versuchsleiter (oder Ihnen selbst) gesetzten Ziele \
         erreicht? Wie zufrieden waren Sie mit Ihrer Leistung bei der Verfolgung dieser Ziele?",
        "Gut",
        "Schlecht",
    ],
    [
        "Anstrengung",
        "Wie hart mussten Sie arbeiten, um Ihren Grad an Aufgabenerfüllung zu erreichen?",
        "Gering",
        "Hoch",
    ],
    [
        "Frustration",
        "Wie unsicher, entmutigt, irritiert, gestresst und verärgert (versus sicher, bestätigt, zufrieden, entspannt \
         und zufrieden mit sich selbst) fühlten Sie sich während der Aufgabe?",
        "Gering",
        "Hoch",
    ],
];

/// The scales have the same names in exports in every language.
fn german() -> Vec<Scale> {
    let translated = |(scale, [title, text, low, high]): (Scale, [&str; 4])| Scale {
        name: scale.name,
        ..workload::scale(title, text, low, high)
    };
    english().into_iter().zip(GERMAN).map(translated).collect()
}

/// The six ratings and their mean. The mean is missing if a rating is.
pub fn measures(scales: &[Scale], items: &[u8]) -> Vec<Measure> {
    let mut measures = workload::ratings(scales, items);
    let ratings: Vec<Option<f64>> = measures.iter().map(|rating| rating.value).collect();
    measures.push(Measure::score("raw-tlx", "Raw TLX", workload::mean(&ratings)));
    measures
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw_tlx(items: &[u8]) -> Option<f64> {
        measures(&english(), items).last().unwrap().value
    }

    #[test]
    fn the_score_is_the_mean_of_the_six_ratings() {
        // We found no published worked example of the unweighted index. Computed by hand from its definition:
        // gradations 7, 4, 13, 9, 7 and 9 of 21 are ratings of 30, 15, 60, 40, 30 and 40; 215 / 6 = 35.83.
        let score = raw_tlx(&[7, 4, 13, 9, 7, 9]).unwrap();
        assert!((score - 215.0 / 6.0).abs() < 1e-9, "{score}");
        assert_eq!(raw_tlx(&[1; 6]), Some(0.0));
        assert_eq!(raw_tlx(&[21; 6]), Some(100.0));
    }

    #[test]
    fn a_translation_has_the_same_scales_for_exports() {
        let names = |scales: Vec<Scale>| scales.into_iter().map(|scale| scale.name).collect::<Vec<_>>();
        assert_eq!(names(german()), names(english()));
        assert_eq!(german()[3].title, "Leistung");
    }

    #[test]
    fn a_missing_rating_leaves_the_others_and_no_score() {
        let measures = measures(&english(), &[7, 0, 13, 9, 7, 9]);
        let values: Vec<Option<f64>> = measures.iter().map(|measure| measure.value).collect();
        assert_eq!(values, [Some(30.0), None, Some(60.0), Some(40.0), Some(30.0), Some(40.0), None]);
        assert_eq!(measures[1].name, "physical-demand");
    }
}
