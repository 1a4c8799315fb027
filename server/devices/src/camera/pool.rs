//! Mosaics whose memory is reused once nobody holds them: allocating 4.4 MB per frame costs more than making the
//! picture.

use std::sync::Arc;

use parfocal_imaging::{FrameError, MosaicFrame};

/// Most mosaics that are remembered. The camera fills one. The control loop, the imaging thread and the threads of the
/// two larger sizes each work on one while their slots hold the next. A recorder that falls behind holds about ten. If
/// more are in use, the camera gets new memory from the system.
const MOST: usize = 20;

/// Frames of one size, shared with their users. Their memory is reused when the last other holder drops them.
#[derive(Debug)]
pub struct MosaicPool {
    width: usize,
    height: usize,
    given: Vec<Arc<MosaicFrame>>,
}

impl MosaicPool {
    /// An empty pool for frames of `width` x `height` samples.
    pub const fn new(width: usize, height: usize) -> Self {
        Self { width, height, given: Vec::new() }
    }

    /// Memory for a frame's samples; it still holds older values.
    pub fn blank(&mut self) -> Vec<u16> {
        let free = self.given.iter().position(|frame| Arc::strong_count(frame) == 1);
        let freed = free.and_then(|index| Arc::try_unwrap(self.given.swap_remove(index)).ok());
        freed.map_or_else(|| vec![0; self.width * self.height], MosaicFrame::into_samples)
    }

    /// Makes `samples` a frame to share, and remembers it to reuse its memory later.
    ///
    /// # Errors
    /// If the number of samples is not that of a frame.
    pub fn frame(&mut self, samples: Vec<u16>) -> Result<Arc<MosaicFrame>, FrameError> {
        let frame = Arc::new(MosaicFrame::new(self.width, self.height, samples)?);
        if self.given.len() < MOST {
            self.given.push(Arc::clone(&frame));
        }
        Ok(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_used_again_when_nobody_holds_the_frame() {
        let mut pool = MosaicPool::new(8, 4);
        let samples = pool.blank();
        let memory = samples.as_ptr();
        let frame = pool.frame(samples).unwrap();
        let other = pool.blank();
        assert_ne!(other.as_ptr(), memory, "still held");
        drop(frame);
        let again = pool.blank();
        assert_eq!(again.as_ptr(), memory);
    }

    #[test]
    fn a_held_frame_never_changes() {
        let mut pool = MosaicPool::new(4, 4);
        let held = pool.frame(vec![7; 16]).unwrap();
        for _ in 0..20 {
            let mut samples = pool.blank();
            samples.fill(9);
            drop(pool.frame(samples).unwrap());
        }

        assert_eq!(held.samples(), [7; 16]);
    }
}
