//! Whether a video's file holds all that its header announces. A copy that was cut off looks whole from its beginning.

use std::path::Path;
use std::process::{Command, Stdio};

use super::video::input;

/// Part of the video, and most seconds, that may be missing at the end: encoders differ in where a video ends.
const TOLERANCE: (f64, f64) = (0.2, 1.0);

/// How much of a video can be read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutOff {
    /// Seconds of pictures in the file.
    pub read: f64,
    /// Seconds that the header announces.
    pub announced: f64,
}

impl std::fmt::Display for CutOff {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "only its first {:.1} of {:.1} seconds can be read", self.read, self.announced)
    }
}

/// How much of the video at `path` can be read, if that is less than its header announces. `None` also if the header
/// announces nothing, or the program `ffprobe`, which comes with ffmpeg, is missing.
pub fn cut_off(path: &Path) -> Option<CutOff> {
    let text = probe(path, &["-show_entries", ENTRIES, "-of", "json"])?;
    let (begin, announced) = announced(&text)?;
    let least = begin + announced - (TOLERANCE.0 * announced).min(TOLERANCE.1);
    let whole = |end: Option<f64>| end.is_some_and(|end| end >= least);

    // The last seconds are found without reading the whole of a long video.
    let tail = format!("{}%", (least - TOLERANCE.1).max(0.0));
    if whole(last_end(path, &["-read_intervals", &tail])) {
        return None;
    }

    let end = last_end(path, &[]);
    if whole(end) {
        return None;
    }
    Some(CutOff { read: (end.unwrap_or(begin) - begin).max(0.0), announced })
}

const ENTRIES: &str = "stream=start_time,duration,nb_frames,avg_frame_rate:stream_tags=DURATION";

/// Begin and length in seconds, from what `ffprobe` says of the first stream of pictures.
fn announced(text: &str) -> Option<(f64, f64)> {
    let whole: serde_json::Value = serde_json::from_str(text).ok()?;
    let stream = whole.get("streams")?.get(0)?;
    let field = |name: &str| stream.get(name).and_then(serde_json::Value::as_str);
    let number = |name: &str| field(name).and_then(|text| text.parse::<f64>().ok());

    // Some headers keep the number of pictures where ffprobe reckons the duration from the file's length.
    let rate = field("avg_frame_rate").and_then(|rate| {
        let (pictures, seconds) = rate.split_once('/')?;
        Some(pictures.parse::<f64>().ok()? / seconds.parse::<f64>().ok()?)
    });
    let counted = number("nb_frames").zip(rate).map(|(pictures, rate)| pictures / rate);

    let tagged = stream.get("tags").and_then(|tags| tags.get("DURATION")?.as_str()).and_then(seconds);
    let longest = [number("duration"), counted, tagged].into_iter().flatten().filter(|seconds| seconds.is_finite());
    Some((number("start_time").unwrap_or(0.0), longest.reduce(f64::max)?))
}

/// Seconds of `00:01:02.5`.
fn seconds(text: &str) -> Option<f64> {
    text.split(':').try_fold(0.0, |sum, part| Some(60.0 * sum + part.trim().parse::<f64>().ok()?))
}

/// When the last picture that is there ends, in seconds.
fn last_end(path: &Path, where_to_look: &[&str]) -> Option<f64> {
    let listed = ["-show_entries", "packet=pts_time,duration_time", "-of", "csv=p=0"];
    let text = probe(path, &[where_to_look, &listed].concat())?;
    let end = |line: &str| {
        let mut fields = line.split(',').map(str::parse::<f64>);
        Some(fields.next()?.ok()? + fields.next().and_then(Result::ok).unwrap_or(0.0))
    };
    text.lines().filter_map(end).reduce(f64::max)
}

fn probe(path: &Path, arguments: &[&str]) -> Option<String> {
    let mut command = Command::new("ffprobe");
    command.args(["-v", "error", "-select_streams", "v:0"]).args(arguments).arg(input(path)).stdin(Stdio::null());
    String::from_utf8(command.output().ok()?.stdout).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_announced_duration_counts() {
        let stream = |fields: &str| announced(&format!("{{\"streams\": [{{{fields}}}]}}"));
        assert_eq!(stream(r#""duration": "8.0", "start_time": "1.5""#), Some((1.5, 8.0)));
        let cut = r#""duration": "4.04", "nb_frames": "200", "avg_frame_rate": "25/1""#;
        assert_eq!(stream(cut), Some((0.0, 8.0)));
        assert_eq!(stream(r#""tags": {"DURATION": "00:01:02.500000000"}"#), Some((0.0, 62.5)));
        assert_eq!(stream(r#""avg_frame_rate": "0/0""#), None);
        assert_eq!(announced("{}"), None);
    }
}
