//! Counts of the work for viewers so far.

use std::time::Duration;

use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;

use parfocal_base::step::StepRecord;
use parfocal_imaging::Size;

/// Upper ends of the latency histogram's buckets, seconds. They lie around the limits: 1 ms for the median and 3 ms for
/// the 99th percentile.
const LATENCY_BUCKETS: [f64; 10] = [1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 3e-3, 5e-3, 1e-2, 2e-2, 5e-2];

/// Upper ends of the buckets for a policy's step, seconds: a hill-climber takes some microseconds, a network more.
const STEP_BUCKETS: [f64; 10] = [1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 2e-2];

/// Upper ends of the buckets for making a picture, seconds: from a cell picture's millisecond to several frame
/// intervals.
const MAKING_BUCKETS: [f64; 10] = [5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 3e-2, 5e-2, 0.1, 0.2];

/// A metric for each size of pictures, labelled with the size's name.
pub type BySize<M> = Family<[(&'static str, &'static str); 1], M>;

/// Counts of the imaging threads' work so far.
///
/// Times are kept only for frames outside a session's settings. They differ between a network and a hill-climber,
/// directly or through the load on the machine. So a comparison of them before and after a setting could unblind it.
#[derive(Debug)]
pub struct Counts {
    /// Viewers that want pictures now.
    pub viewers: BySize<Gauge>,
    /// Frames encoded as JPEG.
    pub encoded: BySize<Counter>,
    /// Bytes of these JPEGs.
    pub jpeg_bytes: BySize<Counter>,
    /// Time from exposure to lens command, seconds, of the frames that reached the imaging thread.
    pub latency: Histogram,
    /// Time that a policy took for its step, seconds.
    pub steps: Histogram,
    /// Time to develop and encode a picture, seconds.
    pub making: BySize<Histogram>,
    sizes: [SizeCounts; Size::ALL.len()],
}

/// The counts of one size.
#[derive(Debug)]
pub(super) struct SizeCounts {
    pub(super) viewers: Gauge,
    pub(super) encoded: Counter,
    pub(super) jpeg_bytes: Counter,
    making: Histogram,
}

impl Default for Counts {
    fn default() -> Self {
        let viewers = BySize::<Gauge>::default();
        let encoded = BySize::<Counter>::default();
        let jpeg_bytes = BySize::<Counter>::default();
        let making = BySize::<Histogram>::new_with_constructor(|| Histogram::new(MAKING_BUCKETS));
        let sizes = Size::ALL.map(|size| {
            let label = [("size", size.name())];
            SizeCounts {
                viewers: viewers.get_or_create_owned(&label),
                encoded: encoded.get_or_create_owned(&label),
                jpeg_bytes: jpeg_bytes.get_or_create_owned(&label),
                making: making.get_or_create_owned(&label),
            }
        });

        let latency = Histogram::new(LATENCY_BUCKETS);
        let steps = Histogram::new(STEP_BUCKETS);
        Self { viewers, encoded, jpeg_bytes, latency, steps, making, sizes }
    }
}

impl Counts {
    pub(super) const fn of(&self, size: Size) -> &SizeCounts {
        &self.sizes[size as usize]
    }

    /// Records the times of the loop's `step`, unless it belongs to a setting.
    pub(super) fn note_step(&self, step: &StepRecord) {
        if step.segment.is_some() {
            return;
        }

        self.latency.observe(seconds(step.latency_micros));
        if step.policy.is_some() {
            self.steps.observe(seconds(step.policy_micros));
        }
    }

    /// Records the time that the picture of `step`'s frame `took` at `size`, unless it belongs to a setting.
    pub(super) fn note_picture(&self, size: Size, step: &StepRecord, took: Duration) {
        if step.segment.is_none() {
            self.of(size).making.observe(took.as_secs_f64());
        }
    }
}

fn seconds(micros: u32) -> f64 {
    f64::from(micros) / 1e6
}

#[cfg(test)]
mod tests {
    use prometheus_client::encoding::text::encode;
    use prometheus_client::registry::Registry;
    use uuid::Uuid;

    use super::*;
    use parfocal_base::FocalPower;
    use parfocal_base::PolicyName;
    use parfocal_base::clock::Moment;
    use parfocal_base::ids::SegmentId;

    fn step(segment: Option<SegmentId>) -> StepRecord {
        StepRecord {
            frame: 1,
            exposed_at: Moment::default(),
            segment,
            policy: Some(PolicyName::new("cnn-learned")),
            asked: FocalPower::MIDDLE,
            measured: None,
            metric: None,
            policy_micros: 300,
            latency_micros: 900,
            held: None,
            optimal: None,
            patch: (240, 120),
        }
    }

    fn counted(counts: &Counts) -> Vec<String> {
        let mut registry = Registry::default();
        registry.register("latency", "Latency", counts.latency.clone());
        registry.register("step", "Step", counts.steps.clone());
        registry.register("picture", "Picture", counts.making.clone());

        let mut text = String::new();
        encode(&mut text, &registry).unwrap();
        text.lines().filter(|line| line.contains("_count") && !line.ends_with(" 0")).map(str::to_owned).collect()
    }

    #[test]
    fn no_time_of_a_setting_is_kept() {
        let counts = Counts::default();
        let note = |step: &StepRecord| {
            counts.note_step(step);
            counts.note_picture(Size::Half, step, Duration::from_millis(4));
        };

        note(&step(Some(SegmentId(Uuid::nil()))));
        assert_eq!(counted(&counts), Vec::<String>::new());
        note(&step(None));
        assert_eq!(counted(&counts), ["latency_count 1", "step_count 1", "picture_count{size=\"half\"} 1"]);
    }
}
