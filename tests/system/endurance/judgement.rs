//! Limits on growth for a long run.

use super::sample::Sample;

/// Limit on the growth of memory after the warm-up, as a fraction.
const MEMORY: f64 = 0.05;
/// Limit on the growth of the loop's 99th percentile, as a factor.
const LATENCY: f64 = 2.0;
/// A 99th percentile below this counts as this, in microseconds: doubling it does not matter to anybody.
const LATENCY_FLOOR: f64 = 1000.0;

/// The database is read over up to three connections, made when needed and closed after a long idle time. So this many
/// may exist after a run that did not exist before; each has three open files and a thread.
const READERS: u64 = 2;
const FILES_OF_A_READER: u64 = 3;

/// Fraction of the samples that is warm-up: caches fill, every viewer has come once, every policy has run.
const WARM_UP: f64 = 0.25;

/// Describes everything that has grown and must not; empty if nothing has. `quiet` are samples without any viewer or
/// session: one from before and one from after.
pub fn judge(samples: &[Sample], quiet: [Sample; 2]) -> Vec<String> {
    let warm = &samples[(samples.len() as f64 * WARM_UP).ceil() as usize..];
    assert!(warm.len() >= 6, "too few samples to judge by: {}", samples.len());
    let (early, late) = (&warm[..warm.len() / 3], &warm[warm.len() - warm.len() / 3..]);
    let mut complaints = Vec::new();

    let memory = |part: &[Sample]| median(part.iter().map(|sample| sample.memory as f64).collect());
    let growth = memory(late) / memory(early) - 1.0;
    if growth >= MEMORY {
        complaints.push(format!("memory grew by {:.1} % after the warm-up", growth * 100.0));
    }

    let p99 = |part: &[Sample]| median(part.iter().map(|sample| f64::from(sample.p99)).collect());
    let before = p99(early).max(LATENCY_FLOOR);
    if p99(late) > LATENCY * before {
        complaints.push(format!("the loop's p99 rose from {before:.0} to {:.0} µs", p99(late)));
    }

    let [before, after] = quiet;
    for (what, before, after, spare) in [
        ("descriptors", before.descriptors, after.descriptors, READERS * FILES_OF_A_READER),
        ("threads", before.threads, after.threads, READERS),
    ] {
        if after > before + spare {
            complaints.push(format!("{what} leaked: {before} before, {after} after everyone left"));
        }
    }
    complaints
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(memory: u64, p99: u32) -> Sample {
        Sample { at: 0.0, memory, descriptors: 40, threads: 20, database: 0, steps: 3000, p99 }
    }

    fn course(memory: impl Fn(u64) -> u64, p99: impl Fn(u64) -> u32) -> Vec<Sample> {
        (0..60).map(|minute| sample(memory(minute), p99(minute))).collect()
    }

    #[test]
    fn a_steady_server_passes_also_where_it_warms_up_and_where_one_sample_stands_out() {
        let warming = |minute| if minute < 10 { 300_000 } else { 400_000 };
        let outlier = |minute| if minute == 50 { 90_000 } else { 900 };
        assert_eq!(judge(&course(warming, outlier), [sample(0, 0); 2]), Vec::<String>::new());
    }

    #[test]
    fn growth_is_reported() {
        let leak = course(|minute| 400_000 + minute * 1000, |_| 900);
        assert_eq!(judge(&leak, [sample(0, 0); 2]), ["memory grew by 7.1 % after the warm-up"]);

        // After a warm-up of 15 minutes the median of the first third is at minute 22, that of the last third at minute
        // 52.
        let slower = course(|_| 400_000, |minute| 1000 + 100 * minute as u32);
        assert_eq!(judge(&slower, [sample(0, 0); 2]), Vec::<String>::new(), "1.94 times");
        let slower = course(|_| 400_000, |minute| 900 + 4 * (minute * minute) as u32);
        assert_eq!(judge(&slower, [sample(0, 0); 2]), ["the loop's p99 rose from 2836 to 11716 µs"]);

        let more = |descriptors| {
            let after = Sample { descriptors, ..sample(0, 0) };
            judge(&course(|_| 400_000, |_| 900), [sample(0, 0), after])
        };
        assert_eq!(more(46), Vec::<String>::new(), "two more connections of the database");
        assert_eq!(more(47), ["descriptors leaked: 40 before, 47 after everyone left"]);
    }
}
