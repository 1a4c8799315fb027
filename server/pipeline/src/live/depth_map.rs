//! The depth map: which places of the picture are in focus, and on which side of the lens the others are. At each place
//! a tracker looks on, of the kind that drives the lens by a belief, while something else moves the lens. The map is
//! made only while somebody looks at it, by a thread that takes the latest frame whenever it is done with one.

use std::sync::Arc;

use serde::Serialize;
use tokio::sync::watch;

use super::frame_thread::{FrameSlot, FrameThread};
use crate::control::{ControlledFrame, Eye, GAP, cells};
use parfocal_autofocus::belief::{SURE, Sides};
use parfocal_autofocus::networks::compute_on_this_thread;
use parfocal_autofocus::{Observation, Policy, PolicyError, Registry};
use parfocal_base::clock::Moment;
use parfocal_base::{FocalPower, PolicyName, guarded};
use parfocal_imaging::{ContentArea, PATCH_SIDE, PatchArea};

/// The policy whose belief is asked at each place.
const BELIEVER: &str = "parfocal";

/// Places are as far apart as if this many shared the whole picture.
const PLACES: f64 = 24.0;

/// Where the optima of the places of one frame are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DepthMap {
    /// When the frame was exposed.
    #[serde(skip)]
    pub exposed_at: Moment,
    /// The places, row by row.
    pub places: Vec<PlaceDepth>,
}

/// What is believed of one place.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaceDepth {
    /// Mosaic cells from the left edge of the picture to the place.
    pub x: usize,
    /// Mosaic cells from the top edge of the picture to the place.
    pub y: usize,
    /// Where its optimum is, seen from the lens. By how much is not told: such a number, given as sure, is right for
    /// other optics only seven times in ten (`docs/notebook.md`).
    pub side: Side,
}

/// Where an optimum is, seen from the lens, as far as the belief is sure of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Within the depth of focus.
    InFocus,
    /// At a higher focal power.
    Higher,
    /// At a lower focal power.
    Lower,
    /// The belief is not sure.
    Unknown,
}

impl Side {
    /// The side that `belief` (see [`Decision::belief`](parfocal_autofocus::Decision::belief)) is sure of, with the
    /// lens at `focal_power`.
    pub fn of(belief: &[f32], focal_power: FocalPower) -> Self {
        let Sides { below, here, above } = Sides::of(belief, focal_power.get());
        let sides = [(here, Self::InFocus), (above, Self::Higher), (below, Self::Lower)];
        sides.into_iter().find(|(share, _)| *share >= SURE).map_or(Self::Unknown, |(_, side)| side)
    }
}

/// The latest map; `None` while there is none.
pub type DepthMaps = watch::Receiver<Option<Arc<DepthMap>>>;

/// The thread that makes depth maps; ends when dropped.
pub(super) struct Surveyor {
    maps: watch::Sender<Option<Arc<DepthMap>>>,
    thread: FrameThread,
}

impl Surveyor {
    /// Starts the thread. `eye` makes what trackers of `registry` see. Maps go to `maps` while it has receivers.
    ///
    /// # Errors
    /// If the system cannot create a thread.
    pub(super) fn start(
        eye: Eye,
        registry: Registry,
        maps: watch::Sender<Option<Arc<DepthMap>>>,
    ) -> std::io::Result<Self> {
        let worker = Worker { maps: maps.clone(), survey: Survey::new(eye, registry) };
        let thread = FrameThread::start("depth-map".into(), |slot| worker.run(&slot))?;
        Ok(Self { maps, thread })
    }

    /// Hands `frame` over if somebody looks at the map; never waits. During a session's settings nothing is mapped: the
    /// map would tell how the lens moves.
    pub(super) fn offer(&self, frame: &ControlledFrame) {
        if self.maps.receiver_count() > 0 && frame.record.segment.is_none() {
            self.thread.offer(frame);
        }
    }
}

struct Worker {
    maps: watch::Sender<Option<Arc<DepthMap>>>,
    survey: Survey,
}

impl Worker {
    fn run(mut self, slot: &FrameSlot) {
        parfocal_base::priority::lower_further();
        compute_on_this_thread();
        let mut told = false;
        while !slot.is_closed() {
            let Some(frame) = slot.take(GAP) else {
                self.survey.end();
                self.maps.send_replace(None);
                continue;
            };

            // One bad picture must not end the live view.
            match guarded(|| self.survey.see(&frame)) {
                Ok(Ok(map)) => drop(self.maps.send_replace(map.map(Arc::new))),
                Ok(Err(error)) => {
                    // Not once a frame.
                    if !told {
                        tracing::warn!(%error, "no depth map can be made");
                    }
                    told = true;
                    self.maps.send_replace(None);
                }
                Err(_) => {
                    tracing::error!("a depth map could not be made; continuing with the next frame");
                    self.survey.end();
                }
            }
        }
    }
}

/// The trackers at the places, and what they saw last.
struct Survey {
    eye: Eye,
    registry: Registry,
    onlookers: Vec<Onlooker>,
    /// When the latest frame was exposed.
    latest: Option<Moment>,
}

/// A tracker at one place.
struct Onlooker {
    patch: PatchArea,
    tracker: Box<dyn Policy>,
}

impl Survey {
    const fn new(eye: Eye, registry: Registry) -> Self {
        Self { eye, registry, onlookers: Vec::new(), latest: None }
    }

    /// Forgets everything, and frees the trackers.
    fn end(&mut self) {
        self.onlookers = Vec::new();
        self.latest = None;
    }

    /// The map of `frame`; `None` while nobody knows where the lens is.
    ///
    /// # Errors
    /// If there is no tracker.
    fn see(&mut self, frame: &ControlledFrame) -> Result<Option<DepthMap>, PolicyError> {
        let exposed_at = frame.frame.exposed_at;
        if self.latest.is_some_and(|latest| exposed_at.since(latest) > GAP) {
            self.end();
        }
        let Some(focal_power) = frame.record.measured else {
            self.end();
            return Ok(None);
        };

        self.place(&places(cells(&frame.frame.image), frame.content_area.as_ref()))?;
        self.latest = Some(exposed_at);

        let look_on = |Onlooker { patch, tracker }: &mut Onlooker| {
            let view = self.eye.look(&frame.frame.image, *patch, tracker.field_of_view());
            let belief = tracker.look_on(&Observation { view: &view, focal_power }, frame.record.asked)?;
            let side = Side::of(&belief, focal_power);
            Some(PlaceDepth { x: patch.x + patch.width / 2, y: patch.y + patch.height / 2, side })
        };
        Ok(Some(DepthMap { exposed_at, places: self.onlookers.iter_mut().filter_map(look_on).collect() }))
    }

    /// Puts trackers at `patches`. Those of nearly the same places stay, and follow the content area's small motions.
    fn place(&mut self, patches: &[PatchArea]) -> Result<(), PolicyError> {
        let name = PolicyName::new(BELIEVER);
        let mut before = std::mem::take(&mut self.onlookers);
        let mut onlooker = |&patch: &PatchArea| {
            let tracker = match before.iter().position(|onlooker| onlooker.patch.is_near(patch)) {
                Some(index) => before.swap_remove(index).tracker,
                None => self.registry.build(&name)?,
            };
            Ok(Onlooker { patch, tracker })
        };
        self.onlookers = patches.iter().map(&mut onlooker).collect::<Result<_, _>>()?;
        Ok(())
    }
}

/// The patches of a map, row by row: a square grid around the middle of the circle `content`, as far as patches lie
/// in it; of the whole picture of `width` x `height` cells, if there is no circle.
fn places((width, height): (usize, usize), content: Option<&ContentArea>) -> Vec<PatchArea> {
    let side = PATCH_SIDE as f64;
    let half = side / 2.0;
    let (middle, area) = match content {
        Some(circle) => ((circle.x, circle.y), std::f64::consts::PI * circle.radius.powi(2)),
        None => ((width as f64 / 2.0, height as f64 / 2.0), (width * height) as f64),
    };
    let apart = (area / PLACES).sqrt().max(side);

    let is_in_circle = |x: f64, y: f64| {
        let reach = |circle: &ContentArea| ((x - circle.x).abs() + half).hypot((y - circle.y).abs() + half);
        content.is_none_or(|circle| reach(circle) <= circle.radius)
    };

    // Only whole patches inside the picture.
    let steps = |middle: f64, length: usize| {
        let first = ((half - middle) / apart).ceil() as i64;
        let last = ((length as f64 - half - middle) / apart).floor() as i64;
        (first..=last).map(move |step| middle + step as f64 * apart)
    };
    let rows = steps(middle.1, height);
    rows.flat_map(|y| steps(middle.0, width).map(move |x| (x, y)))
        .filter(|&(x, y)| is_in_circle(x, y))
        .map(|(x, y)| PatchArea {
            x: (x - half).round() as usize,
            y: (y - half).round() as usize,
            width: PATCH_SIDE,
            height: PATCH_SIDE,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::control::Aim;
    use parfocal_base::IN_FOCUS;
    use parfocal_base::step::StepRecord;
    use parfocal_devices::camera::{Frame, FrameImage};
    use parfocal_devices::simulation::blur::gaussian_blur;
    use parfocal_devices::simulation::texture::texture;
    use parfocal_imaging::{GrayImage, Reconstructor, RgbImage};

    /// Rows and columns of each half of the scene.
    const SIDE: usize = 128;

    /// Frame `number` of a scene whose left half is in focus at 0.3 and its right half at 0.7.
    fn frame(number: u64, focal_power: f64, [left, right]: &[GrayImage; 2]) -> ControlledFrame {
        let blurred = |half, optimum: f64| gaussian_blur(half, 6.0 * (focal_power - optimum).abs());
        let [left, right] = [blurred(left, 0.3), blurred(right, 0.7)];
        let row = |y: usize| {
            let of = |half: &GrayImage| half.data[y * SIDE..][..SIDE].to_vec();
            [of(&left), of(&right)].concat()
        };
        let data = (0..SIDE).flat_map(row).flat_map(|level| [level.round() as u8; 3]).collect();
        let exposed_at = Moment::from_nanos(number * 40_000_000);
        let focal_power = FocalPower::nearest(focal_power);
        ControlledFrame {
            frame: Frame {
                number,
                exposed_at,
                exposure: Duration::ZERO,
                image: FrameImage::Rgb(Arc::new(RgbImage { width: 2 * SIDE, height: SIDE, data })),
                truth: None,
            },
            patch: PatchArea { x: 112, y: 48, width: PATCH_SIDE, height: PATCH_SIDE },
            content_area: None,
            aim: Aim::default(),
            jumps: 0,
            record: StepRecord {
                frame: number,
                exposed_at,
                segment: None,
                policy: None,
                asked: focal_power,
                measured: Some(focal_power),
                metric: None,
                policy_micros: 0,
                latency_micros: 0,
                held: None,
                optimal: None,
                patch: (112, 48),
            },
            belief: None,
            left_by_session: false,
        }
    }

    fn survey() -> Survey {
        Survey::new(Eye::new(Reconstructor::default()), Registry::standard())
    }

    #[test]
    fn two_halves_at_two_depths_are_told_apart_while_the_lens_swings() {
        let halves = [texture(3, SIDE), texture(8, SIDE)];
        let mut survey = survey();
        let mut map = |number: u64| {
            let focal_power = 0.5 + 0.3 * (number as f64 / 10.0).sin();
            (focal_power, survey.see(&frame(number, focal_power, &halves)).unwrap().unwrap())
        };
        let (_, first) = map(0);
        assert!(first.places.iter().all(|place| place.side == Side::Unknown), "one frame tells little: {first:?}");

        // Two swings, of which the first tells where the halves are.
        let [mut all, mut told, mut wrong] = [0; 3];
        for (focal_power, map) in (1..126).map(map).skip(62) {
            for place in map.places.iter().filter(|place| place.x.abs_diff(SIDE) > 32) {
                let truth = if place.x < SIDE { 0.3 } else { 0.7 };
                let distance = truth - focal_power;
                all += 1;
                told += usize::from(place.side != Side::Unknown);
                wrong += usize::from(match place.side {
                    Side::Higher => distance < 0.0,
                    Side::Lower => distance > 0.0,
                    Side::InFocus => distance.abs() > 2.0 * IN_FOCUS,
                    Side::Unknown => false,
                });
            }
        }
        assert!(told > all / 2 && wrong * 50 < told, "{told} of {all} told, {wrong} wrong");
    }

    #[test]
    fn after_a_gap_and_without_a_lens_everything_is_forgotten() {
        let halves = [texture(3, SIDE), texture(8, SIDE)];
        let mut survey = survey();
        // How many places are told after a swing of the lens, or a frame, from the frame `first` on.
        let told = |survey: &mut Survey, first: u64, frames: u64| {
            let focal_power = |number: u64| 0.5 + 0.3 * (number as f64 / 10.0).sin();
            let map = |number| survey.see(&frame(number, focal_power(number), &halves)).unwrap().unwrap();
            let last = (first..first + frames).map(map).last().unwrap();
            last.places.iter().filter(|place| place.side != Side::Unknown).count()
        };
        assert!(told(&mut survey, 0, 40) > 3);
        assert!(told(&mut survey, 40, 1) > 3);
        assert_eq!(told(&mut survey, 70, 1), 0, "1.2 seconds are missing");

        assert!(told(&mut survey, 71, 40) > 3);
        let mut unknown = frame(111, 0.5, &halves);
        unknown.record.measured = None;
        assert_eq!(survey.see(&unknown).unwrap(), None);
        assert_eq!(told(&mut survey, 112, 1), 0);
    }

    #[test]
    fn what_is_known_is_kept_while_the_circle_moves_a_little_and_loses_places() {
        let halves = [texture(3, SIDE), texture(8, SIDE)];
        let mut survey = survey();
        let mut map = |number: u64, circle: ContentArea| {
            let mut frame = frame(number, 0.5 + 0.3 * (number as f64 / 10.0).sin(), &halves);
            frame.content_area = Some(circle);
            survey.see(&frame).unwrap().unwrap().places
        };
        let known = |places: &[PlaceDepth]| places.iter().filter(|place| place.side != Side::Unknown).count();

        let circle = ContentArea { x: 128.0, y: 64.0, radius: 90.0, confidence: 1.0 };
        let before = (0..40).map(|number| map(number, circle)).last().unwrap();
        let after = map(40, ContentArea { x: 134.0, radius: 72.0, ..circle });
        assert!(after.len() < before.len() && known(&after) > 3, "{before:?} {after:?}");
        assert_eq!(known(&map(41, ContentArea { x: 60.0, radius: 50.0, ..circle })), 0);
    }

    #[test]
    fn the_places_lie_in_the_circle_or_fill_the_picture() {
        let circle = ContentArea { x: 250.0, y: 140.0, radius: 120.0, confidence: 1.0 };
        let inside = places((512, 272), Some(&circle));
        assert_eq!(inside.len(), 21);
        assert!(inside.contains(&PatchArea { x: 234, y: 124, width: 32, height: 32 }), "its middle: {inside:?}");
        for patch in &inside {
            for (x, y) in [(0, 0), (32, 0), (0, 32), (32, 32)] {
                let (x, y) = ((patch.x + x) as f64 - circle.x, (patch.y + y) as f64 - circle.y);
                assert!(x.hypot(y) < circle.radius + 1.0, "{patch:?}");
            }
        }

        let whole = places((512, 272), None);
        assert!((15..=24).contains(&whole.len()), "{whole:?}");
        assert!(whole.iter().all(|patch| patch.x + 32 <= 512 && patch.y + 32 <= 272));
        assert!(whole.iter().any(|patch| patch.x < 60) && whole.iter().any(|patch| patch.x > 420));
        assert_eq!(places((32, 32), None).len(), 1);
        assert_eq!(places((31, 400), None), []);
        // A circle of which little is in the picture leaves no place.
        assert_eq!(places((512, 272), Some(&ContentArea { x: -500.0, y: 1e9, radius: 50.0, confidence: 0.1 })), []);
    }
}
