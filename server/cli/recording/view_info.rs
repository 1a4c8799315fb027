//! What a recording of the view holds, for `parfocal recording info`.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use serde::Serialize;

use parfocal_recording::{Ended, ViewHeader, ViewRecording, ViewRow};

/// What is printed.
#[derive(Debug, Serialize)]
pub(super) struct ViewInfo {
    path: String,
    #[serde(flatten)]
    header: ViewHeader,
    frames: usize,
    seconds: f64,
    fps: Option<f64>,
    /// Frames that the camera numbered but that have no picture here.
    frames_missing: u64,
    /// Bytes of the pictures.
    bytes: u64,
    /// The sizes of the pictures, smallest first.
    sizes: Vec<SizeInfo>,
    /// Descriptions of the pictures that cannot be read.
    pub(super) damaged: Vec<String>,
}

/// Pictures of one size.
#[derive(Debug, Serialize)]
struct SizeInfo {
    width: u32,
    height: u32,
    frames: usize,
}

/// Looks at the recording and checks every picture.
pub(super) fn look(path: &Path, recording: &ViewRecording) -> ViewInfo {
    let rows = recording.rows();
    let seconds = seconds(rows);
    let numbered = rows
        .first()
        .zip(rows.last())
        .map_or(0, |(first, last)| last.number.saturating_sub(first.number).saturating_add(1));

    let mut sizes: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for row in rows {
        *sizes.entry((row.width, row.height)).or_default() += 1;
    }

    ViewInfo {
        path: path.display().to_string(),
        header: recording.header().clone(),
        frames: rows.len(),
        seconds,
        fps: (seconds > 0.0).then(|| (rows.len() - 1) as f64 / seconds),
        frames_missing: numbered.saturating_sub(rows.len() as u64),
        bytes: recording.bytes(),
        sizes: sizes.into_iter().map(|((width, height), frames)| SizeInfo { width, height, frames }).collect(),
        damaged: recording.check(),
    }
}

/// Seconds from the first picture to the last.
fn seconds(rows: &[ViewRow]) -> f64 {
    let span = rows.first().zip(rows.last()).map_or(0, |(first, last)| last.time.saturating_sub(first.time));
    span as f64 / 1e9
}

/// `info` in words.
pub(super) fn describe(info: &ViewInfo) -> String {
    let ViewInfo { header, frames, seconds, bytes, .. } = info;
    let mut text = String::new();

    let _ = writeln!(text, "recording    {} by {}, pictures of the view", header.started, header.software);
    let _ = writeln!(text, "camera       {}", header.camera);
    if let Some(session) = &header.session {
        let _ = writeln!(text, "session      {session}");
    }

    let rate = info.fps.map_or(String::new(), |fps| format!(", {fps:.1} a second"));
    let _ = writeln!(text, "frames       {frames} over {seconds:.1} s{rate}");
    for SizeInfo { width, height, frames } in &info.sizes {
        let _ = writeln!(text, "             {frames} of {width}x{height}");
    }
    let _ = writeln!(text, "missing      {} that were not made for viewers", info.frames_missing);
    let _ = writeln!(text, "size         {:.1} MB", *bytes as f64 / 1e6);

    text + &state(header.ended.as_ref(), "every picture is whole", &info.damaged)
}

/// How a recording `ended`, and what the check found: `well`, if nothing is damaged.
pub(super) fn state(ended: Option<&Ended>, well: &str, damaged: &[String]) -> String {
    let cut = "cut short, or still being recorded; the frames above are whole".to_owned();
    let ended = ended.map_or(cut, Ended::to_string);
    let checked = if damaged.is_empty() { well } else { "damaged:" };
    let mut text = format!("ended        {ended}\nchecked      {checked}\n");
    for damage in damaged {
        let _ = writeln!(text, "  {damage}");
    }
    text
}
