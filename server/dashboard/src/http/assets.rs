//! Static files, built into the program. Their addresses contain a hash of all of them, so browsers can keep them
//! forever, and a new version of the program is never mixed with old files.

use std::sync::LazyLock;

use axum::extract::Path;
use axum::http::StatusCode;
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE, ETAG, HeaderMap, IF_NONE_MATCH};
use axum::response::{IntoResponse, Response};
use sha2::{Digest, Sha256};
use utoipa_axum::{router::OpenApiRouter, routes};

use super::AppState;
use super::error::Error;

struct Asset {
    name: &'static str,
    body: &'static [u8],
}

macro_rules! assets {
    ($($name:literal),* $(,)?) => {
        [$(Asset { name: $name, body: include_bytes!(concat!("../../../../web/static/", $name)) }),*]
    };
}

/// All files of `web/static/`, by folder and name. A test compares this table with the folder.
static ASSETS: &[Asset] = &assets![
    "accounts/backup.js",
    "accounts/people.js",
    "accounts/sign_in.js",
    "offline/worker.js",
    "operator/camera_card.js",
    "operator/camera_settings.js",
    "operator/checks_card.js",
    "operator/checks_words.js",
    "operator/choices.js",
    "operator/consent.js",
    "operator/device_words.js",
    "operator/devices.js",
    "operator/focus_card.js",
    "operator/now.js",
    "operator/orders.js",
    "operator/page.css",
    "operator/page.js",
    "operator/recording_card.js",
    "operator/recording_words.js",
    "operator/session_card.js",
    "operator/session_words.js",
    "operator/surgeon_link.js",
    "operator/traces.js",
    "researcher/analysis.css",
    "researcher/correction_words.js",
    "researcher/corrections.js",
    "researcher/deeds.js",
    "researcher/definition.js",
    "researcher/metric_drawing.js",
    "researcher/page.css",
    "researcher/pictures.js",
    "researcher/player.js",
    "researcher/player_words.js",
    "researcher/playhead.js",
    "researcher/session.js",
    "researcher/studies.js",
    "researcher/study.js",
    "researcher/study_export.js",
    "researcher/study_export_words.js",
    "researcher/svg.js",
    "researcher/timeline.js",
    "researcher/timeline_drawing.js",
    "researcher/timeline_words.js",
    "researcher/track.js",
    "researcher/voice.js",
    "shared/api.js",
    "shared/canvas.js",
    "shared/contact.js",
    "shared/copy.js",
    "shared/dialogs.js",
    "shared/dom.js",
    "shared/fit.js",
    "shared/framing.js",
    "shared/gestures.js",
    "shared/icon.svg",
    "shared/live.js",
    "shared/overlay.js",
    "shared/overlay_boxes.js",
    "shared/pacing.js",
    "shared/peaking.js",
    "shared/reconnection.js",
    "shared/sight.js",
    "shared/sign_in.js",
    "shared/storage.js",
    "shared/style.css",
    "shared/text.js",
    "shared/trouble.js",
    "shared/uuid.js",
    "shared/viewer.css",
    "shared/viewer.js",
    "shared/zooming.js",
    "surgeon/answers.js",
    "surgeon/awake.js",
    "surgeon/choices.js",
    "surgeon/comment_box.js",
    "surgeon/comments.js",
    "surgeon/confirm.js",
    "surgeon/confirm_button.js",
    "surgeon/device.js",
    "surgeon/dimmer.js",
    "surgeon/disk_store.js",
    "surgeon/drafts.js",
    "surgeon/grip.js",
    "surgeon/holding.js",
    "surgeon/instrument_form.js",
    "surgeon/last_view.js",
    "surgeon/microphone.js",
    "surgeon/notice.js",
    "surgeon/notice_dialog.js",
    "surgeon/now.js",
    "surgeon/offline.js",
    "surgeon/origin.js",
    "surgeon/outbox.js",
    "surgeon/over.js",
    "surgeon/page.css",
    "surgeon/page.js",
    "surgeon/panel.js",
    "surgeon/question_form.js",
    "surgeon/question_panel.js",
    "surgeon/questions.js",
    "surgeon/ranking.js",
    "surgeon/room.js",
    "surgeon/storage_words.js",
    "surgeon/talk.js",
    "surgeon/talk_button.js",
    "surgeon/talk_keys.js",
    "surgeon/tap_guard.js",
    "surgeon/track.js",
    "surgeon/voice_outbox.js",
    "surgeon/words.js",
    "tablet/device.js",
    "tablet/page.js",
    "tablet/trials.js",
    "tablet/words.js",
    "trust/page.css",
    "trust/page.js",
    "trust/verdict.js",
];

/// Hash of all files: the first 8 bytes of a SHA-256, in hexadecimal.
static VERSION: LazyLock<String> = LazyLock::new(|| {
    let mut hash = Sha256::new();
    for asset in ASSETS {
        hash.update(asset.name);
        hash.update(asset.body.len().to_le_bytes());
        hash.update(asset.body);
    }
    hex::encode(&hash.finalize()[..8])
});

/// Address of static file `name`, such as `shared/api.js`. Relative imports between the files keep the hash.
#[must_use]
pub fn url(name: &str) -> String {
    format!("/static/{}/{name}", *VERSION)
}

/// Hash of all files, as it appears in their addresses.
#[must_use]
pub fn version() -> &'static str {
    &VERSION
}

/// Addresses of all static files in `folder`.
pub fn urls_in(folder: &str) -> impl Iterator<Item = String> {
    ASSETS.iter().filter(move |asset| asset.name.split('/').next() == Some(folder)).map(|asset| url(asset.name))
}

/// The content of static file `name`; `None` if there is no such file.
#[must_use]
pub fn body(name: &str) -> Option<&'static [u8]> {
    ASSETS.iter().find(|asset| asset.name == name).map(|asset| asset.body)
}

/// A static file: a script, a style sheet, an icon.
#[utoipa::path(
    get,
    path = "/static/{version}/{folder}/{name}",
    tag = "assets",
    params(
        ("version" = String, Path, description = "hash of all static files"),
        ("folder" = String, Path, description = "the page that the file belongs to, or `shared`"),
        ("name" = String, Path, description = "file name"),
    ),
    responses(
        (status = 200, description = "The file"),
        (status = 304, description = "The browser's copy is current"),
        (status = 404, description = "No such file", body = super::error::ErrorBody),
    )
)]
async fn asset(
    Path((version, folder, name)): Path<(String, String, String)>,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let name = format!("{folder}/{name}");
    let body = body(&name).ok_or_else(|| Error::NotFound(format!("There is no file {name}.")))?;

    // A page of an older version of the program asks with the older hash. It gets the current file, and must not keep
    // it.
    let cache = if version == *VERSION { "public, max-age=31536000, immutable" } else { "no-cache" };
    let etag = format!("\"{}\"", *VERSION);
    let common = [(CACHE_CONTROL, cache.to_owned()), (ETAG, etag.clone())];
    if headers.get(IF_NONE_MATCH).is_some_and(|known| known.as_bytes() == etag.as_bytes()) {
        return Ok((StatusCode::NOT_MODIFIED, common).into_response());
    }
    Ok((common, [(CONTENT_TYPE, content_type(&name))], body).into_response())
}

fn content_type(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("woff2") => "font/woff2",
        Some("webmanifest") => "application/manifest+json",
        _ => "application/octet-stream",
    }
}

/// The routes of this file.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(asset))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{ASSETS, content_type};

    #[test]
    fn every_file_of_the_folder_is_part_of_the_program() {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../web/static");
        let mut found = 0;

        for folder in std::fs::read_dir(root).unwrap() {
            let folder = folder.unwrap();
            for file in std::fs::read_dir(folder.path()).unwrap() {
                let name = Path::new(&folder.file_name()).join(file.unwrap().file_name());
                let name = name.to_str().unwrap().to_owned();
                assert!(ASSETS.iter().any(|asset| asset.name == name), "{name} is missing from the table");
                assert_ne!(content_type(&name), "application/octet-stream", "{name}");
                found += 1;
            }
        }

        assert_eq!(found, ASSETS.len(), "a file stands in the table twice");
    }
}
