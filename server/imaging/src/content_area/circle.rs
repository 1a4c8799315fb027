//! The circle through the most candidates: RANSAC over least-squares fits.

use nalgebra::{Matrix2, Vector2};
use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;

use super::edges::Edge;

/// Number of triples of candidates that are tried.
const ATTEMPTS: usize = 32;

/// Fits per attempt, each over the inliers of the one before.
const REFINEMENTS: usize = 3;

/// Largest distance of an inlier from the circle, in pixels.
const INLIER: f64 = 3.0;

/// Fixed, so that the same candidates always give the same circle.
const SEED: u64 = 0;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Circle {
    pub x: f64,
    pub y: f64,
    pub radius: f64,
}

/// Of the circles that `valid` accepts, the one with the highest sum of its inliers' scores; and that sum.
pub(super) fn find(edges: &[Edge], valid: impl Fn(&Circle) -> bool) -> Option<(Circle, f64)> {
    if edges.len() < 3 {
        return None;
    }

    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    (0..ATTEMPTS)
        .filter_map(|_| {
            let triple = index::sample(&mut random, edges.len(), 3).iter().map(|index| edges[index]).collect();
            attempt(edges, triple)
        })
        .filter(|(circle, _)| valid(circle))
        .max_by(|(_, one), (_, other)| one.total_cmp(other))
}

fn attempt(edges: &[Edge], mut inliers: Vec<Edge>) -> Option<(Circle, f64)> {
    let mut found = None;
    for _ in 0..REFINEMENTS {
        let circle = fit(&inliers)?;
        let off = |edge: &Edge| ((edge.x - circle.x).hypot(edge.y - circle.y) - circle.radius).abs();
        inliers = edges.iter().copied().filter(|edge| off(edge) < INLIER).collect();
        found = Some((circle, inliers.iter().map(|edge| edge.score).sum()));
    }

    found
}

/// The circle with the least sum of (x^2 + y^2 - 2ax - 2by - c)^2 (Kasa's fit). It goes through all points if there are
/// three. `None` for points on a line. With the points' mean as the origin, c is the mean of x^2 + y^2, so two unknowns
/// are left.
fn fit(points: &[Edge]) -> Option<Circle> {
    let count = points.len() as f64;
    let mean = points.iter().map(|point| Vector2::new(point.x, point.y) / count).sum::<Vector2<f64>>();

    let mut scatter = Matrix2::zeros();
    let mut cubes = Vector2::zeros();
    for point in points {
        let offset = Vector2::new(point.x, point.y) - mean;
        scatter += offset * offset.transpose();
        cubes += offset * offset.norm_squared();
    }

    // Points on a line scatter along one direction only.
    if scatter.determinant() <= 1e-9 * scatter.trace().powi(2) {
        return None;
    }

    let centre = scatter.try_inverse()? * cubes / 2.0;
    let radius = (scatter.trace() / count + centre.norm_squared()).sqrt();
    Some(Circle { x: mean.x + centre.x, y: mean.y + centre.y, radius })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_circle(degrees: f64) -> Edge {
        let angle = degrees.to_radians();
        Edge { x: 250.0 + 130.0 * angle.cos(), y: 140.0 + 130.0 * angle.sin(), score: 0.5 }
    }

    #[test]
    fn three_points_lie_on_their_circle() {
        let circle = fit(&[10.0, 100.0, 230.0].map(on_circle)).unwrap();
        assert!((circle.x - 250.0).abs() < 1e-6 && (circle.y - 140.0).abs() < 1e-6);
        assert!((circle.radius - 130.0).abs() < 1e-6);
    }

    #[test]
    fn points_on_a_line_have_no_circle() {
        assert_eq!(fit(&[1.0, 2.0, 3.0].map(|x| Edge { x, y: 2.0 * x, score: 1.0 })), None);
        assert_eq!(fit(&[]), None);
    }

    #[test]
    fn strays_do_not_count() {
        let mut edges: Vec<Edge> = (0..20).map(|step| on_circle(17.0 * f64::from(step))).collect();
        edges.extend((0..10).map(|step| Edge {
            x: 7.0 * f64::from(step * step),
            y: 20.0 + f64::from(step),
            score: 0.3,
        }));
        let (circle, score) = find(&edges, |_| true).unwrap();
        assert!((circle.x - 250.0).abs() < 0.5 && (circle.radius - 130.0).abs() < 0.5, "{circle:?}");
        assert!((10.0..10.7).contains(&score), "{score}");
    }
}
