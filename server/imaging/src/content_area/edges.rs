//! Candidate points of the content area's edge: on each of 16 strips the best one from the left and
//! from the right.

use crate::frame::GrayImage;

/// Strips across the picture.
const STRIPS: u32 = 16;

/// Most candidates: two per strip.
pub(super) const CANDIDATES: f64 = 2.0 * STRIPS as f64;

/// Gradient at which an edge counts as strong, in gray levels per pixel.
const STRONG_GRADIENT: f64 = 20.0;

/// Angle between a gradient and the direction to the picture's centre at which an edge counts as askew, in degrees.
const ASKEW: f64 = 30.0;

/// Gray level outside of the edge that counts as bright.
const BRIGHT: f64 = 25.0;

/// Pixels next to the left and right border that never count.
const BORDER: usize = 3;

/// Candidates must score more than this.
const LEAST_SCORE: f64 = 0.03;

/// A point that may lie on the content area's edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edge {
    pub x: f64,
    pub y: f64,
    /// Score as an edge that faces the centre and is dark outside, 0..=1.
    pub score: f64,
}

/// All candidates that score enough: at most one per side of a strip.
pub(super) fn find(gray: &GrayImage) -> Vec<Edge> {
    if gray.width <= 2 * BORDER || gray.height < 3 {
        return Vec::new();
    }

    let mut edges = Vec::new();
    for strip in 0..STRIPS {
        // The strips' places: the logistic function of 16 even steps from -3.75 to 3.75.
        let place = 1.0 / (1.0 + (-(f64::from(strip) - 7.5) / 2.0).exp());
        let y = 1 + ((gray.height - 2) as f64 * place) as usize;

        let half = gray.width / 2;
        edges.extend(best(gray, y, 0..half));
        edges.extend(best(gray, y, (gray.width - half..gray.width).rev()));
    }

    edges
}

/// The best-scoring point of row `y` on the way along `columns`, which leads from a border to the middle.
fn best(gray: &GrayImage, y: usize, columns: impl Iterator<Item = usize>) -> Option<Edge> {
    let mut found = None;
    let mut least = LEAST_SCORE;
    let mut brightest = 0.0_f32;
    let mut darkness = 1.0;

    for (passed, x) in columns.enumerate() {
        let value = gray.data[y * gray.width + x];
        if value > brightest {
            brightest = value;
            darkness = 1.0 - (f64::from(brightest) / BRIGHT).tanh();
        }

        // `darkness` only falls along the way, so nothing further in can score more than this.
        if darkness <= least {
            break;
        }
        if passed < BORDER {
            continue;
        }

        let score = darkness * edge_score(gray, x, y, least / darkness);
        if score > least {
            least = score;
            found = Some(Edge { x: x as f64, y: y as f64, score });
        }
    }

    found
}

/// How strongly the point is an edge that faces the picture's centre, 0..=1. May return 0 if that is at most `least`.
fn edge_score(gray: &GrayImage, x: usize, y: usize, least: f64) -> f64 {
    let (across, down) = gradient(gray, x, y);
    let strength = across.hypot(down);

    // The hyperbolic tangent is never above its argument.
    if strength / STRONG_GRADIENT <= least {
        return 0.0;
    }

    let to_x = gray.width as f64 / 2.0 - x as f64;
    let to_y = gray.height as f64 / 2.0 - y as f64;
    let cosine = (to_x * across + to_y * down) / (to_x.hypot(to_y) * strength);
    let angle = cosine.clamp(-1.0, 1.0).acos().to_degrees();

    (strength / STRONG_GRADIENT).tanh() * (1.0 - (angle / ASKEW).tanh())
}

/// Sobel responses across and down at an inner pixel, divided by 4.
fn gradient(gray: &GrayImage, x: usize, y: usize) -> (f64, f64) {
    let at = |column: usize, row: usize| gray.data[row * gray.width + column];
    let smooth = |before: f32, here: f32, after: f32| f64::from(0.25 * before + 0.5 * here + 0.25 * after);
    let column = |x: usize| smooth(at(x, y - 1), at(x, y), at(x, y + 1));
    let row = |y: usize| smooth(at(x - 1, y), at(x, y), at(x + 1, y));

    (column(x + 1) - column(x - 1), row(y + 1) - row(y - 1))
}
