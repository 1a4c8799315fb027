//! Poses of the phantom to record: a hand-held trajectory, with each pose held still.

use rayon::prelude::*;

use super::{PosePictures, PoseSource, RecordError};
use crate::scans::recorded::put_square;
use parfocal_base::FocalPower;
use parfocal_devices::camera::CameraError;
use parfocal_devices::simulation::phantom::{SENSOR_HEIGHT, SENSOR_WIDTH, Trajectory};
use parfocal_imaging::{GrayImage, MosaicFrame, Reconstructor, RgbImage};

/// The poses of a [`Trajectory`].
pub struct PhantomPoses {
    trajectory: Trajectory,
    reconstructor: Reconstructor,
}

impl PhantomPoses {
    /// The poses of `trajectory`, one after another.
    pub fn new(trajectory: Trajectory) -> Self {
        Self { trajectory, reconstructor: Reconstructor::default() }
    }
}

impl PoseSource for PhantomPoses {
    fn take(&mut self, pose: usize, powers: &[FocalPower]) -> Result<PosePictures, RecordError> {
        let beyond = || CameraError::BadSource(format!("the trajectory has no pose {pose}"));
        let still = pose.checked_sub(1).and_then(|index| self.trajectory.still(index)).ok_or_else(beyond)?;

        let tools = || (vec![0; SENSOR_WIDTH * SENSOR_HEIGHT], self.reconstructor.clone());
        let picture = |(samples, reconstructor): &mut (Vec<u16>, Reconstructor), (number, power): (u16, FocalPower)| {
            still.expose(number, power, samples);
            let mosaic = MosaicFrame::new(SENSOR_WIDTH, SENSOR_HEIGHT, std::mem::take(samples))
                .map_err(|error| CameraError::Failed(error.to_string()))?;
            let mut rgb = RgbImage::default();
            let mut gray = GrayImage::default();

            reconstructor.reconstruct(&mosaic, &mut rgb, &mut gray);
            // The part that policies see is made as for policies: the picture for people may differ from it by a gray
            // level.
            put_square(&mut gray, still.seen(), &reconstructor.gray_square(&mosaic, still.seen()));
            *samples = mosaic.into_samples();
            Ok(gray)
        };

        let numbered: Vec<(u16, FocalPower)> = (0..).zip(powers.iter().copied()).collect();
        let pictures = numbered.into_par_iter().map_init(tools, picture).collect::<Result<_, CameraError>>()?;
        Ok(PosePictures { pictures, patch: still.patch(), truth: Some(still.optimal()) })
    }
}
