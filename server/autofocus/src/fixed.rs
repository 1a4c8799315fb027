//! The fixed policy: the lens never moves.

use super::{Decision, FieldOfView, Observation, Policy};
use parfocal_base::FocalPower;

/// Stays at the focal power of its first frame, whatever it sees and wherever it looks.
#[derive(Debug, Clone, Default)]
pub struct Fixed {
    /// Remembered instead of read from each frame, so that errors of the reading cannot make the lens creep.
    start: Option<FocalPower>,
}

impl Policy for Fixed {
    fn field_of_view(&self) -> FieldOfView {
        FieldOfView::Patch
    }

    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        let target = self.start.get_or_insert(seen.focal_power).get();
        Decision { target, ..Decision::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_imaging::{PATCH_SIDE, Patch};

    #[test]
    fn never_moves_from_where_it_started() {
        let patch = Patch([0.0; PATCH_SIDE * PATCH_SIDE]);
        let mut fixed = Fixed::default();
        for seen in [0.3, 0.302, 0.9] {
            let focal_power = FocalPower::new(seen).unwrap();
            let decision = fixed.step(&Observation { view: &patch.into(), focal_power });
            assert_eq!(decision, Decision { target: 0.3, metric: None, belief: None });
        }
    }
}
