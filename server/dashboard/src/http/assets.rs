//! Static files, built into the program. Their addresses contain a hash of all of them, so browsers can keep them
//! forever, and a new version of the program is never mixed with old files.
//!
//! Of the surgeon's page all scripts are one file, and every file is compressed where the browser takes that: a tablet
//! at the end of a slow link opens the page several times sooner.

use std::borrow::Cow;
use std::io::Write;
use std::sync::{LazyLock, OnceLock};

use axum::extract::Path;
use axum::http::StatusCode;
use axum::http::header::{
    ACCEPT_ENCODING, CACHE_CONTROL, CONTENT_ENCODING, CONTENT_TYPE, ETAG, HeaderMap, IF_NONE_MATCH, VARY,
};
use axum::response::{IntoResponse, Response};
use flate2::Compression;
use flate2::write::GzEncoder;
use rust_embed::RustEmbed;
use sha2::{Digest, Sha256};

use super::bundle::bundle;
use super::error::Error;
use parfocal_language::Language;

struct Asset {
    name: Cow<'static, str>,
    /// The file as it is in the repository.
    body: Cow<'static, [u8]>,
    /// What a browser gets, compressed; made when it is first asked for.
    packed: OnceLock<Vec<u8>>,
}

/// The script of the surgeon's page, which browsers get with all that it imports.
const BUNDLED: &str = "surgeon/page.js";

/// What else the surgeon's page loads.
const WITH_BUNDLE: [&str; 4] = ["shared/style.css", "shared/viewer.css", "shared/icon.svg", "surgeon/page.css"];

/// The script of the surgeon's page in one file; as it is in the repository if the scripts cannot be put together,
/// which a test rules out.
static BUNDLE: LazyLock<Vec<u8>> = LazyLock::new(|| match bundle(BUNDLED, &source) {
    Ok(text) => text.into_bytes(),
    Err(error) => {
        tracing::error!(%error, "the scripts of the surgeon's page are sent one by one");
        source(BUNDLED).unwrap_or_default().as_bytes().to_vec()
    }
});

/// The text of script `name`.
fn source(name: &str) -> Option<&'static str> {
    body(name).and_then(|body| std::str::from_utf8(body).ok())
}

impl Asset {
    const fn new(name: Cow<'static, str>, body: Cow<'static, [u8]>) -> Self {
        Self { name, body, packed: OnceLock::new() }
    }

    /// What a browser gets.
    fn content(&'static self) -> &'static [u8] {
        if self.name == BUNDLED { &BUNDLE } else { &self.body }
    }

    /// The same, compressed.
    fn packed(&'static self) -> &'static [u8] {
        self.packed.get_or_init(|| {
            let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
            // Writing to memory does not fail.
            let written = encoder.write_all(self.content()).and_then(|()| encoder.finish());
            written.unwrap_or_default()
        })
    }
}

/// All files of `web/static/`, by folder and name.
#[derive(RustEmbed)]
#[folder = "../../web/static"]
struct Files;

/// All static files: those of `web/static/` and the languages' scripts.
static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let files = Files::iter().filter_map(|name| {
        let file = Files::get(&name)?;
        Some(Asset::new(name, file.data))
    });
    files.chain(languages()).collect()
});

/// Beginnings of the names of messages that the server alone says. Pages get their words with the server's answers.
const SAID_BY_SERVER: [&str; 2] = ["error-", "refused-"];

/// The messages of `language` that pages say, without what is said to translators.
fn page_messages(language: Language) -> String {
    let mut wanted = false;
    let lines = language.source().lines().filter(|line| {
        // What belongs to a message is indented.
        if !line.starts_with(' ') {
            wanted = !line.starts_with('#') && !SAID_BY_SERVER.iter().any(|beginning| line.starts_with(beginning));
        }
        wanted && !line.is_empty()
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// The languages' files as scripts. Each gives its text to
/// `web/static/shared/language.js` by a variable of the page, because the surgeon's page has that file in one with
/// others.
fn languages() -> impl Iterator<Item = Asset> {
    Language::ALL.into_iter().map(|language| {
        let text = serde_json::Value::from(page_messages(language));
        let script = format!("(globalThis.parfocalLanguages ??= {{}}).{language} = {text};\n");
        Asset::new(format!("languages/{language}.js").into(), script.into_bytes().into())
    })
}

/// Hash of all files: the first 8 bytes of a SHA-256, in hexadecimal.
static VERSION: LazyLock<String> = LazyLock::new(|| {
    let mut hash = Sha256::new();
    for asset in ASSETS.iter() {
        hash.update(&*asset.name);
        hash.update(asset.body.len().to_le_bytes());
        hash.update(&asset.body);
    }
    // How the scripts are put together may change, too.
    hash.update(&*BUNDLE);
    hex::encode(&hash.finalize()[..8])
});

/// Address of static file `name`, such as `shared/api.js`. Relative imports between the files keep the hash.
pub fn url(name: &str) -> String {
    format!("/static/{}/{name}", *VERSION)
}

/// Hash of all files, as it appears in their addresses.
pub fn version() -> &'static str {
    &VERSION
}

/// Address of the script with the messages of the language with this code.
pub fn language_url(code: impl AsRef<str>) -> String {
    url(&format!("languages/{}.js", code.as_ref()))
}

/// Addresses of all files that the surgeon's page loads, in whatever language its sessions are.
pub fn surgeon_urls() -> impl Iterator<Item = String> {
    let languages = Language::ALL.into_iter().map(|language| language_url(language.code()));
    WITH_BUNDLE.into_iter().chain([BUNDLED]).map(url).chain(languages)
}

/// What a browser gets as static file `name`; `None` if there is no such file.
pub fn content(name: &str) -> Option<&'static [u8]> {
    asset_of(name).map(Asset::content)
}

fn asset_of(name: &str) -> Option<&'static Asset> {
    ASSETS.iter().find(|asset| asset.name == name)
}

/// Static file `name` as it is in the repository; `None` if there is no such file.
pub fn body(name: &str) -> Option<&'static [u8]> {
    asset_of(name).map(|asset| &*asset.body)
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
        (status = 404, description = "No such file"),
    )
)]
pub(super) async fn asset(
    Path((version, folder, name)): Path<(String, String, String)>,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let name = format!("{folder}/{name}");
    let asset = asset_of(&name).ok_or_else(|| Error::NotFound(format!("There is no file {name}.")))?;

    // A page of an older version of the program asks with the older hash. It gets the current file, and must not keep
    // it.
    let cache = if version == *VERSION { "public, max-age=31536000, immutable" } else { "no-cache" };
    let packs = takes_gzip(&headers);
    let etag = if packs { format!("\"{}-gzip\"", *VERSION) } else { format!("\"{}\"", *VERSION) };
    let common = [(CACHE_CONTROL, cache.to_owned()), (ETAG, etag.clone()), (VARY, "accept-encoding".to_owned())];
    if headers.get(IF_NONE_MATCH).is_some_and(|known| known.as_bytes() == etag.as_bytes()) {
        return Ok((StatusCode::NOT_MODIFIED, common).into_response());
    }

    let kind = [(CONTENT_TYPE, content_type(&name))];
    if packs {
        return Ok((common, kind, [(CONTENT_ENCODING, "gzip")], asset.packed()).into_response());
    }
    Ok((common, kind, asset.content()).into_response())
}

/// Whether the browser takes compressed files (RFC 9110, section 12.5.3).
fn takes_gzip(headers: &HeaderMap) -> bool {
    let accepted = headers.get(ACCEPT_ENCODING).and_then(|value| value.to_str().ok()).unwrap_or_default();
    accepted.split(',').any(|coding| {
        let mut parts = coding.split(';').map(str::trim);
        let refused = |weight: &str| weight.strip_prefix("q=").is_some_and(|q| q.parse() == Ok(0.0));
        parts.next() == Some("gzip") && !parts.any(refused)
    })
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use std::io::Read;

    use axum::http::header::{ACCEPT_ENCODING, HeaderMap};
    use flate2::read::GzDecoder;

    use super::{ASSETS, asset_of, bundle, content, content_type, source, takes_gzip};

    #[test]
    fn every_file_of_the_folder_is_part_of_the_program_and_has_a_type() {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../web/static");

        for folder in std::fs::read_dir(root).unwrap() {
            let folder = folder.unwrap();
            for file in std::fs::read_dir(folder.path()).unwrap() {
                let name = Path::new(&folder.file_name()).join(file.unwrap().file_name());
                let name = name.to_str().unwrap().to_owned();
                assert!(asset_of(&name).is_some(), "{name} is not in the program");
                assert_ne!(content_type(&name), "application/octet-stream", "{name}");
            }
        }
    }

    #[test]
    fn the_scripts_of_every_page_can_be_put_together() {
        for asset in ASSETS.iter().filter(|asset| {
            content_type(&asset.name).starts_with("text/javascript") && asset.name != "offline/worker.js"
        }) {
            bundle(&asset.name, &source).unwrap();
        }
        let page = std::str::from_utf8(content("surgeon/page.js").unwrap()).unwrap();
        assert!(page.contains("// shared/live.js") && !page.contains("\nimport ") && !page.contains("\nexport "));
    }

    #[test]
    fn a_packed_file_is_the_file_and_much_smaller() {
        let page = asset_of("surgeon/page.js").unwrap();
        let mut unpacked = Vec::new();
        GzDecoder::new(page.packed()).read_to_end(&mut unpacked).unwrap();
        assert!(unpacked == page.content());
        assert!(page.packed().len() * 3 < unpacked.len(), "{} of {}", page.packed().len(), unpacked.len());
    }

    #[test]
    fn a_browser_that_does_not_take_compressed_files_gets_none() {
        let takes = |accepted: &'static str| {
            let mut headers = HeaderMap::new();
            headers.insert(ACCEPT_ENCODING, accepted.parse().unwrap());
            takes_gzip(&headers)
        };
        assert!(takes("gzip") && takes("br, gzip;q=0.5, *") && takes("deflate,gzip"));
        assert!(!takes("br") && !takes("gzip;q=0, br") && !takes("gzip; q=0.000") && !takes("") && !takes("x-gzip"));
        assert!(!takes_gzip(&HeaderMap::new()));
    }
}
