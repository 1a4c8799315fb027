//! Clips: sharp pictures in order of time. Simulated scans are made from them.

use std::sync::{Arc, OnceLock};

use sha2::{Digest, Sha256};

use crate::LearningError;
use parfocal_imaging::{GrayImage, reduced};

/// Sharp pictures in order of time, one for a still, and where patches may lie on them.
#[derive(Debug, Clone)]
pub struct Clip {
    frames: Vec<Arc<GrayImage>>,
    area: Area,
    /// The pictures at half the resolution, made on first use.
    coarse: Vec<OnceLock<GrayImage>>,
}

/// A rectangle of pixels: `left <= x < right`, `top <= y < bottom`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Area {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// Column after the last.
    pub right: usize,
    /// Row after the last.
    pub bottom: usize,
}

impl Clip {
    /// A clip of `frames`. Patches stay within `area`; if it is `None`, they may lie anywhere.
    ///
    /// # Errors
    /// If there is no frame, sizes differ, or less than 64x64 pixels can be used.
    pub fn new(frames: Vec<Arc<GrayImage>>, area: Option<Area>) -> Result<Self, LearningError> {
        let first = frames.first().ok_or_else(|| LearningError::new("there are no pictures to scan"))?;
        let size = (first.width, first.height);

        if let Some(index) = frames.iter().position(|frame| (frame.width, frame.height) != size) {
            bail!("picture {index} differs in size from the first one");
        }

        let area = area.unwrap_or(Area { left: 0, top: 0, right: size.0, bottom: size.1 });
        let area = Area { right: area.right.min(size.0), bottom: area.bottom.min(size.1), ..area };
        let width = area.right.saturating_sub(area.left);
        let height = area.bottom.saturating_sub(area.top);
        if width < 64 || height < 64 {
            bail!(
                "pictures must show at least 64x64 pixels to scan, in the square within their content area where they \
                 have one; these show {width}x{height}"
            );
        }

        let coarse = vec![OnceLock::new(); frames.len()];
        Ok(Self { frames, area, coarse })
    }

    /// A clip of one picture.
    ///
    /// # Errors
    /// If it is smaller than 64x64 pixels.
    pub fn still(picture: GrayImage) -> Result<Self, LearningError> {
        Self::new(vec![Arc::new(picture)], None)
    }

    /// The picture at time `t`. After its end the clip runs backwards, then forwards again, and so on.
    pub fn at(&self, t: usize) -> &GrayImage {
        &self.frames[self.index(t)]
    }

    /// The picture at time `t` at half the resolution: means of 2x2 pixels.
    pub fn coarse_at(&self, t: usize) -> &GrayImage {
        let index = self.index(t);
        let picture = &*self.frames[index];
        self.coarse[index].get_or_init(|| reduced(picture, picture.width / 2, picture.height / 2))
    }

    fn index(&self, t: usize) -> usize {
        to_and_fro(t, self.frames.len())
    }

    /// Number of pictures, at least 1.
    #[allow(clippy::len_without_is_empty, reason = "a clip is never empty")]
    pub const fn len(&self) -> usize {
        self.frames.len()
    }

    /// Adds everything that scans show of the clip to `hash`.
    pub(crate) fn digest(&self, hash: &mut Sha256) {
        let Area { left, top, right, bottom } = self.area;
        for number in [self.frames.len(), left, top, right, bottom] {
            hash.update((number as u64).to_le_bytes());
        }

        for frame in &self.frames {
            hash.update((frame.width as u64).to_le_bytes());
            let bytes: Vec<u8> = frame.data.iter().flat_map(|value| value.to_le_bytes()).collect();
            hash.update(bytes);
        }
    }

    /// Where patches may lie.
    pub const fn area(&self) -> Area {
        self.area
    }
}

/// Index of the picture at time `t` when `count` pictures are played forwards and backwards forever.
pub(super) fn to_and_fro(t: usize, count: usize) -> usize {
    let last = count.saturating_sub(1);
    if last == 0 {
        return 0;
    }
    let phase = t % (2 * last);
    phase.min(2 * last - phase)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unusable_pictures_are_refused() {
        let error = Clip::new(Vec::new(), None).unwrap_err().to_string();
        assert!(error.contains("no pictures"), "{error}");
        let small = GrayImage::new(70, 20, vec![0.0; 1400]).unwrap();
        let error = Clip::still(small).unwrap_err().to_string();
        assert!(error.ends_with("these show 70x20"), "{error}");
    }

    #[test]
    fn after_its_end_a_clip_runs_backwards() {
        let frames =
            [10.0, 20.0, 30.0].map(|level| Arc::new(GrayImage { width: 64, height: 64, data: vec![level; 4096] }));
        let clip = Clip::new(frames.to_vec(), None).unwrap();
        let played: Vec<f32> = (0..7).map(|t| clip.at(t).data[0]).collect();
        assert_eq!(played, [10.0, 20.0, 30.0, 20.0, 10.0, 20.0, 30.0]);
    }
}
