//! Protocols: what a trial compares, for how long, and which questions it asks. Protocols are written in TOML
//! (docs/trial.md); a parsed protocol is valid.

pub(crate) mod fault;
mod file;

use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use utoipa::ToSchema;

pub use fault::ProtocolError;
pub(crate) use file::{between, identifier, text};

use super::allocation::{Order, Seed};
use super::pointing::PatchRule;
use super::question::Question;
use super::tablet::WhenAway;
use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_language::Language;

/// A valid protocol, with the text that it was read from.
#[derive(Debug, Clone, PartialEq)]
pub struct Protocol {
    /// Name: lower-case letters, digits and dashes.
    pub name: String,
    /// Language of all that surgeons read.
    pub language: Language,
    /// Title for surgeons.
    pub title: String,
    /// Title for researchers and operators, shown before a session. It is never sent to a surgeon.
    pub researcher_title: String,
    /// Whether sessions with this protocol are practice. They are kept apart from real data everywhere.
    pub practice: bool,
    /// Policies to compare, in the order in which the allocation algorithm takes them.
    pub policies: Vec<PolicyName>,
    /// Number of segments for each policy.
    pub repeats: usize,
    /// Rule by which the order of the segments is drawn.
    pub order: Order,
    /// Maximum time inspected in a segment.
    pub segment_limit: Duration,
    /// Focal power at which every segment begins, so that the start reveals nothing about the policy.
    pub start: FocalPower,
    /// Prompts to comment, in the order of their times.
    pub prompts: Vec<Prompt>,
    /// How long a prompt stays on the page.
    pub prompt_stay: Duration,
    /// Comments that the surgeon can give with one tap.
    pub quick_comments: Vec<String>,
    /// Whether the surgeon may comment aloud.
    pub voice: bool,
    /// Number of days for which the sound of voice comments is kept; none if it is kept until somebody erases it.
    pub voice_days: Option<u32>,
    /// Grace period after a session's end: what a surgeon's device still holds counts if it arrives in this time.
    pub grace: Duration,
    /// What is recorded during a session.
    pub record: Record,
    /// What happens to a segment's clock while no tablet shows the surgeon's page.
    pub when_tablet_away: WhenAway,
    /// Who chooses the patch's place.
    pub patch: PatchRule,
    /// Whether the focus may be held during an inspection.
    pub hold: bool,
    /// Width in pixels that the surgeon's picture must have; a session with a smaller one is paused.
    pub least_picture_width: Option<u32>,
    /// Version of the consent text that a participant must have consented to before a session starts; none if no
    /// consent is required.
    pub consent: Option<String>,
    /// Questions asked after each segment.
    pub after_segment: Vec<Question>,
    /// Closing questions, asked at the end.
    pub closing: Vec<Question>,
    /// The TOML text, byte for byte.
    pub source: Arc<str>,
}

/// What is recorded during a session, from its start to its end.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Record {
    /// Nothing.
    #[default]
    None,
    /// The pictures that viewers get.
    View,
    /// Every mosaic of the camera, without loss.
    Mosaic,
}

/// A prompt to comment.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Prompt {
    /// When the prompt appears: time inspected in the segment.
    pub at: Duration,
    /// Text of the prompt.
    pub text: String,
}

impl Protocol {
    /// Number of segments in a session.
    pub fn settings(&self) -> usize {
        self.policies.len() * self.repeats
    }

    /// Number of sessions whose orders are drawn together from one seed: 1 if they are plainly shuffled.
    pub fn set_size(&self) -> usize {
        self.order.algorithm().set_size(self.policies.len())
    }

    /// Draws the order of session `index` (from 0) of the set with this seed: the policy of each segment.
    pub fn draw(&self, seed: Seed, index: usize) -> Vec<PolicyName> {
        let order = self.order.algorithm().draw(seed, self.policies.len(), self.repeats, index);
        order.into_iter().map(|policy| self.policies[policy].clone()).collect()
    }

    /// SHA-256 of the TOML text.
    pub fn sha256(&self) -> [u8; 32] {
        Sha256::digest(self.source.as_bytes()).into()
    }

    /// The question with this id: among those after a segment if `after_segment`, otherwise among the closing
    /// questions.
    pub fn question(&self, id: &str, after_segment: bool) -> Option<&Question> {
        let questions = if after_segment { &self.after_segment } else { &self.closing };
        questions.iter().find(|question| question.id == id)
    }

    /// The prompt to show when `inspected` has been inspected in a segment; none if none is due.
    pub fn prompt_at(&self, inspected: Duration) -> Option<&Prompt> {
        self.prompts.iter().rev().find(|prompt| prompt.at <= inspected && inspected < prompt.at + self.prompt_stay)
    }

    /// The next time inspected, after `inspected`, at which the shown prompt changes; none if it stays as it is.
    pub fn next_prompt_change(&self, inspected: Duration) -> Option<Duration> {
        self.prompts
            .iter()
            .flat_map(|prompt| [prompt.at, prompt.at + self.prompt_stay])
            .filter(|&at| at > inspected)
            .min()
    }
}

/// The first of `policies` that `text` names, in upper or lower case, and with dashes, spaces or other signs between
/// the words. A name of letters alone ("fixed") is also an ordinary word, which texts may use.
pub(crate) fn named_policy<'a>(
    text: &str,
    policies: impl IntoIterator<Item = &'a PolicyName>,
) -> Option<&'a PolicyName> {
    let text = words(text);
    let is_word = |policy: &PolicyName| policy.as_str().chars().all(char::is_alphabetic);
    policies.into_iter().find(|policy| !is_word(policy) && text.contains(&words(policy.as_str())))
}

/// The words of `text` in lower case, with one dash between each and the next.
fn words(text: &str) -> String {
    let text = text.to_lowercase();
    let words: Vec<&str> = text.split(|sign: char| !sign.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    words.join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Vec<PolicyName> {
        ["fixed", "mgm-hill-climber", "mgm-learned", "cnn-learned", "parfocal"].map(PolicyName::new).to_vec()
    }

    fn error(source: &str) -> String {
        Protocol::parse(source, "trial.toml", &known()).unwrap_err().to_string()
    }

    const PAPER: &str = include_str!("../../../../trial-protocols/paper.toml");

    #[test]
    fn the_papers_trial_compares_three_policies_twice_for_two_minutes() {
        let paper = Protocol::parse(PAPER, "paper.toml", &known()).unwrap();
        assert_eq!((paper.policies.len(), paper.repeats, paper.settings()), (3, 2, 6));
        assert_eq!(paper.segment_limit, Duration::from_mins(2));
        assert_eq!(paper.order, Order::Shuffled);
        assert!(!paper.practice);
        assert_eq!(paper.start, FocalPower::MIDDLE);
    }

    #[test]
    fn the_follow_up_compares_the_papers_policies_with_our_own_in_balanced_orders() {
        let source = include_str!("../../../../trial-protocols/follow-up.toml");
        let follow_up = Protocol::parse(source, "follow-up.toml", &known()).unwrap();
        let policies = ["mgm-hill-climber", "cnn-learned", "parfocal"].map(PolicyName::new);
        assert_eq!(follow_up.policies, policies);
        assert_eq!((follow_up.repeats, follow_up.order, follow_up.practice), (2, Order::Balanced, false));

        // Everything that a surgeon meets is the paper's, so that results can be compared.
        let paper = Protocol::parse(PAPER, "paper.toml", &known()).unwrap();
        let alike = Protocol {
            name: paper.name.clone(),
            researcher_title: paper.researcher_title.clone(),
            policies: paper.policies.clone(),
            order: paper.order,
            source: paper.source.clone(),
            ..follow_up
        };
        assert_eq!(alike, paper);
    }

    #[test]
    fn what_a_tablet_holds_counts_for_half_an_hour_or_as_long_as_the_protocol_says() {
        let grace = |line: &str| {
            let source = PAPER.replace("repeats = 2", &format!("repeats = 2\n{line}"));
            Protocol::parse(&source, "trial.toml", &known()).map(|protocol| protocol.grace)
        };

        assert_eq!(grace(""), Ok(Duration::from_mins(30)));
        assert_eq!(grace("grace_minutes = 5"), Ok(Duration::from_mins(5)));
        assert_eq!(grace("grace_minutes = 0"), Ok(Duration::ZERO));
        let said = grace("grace_minutes = 1441").unwrap_err().to_string();
        assert!(said.contains("key 'grace_minutes': must be from 0 to 1440 minutes, not 1441"), "{said}");
    }

    #[test]
    fn voice_is_asked_for_by_name_and_kept_as_long_as_the_protocol_says() {
        let voice = |lines: &str| {
            let source = PAPER.replace("repeats = 2", &format!("repeats = 2\n{lines}"));
            let protocol = Protocol::parse(&source, "trial.toml", &known());
            protocol.map(|protocol| (protocol.voice, protocol.voice_days)).map_err(|error| error.to_string())
        };

        assert_eq!(voice(""), Ok((false, None)));
        assert_eq!(voice("voice = true"), Ok((true, None)));
        assert_eq!(voice("voice = true\nvoice_days = 30"), Ok((true, Some(30))));
        let without = voice("voice_days = 30").unwrap_err();
        assert!(without.contains("key 'voice_days': needs 'voice = true'"), "{without}");
        let none = voice("voice = true\nvoice_days = 0").unwrap_err();
        assert!(none.contains("must be from 1 to 10980 days, not 0"), "{none}");
    }

    #[test]
    fn the_patch_stays_at_the_centre_unless_the_protocol_lets_the_surgeon_point() {
        let rule = |lines: &str| {
            let source = PAPER.replace("repeats = 2", &format!("repeats = 2\n{lines}"));
            let protocol = Protocol::parse(&source, "trial.toml", &known());
            protocol.map(|protocol| (protocol.patch, protocol.hold)).map_err(|error| error.to_string())
        };

        assert_eq!(rule(""), Ok((PatchRule::Centre, false)));
        assert_eq!(rule("patch = \"centre\""), Ok((PatchRule::Centre, false)));
        assert_eq!(rule("patch = \"surgeon\""), Ok((PatchRule::Surgeon { stays: false }, false)));
        assert_eq!(
            rule("patch = \"surgeon\"\npatch_stays = true\nhold = true"),
            Ok((PatchRule::Surgeon { stays: true }, true))
        );
        let unknown = rule("patch = \"center\"").unwrap_err();
        assert!(unknown.contains("key 'patch': must be \"centre\" or \"surgeon\", not \"center\""), "{unknown}");
        let alone = rule("patch_stays = true").unwrap_err();
        assert!(alone.contains("key 'patch_stays': needs 'patch = \"surgeon\"'"), "{alone}");

        let surgeon = |follows: &str| rule(&format!("patch = \"surgeon\"\npatch_follows = \"{follows}\""));
        assert_eq!(surgeon("screen"), rule("patch = \"surgeon\""));
        let blinded = surgeon("tissue").unwrap_err();
        assert!(blinded.contains("key 'patch_follows': cannot be \"tissue\": sessions are blinded"), "{blinded}");
        let unknown = surgeon("vessel").unwrap_err();
        assert!(unknown.contains("key 'patch_follows': must be \"screen\", not \"vessel\""), "{unknown}");
    }

    /// The paper's protocol in `language`, with one question of `kind` at the end. Its own instrument, the SUS, becomes
    /// a text, because there is no Spanish one.
    fn asking(language: &str, kind: &str) -> Result<Protocol, String> {
        let source = PAPER.replace("kind = \"sus\"", "kind = \"text\"");
        let source = source.replace("repeats = 2", &format!("repeats = 2\nlanguage = \"{language}\""));
        let question = format!("\n[[closing]]\nid = \"q\"\ntext = \"?\"\nkind = \"{kind}\"\n");
        let source = format!("{source}{question}");
        Protocol::parse(&source, "trial.toml", &known()).map_err(|error| error.to_string())
    }

    #[test]
    fn surgeons_read_english_unless_the_protocol_names_another_language() {
        let paper = Protocol::parse(PAPER, "paper.toml", &known()).unwrap();
        assert_eq!(paper.language, Language::English);
        for language in Language::ALL {
            assert_eq!(asking(language.code(), "text").unwrap().language, language);
        }
        for unknown in ["it", "DE", "german", ""] {
            let said = asking(unknown, "text").unwrap_err();
            assert!(said.contains(&format!("key 'language': there is no language \"{unknown}\"")), "{said}");
            assert!(said.ends_with("there are: en, de, fr, es"), "{said}");
        }
    }

    #[test]
    fn an_instrument_is_asked_only_in_a_language_into_which_it_was_translated() {
        let translated = [("sus", vec!["en", "de", "fr"]), ("nasa-tlx", vec!["en", "de"]), ("surg-tlx", vec!["en"])];
        for (kind, languages) in translated {
            for language in Language::ALL {
                let asked = asking(language.code(), kind);
                if languages.contains(&language.code()) {
                    assert!(asked.is_ok(), "{kind} {language}: {asked:?}");
                    continue;
                }
                let said = asked.unwrap_err();
                assert!(said.contains("key 'kind': "), "{said}");
                assert!(said.contains(&format!("no published {} translation", language.name())), "{said}");
            }
        }
    }

    #[test]
    fn what_follows_a_recognition_question_is_asked_in_the_protocols_language() {
        let questions = asking("de", "recognition").unwrap().closing;
        let follow_up = questions.iter().find(|question| question.id == "q-why").unwrap();
        assert!(follow_up.text.starts_with("Welche Einstellungen"), "{}", follow_up.text);
    }

    #[test]
    fn practice_is_one_minute_and_marked() {
        let source = include_str!("../../../../trial-protocols/practice.toml");
        let practice = Protocol::parse(source, "practice.toml", &known()).unwrap();
        assert!(practice.practice);
        assert_eq!(practice.segment_limit * u32::try_from(practice.settings()).unwrap(), Duration::from_mins(1));
    }

    #[test]
    fn an_unknown_key_is_named_with_its_line() {
        let text = PAPER.replace("repeats = 2", "repeats = 2\nrepeat = 3");
        let line = text.lines().position(|line| line == "repeat = 3").unwrap() + 1;
        let said = error(&text);
        assert!(said.starts_with(&format!("trial.toml, line {line}: key 'repeat'")), "{said}");
    }

    #[test]
    fn a_wrong_type_is_named_with_its_line_and_key() {
        let said = error(&PAPER.replace("repeats = 2", "repeats = \"two\""));
        assert!(said.contains("key 'repeats'") && said.contains("line "), "{said}");
    }

    #[test]
    fn a_missing_key_is_named() {
        let said = error(&PAPER.replace("repeats = 2", ""));
        assert!(said.starts_with("trial.toml, line ") && said.contains("repeats"), "{said}");
    }

    #[test]
    fn an_unknown_policy_is_named_and_the_known_are_listed() {
        let text = PAPER.replace("\"mgm-hill-climber\"", "\"mgm-hill\"");
        let line = text.lines().position(|line| line.contains("\"mgm-hill\"")).unwrap() + 1;
        let said = error(&text);
        assert!(said.starts_with(&format!("trial.toml, line {line}: key 'policies'")), "{said}");
        assert!(said.contains("'mgm-hill'") && said.contains("cnn-learned"), "{said}");
    }

    #[test]
    fn broken_toml_is_named_with_its_line() {
        let said = error("name = \"x\"\ntitle = \n");
        assert!(said.starts_with("trial.toml, line 2"), "{said}");
    }

    #[test]
    fn texts_for_surgeons_may_not_name_a_policy() {
        let said =
            error(&PAPER.replace("text = \"How does the focus feel now?\"", "text = \"Is MGM-hill-climber good?\""));
        assert!(said.contains("mgm-hill-climber") && said.contains("must not know"), "{said}");

        for spelt in ["the MGM hill climber", "mgm\u{2011}hill\u{2011}climber", "MGM  hill-climber"] {
            let said = error(&PAPER.replace("How does the focus feel now?", spelt));
            assert!(said.contains("names the policy 'mgm-hill-climber'"), "{said}");
        }
    }

    #[test]
    fn a_protocol_that_was_kept_is_read_though_a_new_one_would_be_refused() {
        let kept = PAPER.replace("How does the focus feel now?", "How is the MGM hill climber?");
        Protocol::parse_kept(&kept, "the protocol of a session").unwrap();
    }

    #[test]
    fn a_policy_of_a_file_or_of_another_process_is_named_too() {
        let policies = ["parfocal", "file:Nets/Sharp.pt", "exec:./Search-Fast"].map(PolicyName::new);
        let named = |text: &str| named_policy(text, &policies).map(PolicyName::as_str);
        assert_eq!(named("Was it FILE:nets/sharp.pt?"), Some("file:Nets/Sharp.pt"));
        assert_eq!(named("it was exec:./Search-Fast"), Some("exec:./Search-Fast"));
        assert_eq!(named("made with parfocal"), None, "an ordinary word");
    }

    #[test]
    fn a_likert_has_five_or_seven_points() {
        let text = "\n[[after_segment]]\nid = \"x\"\ntext = \"x?\"\n\
                    kind = \"likert\"\npoints = 6\nlow = \"l\"\nhigh = \"h\"\n";
        let said = error(&format!("{PAPER}{text}"));
        assert!(said.contains("key 'points'") && said.contains("5 or 7"), "{said}");
    }

    #[test]
    fn two_questions_may_not_share_an_id() {
        let text = "\n[[after_segment]]\nid = \"x\"\ntext = \"x?\"\nkind = \"text\"\n".repeat(2);
        let said = error(&format!("{PAPER}{text}"));
        assert!(said.contains("key 'id'") && said.contains("'x'"), "{said}");
    }

    #[test]
    fn a_prompt_shows_for_its_time_and_no_longer() {
        let paper = Protocol::parse(PAPER, "paper.toml", &known()).unwrap();
        let first = &paper.prompts[0];
        assert_eq!(first.at, Duration::from_secs(20));
        let just_before = Duration::from_millis(19_999);
        assert_eq!(paper.prompt_at(just_before), None);
        assert_eq!(paper.next_prompt_change(just_before), Some(first.at));
        assert_eq!(paper.prompt_at(first.at), Some(first));
        assert_eq!(paper.prompt_at(first.at + paper.prompt_stay), None);
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_the_parser_panic(text in "(?s).{0,200}", cut in 0_usize..2000) {
            let _ = Protocol::parse(&text, "x", &known());
            let cut = (0..=cut.min(PAPER.len())).rev().find(|&at| PAPER.is_char_boundary(at)).unwrap();
            let _ = Protocol::parse(&format!("{}{text}", &PAPER[..cut]), "x", &known());
        }
    }
}
