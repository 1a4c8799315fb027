//! Reads every byte that the surgeon's browser received and looks for anything that could tell which policy ran. Only
//! pixels are left out, because the surgeon is to judge the picture.

use std::collections::{BTreeMap, BTreeSet};

use parfocal_dashboard::http::assets;
use serde_json::Value;

use super::proxy::Connection;
use super::wire::{Received, take_apart};

/// Names of policies, and words that only someone who knows the policy would use.
const TELLING: [&str; 16] = [
    "fixed",
    "hill-climber",
    "hill_climber",
    "mgm",
    "mlr",
    "cnn",
    "learned",
    "policy",
    "policies",
    "metric",
    "focal_power",
    "focal power",
    "asked",
    "measured",
    "schedule",
    "seed",
];

/// Every key of JSON that a surgeon's browser may receive.
const KEYS: [&str; 66] = [
    "age",
    "answers",
    "area",
    "camera_simulated",
    "certificate_until",
    "choices",
    "comments",
    "error",
    "estimated",
    "first",
    "focus_held",
    "frame",
    "height",
    "high",
    "holding",
    "id",
    "items",
    "kind",
    "labels",
    "language",
    "lens_simulated",
    "low",
    "may_pause",
    "may_resume",
    "name",
    "notice",
    "only_if_yes",
    "optional",
    "pairs",
    "patch",
    "paused",
    "paused_by",
    "per_cell",
    "phase",
    "pointed",
    "pointing",
    "points",
    "practice",
    "prompt",
    "questions",
    "quick_comments",
    "radius",
    "reduced",
    "run",
    "said",
    "remaining_seconds",
    "scales",
    "second",
    "segment",
    "session",
    "setting",
    "settings",
    "text",
    "ties",
    "title",
    "travel",
    "type",
    "unrecorded",
    "view",
    "voice",
    "width",
    "x",
    "y",
    "preference",
    "remarks",
    "sharpness",
];
/// Question ids, which are keys too where answers are listed.
const QUESTION_IDS: [&str; 8] = [
    "usability",
    "closing-remarks",
    "effort",
    "how-often",
    "workload",
    "seen-before",
    "seen-before-why",
    "surgical-workload",
];

/// A question of the NASA Task Load Index about every setting, in its published words.
const PUBLISHED: &str = "what you were asked to do";

/// What the check has seen, as evidence that it looked.
#[derive(Debug, Default)]
pub struct Seen {
    /// Pages, JSON answers, messages and picture headers searched.
    pub texts: usize,
    /// Static files compared.
    pub files: BTreeSet<String>,
    /// Pictures whose headers were searched.
    pub pictures: usize,
    /// The id of each setting's segment, by session and setting.
    pub segments: BTreeMap<(String, u64), BTreeSet<String>>,
    /// The surgeon's views while inspecting, by session, without the fields that change from moment to moment.
    inspecting: BTreeMap<String, BTreeSet<String>>,
}

/// Checks everything on `connections`; panics if something could tell the policy.
pub fn check(connections: &[Connection]) -> Seen {
    let mut seen = Seen::default();
    for received in connections.iter().flat_map(take_apart) {
        match received {
            Received::Answer { path, head, body } => answer(&mut seen, &path, &head, &body),
            Received::Text(text) => json(&mut seen, &text),
            Received::Binary(message) => {
                seen.pictures += 1;
                let length = usize::from(u16::from_le_bytes([message[0], message[1]]));
                // A picture cut off by a killed server may lack the end of its header.
                if let Some(header) = message.get(2..2 + length) {
                    json(&mut seen, std::str::from_utf8(header).unwrap());
                    assert!(message[2 + length..].is_empty() || message[2 + length..].starts_with(&[0xff, 0xd8]));
                }
            }
        }
    }

    finish(seen)
}

/// Checks the entries that a browser keeps to open a page without a network, each with its address and headers. The one
/// entry that is not an answer of the server is the session's last view, as JSON.
pub fn check_kept(kept: &[(String, String, Vec<u8>)], last_told: &Value) -> Seen {
    let mut seen = Seen::default();
    for (path, head, body) in kept {
        answer(&mut seen, path, head, body);
    }
    json(&mut seen, &last_told.to_string());
    finish(seen)
}

fn finish(seen: Seen) -> Seen {
    let ids: Vec<_> = seen.segments.values().flatten().collect();
    assert_eq!(ids.iter().collect::<BTreeSet<_>>().len(), ids.len(), "two settings share an id: {:?}", seen.segments);
    assert!(seen.segments.values().all(|ids| ids.len() == 1), "a setting changed its id: {:?}", seen.segments);
    let same = seen.inspecting.values().all(|forms| forms.len() == 1);
    assert!(same, "settings are told differently: {:#?}", seen.inspecting);
    seen
}

fn answer(seen: &mut Seen, path: &str, head: &str, body: &[u8]) {
    let told = head.lines().filter(|line| !line.to_ascii_lowercase().starts_with("sec-websocket-accept"));
    let told = told.collect::<Vec<_>>().join("\n").to_ascii_lowercase();
    search(path, &told.replace("-policy", ""));
    let kind = told.lines().find_map(|line| line.strip_prefix("content-type: ")).unwrap_or_default();
    if let Some((_, name)) = path.strip_prefix("/static/").and_then(|path| path.split_once('/')) {
        file(seen, name, body);
    } else if kind.starts_with("application/json") {
        json(seen, std::str::from_utf8(body).unwrap());
    } else {
        seen.texts += 1;
        search(path, &String::from_utf8_lossy(body).to_ascii_lowercase());
    }
}

/// A static file that was built into the program is the same whichever policy runs.
fn file(seen: &mut Seen, name: &str, body: &[u8]) {
    if body.is_empty() {
        return; // kept by the browser from before: 304
    }
    assert!(assets::content(name) == Some(body), "{name} is not the file of the program");
    seen.files.insert(name.to_owned());
}

fn json(seen: &mut Seen, text: &str) {
    // The message may be cut off because the server was killed.
    let Ok(value) = serde_json::from_str::<Value>(text) else {
        return search("cut-off message", &text.to_ascii_lowercase());
    };
    seen.texts += 1;
    search("JSON", &text.to_ascii_lowercase());
    keys(&value);
    let view = if value.get("view").is_some() { &value["view"] } else { &value };
    let session = view["session"].as_str().unwrap_or_default().to_owned();
    if let (Some(setting), Some(segment)) = (view["setting"].as_u64(), view["segment"].as_str()) {
        seen.segments.entry((session.clone(), setting)).or_default().insert(segment.to_owned());
    }
    if view["phase"] == "inspecting" {
        let mut form = view.clone();
        let changing = [
            "setting",
            "segment",
            "remaining_seconds",
            "comments",
            "prompt",
            "paused",
            "paused_by",
            "may_pause",
            "may_resume",
            "unrecorded",
        ];
        for changing in changing {
            form[changing] = Value::Null;
        }
        seen.inspecting.entry(session).or_default().insert(form.to_string());
    }
}

fn keys(value: &Value) {
    match value {
        Value::Object(members) => {
            for (key, value) in members {
                let known = KEYS.contains(&key.as_str()) || QUESTION_IDS.contains(&key.as_str());
                assert!(known, "the key '{key}' is not among those that a surgeon's browser may receive");
                keys(value);
            }
        }
        Value::Array(items) => items.iter().for_each(keys),
        _ => {}
    }
}

fn search(place: &str, text: &str) {
    let text = &text.replace(PUBLISHED, "");
    for word in TELLING {
        if let Some(at) = text.find(word) {
            let around: String = text.chars().skip(at.saturating_sub(60)).take(140).collect();
            panic!("'{word}' reached the surgeon's browser in {place}: …{around}…");
        }
    }
}
